//! Clients that are connected: on machines of their own, as fast as they are.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::{Duration, Instant};

use anyhow::{Context, anyhow};
use protocol::question::WorldState;
use scenes::Scene;

use super::measure::{Measured, Timing, draw};
use super::settings::Drawing;
use super::watched::{Place, Took};
use runtime::cluster::{Cluster, ClusterOptions, WorkerInfo};
use runtime::console::Console;
use runtime::failure::Failure;
use runtime::interrupt::Interrupt;
use runtime::reception::Announcer;
use runtime::reception::invitation::{Invitation, Origin};

/// Workers of other machines that have built the scene.
pub struct Connected {
    cluster: Cluster,
    world: WorldState,
    _announcer: Option<Announcer>,
    _invitation: Option<Invitation>,
}

/// How many are there is told this often.
const BETWEEN_WORDS: Duration = Duration::from_secs(5);

impl Connected {
    /// Listens until so many are ready; `None` if it was interrupted.
    ///
    /// # Errors
    /// The address cannot be listened at, or the scene cannot be sent.
    pub fn wait_for(
        count: usize,
        scene: &Arc<Scene>,
        options: ClusterOptions,
        origin: &Origin,
        interrupt: &Interrupt,
        console: &Console,
    ) -> Result<Option<Self>, Failure> {
        let mut cluster = Cluster::start(options).context("cannot listen for clients")?;
        let world = cluster.publish(Arc::clone(scene)).context("the scene cannot be sent to clients")?;
        let invitation = Invitation::extend(origin, None, &cluster, console);
        let announcer = Announcer::of(&cluster).context("cannot start a thread")?;
        let mut told = None;
        loop {
            let ready = cluster.status().ready;
            if ready >= count {
                return Ok(Some(Self { cluster, world, _announcer: announcer, _invitation: invitation }));
            }
            if interrupt.asked() {
                return Ok(None);
            }
            if told.is_none_or(|(number, at): (usize, Instant)| number != ready && at.elapsed() > BETWEEN_WORDS) {
                console.line(&format!("{ready} of {count} clients are ready …"));
                told = Some((ready, Instant::now()));
            }
            cluster.next(Duration::from_millis(50));
        }
    }

    /// Draws with the first so many of them, in the order in which they came. Nothing if it was interrupted.
    ///
    /// # Errors
    /// Too few are left, or frames are not completed.
    pub fn measure(
        &mut self,
        count: usize,
        scene: &Arc<Scene>,
        timing: Timing,
        drawing: &Drawing,
        interrupt: &Interrupt,
    ) -> Result<Option<Measured>, Failure> {
        let crew: Vec<WorkerInfo> = self.cluster.status().list.into_iter().take(count).collect();
        if crew.len() < count {
            return Err(anyhow!("only {} of {count} clients are left", crew.len()).into());
        }
        let numbers: Vec<u32> = crew.iter().map(|info| info.worker).collect();
        self.cluster.call(Some(&numbers));
        let Some(drawn) = draw(scene, self.world, &mut self.cluster, &|| 0.0, timing, drawing, interrupt)? else {
            return Ok(None);
        };
        let left = self.cluster.status().list;
        if numbers.iter().any(|number| !left.iter().any(|info| info.worker == *number)) {
            return Err(anyhow!("a client left while frames were timed").into());
        }
        let slowness = slowness(&drawn.answers, &numbers);
        let shares = crew.iter().zip(&slowness).map(|(info, slow)| info.threads as f64 * slowness[0] / slow).collect();
        // Time of threads, as long as it would have taken those of the first.
        let [first, last] = drawn.timed;
        let in_time = |took: &&Took| (first..last).contains(&took.frame);
        let by = |worker: u32| numbers.iter().position(|number| *number == worker);
        let busy = drawn.answers.iter().filter(in_time).filter_map(|took| {
            let slow = slowness[by(took.worker)?];
            Some((took.micros + took.set_micros) as f64 * slowness[0] / slow)
        });
        let client_cores = busy.sum::<f64>() / 1e6 / drawn.seconds;
        Ok(Some(Measured { shares, client_cores, ..drawn }))
    }
}

/// How long each worker takes for its tiles, over what all take for them on average; 1 for who has drawn none.
fn slowness(answers: &[Took], workers: &[u32]) -> Vec<f64> {
    let mut tiles: BTreeMap<Place, (f64, f64)> = BTreeMap::new();
    for took in answers {
        let (sum, count) = tiles.entry(took.place).or_default();
        (*sum, *count) = (*sum + took.micros as f64, *count + 1.0);
    }
    let mean = |took: &Took| tiles.get(&took.place).map_or(0.0, |(sum, count)| sum / count);
    let of = |worker: &u32| {
        let own = || answers.iter().filter(|took| took.worker == *worker);
        let usual: f64 = own().map(mean).sum();
        if usual > 0.0 { own().map(|took| took.micros as f64).sum::<f64>() / usual } else { 1.0 }
    };
    workers.iter().map(of).map(|slowness| slowness.max(1e-6)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn who_takes_twice_as_long_is_half_as_fast_whatever_tiles_it_had() {
        let place = |set| Place { set: Some(set), corner: [0, 0] };
        let took = |worker, set, micros| Took { frame: 0, place: place(set), worker, set_micros: 5, micros };
        // Set 1 is dear; the second worker had more of it.
        let answers =
            [took(7, 0, 100), took(9, 0, 200), took(7, 1, 1000), took(9, 1, 2000), took(9, 1, 2000), took(7, 1, 1000)];
        let slow = slowness(&answers, &[7, 9, 11]);
        assert!((slow[1] / slow[0] - 2.0).abs() < 1e-9 && slow[2] == 1.0, "{slow:?}");
    }
}
