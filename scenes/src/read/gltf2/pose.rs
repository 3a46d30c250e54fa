//! Where a file's nodes are at a moment, and how far its morph targets are: what nodes say, and what animations make of it.

use glam::{DMat4, DQuat, DVec3};
use gltf_json::animation::{Channel, Interpolation, Property};
use gltf_json::validation::Checked;
use gltf_json::{Animation, Node};

use super::super::ReadError;
use super::super::error::Notes;
use super::file::File;

/// The animations that are played.
#[derive(Default)]
pub(super) struct Score {
    tracks: Vec<Track>,
    /// First and last time of a key, seconds; `None` if nothing is played.
    pub span: Option<[f64; 2]>,
    /// By node: it moves by itself.
    moves: Vec<bool>,
    /// By node: its morph targets do.
    pub bends: Vec<bool>,
}

/// One channel.
struct Track {
    node: usize,
    property: Property,
    interpolation: Interpolation,
    times: Vec<f32>,
    /// As many for each key as there are parts; three times as many for cubic splines.
    values: Vec<f32>,
}

impl Score {
    /// Of a file's animations all that do not move the same things: exporters write one animation for each thing that
    /// moves, or several from which one is to be chosen.
    pub fn read(file: &File, notes: &mut Notes) -> Self {
        let count = file.root.nodes.len();
        let mut score = Self { moves: vec![false; count], bends: vec![false; count], ..Self::default() };
        let mut left_out = Vec::new();
        for (i, animation) in file.root.animations.iter().enumerate() {
            let name = animation.name.clone().unwrap_or_else(|| format!("{i}"));
            let wanted = |channel: &Channel| (channel.target.node.value(), path(channel));
            let is_taken = |channel: &Channel| {
                let (node, property) = wanted(channel);
                score.tracks.iter().any(|track| track.node == node && Some(track.property) == property)
            };
            if animation.channels.iter().any(is_taken) {
                left_out.push(name);
                continue;
            }
            for (k, channel) in animation.channels.iter().enumerate() {
                let place = format!("animations[{i}].channels[{k}]");
                match Track::read(file, animation, channel, &place) {
                    Ok(track) => score.add(track),
                    Err(error) => file.leave_out(error, "it moves nothing", notes),
                }
            }
        }
        if !left_out.is_empty() {
            let names = left_out.iter().take(20).map(String::as_str).collect::<Vec<_>>().join("`, `");
            let message = format!("move what others move: not played are `{names}`");
            notes.at(&file.path, "animations", message);
        }
        score
    }

    fn add(&mut self, track: Track) {
        let (first, last) = (f64::from(track.times[0]), f64::from(track.times[track.times.len() - 1]));
        let [from, to] = self.span.unwrap_or([first, last]);
        self.span = Some([from.min(first), to.max(last)]);
        match track.property {
            Property::MorphTargetWeights => self.bends[track.node] = true,
            _ => self.moves[track.node] = true,
        }
        self.tracks.push(track);
    }

    /// Whether a node moves by itself, not by its parents.
    pub fn moves(&self, node: usize) -> bool {
        self.moves[node]
    }

    /// All nodes at a time.
    pub fn at(&self, file: &File, time: f64) -> Pose {
        let nodes = &file.root.nodes;
        let mut parts: Vec<Parts> = nodes.iter().map(Parts::of).collect();
        let mut weights: Vec<Option<Vec<f32>>> = vec![None; nodes.len()];
        for track in &self.tracks {
            let part = &mut parts[track.node];
            let value = track.at(time);
            match (track.property, value.as_slice()) {
                (Property::Translation, &[x, y, z]) => part.translation = DVec3::new(x, y, z),
                (Property::Scale, &[x, y, z]) => part.scale = DVec3::new(x, y, z),
                (Property::Rotation, &[x, y, z, w]) => part.rotation = turn(DQuat::from_xyzw(x, y, z, w)),
                (Property::MorphTargetWeights, value) => {
                    weights[track.node] = Some(value.iter().map(|weight| *weight as f32).collect());
                }
                _ => {}
            }
            if track.property != Property::MorphTargetWeights {
                part.matrix = None;
            }
        }
        Pose { parent_from_node: parts.iter().map(Parts::matrix).collect(), weights }
    }
}

