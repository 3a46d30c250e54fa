//! The ways of making pictures: each decides what to ask workers, what to keep of their answers, and how to show it.
//!
//! A method is a room of its own. It builds on [`crate::parts`] and [`crate::front_end`], which know no method; nor does
//! the loop with people ([`crate::live`]) know more of one than what this room says of all.

pub mod igi;
pub mod reference;
