//! Floods: strangers in hundreds, handshakes that nobody ends, talkers without end, a gigabyte from a worker, one that does
//! not listen; the frame that is being drawn goes on. `IGI_FLOOD=10000 cargo test -p runtime floods` sends as many as that.

use std::net::UdpSocket;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use protocol::message::{ALPN, Header, Kind, STRANGER_MAX, ToMaster, ToWorker, encode};
use protocol::schedule::QuestionId;
use quinn::Endpoint;

use super::limits::{STRANGER_PATIENCE, STRANGERS_MAX, STREAM_WINDOW};
use super::tests::{client_config, connect_to, token, wait_for};
use crate::cluster::tests::{self as fakes, PATIENCE, embedded_and_listening};
use crate::cluster::{Cluster, Event};

/// How many strangers come.
fn many() -> usize {
    std::env::var("IGI_FLOOD").ok().and_then(|count| count.parse().ok()).unwrap_or(400)
}

/// What the flood may do to the frame: no answer waits longer for its successor. An answer takes some milliseconds.
const GAP_MAX: Duration = Duration::from_secs(2);

fn runtime() -> tokio::runtime::Runtime {
    tokio::runtime::Builder::new_multi_thread().worker_threads(1).enable_all().build().unwrap()
}

/// Draws frame after frame while `flood` goes on, and one more; the longest time between two answers.
fn draw_during(cluster: &mut Cluster, flood: impl FnOnce() + Send) -> Duration {
    // A worker that has the scene already is not told of it again.
    let world = cluster.state().unwrap_or_else(|| cluster.publish(fakes::scene()).unwrap());
    let over = AtomicBool::new(false);
    let mut longest = Duration::ZERO;
    std::thread::scope(|scope| {
        scope.spawn(|| {
            flood();
            over.store(true, Ordering::Relaxed);
        });
        for frame in 0.. {
            let last = over.load(Ordering::Relaxed);
            let questions = fakes::questions(world, frame);
            let mut open = questions.len();
            cluster.ask(questions);
            let mut heard = Instant::now();
            while open > 0 {
                match cluster.next(Duration::from_millis(100)) {
                    Some(Event::Answered { .. }) => {
                        longest = longest.max(heard.elapsed());
                        (open, heard) = (open - 1, Instant::now());
                    }
                    Some(Event::Unanswered { reason, .. }) => panic!("{reason}"),
                    _ => assert!(heard.elapsed() < PATIENCE, "the frame hangs"),
                }
            }
            if last {
                break;
            }
        }
    });
    longest
}

/// A worker with the token is let in, now that the flood is over: strangers have their time at most.
fn somebody_can_join(cluster: &Cluster) {
    let runtime = runtime();
    let begun = Instant::now();
    let (address, token) = (cluster.address().unwrap(), token(cluster));
    let joined = runtime.block_on(async {
        loop {
            match connect_to(address, ALPN).await {
                Ok(mut peer) => {
                    peer.prove(&token).await;
                    return peer;
                }
                Err(reason) => assert!(begun.elapsed() < PATIENCE, "{reason}"),
            }
            tokio::time::sleep(Duration::from_millis(250)).await;
        }
    });
    drop(joined);
}

#[test]
fn silent_strangers_in_hundreds_leave_the_frame_alive() {
    let mut cluster = embedded_and_listening();
    let address = cluster.address().unwrap();
    let gap = draw_during(&mut cluster, || {
        runtime().block_on(async {
            let endpoint = Endpoint::client("127.0.0.1:0".parse().unwrap()).unwrap();
            let mut strangers = Vec::new();
            for _ in 0..many() {
                // Whoever is let as far as the handshake keeps quiet from then on.
                strangers.push(tokio::spawn(endpoint.connect_with(client_config(ALPN), address, "igi").unwrap()));
                tokio::time::sleep(Duration::from_micros(500)).await;
            }
            tokio::time::sleep(Duration::from_millis(500)).await;
            strangers.iter().for_each(tokio::task::JoinHandle::abort);
        });
    });
    assert!(gap < GAP_MAX, "{gap:?} without an answer");
    assert_eq!(cluster.status().workers, 1);
    somebody_can_join(&cluster);
}

#[test]
fn handshakes_that_nobody_ends_leave_the_frame_alive() {
    let mut cluster = embedded_and_listening();
    let address = cluster.address().unwrap();
    let gap = draw_during(&mut cluster, || {
        runtime().block_on(async {
            // First packets are caught by a socket that answers nothing, and come to the master from others that do not
            // either.
            let sink = tokio::net::UdpSocket::bind("127.0.0.1:0").await.unwrap();
            let endpoint = Endpoint::client("127.0.0.1:0".parse().unwrap()).unwrap();
            let mut packet = [0; 2048];
            for _ in 0..many() {
                let connecting = endpoint.connect_with(client_config(ALPN), sink.local_addr().unwrap(), "igi").unwrap();
                let length = sink.recv(&mut packet).await.unwrap();
                drop(connecting);
                let stranger = UdpSocket::bind("127.0.0.1:0").unwrap();
                let _ = stranger.send_to(&packet[..length], address);
                // The packet that closes the caught one, and what is sent again.
                while sink.try_recv(&mut packet).is_ok() {}
            }
        });
    });
    assert!(gap < GAP_MAX, "{gap:?} without an answer");
    somebody_can_join(&cluster);
}

