//! The viewer as people meet it: the program `igi-master serve`, through its sockets and in a real browser.

mod browser;
mod master;
mod socket;
mod webdriver;
