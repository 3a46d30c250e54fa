//! What both sides set their connections to.

use std::time::Duration;

/// A connection that is silent for so long is gone …
pub const IDLE_MAX: Duration = Duration::from_secs(10);
/// … so something is said this often. A worker that is at rest hears so soon that its master was started again.
pub const KEEP_ALIVE: Duration = Duration::from_secs(1);
/// There and back, until it is measured.
pub const FIRST_ROUND_TRIP: Duration = Duration::from_millis(5);

/// Packets that the other side takes before it confirms them, if it does not wait longer than that
/// (draft-ietf-quic-ack-frequency): a packet of its own for every second one was a quarter of the master's time for small
/// answers.
pub const PACKETS_CONFIRMED_AT_ONCE: u32 = 10;
/// See [`PACKETS_CONFIRMED_AT_ONCE`].
pub const CONFIRMED_WITHIN: Duration = Duration::from_millis(25);

/// Socket buffers, bytes: with the system's 208 KiB, bursts of answers lose hundreds of packets.
pub const SOCKET_BUFFER: usize = 4 << 20;