#[test]
fn a_stranger_that_talks_without_end_is_heard_for_a_moment_only() {
    let mut cluster = embedded_and_listening();
    let address = cluster.address().unwrap();
    let mut taken = 0;
    let gap = draw_during(&mut cluster, || {
        runtime().block_on(async {
            let mut stranger = connect_to(address, ALPN).await.unwrap();
            // The header of a hello as long as it may be, and then more than anybody wants to know.
            let _ = stranger.send.write_all(&Header { kind: Kind::Hello, length: STRANGER_MAX as u32 }.bytes()).await;
            while let Ok(Ok(bytes)) =
                tokio::time::timeout(Duration::from_secs(1), stranger.send.write(&[7; 1 << 16])).await
            {
                taken += bytes;
            }
        });
    });
    assert!(gap < GAP_MAX, "{gap:?} without an answer");
    // What it could send before it was refused: the window, and what its own side kept for later.
    assert!(taken < 1 << 20, "{taken} bytes were taken from a stranger");
}

/// Gigabytes from somebody who has the token: an answer longer than any question allows, and one that never ends.
#[test]
fn a_gigabyte_from_a_worker_is_not_taken() {
    let mut cluster = embedded_and_listening();
    let (address, token) = (cluster.address().unwrap(), token(&cluster));
    let mut taken = 0;
    let gap = draw_during(&mut cluster, || {
        runtime().block_on(async {
            let mut liar = connect_to(address, ALPN).await.unwrap();
            liar.prove(&token).await;
            let mut stream = liar.connection.open_uni().await.unwrap();
            let _ = stream.write_all(&Header { kind: Kind::Answer, length: 1 << 30 }.bytes()).await;
            while let Ok(Ok(bytes)) = tokio::time::timeout(Duration::from_secs(1), stream.write(&[7; 1 << 16])).await {
                taken += bytes;
            }
        });
    });
    assert!(gap < GAP_MAX, "{gap:?} without an answer");
    // What was in flight until it was refused.
    assert!(taken <= (STREAM_WINDOW as usize) + (1 << 20), "{taken} bytes were taken");
    wait_for(&cluster, |status| status.workers == 1);
}

/// Messages cost the dispatcher time and memory: who talks faster than the dispatcher listens has to wait.
#[test]
fn a_worker_that_complains_without_end_leaves_the_frame_alive() {
    let mut cluster = embedded_and_listening();
    let (address, token) = (cluster.address().unwrap(), token(&cluster));
    let gap = draw_during(&mut cluster, || {
        runtime().block_on(async {
            let mut liar = connect_to(address, ALPN).await.unwrap();
            liar.prove(&token).await;
            let message = ToMaster::Failed { id: QuestionId(u64::MAX), reason: "no".into() };
            let bytes = encode(&message).unwrap().repeat(1000);
            let begun = Instant::now();
            while begun.elapsed() < Duration::from_secs(1) && liar.send.write_all(&bytes).await.is_ok() {}
        });
    });
    assert!(gap < GAP_MAX, "{gap:?} without an answer");
    somebody_can_join(&cluster);
}

#[test]
fn a_worker_that_does_not_listen_leaves_the_frame_alive() {
    let mut cluster = embedded_and_listening();
    let (address, token) = (cluster.address().unwrap(), token(&cluster));
    let world = cluster.publish(fakes::scene()).unwrap();
    let runtime = runtime();
    let deaf = runtime.block_on(async {
        let mut peer = connect_to(address, ALPN).await.unwrap();
        peer.prove(&token).await;
        let ToWorker::World { state, .. } = peer.recv().await else { panic!("the first message is the world") };
        assert_eq!(state.world, world.world);
        // From now on it hears nothing and says nothing.
        peer.send(&ToMaster::Ready { state }).await;
        peer
    });
    wait_for(&cluster, |status| status.ready == 2);
    // It holds questions that it will never answer; who has nothing to do takes them over.
    let gap = draw_during(&mut cluster, || {});
    assert!(gap < GAP_MAX, "{gap:?} without an answer");
    assert!(cluster.status().counters.asked_twice > 0);
    drop(deaf);
}

/// Strangers who have shown that they are where they say, all of one machine.
#[test]
fn one_machine_full_of_strangers_keeps_no_other_out() {
    let cluster = embedded_and_listening();
    let (address, token) = (cluster.address().unwrap(), token(&cluster));
    let runtime = runtime();
    let _peer = runtime.block_on(async {
        let mut crowd = Vec::new();
        for _ in 0..STRANGERS_MAX + 8 {
            // Whoever has come so far keeps quiet from then on.
            crowd.extend(connect_to(address, ALPN).await);
        }
        let begun = Instant::now();
        let mut peer = connect_to(address, ALPN).await.unwrap();
        peer.prove(&token).await;
        assert!(begun.elapsed() < STRANGER_PATIENCE, "it waited until one of them had lost its place");
        drop(crowd);
        peer
    });
    wait_for(&cluster, |status| status.workers == 2);
}
