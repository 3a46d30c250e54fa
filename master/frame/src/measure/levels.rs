//! Round illuminances.

/// The steps of EN 12464-1, lx, within one power of ten.
const STEPS: [f64; 6] = [1.0, 1.5, 2.0, 3.0, 5.0, 7.5];
/// Powers of ten that steps are looked for in: far below starlight, far above a sun.
const POWERS: std::ops::RangeInclusive<i32> = -9..=9;

fn all() -> impl Iterator<Item = f64> {
    POWERS.flat_map(|power| STEPS.map(|step| step * libm::pow(10.0, f64::from(power))))
}

/// The steps strictly between two values, ascending.
pub fn between([low, high]: [f64; 2]) -> Vec<f64> {
    all().filter(|level| *level > low && *level < high).collect()
}

/// The narrowest two steps that values lie between; of nothing, 1 and 10.
pub fn around([low, high]: [f64; 2]) -> [f64; 2] {
    let below = all().filter(|level| *level <= low).last();
    let above = all().find(|level| *level >= high && Some(*level) != below);
    match (below, above) {
        (Some(below), Some(above)) => [below, above],
        // From nothing on, three powers of ten are told apart.
        (None, Some(above)) if high > 0.0 => [above / 1000.0, above],
        _ => [1.0, 10.0],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_are_those_of_the_norm() {
        assert_eq!(between([90.0, 800.0]), [100.0, 150.0, 200.0, 300.0, 500.0, 750.0]);
        assert!(between([5.0, 5.0]).is_empty());
        assert_eq!(around([120.0, 480.0]), [100.0, 500.0]);
        assert_eq!(around([100.0, 100.0]), [100.0, 150.0]);
        assert_eq!(around([0.0, 480.0]), [0.5, 500.0]);
        assert_eq!(around([0.0, 0.0]), [1.0, 10.0]);
        assert_eq!(around([f64::NAN; 2]), [1.0, 10.0]);
    }
}
