//! Who waits at a port: a few at a time, and no machine keeps others out.
//!
//! When all places are taken, whoever has waited longest gives way, of the address that has most: so one machine that opens
//! connections without end gets rid of its own, and who asks and goes is served before it has waited longest.

use std::collections::BTreeMap;
use std::net::IpAddr;

use tokio::task::AbortHandle;

/// The tasks of connections that may be ended for others.
#[derive(Debug)]
pub struct Guests {
    most: usize,
    /// Of each address, oldest first.
    here: BTreeMap<IpAddr, Vec<AbortHandle>>,
}

impl Guests {
    /// At most so many at a time.
    pub fn new(most: usize) -> Self {
        Self { most: most.max(1), here: BTreeMap::new() }
    }

    /// All places are taken.
    pub fn is_full(&mut self) -> bool {
        self.here.retain(|_, guests| {
            guests.retain(|guest| !guest.is_finished());
            !guests.is_empty()
        });
        self.here.values().map(Vec::len).sum::<usize>() >= self.most
    }

    /// One more has come; another has to go for it if there is no place.
    pub fn seat(&mut self, from: IpAddr, guest: AbortHandle) {
        if self.is_full()
            && let Some(crowd) = self.here.values_mut().max_by_key(|guests| guests.len())
        {
            crowd.remove(0).abort();
        }
        self.here.entry(machine(from)).or_default().push(guest);
    }
}

/// A machine has as many addresses of IPv6 as it likes, within 64 bits.
fn machine(address: IpAddr) -> IpAddr {
    match address.to_canonical() {
        IpAddr::V6(address) => IpAddr::V6((address.to_bits() >> 64 << 64).into()),
        address => address,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_oldest_of_the_greatest_crowd_gives_way() {
        let runtime = tokio::runtime::Builder::new_current_thread().build().unwrap();
        runtime.block_on(async {
            let mut guests = Guests::new(4);
            let sit = || tokio::spawn(std::future::pending::<()>());
            let [crowd, other]: [IpAddr; 2] = ["2001:db8::1".parse().unwrap(), "192.0.2.1".parse().unwrap()];
            let early = sit();
            guests.seat(other, early.abort_handle());
            let many: Vec<_> = (0..5).map(|_| sit()).collect();
            // Another address of the same machine.
            let last: IpAddr = "2001:db8::2".parse().unwrap();
            many[..4].iter().for_each(|guest| guests.seat(crowd, guest.abort_handle()));
            guests.seat(last, many[4].abort_handle());
            tokio::task::yield_now().await;
            let gone: Vec<_> = many.iter().map(tokio::task::JoinHandle::is_finished).collect();
            assert_eq!((gone, early.is_finished()), (vec![true, true, false, false, false], false));
            assert!(guests.is_full());
            // Who has gone by itself leaves its place.
            many[4].abort();
            tokio::task::yield_now().await;
            assert!(!guests.is_full());
        });
    }
}
