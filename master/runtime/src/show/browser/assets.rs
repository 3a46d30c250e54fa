//! The page and its parts, as they were when the program was built.

use axum::http::header;
use axum::response::{IntoResponse, Response};

/// A file of the page.
#[derive(Clone, Copy)]
pub(super) struct Asset {
    name: &'static str,
    kind: &'static str,
    bytes: &'static [u8],
}

/// The file of that name.
pub(super) fn find(name: &str) -> Option<Asset> {
    ASSETS.iter().find(|asset| asset.name == name).copied()
}

impl Asset {
    /// The answer to a request for it.
    pub(super) fn answer(self) -> Response {
        ([(header::CONTENT_TYPE, self.kind)], self.bytes).into_response()
    }
}

macro_rules! asset {
    ($name:literal, $kind:literal) => {
        Asset { name: $name, kind: $kind, bytes: include_bytes!(concat!("assets/", $name)) }
    };
}

const ASSETS: [Asset; 18] = [
    asset!("index.html", "text/html; charset=utf-8"),
    asset!("style.css", "text/css; charset=utf-8"),
    asset!("main.js", "text/javascript; charset=utf-8"),
    asset!("link.js", "text/javascript; charset=utf-8"),
    asset!("vector.js", "text/javascript; charset=utf-8"),
    asset!("number.js", "text/javascript; charset=utf-8"),
    asset!("orbit.js", "text/javascript; charset=utf-8"),
    asset!("gizmo.js", "text/javascript; charset=utf-8"),
    asset!("panel.js", "text/javascript; charset=utf-8"),
    asset!("pieces.js", "text/javascript; charset=utf-8"),
    asset!("units.js", "text/javascript; charset=utf-8"),
    asset!("light.js", "text/javascript; charset=utf-8"),
    asset!("lamps.js", "text/javascript; charset=utf-8"),
    asset!("hang.js", "text/javascript; charset=utf-8"),
    asset!("projection.js", "text/javascript; charset=utf-8"),
    asset!("presets.js", "text/javascript; charset=utf-8"),
    asset!("hues.js", "text/javascript; charset=utf-8"),
    asset!("icon.svg", "image/svg+xml"),
];
