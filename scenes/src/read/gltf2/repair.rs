//! From JSON text to the typed document, without giving a scene up for one field.
//!
//! `gltf_json` refuses a whole document for one field of the wrong kind, and some that are valid. Here the lists
//! are read item by item. What is valid but refused is put into its terms; of what is broken, the smallest part is left
//! out that makes the rest readable; if nothing does, an item that says nothing takes its place, so that indices keep
//! their meaning.

use std::path::Path;

use gltf_json::extensions::root::{KhrLightsPunctual, Root as Extensions};
use gltf_json::{Index, Root};
use serde::de::DeserializeOwned;
use serde_json::{Value, json};

use super::super::error::Notes;

/// Values of an item times attempts to read it: more are not worth it.
const WORK_MAX: usize = 100_000;

/// The document; only its lists, and what says which scene is meant.
pub(super) fn root(path: &Path, mut document: Value, notes: &mut Notes) -> Root {
    let mut repair = Repair { path, notes, whole: Places::default() };
    repair.leave_out_aimless_channels(&mut document);
    repair.find_pictures(&mut document);
    let scene = document["scene"].as_f64().map(|number| Index::new(number as u32));
    let lights = repair.list(&mut document, "/extensions/KHR_lights_punctual/lights", &json!({ "type": "none" }));
    let extensions = Extensions { khr_lights_punctual: Some(KhrLightsPunctual { lights }), ..Extensions::default() };
    let no_accessor = json!({ "componentType": 0, "count": 0, "type": "none" });
    // The `u32` that no list is long enough for.
    let no_view = json!({ "buffer": u32::MAX, "byteLength": 0 });
    let root = Root {
        accessors: repair.list(&mut document, "/accessors", &no_accessor),
        animations: repair.list(&mut document, "/animations", &json!({ "channels": [], "samplers": [] })),
        buffers: repair.list(&mut document, "/buffers", &json!({ "byteLength": 0 })),
        buffer_views: repair.list(&mut document, "/bufferViews", &no_view),
        cameras: repair.list(&mut document, "/cameras", &json!({ "type": "none" })),
        images: repair.list(&mut document, "/images", &json!({})),
        materials: repair.list(&mut document, "/materials", &json!({})),
        meshes: repair.list(&mut document, "/meshes", &json!({ "primitives": [] })),
        nodes: repair.list(&mut document, "/nodes", &json!({})),
        samplers: repair.list(&mut document, "/samplers", &json!({})),
        scenes: repair.list(&mut document, "/scenes", &json!({ "nodes": [] })),
        skins: repair.list(&mut document, "/skins", &json!({ "joints": [] })),
        textures: repair.list(&mut document, "/textures", &json!({})),
        scene,
        extensions: Some(extensions),
        ..Root::default()
    };
    repair.whole.report(notes, path, "whole numbers are written with a point or an exponent: read as such");
    root
}

struct Repair<'a> {
    path: &'a Path,
    notes: &'a mut Notes,
    whole: Places,
}

/// Where something happens: how often, and where first.
#[derive(Default)]
struct Places {
    count: u64,
    first: String,
}

impl Places {
    fn add(&mut self, place: &str) {
        if self.count == 0 {
            self.first = place.to_owned();
        }
        self.count += 1;
    }

    fn report(self, notes: &mut Notes, path: &Path, message: &str) {
        match self.count {
            0 => {}
            1 => notes.at(path, self.first, message),
            count => notes.at(path, self.first, format!("{message}; so in {} more places", count - 1)),
        }
    }
}

