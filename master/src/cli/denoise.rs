//! The flags of the denoiser.

use std::path::PathBuf;

use clap::Args;

/// Whether files are denoised.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Denoising")]
pub struct DenoiseArgs {
    /// Denoise the pictures that are saved, by Open Image Denoise (2.x, if it is installed): 0.4 s for 400x300 pixels on one
    /// core, once --seconds are over. Its share fades where noise falls below what it blurs, so that long renders converge
    /// all the same. --aov has the raw picture as well; EXR and PNG say what they went through.
    #[arg(long)]
    pub denoise: bool,

    #[command(flatten)]
    pub(crate) oidn: OidnArg,
}

/// Where the denoiser is.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Denoising")]
pub struct OidnArg {
    /// Where Open Image Denoise is: its library, or the folder that has it. [default: where the system looks for libraries]
    #[arg(long = "oidn", value_name = "PATH", env = "IGI_OIDN")]
    pub path: Option<PathBuf>,
}
