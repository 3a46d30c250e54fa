//! When to look at a picture that grows (algorithms.md D4): at powers of two of its frames, so that
//! looking is cheap and points lie evenly on a logarithmic axis, and at the first frame after some moments.

/// What a frame turned out to be.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Passed {
    /// The number of frames is a power of two.
    pub power: bool,
    /// The moments that this frame is the first one after, as indices into the list of moments.
    pub marks: Vec<usize>,
}

/// Tells which frames to look at; told of every one, in order.
#[derive(Clone, Debug)]
pub struct Checkpoints {
    marks: Vec<f64>,
    next_mark: usize,
    next_power: u64,
}

impl Checkpoints {
    /// Moments in seconds, ascending.
    pub fn new(marks: &[f64]) -> Self {
        Self { marks: marks.to_vec(), next_mark: 0, next_power: 1 }
    }

    /// So many frames are there after so many seconds. Frames may be skipped; a power of two that
    /// was skipped is not made up for.
    pub fn pass(&mut self, frames: u64, seconds: f64) -> Passed {
        let mut passed = Passed { power: frames == self.next_power, marks: Vec::new() };
        while self.next_power <= frames {
            self.next_power *= 2;
        }
        while self.marks.get(self.next_mark).is_some_and(|mark| *mark <= seconds) {
            passed.marks.push(self.next_mark);
            self.next_mark += 1;
        }
        passed
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn powers_of_two_and_first_frames_after_moments() {
        let mut checkpoints = Checkpoints::new(&[1.0, 1.05, 10.0]);
        let passed: Vec<Passed> = (1..=9).map(|frame| checkpoints.pass(frame, frame as f64 * 0.3)).collect();
        let powers: Vec<usize> = (0..9).filter(|i| passed[*i].power).map(|i| i + 1).collect();
        assert_eq!(powers, [1, 2, 4, 8]);
        // 0.9 s is before 1, 1.2 s after 1 and 1.05; 10 s is never reached.
        let marks: Vec<_> = passed.iter().enumerate().filter(|(_, p)| !p.marks.is_empty()).collect();
        assert_eq!(marks, [(3, &Passed { power: true, marks: vec![0, 1] })]);
    }

    #[test]
    fn a_skipped_power_is_gone() {
        let mut checkpoints = Checkpoints::new(&[]);
        assert!(checkpoints.pass(1, 0.0).power);
        assert!(!checkpoints.pass(3, 0.0).power);
        assert!(checkpoints.pass(4, 0.0).power);
        assert!(!checkpoints.pass(4, 0.0).power, "told twice");
    }
}
