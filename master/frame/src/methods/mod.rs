//! The ways of making pictures: each decides what to ask workers, what to keep of their answers, and how to show it.
//!
//! A method is a room of its own. It builds on [`crate::parts`] and [`crate::front_end`], which know no method; nor does
//! the loop with people ([`crate::live`]) know one.

pub mod afresh;
pub mod at_once;
pub mod igi;
pub mod reference;
pub mod render_cache;
pub mod shading_cache;

use std::sync::LazyLock;

use crate::front_end::Method;
use at_once::Tables;
use render_cache::RenderCache;
use shading_cache::ShadingCache;

/// All methods of this project, the default one first.
pub const ALL: &[&dyn Method] = &[&igi::IGI, &reference::REFERENCE, &RENDER_CACHE, &SHADING_CACHE];

/// The Render Cache over IGI.
pub const RENDER_CACHE: RenderCache = RenderCache {
    renderer: &igi::IGI,
    quality: igi::quality,
    tables: || {
        static TABLES: LazyLock<Tables> = LazyLock::new(|| render_cache::tables(&igi::IGI));
        &TABLES
    },
};

/// The Shading Cache over IGI.
pub const SHADING_CACHE: ShadingCache = ShadingCache {
    renderer: &igi::IGI,
    quality: igi::quality,
    tables: || {
        static TABLES: LazyLock<Tables> = LazyLock::new(|| shading_cache::tables(&igi::IGI));
        &TABLES
    },
};
