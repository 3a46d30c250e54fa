//! Memory of pictures that nobody looks at any more, for the next ones: a picture takes megabytes, and the system gives them
//! page by page.

use std::sync::Arc;

use glam::Vec3;

use crate::Picture;

/// Pictures that were given out.
#[derive(Clone, Debug, Default)]
pub(super) struct Memory {
    given: Vec<Arc<Picture>>,
}

/// Pictures that are looked at by somebody, or wait for it, at a time; what is more is the system's again.
const GIVEN_MAX: usize = 4;

impl Memory {
    /// Remembers a picture that is given out.
    pub fn keep(&mut self, picture: &Arc<Picture>) {
        if self.given.len() == GIVEN_MAX {
            self.given.remove(0);
        }
        self.given.push(Arc::clone(picture));
    }

    /// Pixels of a picture that nobody has any more, whatever they are; else none.
    pub fn take(&mut self) -> Vec<Vec3> {
        let free = self.given.iter().position(|picture| Arc::strong_count(picture) == 1);
        let free = free.map(|at| self.given.swap_remove(at));
        free.and_then(Arc::into_inner).map(|picture| picture.pixels).unwrap_or_default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_nobody_has_is_used_again() {
        let mut memory = Memory::default();
        assert!(memory.take().is_empty());
        let [first, second] = [1.0, 2.0].map(|value| Arc::new(Picture::from_fn(2, 1, |_, _| Vec3::splat(value))));
        memory.keep(&first);
        memory.keep(&second);
        assert!(memory.take().is_empty(), "both are looked at");
        drop(second);
        assert_eq!(memory.take(), [Vec3::splat(2.0); 2]);
        assert!(memory.take().is_empty());
        for _ in 0..2 * GIVEN_MAX {
            memory.keep(&Arc::new(Picture::black(1, 1)));
        }
        assert!(memory.given.len() <= GIVEN_MAX);
    }
}