/// All nodes at a time.
pub(super) struct Pose {
    pub parent_from_node: Vec<DMat4>,
    /// Of morph targets, where an animation says them.
    weights: Vec<Option<Vec<f32>>>,
}

impl Pose {
    /// How far a node's morph targets are: by animation, or as the node says, or its mesh. Empty: not at all.
    pub fn weights(&self, file: &File, node: usize) -> Vec<f32> {
        let source = &file.root.nodes[node];
        let of_mesh = || file.root.meshes.get(source.mesh?.value())?.weights.clone();
        let weights =
            self.weights[node].clone().or_else(|| source.weights.clone()).or_else(of_mesh).unwrap_or_default();
        if weights.iter().all(|weight| *weight == 0.0) { Vec::new() } else { weights }
    }
}

/// What a node's matrix is made of.
struct Parts {
    matrix: Option<DMat4>,
    translation: DVec3,
    rotation: DQuat,
    scale: DVec3,
}

impl Parts {
    fn of(node: &Node) -> Self {
        let wide =
            |v: Option<[f32; 3]>, default: f64| v.map_or(DVec3::splat(default), |v| DVec3::from(v.map(f64::from)));
        Self {
            matrix: node.matrix.map(|matrix| DMat4::from_cols_array(&matrix.map(f64::from))),
            translation: wide(node.translation, 0.0),
            rotation: turn(DQuat::from_array(node.rotation.unwrap_or_default().0.map(f64::from))),
            scale: wide(node.scale, 1.0),
        }
    }

    fn matrix(&self) -> DMat4 {
        let parts = || DMat4::from_scale_rotation_translation(self.scale, self.rotation, self.translation);
        self.matrix.unwrap_or_else(parts)
    }
}

/// What has no direction does not turn.
pub(super) fn turn(rotation: DQuat) -> DQuat {
    let length = rotation.length();
    if length > 0.0 && length.is_finite() { rotation / length } else { DQuat::IDENTITY }
}

fn path(channel: &Channel) -> Option<Property> {
    match channel.target.path {
        Checked::Valid(property) => Some(property),
        Checked::Invalid => None,
    }
}

impl Track {
    fn read(file: &File, animation: &Animation, channel: &Channel, place: &str) -> Result<Self, ReadError> {
        let property = path(channel).ok_or_else(|| file.refuse(place, "has an unknown target.path"))?;
        let node = channel.target.node;
        file.get(&file.root.nodes, node, || format!("{place}.target.node"))?;
        let sampler = animation.samplers.get(channel.sampler.value());
        let sampler = sampler.ok_or_else(|| file.refuse(place, "names a sampler that does not exist"))?;
        let Checked::Valid(interpolation) = sampler.interpolation else {
            return Err(file.refuse(place, "has an unknown interpolation"));
        };
        let times: Vec<f32> =
            file.vectors::<1>(sampler.input, &format!("{place}: input"))?.into_iter().flatten().collect();
        let values = file.numbers(sampler.output, &format!("{place}: output"))?;
        let sound = !times.is_empty() && times.is_sorted_by(|a, b| a <= b) && times.iter().all(|time| time.is_finite());
        let keys = times.len() * if interpolation == Interpolation::CubicSpline { 3 } else { 1 };
        let parts = values.len() / keys.max(1);
        let wanted = match property {
            Property::Translation | Property::Scale => parts == 3,
            Property::Rotation => parts == 4,
            Property::MorphTargetWeights => parts > 0,
        };
        let whole = sound && wanted && values.len() == parts * keys && values.iter().all(|value| value.is_finite());
        if !whole {
            return Err(file.refuse(place, "its keys are none, not in order, no numbers, or not as many as its values"));
        }
        Ok(Self { node: node.value(), property, interpolation, times, values })
    }

