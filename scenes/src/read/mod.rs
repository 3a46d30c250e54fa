//! From files to [`crate::Scene`]s: the only place of this room that touches the file system.
