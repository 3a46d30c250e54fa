//! The language master and worker speak, and its manners. No sockets, no clocks.

pub mod answer;
pub mod pack;
pub mod question;