impl Repair<'_> {
    /// The list at a pointer, every item in its place. `neutral` is an item that says nothing; what it has stands in for
    /// what an item lacks.
    fn list<T: DeserializeOwned>(&mut self, document: &mut Value, pointer: &str, neutral: &Value) -> Vec<T> {
        let name = pointer[1..].replace('/', ".");
        let items = match document.pointer_mut(pointer).map(Value::take) {
            None | Some(Value::Null) => return Vec::new(),
            Some(Value::Array(items)) => items,
            Some(_) => {
                self.notes.at(self.path, name, "is no list: left out");
                return Vec::new();
            }
        };
        let mut read = |(i, item)| self.item(item, &format!("{name}[{i}]"), neutral);
        items.into_iter().enumerate().map(&mut read).collect()
    }

    fn item<T: DeserializeOwned>(&mut self, mut item: Value, place: &str, neutral: &Value) -> T {
        if let Ok(read) = typed(&item) {
            return read;
        }
        if make_whole(&mut item) {
            self.whole.add(place);
        }
        let attempts = WORK_MAX / size(&item).max(1) + 1;
        for _ in 0..attempts {
            let error = match typed(&item) {
                Ok(read) => return read,
                Err(error) => error,
            };
            let path = error.path().to_string();
            let missing = neutral.as_object().into_iter().flatten().find(|(field, _)| lacks(&error, field));
            if let (Some(item), Some((field, value))) = (item.as_object_mut(), missing) {
                item.insert(field.clone(), value.clone());
                continue;
            }
            if !leave_out(&mut item, error.path()) {
                self.notes.at(self.path, place, format!("{}: left out", error.inner()));
                break;
            }
            self.notes.at(self.path, format!("{place}.{path}"), format!("{}: left out", error.inner()));
        }
        typed(neutral).unwrap_or_else(|error| unreachable!("the neutral item of {place}: {error}"))
    }

    /// Channels of animations that move no node are valid (extensions add such) and mean nothing here.
    fn leave_out_aimless_channels(&mut self, document: &mut Value) {
        let mut left_out = Places::default();
        for (i, animation) in document["animations"].as_array_mut().into_iter().flatten().enumerate() {
            let Some(channels) = animation.get_mut("channels").and_then(Value::as_array_mut) else { continue };
            let before = channels.len();
            channels.retain(|channel| channel["target"]["node"].is_number());
            (channels.len()..before).for_each(|_| left_out.add(&format!("animations[{i}].channels")));
        }
        left_out.report(self.notes, self.path, "a channel's target has no node: left out");
    }

    /// A texture may have its picture from an extension, which goes before the one for programs that do not know it.
    fn find_pictures(&mut self, document: &mut Value) {
        for (i, texture) in document["textures"].as_array_mut().into_iter().flatten().enumerate() {
            let known = READ_PICTURES.iter().find_map(|name| texture["extensions"][*name].get("source").cloned());
            if let Some(source) = known {
                texture["source"] = source;
            }
            if texture.get("source").is_none() {
                let names = texture["extensions"].as_object().into_iter().flat_map(|all| all.keys());
                let names = names.map(String::as_str).collect::<Vec<_>>().join(", ");
                let why = if names.is_empty() { "has no source" } else { "has its picture only from an extension" };
                let message =
                    format!("{why}{}{names}: the plain colour is used", if names.is_empty() { "" } else { " " });
                self.notes.at(self.path, format!("textures[{i}]"), message);
            }
        }
    }
}

/// Extensions that name a picture of a kind that is read.
const READ_PICTURES: [&str; 2] = ["EXT_texture_webp", "MSFT_texture_dds"];

/// The one place where types are read: each costs much code.
fn typed<T: DeserializeOwned>(item: &Value) -> Result<T, Error> {
    serde_path_to_error::deserialize(item)
}

type Error = serde_path_to_error::Error<serde_json::Error>;

/// Whether the error is that the item lacks this field.
fn lacks(error: &Error, field: &str) -> bool {
    error.path().iter().next().is_none() && error.inner().to_string() == format!("missing field `{field}`")
}

/// Numbers such as 48.0 and 4.8e1 become 48: JSON does not tell them apart, but Rust's types do. True if there was one.
fn make_whole(value: &mut Value) -> bool {
    /// Above, floating-point numbers skip integers.
    const MOST: f64 = 9_007_199_254_740_992.0;
    match value {
        Value::Array(items) => items.iter_mut().fold(false, |some, item| make_whole(item) | some),
        Value::Object(fields) => fields.values_mut().fold(false, |some, field| make_whole(field) | some),
        Value::Number(number) if number.is_f64() => match number.as_f64() {
            Some(whole) if whole.fract() == 0.0 && whole.abs() <= MOST => {
                *value = Value::from(whole as i64);
                true
            }
            _ => false,
        },
        _ => false,
    }
}

/// How many values there are in it.
fn size(value: &Value) -> usize {
    match value {
        Value::Array(items) => 1 + items.iter().map(size).sum::<usize>(),
        Value::Object(fields) => 1 + fields.values().map(size).sum::<usize>(),
        _ => 1,
    }
}

/// Removes what a path leads to; false if that is the item itself, or nothing.
fn leave_out(item: &mut Value, path: &serde_path_to_error::Path) -> bool {
    use serde_path_to_error::Segment;
    let mut segments: Vec<&Segment> = path.iter().collect();
    let Some(last) = segments.pop() else { return false };
    let parent = segments.into_iter().try_fold(item, |value, segment| match segment {
        Segment::Map { key } => value.get_mut(key),
        Segment::Seq { index } => value.get_mut(*index),
        _ => None,
    });
    match (parent, last) {
        (Some(Value::Object(fields)), Segment::Map { key }) => fields.remove(key).is_some(),
        (Some(Value::Array(items)), Segment::Seq { index }) if *index < items.len() => {
            items.remove(*index);
            true
        }
        _ => false,
    }
}
