//! Pictures in files.

mod exr;
mod name;
mod output;
mod png;
mod read;
mod record;
mod unsaved;
mod write;

pub use exr::{MISSES, Metadata, encode_exr, missing_from, read_metadata};
pub use name::name_of;
pub use output::{Output, OutputKind};
pub use png::{encode_png, encode_png_saying};
pub use read::{read_guides, read_layers, read_picture};
pub use record::{Record, encode_record, read_record};
pub use unsaved::{Fallback, Unsaved, write_each};
pub use write::{try_to_write, write_secret, write_whole};
