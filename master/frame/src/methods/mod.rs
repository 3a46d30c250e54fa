//! The ways of making pictures: each decides what to ask workers, what to keep of their answers, and how to show it.
//!
//! A method is a room of its own. It builds on [`crate::parts`] and [`crate::front_end`], which know no method; nor does
//! the loop with people ([`crate::live`]) know one.

pub mod afresh;
pub mod igi;
pub mod reference;
pub mod render_cache;

use std::sync::LazyLock;

use crate::front_end::Method;
use render_cache::{RenderCache, Tables};

/// All methods of this project, the default one first.
pub const ALL: &[&dyn Method] = &[&igi::IGI, &reference::REFERENCE, &RENDER_CACHE];

/// The Render Cache over IGI.
pub const RENDER_CACHE: RenderCache = RenderCache { renderer: &igi::IGI, quality: igi::quality, tables: cached_tables };

fn cached_tables() -> &'static Tables {
    static TABLES: LazyLock<Tables> = LazyLock::new(|| Tables::over(&igi::IGI));
    &TABLES
}
