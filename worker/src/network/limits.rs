//! Every limit of the worker's network, in one place: what masters, and whoever passes for one, may take of its memory
//! and time. `SECURITY.md` has them in a table, and a test compares.

use std::time::Duration;

/// Addresses that are tried for one master, and masters of others that are counted.
pub(super) const ADDRESSES_MAX: usize = 8;
/// Longest wait for the addresses of a name: resolvers give a silent server five seconds, then ask the next.
pub(super) const NAME_PATIENCE: Duration = Duration::from_secs(15);
/// Longest wait for a master to say where it is …
pub(super) const NOTICE_PATIENCE: Duration = Duration::from_secs(4);
/// … and, after its first address, for others.
pub(super) const MORE_NOTICES: Duration = Duration::from_millis(200);
/// Longest wait for each address to answer …
pub(super) const HANDSHAKE: Duration = Duration::from_secs(4);
/// … and for the first words of the master there.
pub(super) const FIRST_WORDS: Duration = Duration::from_secs(10);
/// Longest wait for the master to have received our last messages.
pub(super) const FAREWELL: Duration = Duration::from_secs(2);

/// What a master may send before it is read, bytes: in all, and on one stream.
pub(super) const MASTER_WINDOW: u32 = 64 << 20;
pub(super) const STREAM_WINDOW: u32 = 16 << 20;
/// What waits to be sent to the master, bytes.
pub(super) const SEND_WINDOW: u64 = 64 << 20;
/// Scene parts in flight at a time.
pub(super) const PARTS_IN_FLIGHT: u32 = 16;
/// Answers in flight at a time: of all questions that the master asks of somebody far away.
pub(super) const ANSWERS_IN_FLIGHT: u32 = protocol::schedule::HELD_MAX as u32;
/// Words and answers that wait for the network; when it is full, the engine waits.
pub(super) const OUTBOX: usize = 256;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::blob_store::FOLDER_MAX;

    #[test]
    fn the_table_in_the_papers_is_true() {
        let papers = include_str!("../../../SECURITY.md");
        for (what, limit) in [
            ("addresses that are tried for a master", ADDRESSES_MAX.to_string()),
            ("time for an address to answer", format!("{} s", HANDSHAKE.as_secs())),
            ("time for a master's first words", format!("{} s", FIRST_WORDS.as_secs())),
            ("bytes of a master that were not read yet", format!("{} MiB", MASTER_WINDOW >> 20)),
            ("bytes that wait to be sent to a master", format!("{} MiB", SEND_WINDOW >> 20)),
            ("scene parts in flight to a worker", PARTS_IN_FLIGHT.to_string()),
            ("bytes in a folder of `--cache`, about", format!("{} GiB", FOLDER_MAX >> 30)),
        ] {
            assert!(papers.contains(&format!("| {what} | {limit} |")), "{what} is {limit}: SECURITY.md says otherwise");
        }
    }
}
