//! A line that delays: takes datagrams of one worker, and passes them on later, both ways, in order.
//!
//! The kernels that we test on have no `netem`, so this is done by hand; rate, loss and partition are the kernel's.

use std::io::ErrorKind;
use std::net::{SocketAddr, UdpSocket};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

/// Ends when dropped.
pub struct Delay {
    /// Where the worker finds its master.
    pub address: SocketAddr,
    shared: Arc<Shared>,
}

struct Shared {
    /// The worker's side, and the master's.
    sockets: [UdpSocket; 2],
    /// Where the last datagram of the worker came from.
    worker: Mutex<Option<SocketAddr>>,
    micros: AtomicU64,
    ended: AtomicBool,
}

impl Delay {
    /// From an address of this machine to the master on it.
    pub fn new(near: &str, master: SocketAddr) -> Self {
        let sockets = [UdpSocket::bind((near, 0)), UdpSocket::bind("127.0.0.1:0")].map(|socket| {
            let socket = socket.expect("a free port");
            socket.set_read_timeout(Some(Duration::from_millis(100))).expect("sockets have timeouts");
            socket
        });
        sockets[1].connect(master).expect("the master is on this machine");
        let address = sockets[0].local_addr().expect("it is bound");
        let (worker, micros, ended) = (Mutex::new(None), AtomicU64::new(0), AtomicBool::new(false));
        let shared = Arc::new(Shared { sockets, worker, micros, ended });
        for from in [0, 1] {
            let (late, due) = channel();
            let (reader, writer) = (Arc::clone(&shared), Arc::clone(&shared));
            std::thread::spawn(move || reader.read(from, &late));
            std::thread::spawn(move || writer.write(1 - from, &due));
        }
        Self { address, shared }
    }

    /// What comes in from now on comes out so much later.
    pub fn set(&self, delay: Duration) {
        self.shared.micros.store(delay.as_micros() as u64, Ordering::Relaxed);
    }
}

impl Shared {
    fn read(&self, side: usize, late: &Sender<(Instant, Vec<u8>)>) {
        let mut datagram = [0; 65536];
        while !self.ended.load(Ordering::Relaxed) {
            let (length, from) = match self.sockets[side].recv_from(&mut datagram) {
                Ok(received) => received,
                Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => continue,
                // The master's port was closed, or the worker's link went down.
                Err(_) => continue,
            };
            if side == 0 {
                *self.worker.lock().unwrap() = Some(from);
            }
            let due = Instant::now() + Duration::from_micros(self.micros.load(Ordering::Relaxed));
            if late.send((due, datagram[..length].to_vec())).is_err() {
                return;
            }
        }
    }

    fn write(&self, side: usize, due: &Receiver<(Instant, Vec<u8>)>) {
        while let Ok((due, datagram)) = due.recv() {
            std::thread::sleep(due.saturating_duration_since(Instant::now()));
            // What cannot be sent now is lost, as on any network.
            let _ = match (side, *self.worker.lock().unwrap()) {
                (0, Some(worker)) => self.sockets[0].send_to(&datagram, worker),
                (0, None) => continue,
                _ => self.sockets[1].send(&datagram),
            };
        }
    }
}

impl Drop for Delay {
    fn drop(&mut self) {
        self.shared.ended.store(true, Ordering::Relaxed);
    }
}
