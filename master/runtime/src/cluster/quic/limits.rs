//! Every limit of the master's network, in one place: what strangers and workers may take of its memory and time.
//! `SECURITY.md` has them in a table, and a test compares.

use std::time::Duration;

/// Strangers: connections that are neither in nor refused yet. More must first show that their address is theirs.
pub(super) const STRANGERS_MAX: usize = 64;
/// A stranger must have proved itself by then.
pub(super) const STRANGER_PATIENCE: Duration = Duration::from_secs(5);
/// What a stranger may send before its proof, bytes.
pub(super) const STRANGER_WINDOW: u32 = 8 << 10;
/// Packets that wait for a connection that is not taken up yet, bytes: of one, and of all.
pub(super) const INCOMING_BUFFER: [u64; 2] = [16 << 10, 1 << 20];

/// Between two words to workers of a master that was killed, that it knows nothing of them; a whole crew hears it in time.
pub(super) const BETWEEN_RESETS: Duration = Duration::from_millis(1);

/// Connections at a time, workers and strangers.
pub(super) const CONNECTIONS_MAX: usize = 4096;

/// What a worker may send before it is read, bytes: in all, and on one stream.
pub(super) const WORKER_WINDOW: u32 = 64 << 20;
pub(super) const STREAM_WINDOW: u32 = 16 << 20;
/// What waits to be sent to one worker, bytes.
pub(super) const SEND_WINDOW: u64 = 64 << 20;
/// Answers of one worker in flight: of all questions that it may hold.
pub(super) const ANSWERS_MAX: u32 = protocol::schedule::HELD_MAX as u32;
/// Answers of one worker that wait for the dispatcher; when all are taken, no more are read.
pub(super) const ANSWERS_WAITING: usize = 64;
/// Messages of one worker that wait for the dispatcher; when all are taken, no more are read.
pub(super) const MESSAGES_WAITING: usize = 256;
/// What an answer may be longer than its packed pixels, bytes.
pub(super) const ANSWER_HEAD_MAX: usize = 1024;
/// Room made for a message on its header's word, bytes.
pub(super) const FIRST_ROOM: usize = 64 << 10;
/// Words that wait for the network. A worker that does not read this many is gone.
pub(super) const MESSAGES_MAX: usize = 1 << 14;
/// Lists of wanted parts that wait. An honest worker sends the next when the last is served.
pub(super) const WANTS_MAX: usize = 1 << 10;

/// Longest wait for a worker to have received our last messages, and for all of them.
pub(super) const FAREWELL: Duration = Duration::from_secs(1);
pub(super) const FAREWELL_ALL: Duration = Duration::from_secs(2);

/// Threads for encryption, and for unpacking answers: one a core, within these. Two, because one must not wait for the other's
/// unpacking; and so many keep a dispatcher busy.
pub(super) const THREADS: std::ops::RangeInclusive<usize> = 2..=16;

#[cfg(test)]
mod tests {
    use protocol::transport::IDLE_MAX;

    use super::*;

    #[test]
    fn the_table_in_the_papers_is_true() {
        let papers = include_str!("../../../../../SECURITY.md");
        for (what, limit) in [
            ("strangers at a time", STRANGERS_MAX.to_string()),
            ("time for a stranger to prove itself", format!("{} s", STRANGER_PATIENCE.as_secs())),
            ("bytes of a stranger", format!("{} KiB", STRANGER_WINDOW >> 10)),
            ("packets that wait for connections not taken up", format!("{} MiB", INCOMING_BUFFER[1] >> 20)),
            ("pause between two resets of forgotten connections", format!("{} ms", BETWEEN_RESETS.as_millis())),
            ("connections at a time", CONNECTIONS_MAX.to_string()),
            ("silence until a connection is gone", format!("{} s", IDLE_MAX.as_secs())),
            ("bytes of a worker that were not read yet", format!("{} MiB", WORKER_WINDOW >> 20)),
            ("bytes that wait to be sent to a worker", format!("{} MiB", SEND_WINDOW >> 20)),
            ("answers of a worker in flight", ANSWERS_MAX.to_string()),
            ("answers of a worker that wait to be unpacked", ANSWERS_WAITING.to_string()),
            ("messages of a worker that wait to be handled", MESSAGES_WAITING.to_string()),
            ("messages that a worker has not read", MESSAGES_MAX.to_string()),
        ] {
            assert!(papers.contains(&format!("| {what} | {limit} |")), "{what} is {limit}: SECURITY.md says otherwise");
        }
    }
}
