//! What a worker has been asked: so that its answers are unpacked and checked where they arrive, on threads of which there are
//! several, instead of one after the other by the dispatcher.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use protocol::answer::Body;
use protocol::message::ToWorker;
use protocol::pack;
use protocol::question::Question;
use protocol::schedule::QuestionId;

use super::Known;

/// What is in an answer, as far as whoever passes it on knows.
pub enum Content {
    /// It fits its question and the scene.
    Sound {
        /// What it says.
        body: Body,
        /// It has light too bright to be sent, see [`protocol::pack::LARGEST`].
        is_saturated: bool,
        /// Of its packed bytes: the same for the same. 0 if answers are not checked.
        digest: u64,
    },
    /// Packed, not compressed, and hostile: its question is not known here.
    Packed(Vec<u8>),
    /// Why there is nothing in it.
    Broken(String),
}

impl Content {
    /// Unpacks an answer to a question and looks whether it fits the scene.
    pub(super) fn of(packed: &[u8], question: &Question, known: &Known) -> Self {
        let body = pack::unpack(question, packed, known.fields).map_err(|error| error.to_string());
        let checked = body.and_then(|body| match body.check_in(&known.scene) {
            Ok(()) => Ok(body),
            Err(absent) => Err(absent.to_string()),
        });
        match checked {
            Ok(body) => {
                let digest = known.key.map_or(0, |key| key.digest(packed));
                Self::Sound { body, is_saturated: pack::is_saturated(packed), digest }
            }
            Err(reason) => Self::Broken(reason),
        }
    }

    /// What it says, whether it has light too bright to be sent, and its digest.
    pub(super) fn sound(self) -> Result<(Body, bool, u64), String> {
        match self {
            Self::Sound { body, is_saturated, digest } => Ok((body, is_saturated, digest)),
            Self::Packed(_) => Err("nobody has unpacked it".into()),
            Self::Broken(reason) => Err(reason),
        }
    }
}

/// The questions of one worker. The dispatcher's end of the way to it writes, whoever hears it reads.
#[derive(Clone, Default)]
pub(crate) struct Ledger(Arc<Mutex<Entries>>);

#[derive(Default)]
struct Entries {
    /// What questions are about from now on, …
    known: Option<Arc<Known>>,
    /// … and what each is about that was asked.
    asked: BTreeMap<QuestionId, (Arc<Question>, Arc<Known>)>,
}

/// Questions that are remembered of a worker: more than it may hold, even one that hands on what a thousand threads answer, so that what it is late with is known as well. Answers to
/// others are left to the dispatcher.
const ASKED_MAX: usize = protocol::serve::QUEUE_MAX;

impl Ledger {
    /// Questions will be about this.
    pub(crate) fn turn_to(&self, known: &Arc<Known>) {
        let mut entries = self.entries();
        // What was asked before an edit may still be answered.
        if entries.known.as_ref().is_some_and(|before| before.state.world != known.state.world) {
            entries.asked.clear();
        }
        entries.known = Some(Arc::clone(known));
    }

    /// The worker is told something.
    pub(crate) fn note(&self, message: &ToWorker) {
        match message {
            ToWorker::Ask { id, question } => {
                let mut entries = self.entries();
                let Some(known) = entries.known.clone() else { return };
                entries.asked.insert(*id, (Arc::clone(question), known));
                if entries.asked.len() > ASKED_MAX {
                    entries.asked.pop_first();
                }
            }
            ToWorker::Cancel { ids } => {
                let asked = &mut self.entries().asked;
                ids.iter().for_each(|id| drop(asked.remove(id)));
            }
            ToWorker::World { .. } | ToWorker::Changes { .. } | ToWorker::Goodbye { .. } => {}
        }
    }

    /// What is in an answer that was decompressed, or why it could not be.
    pub(crate) fn content(&self, id: QuestionId, packed: Result<Vec<u8>, String>) -> Content {
        let found = self.entries().asked.remove(&id);
        match (packed, found) {
            (Ok(packed), Some((question, known))) => Content::of(&packed, &question, &known),
            (Ok(packed), None) => Content::Packed(packed),
            (Err(reason), _) => Content::Broken(reason),
        }
    }

    fn entries(&self) -> MutexGuard<'_, Entries> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use protocol::answer::Pixels;
    use protocol::question::WorldState;
    use scenes::Keep;

    use super::*;
    use crate::cluster::tests;

    #[test]
    fn what_is_known_is_unpacked_and_all_else_is_left_as_it_is() {
        let world = super::super::known::World::new(tests::scene(), false, Keep::Needed, None);
        let known = world.unwrap().known;
        let question = &tests::questions(WorldState::default(), 0)[0].question;
        let len = question.ask.len();
        let packed = || Ok(pack::pack(question, &Body::Pixels(Pixels::black(len)), known.fields));
        let ask = |id| ToWorker::Ask { id: QuestionId(id), question: Arc::clone(question) };
        let ledger = Ledger::default();
        ledger.turn_to(&known);
        (0..4).for_each(|id| ledger.note(&ask(id)));
        ledger.note(&ToWorker::Cancel { ids: vec![QuestionId(1)] });
        let content = |id, packed| ledger.content(QuestionId(id), packed);
        assert!(
            matches!(content(0, packed()), Content::Sound { body: Body::Pixels(pixels), .. } if pixels.len() == len)
        );
        assert!(matches!(content(0, packed()), Content::Packed(_)), "it was answered before");
        assert!(matches!(content(1, packed()), Content::Packed(_)), "it was cancelled");
        assert!(matches!(content(2, Ok(vec![1, 2, 3])), Content::Broken(_)));
        assert!(matches!(content(3, Err("torn".into())), Content::Broken(reason) if reason == "torn"));
        ledger.note(&ask(4));
        ledger.note(&ask(5));
        ledger.turn_to(&known);
        assert!(matches!(content(4, packed()), Content::Sound { .. }), "it was asked before an edit");
        let mut other = (*known).clone();
        other.state.world[0] ^= 1;
        ledger.turn_to(&Arc::new(other));
        assert!(matches!(content(5, packed()), Content::Packed(_)), "it was about another scene");
        ledger.turn_to(&known);
        (0..=ASKED_MAX as u64).for_each(|id| ledger.note(&ask(id)));
        assert!(matches!(content(0, packed()), Content::Packed(_)), "nobody remembers everything");
        assert!(matches!(content(1, packed()), Content::Sound { .. }));
    }
}
