//! The language master and worker speak, and its manners. No sockets, no clocks.
//!
//! *Words*: [`question`], [`answer`], [`pack`] (pixels in few bytes), [`digest`] (answers told apart by few more), [`message`] (frames and
//! control messages), [`parts`] (scenes by content), [`identity`] and
//! [`token_file`] (who may join).
//! *Manners*: [`schedule`] is the master's half, [`serve`] the worker's: state machines that take
//! events and give actions.

pub mod answer;
pub mod digest;
pub mod discovery;
pub mod identity;
mod means;
pub mod message;
pub mod pack;
pub mod parts;
pub mod question;
pub mod schedule;
pub mod serve;
pub mod token_file;
pub mod transport;
