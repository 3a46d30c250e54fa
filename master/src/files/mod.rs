//! Pictures in files.

mod exr;
mod name;
mod output;
mod png;
mod read;
mod record;

pub use exr::{Metadata, encode_exr, read_metadata};
pub use name::name_of;
pub use output::{Output, OutputKind, write_secret, write_whole};
pub use png::encode_png;
pub use read::read_picture;
pub use record::{Record, encode_record, read_record};