    /// The parts at a time: those of the first key before it, of the last behind it.
    fn at(&self, time: f64) -> Vec<f64> {
        let last = self.times.len() - 1;
        let next = self.times.partition_point(|key| f64::from(*key) <= time).min(last);
        let from = if f64::from(self.times[next]) <= time { next } else { next.saturating_sub(1) };
        let span = f64::from(self.times[next]) - f64::from(self.times[from]);
        let s = if span > 0.0 { ((time - f64::from(self.times[from])) / span).clamp(0.0, 1.0) } else { 0.0 };
        let cubic = self.interpolation == Interpolation::CubicSpline;
        let parts = self.values.len() / (self.times.len() * if cubic { 3 } else { 1 });
        // Of a cubic spline's key: tangent before it, value, tangent behind it.
        let list = |key: usize, which: usize| -> Vec<f64> {
            let first = if cubic { (3 * key + which) * parts } else { key * parts };
            self.values[first..first + parts].iter().map(|value| f64::from(*value)).collect()
        };
        let (a, b) = (list(from, 1), list(next, 1));
        match self.interpolation {
            Interpolation::Step => a,
            Interpolation::Linear if self.property == Property::Rotation => {
                let quaternion = |v: &[f64]| turn(DQuat::from_xyzw(v[0], v[1], v[2], v[3]));
                slerp(quaternion(&a), quaternion(&b), s).to_array().to_vec()
            }
            Interpolation::Linear => a.iter().zip(&b).map(|(a, b)| a + (b - a) * s).collect(),
            Interpolation::CubicSpline => {
                // Appendix C of the specification.
                let (out, into) = (list(from, 2), list(next, 0));
                let (s2, s3) = (s * s, s * s * s);
                let spline = |i: usize| {
                    (2.0 * s3 - 3.0 * s2 + 1.0) * a[i]
                        + span * (s3 - 2.0 * s2 + s) * out[i]
                        + (3.0 * s2 - 2.0 * s3) * b[i]
                        + span * (s3 - s2) * into[i]
                };
                (0..parts).map(spline).collect()
            }
        }
    }
}

/// The shorter way round, with sines from one library everywhere.
fn slerp(a: DQuat, b: DQuat, s: f64) -> DQuat {
    let cos = a.dot(b);
    let (b, cos) = if cos < 0.0 { (-b, -cos) } else { (b, cos) };
    if cos > 0.9995 {
        return turn(a + (b - a) * s);
    }
    let angle = libm::acos(cos.min(1.0));
    let sin = libm::sin(angle);
    turn(a * (libm::sin((1.0 - s) * angle) / sin) + b * (libm::sin(s * angle) / sin))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn track(property: Property, interpolation: Interpolation, times: &[f32], values: &[f32]) -> Track {
        Track { node: 0, property, interpolation, times: times.to_vec(), values: values.to_vec() }
    }

    #[test]
    fn keys_are_met_and_held_beyond_the_ends() {
        for interpolation in [Interpolation::Step, Interpolation::Linear] {
            let track =
                track(Property::Translation, interpolation, &[1.0, 2.0, 4.0], &[0., 0., 0., 8., 0., 0., 2., 0., 0.]);
            let x = |time| track.at(time)[0];
            assert_eq!([x(-5.0), x(1.0), x(2.0), x(4.0), x(9.0)], [0.0, 0.0, 8.0, 2.0, 2.0]);
            assert_eq!(x(3.0), if interpolation == Interpolation::Step { 8.0 } else { 5.0 });
        }
    }

    #[test]
    fn rotations_take_the_shorter_way_at_an_even_pace() {
        let half = std::f32::consts::FRAC_1_SQRT_2;
        // From none to a quarter about y, written as its negative.
        let values = [0.0, 0.0, 0.0, 1.0, 0.0, -half, 0.0, -half];
        let track = track(Property::Rotation, Interpolation::Linear, &[0.0, 3.0], &values);
        let [_, y, _, w] = track.at(1.0).try_into().unwrap();
        let angle: f64 = 2.0 * libm::atan2(y, w);
        assert!((angle.to_degrees() - 30.0).abs() < 1e-4, "{}", angle.to_degrees());
    }

    #[test]
    fn cubic_splines_leave_and_arrive_by_their_tangents() {
        // 0 → 1 within two seconds, leaving at a speed of 1, arriving at rest.
        let values = [0., 0., 0., 0., 0., 0., 1., 0., 0., 0., 0., 0., 1., 0., 0., 0., 0., 0.];
        let track = track(Property::Translation, Interpolation::CubicSpline, &[0.0, 2.0], &values);
        let x = |time| track.at(time)[0];
        assert!((x(1e-4) / 1e-4 - 1.0).abs() < 1e-3);
        assert_eq!((x(0.0), x(2.0)), (0.0, 1.0));
        // ½ by the ends, ⅛ · 2 by the tangent.
        assert!((x(1.0) - 0.75).abs() < 1e-12);
    }
}
