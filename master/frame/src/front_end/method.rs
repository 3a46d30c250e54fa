//! The description of a way of making pictures, and how to begin with it.

use protocol::answer::Fields;
use scenes::{Camera, Scene};

use super::{FrontEnd, Interactive, Knob, Layer, Literal, Preset, Settings, Value, View};

/// A way of making pictures: what it is called, what can be set, what can be looked at, and how to begin.
///
/// All that the rest of the program knows of a method is here: command line, panels, recordings, checkpoints, reports
/// and metadata work with whatever methods they are given.
pub trait Method: Sync {
    /// As in `--method NAME`; letters, digits and dashes.
    fn name(&self) -> &'static str;

    /// What it does, in a sentence.
    fn about(&self) -> &'static str;

    /// All that can be set.
    fn knobs(&self) -> &'static [Knob];

    /// Named settings. The first, if there are any, has all defaults.
    fn presets(&self) -> &'static [Preset] {
        &[]
    }

    /// All that can be looked at, [`Layer::FINAL`] first.
    fn layers(&self) -> &'static [Layer];

    /// Whether settings fit together, each being as its knob has it.
    ///
    /// # Errors
    /// In words, what does not.
    fn check(&self, _settings: &Settings) -> Result<(), String> {
        Ok(())
    }

    /// Memory that a picture takes on the master, bytes.
    fn memory_bytes(&self, settings: &Settings, camera: &Camera, fields: Fields) -> u64;

    /// Begins with a picture for a file.
    fn begin(&self, settings: &Settings, view: &View) -> Box<dyn FrontEnd>;

    /// Goes on with what [`FrontEnd::keep`] has kept.
    ///
    /// # Errors
    /// [`NoCheckpoint`]: it is none, or not of this picture, or the method keeps none.
    fn resume(&self, _settings: &Settings, _view: &View, _kept: &[u8]) -> Result<Box<dyn FrontEnd>, NoCheckpoint> {
        Err(NoCheckpoint::Another)
    }

    /// Begins with pictures for people, once they look; its tickets count from `first_ticket` on.
    fn interactive(&self, settings: &Settings, first_ticket: u32) -> Box<dyn Interactive>;

    /// Samples a pixel that a frame adds.
    fn samples_per_frame(&self) -> u32 {
        1
    }

    /// The picture as it is shown differs from the raw one.
    fn is_filtered(&self, _settings: &Settings) -> bool {
        false
    }

    /// By which power of the number of samples the squared error of the raw picture falls in the end: −1 if they are
    /// independent and nothing is left out; 0 if something is.
    fn expected_slope(&self, _settings: &Settings) -> f64 {
        -1.0
    }

    /// Light of a scene that no picture of this method has, whatever is set and however long it is drawn, and of which its
    /// error says nothing: in words, or `None`.
    fn misses(&self, _scene: &Scene) -> Option<String> {
        None
    }

    /// It is what others are judged by, rather than one of them.
    fn is_reference(&self) -> bool {
        false
    }
}

/// A method and its settings.
#[derive(Clone)]
pub struct Chosen {
    /// Which.
    pub method: &'static dyn Method,
    /// All of them.
    pub settings: Settings,
}

impl Chosen {
    /// A method as it is by default.
    pub fn new(method: &'static dyn Method) -> Self {
        Self { method, settings: Settings::new(method.knobs()) }
    }

    /// With other values for some knobs.
    ///
    /// # Errors
    /// In words: there is no such knob, it cannot have that value, or values do not fit together.
    pub fn with(&self, values: impl IntoIterator<Item = (impl AsRef<str>, impl Into<Value>)>) -> Result<Self, String> {
        let settings = self.settings.clone().with(self.method.knobs(), values)?;
        self.method.check(&settings)?;
        Ok(Self { settings, ..*self })
    }

    /// The flags that choose it again, whatever the defaults are by then.
    pub fn flags(&self) -> Vec<String> {
        let flag = |knob: &Knob| knob.flag(self.settings.get(knob.name));
        let method = format!("--method {}", self.method.name());
        std::iter::once(method).chain(self.method.knobs().iter().filter_map(flag)).collect()
    }

    /// As [`Method::memory_bytes`].
    pub fn memory_bytes(&self, camera: &Camera, fields: Fields) -> u64 {
        self.method.memory_bytes(&self.settings, camera, fields)
    }

    /// As [`Method::begin`].
    pub fn begin(&self, view: &View) -> Box<dyn FrontEnd> {
        self.method.begin(&self.settings, view)
    }

    /// As [`Method::interactive`].
    pub fn interactive(&self, first_ticket: u32) -> Box<dyn Interactive> {
        self.method.interactive(&self.settings, first_ticket)
    }

    /// The method's layer of this name.
    pub fn layer(&self, name: &str) -> Option<Layer> {
        self.method.layers().iter().find(|layer| layer.name == name).copied()
    }
}

impl PartialEq for Chosen {
    fn eq(&self, other: &Self) -> bool {
        self.method.name() == other.method.name() && self.settings == other.settings
    }
}

impl std::fmt::Debug for Chosen {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.flags().join(" "))
    }
}

/// The preset of this name, as values.
pub fn preset(method: &dyn Method, name: &str) -> Option<&'static [(&'static str, Literal)]> {
    method.presets().iter().find(|preset| preset.name == name).map(|preset| preset.values)
}

/// Bytes that cannot be gone on with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NoCheckpoint {
    /// Damaged, cut off, or of a version that wrote otherwise.
    Broken,
    /// Another scene, size, seed, method or setting, or a version that may draw otherwise.
    Another,
}

impl std::fmt::Display for NoCheckpoint {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Broken => "it is damaged, or of another version of this program",
            Self::Another => "it is of another picture, or another version of this program drew it: scene, size, seed, method or a setting differs",
        })
    }
}
