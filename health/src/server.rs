//! The socket: a thread of its own, so that it answers also when nothing else does.
//!
//! Whoever can reach it may ask; it tells numbers and states, no names, scenes or tokens. A client has little time and
//! room, and there are few at a time: nobody can make it hold more than [`CLIENTS_MAX`] × [`REQUEST_MAX`] bytes.

use std::net::SocketAddr;
use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::Duration;

use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::oneshot;

use crate::Guests;
use crate::answer::{REQUEST_MAX, Report, answer, is_complete};

/// Clients at a time; for one more, another has to go (see [`Guests`]).
const CLIENTS_MAX: usize = 32;
/// Longest time for a client to ask and to hear.
const PATIENCE: Duration = Duration::from_secs(2);

/// Answers until it is dropped.
#[derive(Debug)]
pub struct Server {
    address: SocketAddr,
    stop: Option<oneshot::Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

impl Server {
    /// Listens; `report` is called on the server's thread for every request.
    ///
    /// # Errors
    /// In words: the address cannot be listened at.
    pub fn start(address: SocketAddr, report: impl Fn() -> Report + Send + Sync + 'static) -> Result<Self, String> {
        let cannot = |error: std::io::Error| {
            format!("cannot serve /metrics at {address}: {error}; choose another address or port with --metrics")
        };
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().map_err(cannot)?;
        let listener = std::net::TcpListener::bind(address).map_err(cannot)?;
        listener.set_nonblocking(true).map_err(cannot)?;
        let address = listener.local_addr().map_err(cannot)?;
        let listener = {
            let _inside = runtime.enter();
            TcpListener::from_std(listener).map_err(cannot)?
        };
        let (stop, stopped) = oneshot::channel();
        let thread = std::thread::Builder::new().name("health".into()).spawn(move || {
            runtime.block_on(async {
                tokio::select! {
                    () = serve(listener, Arc::new(report)) => {}
                    _ = stopped => {}
                }
            });
        });
        Ok(Self { address, stop: Some(stop), thread: Some(thread.map_err(cannot)?) })
    }

    /// Where it listens.
    pub fn address(&self) -> SocketAddr {
        self.address
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        drop(self.stop.take());
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

async fn serve(listener: TcpListener, report: Arc<impl Fn() -> Report + Send + Sync + 'static>) {
    let mut guests = Guests::new(CLIENTS_MAX);
    loop {
        let Ok((client, from)) = listener.accept().await else {
            // Out of descriptors, perhaps: others may give some back.
            tokio::time::sleep(Duration::from_millis(100)).await;
            continue;
        };
        let report = Arc::clone(&report);
        let guest = tokio::spawn(async move {
            // Who is late or hangs up has lost interest.
            let _ = tokio::time::timeout(PATIENCE, attend(client, &*report)).await;
        });
        guests.seat(from.ip(), guest.abort_handle());
    }
}

async fn attend(mut client: TcpStream, report: &impl Fn() -> Report) -> std::io::Result<()> {
    let mut request = Vec::with_capacity(1024);
    while !is_complete(&request) && request.len() < REQUEST_MAX {
        if (&mut client).take((REQUEST_MAX - request.len()) as u64).read_buf(&mut request).await? == 0 {
            break;
        }
    }
    client.write_all(&answer(&request, report)).await?;
    client.shutdown().await
}

#[cfg(test)]
mod tests {
    use std::io::Write;

    use super::*;
    use crate::ask::{ask, check};
    use crate::page::Page;

    fn server() -> Server {
        let report = || Report { page: Page::default(), alive: Ok(()), ready: Err("not yet".into()) };
        Server::start("127.0.0.1:0".parse().unwrap(), report).unwrap()
    }

    #[test]
    fn it_answers_and_its_port_is_free_again() {
        let server = server();
        let address = server.address();
        assert_eq!(ask(address, "/healthz").unwrap(), (200, "ok\n".to_owned()));
        assert_eq!(ask(address, "/readyz").unwrap(), (503, "not yet\n".to_owned()));
        assert_eq!((check(address, false), check(address, true)), (Ok("ok".into()), Err("not yet".into())));
        drop(server);
        assert!(ask(address, "/healthz").is_err());
    }

    #[test]
    fn silent_and_endless_clients_keep_nobody_from_asking() {
        let server = server();
        let silent: Vec<_> = (0..200).map(|_| std::net::TcpStream::connect(server.address()).unwrap()).collect();
        let mut endless = std::net::TcpStream::connect(server.address()).unwrap();
        // It is answered after REQUEST_MAX bytes; the rest falls on deaf ears.
        let _ = endless.write_all(&[b'x'; 4 * REQUEST_MAX]);
        let asked = std::time::Instant::now();
        assert_eq!(ask(server.address(), "/healthz").unwrap().0, 200);
        assert!(asked.elapsed() < PATIENCE, "it waited for a silent one to lose its place");
        drop(silent);
    }
}
