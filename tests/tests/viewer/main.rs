//! The viewer as people meet it: the program `igi-master serve`, through its sockets and in a real browser.

mod browser;
mod denoising;
mod exposure;
mod hanging;
mod http;
mod lamps;
mod master;
mod materials;
mod mixing;
mod page;
mod projection;
mod replay;
mod room;
mod saved;
mod saved_scene;
mod session;
mod socket;
mod storm;
mod toy;
mod webdriver;
