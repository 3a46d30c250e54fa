//! When chains of mirrors and glass end.
//!
//! Between perfect mirrors, and in glass where total reflection traps light, nothing is lost on the way, so nothing
//! but chance ends a chain. Chance makes those that go on brighter. If every step took the same share, their weight
//! would grow exponentially, and so may the time for which light is trapped: a ball of interpolated normals lets light
//! in that leaves it after hundreds of total reflections, when one sample would outshine thousands of others.
//! Here survivors of n steps weigh n / [`PATIENT`] up to a thousand steps, and a chain that nothing else ends costs
//! three hundred rays on average.

/// Chains lose nothing to chance before they are so long. (A plain limit of 256 took 0.5 % of what a ball of index 4
/// lets through.)
pub const PATIENT: u32 = 64;
/// From here on every step takes the same share.
const IMPATIENT: u32 = 1024;
/// Longer chains end whatever they carry, which has probability e⁻⁶⁶: it only guards against endless loops.
pub const LONGEST: u32 = 65_000;

/// The greatest probability with which a chain goes on after `steps` of specular surfaces, 0..=1.
pub fn most(steps: u32) -> f32 {
    if steps < PATIENT { 1.0 } else { 1.0 - 1.0 / steps.min(IMPATIENT) as f32 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_of_long_chains_grow_slowly_and_time_is_bounded() {
        let (mut alive, mut expected) = (1.0_f64, 0.0);
        for steps in 0..LONGEST {
            expected += alive;
            alive *= f64::from(most(steps));
            let weight = 1.0 / alive;
            if (PATIENT..IMPATIENT).contains(&steps) {
                assert!(weight <= f64::from(steps + 1) / 63.0 * 1.001, "{steps} steps weigh {weight}");
            }
        }
        assert!(expected < 320.0, "{expected} rays");
        assert!(alive < 1e-27, "{alive} of what is trapped for ever is lost");
    }
}
