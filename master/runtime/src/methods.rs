//! The methods that this program has. A program of its own may have others: `master::main_with`.

use std::collections::BTreeMap;
use std::sync::OnceLock;

use frame::front_end::Value;
use frame::{Chosen, Method};
use serde::{Deserialize, Serialize};

static METHODS: OnceLock<&'static [&'static dyn Method]> = OnceLock::new();

/// All of them, the default one first.
pub fn all() -> &'static [&'static dyn Method] {
    METHODS.get().copied().filter(|methods| !methods.is_empty()).unwrap_or(frame::methods::ALL)
}

/// Has these instead of those of this project; once, before anything else.
pub fn set(methods: &'static [&'static dyn Method]) {
    let _ = METHODS.set(methods);
}

/// The method of this name.
pub fn find(name: &str) -> Option<&'static dyn Method> {
    all().iter().find(|method| method.name() == name).copied()
}

/// The names of all methods, for people.
pub fn names() -> String {
    all().iter().map(|method| method.name()).collect::<Vec<_>>().join(", ")
}

/// A method and values of its knobs, by name.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Named {
    /// Of the method.
    pub name: String,
    /// Of some or all of its knobs.
    pub settings: BTreeMap<String, Value>,
}

impl From<&Chosen> for Named {
    fn from(chosen: &Chosen) -> Self {
        let settings = chosen.settings.iter().map(|(name, value)| (name.to_owned(), value.clone()));
        Self { name: chosen.method.name().to_owned(), settings: settings.collect() }
    }
}

impl Named {
    /// The method with these values; knobs that are not named stay as they were before, or have their defaults where
    /// another method was chosen.
    ///
    /// # Errors
    /// In words: there is no such method, no such knob, or it cannot have that value.
    pub fn after(&self, before: Option<&Chosen>) -> Result<Chosen, String> {
        let before = before.filter(|before| before.method.name() == self.name).cloned();
        let fresh = || find(&self.name).map(Chosen::new);
        let chosen = before.or_else(fresh);
        let unknown = || format!("there is no method {:?}, only {}", self.name, names());
        chosen.ok_or_else(unknown)?.with(self.settings.iter().map(|(name, value)| (name, value.clone())))
    }
}
