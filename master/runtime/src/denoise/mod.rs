//! Open Image Denoise, where it is installed: a learned filter that makes noisy pictures look finished.
//!
//! It is opened when it is asked for; nothing of it is needed to build this program, or to run it. What it is given, and
//! how its share fades as the picture converges: [`frame::parts::Undenoised`].

mod api;
mod thread;

use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use frame::Picture;
use frame::parts::Undenoised;
use glam::Vec3;

pub use api::{Place, Trouble};
pub use thread::DenoiseThread;

use api::Device;

/// What it is called by systems that have it.
const NAMES: [&str; 2] = ["libOpenImageDenoise.so.2", "libOpenImageDenoise.so"];

/// The library, opened.
pub struct Denoiser {
    device: Device,
}

impl Denoiser {
    /// Opens the library: the file, or that in the folder, that `path` names; else the one that the system knows.
    ///
    /// # Errors
    /// A sentence: why not, and how to get it.
    pub fn open(path: Option<&Path>, place: Place) -> Result<Self, String> {
        let mut reasons = Vec::new();
        for candidate in candidates(path) {
            match Device::open(&candidate, place) {
                Ok(device) => return Ok(Self { device }),
                Err(reason) => reasons.push(reason),
            }
        }
        let reason = match (path, reasons.first()) {
            (Some(path), None) => format!("there is none of {} in {}", NAMES.join(", "), path.display()),
            (_, reason) => reason.cloned().unwrap_or_default(),
        };
        Err(format!("Open Image Denoise cannot be used ({reason}): {ADVICE}"))
    }

    /// Its name and version, for people and metadata.
    pub fn name(&self) -> String {
        let [major, minor, patch] = self.device.version();
        format!("Open Image Denoise {major}.{minor}.{patch}")
    }

    /// Setting it stops the picture that is being denoised.
    pub fn stop(&self) -> Arc<AtomicBool> {
        self.device.stop()
    }

    /// The picture as it is to be shown.
    ///
    /// # Errors
    /// [`Trouble`]; the next picture may succeed all the same.
    pub fn denoise(&mut self, undenoised: &Undenoised) -> Result<Picture, Trouble> {
        let Picture { width, height, .. } = undenoised.radiance;
        let inputs = [&undenoised.radiance, &undenoised.albedo, &undenoised.normal].map(floats);
        let output = self.device.denoise([width as usize, height as usize], inputs.each_ref().map(Vec::as_slice))?;
        let pixels = output.as_chunks::<3>().0.iter().map(|pixel| Vec3::from_array(*pixel)).collect();
        Ok(undenoised.shown(Picture { width, height, pixels }))
    }
}

/// How to get it.
const ADVICE: &str = "install it (from your system's packages or https://www.openimagedenoise.org, or with `python3 -m pip \
                      install pyoidn`, which puts it into the folder pyoidn/oidn/lib), and name its folder by --oidn or \
                      IGI_OIDN if it is not found";

/// What to try, in order. A library is named by its whole path, or by a name that the system looks for.
fn candidates(path: Option<&Path>) -> Vec<OsString> {
    let Some(path) = path else { return NAMES.map(OsString::from).into() };
    let path = path.canonicalize().unwrap_or_else(|_| path.to_path_buf());
    if !path.is_dir() {
        return vec![path.into()];
    }
    let folders = [path.clone(), path.join("lib")];
    let files = folders.iter().flat_map(|folder| NAMES.map(|name| folder.join(name)));
    files.filter(|file| file.is_file()).map(PathBuf::into_os_string).collect()
}

fn floats(picture: &Picture) -> Vec<f32> {
    picture.pixels.iter().flat_map(Vec3::to_array).collect()
}
