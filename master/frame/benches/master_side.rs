//! Speed of the master side.
fn main() {}
