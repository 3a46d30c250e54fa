//! What can be looked at: every layer of a method with its name, its unit and its colours, once for files, panels, legends
//! and metadata.

/// The numbers of a picture, pixel by pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Plane {
    /// Radiance as the method shows it, W·m⁻²·sr⁻¹: filtered, filled in, whatever it does.
    Final,
    /// Mean radiance, never filtered, W·m⁻²·sr⁻¹.
    Raw,
    /// Unfiltered irradiance at the eye paths' end points, W·m⁻²; 0 where nothing diffuse is seen. Of rough metals, weighed
    /// by what their lobes reflect to the eye.
    Irradiance,
    /// Unfiltered irradiance of what the eye meets first, whatever it is made of, W·m⁻²: of answers that were asked for
    /// it ([`protocol::question::Quality::illuminance`]).
    Illuminance,
    /// Reflectance along the eye path, 0..=1.
    Albedo,
    /// Mean normal, its components in −1..=1.
    Normal,
    /// Mean length of the eye path in the scene's unit, the same in all three channels.
    Distance,
    /// Number of samples, the same in all three channels.
    Samples,
    /// Standard deviation of the raw mean; 0 as long as it is unknown.
    Error,
    /// Number of the worker that answered last for this pixel.
    Worker,
    /// Microseconds of a thread that a pixel of the last answer cost.
    Cost,
    /// A plane of one method alone, by its name.
    Own(&'static str),
}

/// Something that people can look at, and files can hold.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Layer {
    /// By which messages, recordings and metadata know it; unique within a method.
    pub name: &'static str,
    /// For people who choose.
    pub label: &'static str,
    /// What its files are called after the scene's name; empty for the picture itself.
    pub file: &'static str,
    /// Where its numbers come from.
    pub plane: Plane,
    /// How numbers become colours.
    pub colours: Colours,
    /// What its values are, for files that hold them, with their unit.
    pub values: &'static str,
    /// Its channels in an EXR with all layers; `None`: such files leave it out.
    pub exr: Option<Channels>,
    /// The method's marks ([`super::Mark`]) are shown over it.
    pub marks: bool,
}

/// Channels of a layer in an EXR.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Channels {
    /// Before the dot.
    pub name: &'static str,
    /// Red, green and blue; else one value.
    pub coloured: bool,
}

/// How numbers become colours.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Colours {
    /// Radiance: exposure and tone curve as people choose them. `title`: what the marks over it are, if there are any.
    Light {
        /// Shown as a legend; empty: no legend.
        title: &'static str,
    },
    /// Irradiance, as a white wall would look in it.
    Wall,
    /// The numbers are colours, 0..=1.
    Plain,
    /// Components in −1..=1.
    Direction,
    /// Photometric false colours of irradiance: equal steps of colour are equal factors.
    Illuminance,
    /// A ramp from 0 to what this share of the pixels stays below, 0..=1.
    Ramp {
        /// What is shown.
        title: &'static str,
        /// Of the numbers; empty for pure numbers.
        unit: &'static str,
        /// Share of the pixels, 0..=1.
        share: f64,
        /// From white to dark, not from blue to red.
        grey: bool,
    },
    /// A colour for each number.
    Numbers {
        /// What is shown.
        title: &'static str,
    },
}

impl Layer {
    /// The picture: every method has it.
    pub const FINAL: Self = Self {
        name: "final",
        label: "Picture",
        file: "",
        plane: Plane::Final,
        colours: Colours::Light { title: "" },
        values: "radiance, W/(m² sr)",
        exr: None,
        marks: false,
    };
    /// Without any filter.
    pub const RAW: Self = Self {
        name: "raw",
        label: "Picture, unfiltered",
        file: "unfiltered",
        plane: Plane::Raw,
        exr: Some(Channels { name: "raw", coloured: true }),
        ..Self::FINAL
    };
    /// Illuminance in lux.
    pub const LUX: Self = Self {
        name: "lux",
        label: "Illuminance, lux",
        file: "illuminance",
        plane: Plane::Illuminance,
        colours: Colours::Illuminance,
        values: "lx",
        ..Self::FINAL
    };
    /// Irradiance in colour.
    pub const IRRADIANCE: Self = Self {
        name: "irradiance",
        label: "Irradiance",
        file: "irradiance",
        plane: Plane::Irradiance,
        colours: Colours::Wall,
        values: "W/m²",
        exr: Some(Channels { name: "irradiance", coloured: true }),
        ..Self::FINAL
    };
    /// Reflectance.
    pub const ALBEDO: Self = Self {
        name: "albedo",
        label: "Reflectance",
        file: "reflectance",
        plane: Plane::Albedo,
        colours: Colours::Plain,
        values: "share of the light",
        exr: Some(Channels { name: "albedo", coloured: true }),
        ..Self::FINAL
    };
    /// Normals.
    pub const NORMAL: Self = Self {
        name: "normal",
        label: "Normals",
        file: "normals",
        plane: Plane::Normal,
        colours: Colours::Direction,
        values: "unit vectors, scene space",
        exr: Some(Channels { name: "normal", coloured: true }),
        ..Self::FINAL
    };
    /// Distance from the eye.
    pub const DISTANCE: Self = Self {
        name: "distance",
        label: "Distance",
        file: "distance",
        plane: Plane::Distance,
        colours: Colours::Ramp { title: "distance", unit: "", share: 0.99, grey: true },
        values: "the scene's unit of length",
        exr: Some(Channels { name: "distance", coloured: false }),
        ..Self::FINAL
    };
    /// Number of samples.
    pub const SAMPLES: Self = Self {
        name: "samples",
        label: "Samples",
        file: "samples",
        plane: Plane::Samples,
        colours: Colours::Ramp { title: "samples a pixel", unit: "", share: 1.0, grey: false },
        values: "samples a pixel",
        exr: Some(Channels { name: "samples", coloured: false }),
        ..Self::FINAL
    };
    /// Estimated error.
    pub const ERROR: Self = Self {
        name: "error",
        label: "Estimated error",
        file: "error",
        plane: Plane::Error,
        colours: Colours::Ramp { title: "standard deviation of the radiance", unit: "", share: 0.99, grey: false },
        values: "standard deviation of the radiance, W/(m² sr)",
        exr: Some(Channels { name: "deviation", coloured: true }),
        ..Self::FINAL
    };
    /// Who answered.
    pub const WORKER: Self = Self {
        name: "worker",
        label: "Who drew it",
        file: "workers",
        plane: Plane::Worker,
        colours: Colours::Numbers { title: "who drew it" },
        values: "number of the worker",
        exr: Some(Channels { name: "worker", coloured: false }),
        ..Self::FINAL
    };
    /// What it cost.
    pub const COST: Self = Self {
        name: "cost",
        label: "Cost",
        file: "cost",
        plane: Plane::Cost,
        colours: Colours::Ramp { title: "time a pixel", unit: "µs", share: 0.99, grey: false },
        values: "microseconds a pixel",
        exr: Some(Channels { name: "cost", coloured: false }),
        ..Self::FINAL
    };
}
