//! The command line of `scale` as it is meant.

use std::path::PathBuf;
use std::sync::Arc;

use frame::{Chosen, View};
use protocol::answer::Fields;
use protocol::question::WorldState;
use scenes::{Camera, Needs, Scene};

use crate::cli::{ScaleArgs, Size};
use crate::command::options;
use runtime::cluster::ClusterOptions;
use runtime::console::ConsoleOptions;
use runtime::failure::Failure;
use runtime::reception::invitation::Origin;

/// What is measured, and where it goes.
pub struct Settings {
    /// Folder or file.
    pub scene: PathBuf,
    /// Pixels; `None`: as many as the scene says.
    pub size: Option<Size>,
    /// Folder of the page.
    pub output: PathBuf,
    /// Numbers of clients to measure, increasing; the first is 1, because all others are compared with it.
    pub counts: Vec<u16>,
    /// Who they are.
    pub clients: ClientSource,
    /// Relative speeds of unequal clients, if those are measured as well.
    pub uneven: Option<Vec<f64>>,
    /// What they draw.
    pub drawing: Drawing,
    /// Frames to time for each number of clients, at least 2.
    pub frames: u32,
    /// Most clients to simulate.
    pub simulate: u32,
    /// Bandwidth of the simulated master's link, Mbit/s.
    pub bandwidth: f64,
    /// Time from the simulated master to a client, milliseconds.
    pub delay: f64,
    /// How much is said.
    pub console: ConsoleOptions,
    /// Numbers of clients as they were typed.
    typed: Vec<u16>,
}

/// ClientSource that are measured.
pub enum ClientSource {
    /// Processes of this machine, each held to such a share of a core.
    Emulated(f64),
    /// Workers that join from machines of their own.
    Connected {
        /// Where they join.
        cluster: ClusterOptions,
        /// Where their token comes from.
        origin: Origin,
    },
}

/// What clients draw.
pub struct Drawing {
    /// How.
    pub method: Chosen,
    /// All randomness comes from it.
    pub seed: u64,
}

impl Drawing {
    /// What is drawn of a scene that workers know as this world.
    pub fn view(&self, scene: &Arc<Scene>, world: WorldState) -> View {
        let fields = Fields::of(&Needs::of(scene));
        View { world, scene: Arc::clone(scene), fields, camera: scene.camera, seed: self.seed }
    }
}

impl Settings {
    /// What these flags mean.
    ///
    /// # Errors
    /// [`Failure::Usage`] if numbers of clients do not increase.
    pub fn new(args: &ScaleArgs) -> Result<Self, Failure> {
        if !args.clients.is_sorted_by(|a, b| a < b) {
            return Err(Failure::Usage("--clients wants increasing numbers, such as 1,2,4,8,16".into()));
        }
        let one = (args.clients.first() != Some(&1)).then_some(1);
        let clients = match args.listen {
            None => ClientSource::Emulated(args.cpu_per_client),
            Some(_) => {
                let (listen, token, token_file) = (args.listen, args.token.clone(), args.token_file.clone());
                let origin = options::origin(token_file.as_deref(), token.as_deref());
                let cluster = ClusterOptions { listen, token, token_file, ..ClusterOptions::default() };
                ClientSource::Connected { cluster, origin }
            }
        };
        Ok(Self {
            scene: args.scene.clone(),
            size: args.size,
            output: args.output.clone(),
            counts: one.into_iter().chain(args.clients.iter().copied()).collect(),
            clients,
            uneven: args.uneven.as_ref().map(|ratio| ratio.0.clone()),
            drawing: Drawing { method: args.method.0.clone(), seed: args.seed },
            frames: args.frames,
            simulate: args.simulate,
            bandwidth: args.bandwidth,
            delay: args.delay,
            console: options::console(args.talk),
            typed: args.clients.clone(),
        })
    }

    /// The largest number of clients.
    pub fn most(&self) -> u16 {
        self.counts.last().copied().unwrap_or(1)
    }

    /// How many times as fast as the first all unequal clients are together; 0 if there are none.
    pub fn uneven_sum(&self) -> f64 {
        self.uneven.as_ref().map_or(0.0, |parts| parts.iter().sum())
    }

    /// The command that measures the same again.
    pub fn command(&self, camera: &Camera) -> String {
        let listed = |numbers: Vec<String>, between| numbers.join(between);
        let who = match &self.clients {
            ClientSource::Emulated(share) => format!("--cpu-per-client {share}"),
            ClientSource::Connected { cluster, .. } => {
                cluster.listen.map_or(String::new(), |address| format!("--listen {address}"))
            }
        };
        let uneven = self.uneven.as_ref().map_or(String::new(), |parts| {
            format!(" --uneven {}", listed(parts.iter().map(f64::to_string).collect(), ":"))
        });
        format!(
            "igi-master scale {} --size {}x{} --clients {} {who}{uneven} --frames {} --seed {} {}",
            self.scene.display(),
            camera.width,
            camera.height,
            listed(self.typed.iter().map(u16::to_string).collect(), ","),
            self.frames,
            self.drawing.seed,
            self.drawing.method.flags().join(" ")
        )
    }
}
