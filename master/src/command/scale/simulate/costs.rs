//! What an answer costs a master, as it was measured with several numbers of connections.

use super::super::measure::Costs;

/// Costs by number of connections: as measured, in proportion to doublings between.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Calibrated {
    /// Increasing numbers of connections, and what an answer took with each.
    measured: Vec<(usize, Costs)>,
    /// What the dispatcher takes more beyond the largest number, with every doubling, microseconds.
    growth: f64,
    /// What a relay was measured to take, microseconds of a core.
    relay: Option<f64>,
}

impl Calibrated {
    /// By one measurement; `growth` is what the dispatcher takes more with every doubling of the connections, microseconds.
    pub fn by_one(connections: usize, costs: Costs, growth: f64) -> Self {
        Self { measured: vec![(connections.max(1), costs)], growth, relay: None }
    }

    /// By one more measurement.
    pub fn and(&mut self, connections: usize, costs: Costs) {
        self.measured.retain(|(others, _)| *others != connections);
        self.measured.push((connections.max(1), costs));
        self.measured.sort_by_key(|(connections, _)| *connections);
    }

    /// A relay was measured to take so many microseconds of a core for an answer.
    pub fn with_relay(self, micros: f64) -> Self {
        Self { relay: Some(micros), ..self }
    }

    /// Microseconds of a relay's core for an answer: as measured; else what a master's network and dispatcher take, and as much
    /// again as the network for sending it on.
    pub fn relay(&self) -> f64 {
        let Costs { network, dispatcher, .. } = self.measured.first().map(|(_, costs)| *costs).unwrap_or_default();
        self.relay.unwrap_or(2.0 * network + dispatcher)
    }

    /// With so many connections. Beyond what was measured, the dispatcher takes more with each doubling; the others do not: a
    /// connection more costs nothing until it brings something.
    pub fn with(&self, connections: usize) -> Costs {
        let (Some(first), Some(last)) = (self.measured.first(), self.measured.last()) else { return Costs::default() };
        let doublings = |from: usize, to: usize| (to.max(1) as f64 / from.max(1) as f64).log2();
        if connections <= first.0 || connections >= last.0 {
            let (measured, costs) = if connections >= last.0 { *last } else { *first };
            let dispatcher = costs.dispatcher + self.growth * doublings(measured, connections);
            return Costs { dispatcher: dispatcher.max(LEAST * costs.dispatcher), ..costs };
        }
        let above = self.measured.partition_point(|(measured, _)| *measured < connections);
        let ((below, low), (above, high)) = (self.measured[above - 1], self.measured[above]);
        let share = doublings(below, connections) / doublings(below, above);
        let between = |of: fn(&Costs) -> f64| of(&low) + (of(&high) - of(&low)) * share;
        Costs {
            network: between(|costs| costs.network),
            dispatcher: between(|costs| costs.dispatcher),
            main: between(|costs| costs.main),
            helpers: between(|costs| costs.helpers),
        }
    }
}

/// The share of what the dispatcher was measured to take that it takes with any number of connections.
const LEAST: f64 = 0.25;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_measured_is_what_is_taken_and_between_it_goes_by_doublings() {
        let costs = |dispatcher: f64| Costs { network: 10.0 * dispatcher, dispatcher, main: 1.0, helpers: 2.0 };
        let mut calibrated = Calibrated::by_one(64, costs(7.0), 0.5);
        calibrated.and(4, costs(3.0));
        for (connections, dispatcher) in [(4, 3.0), (16, 5.0), (64, 7.0), (128, 7.5), (1024, 9.0), (1, 2.0)] {
            let with = calibrated.with(connections);
            assert!((with.dispatcher - dispatcher).abs() < 1e-9, "{connections}: {with:?}");
        }
        assert_eq!(calibrated.with(16).network, 50.0);
        assert_eq!(calibrated.with(1024).network, 70.0);
        assert_eq!(calibrated.relay(), 63.0);
        assert_eq!(calibrated.with_relay(5.0).relay(), 5.0);
    }
}
