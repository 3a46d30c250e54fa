//! What crosses the wire between master and worker, and how it is framed.
//!
//! Every message is a header of 12 bytes and a body:
//! ```text
//! "IGI" , kind u8 , version u16 , 0 u16 , body length u32        (little endian)
//! ```
//! The header keeps this form in all versions, so that peers of different versions can tell each
//! other so. Its length is checked against the kind's limit before anything is allocated.
//!
//! Who says what, where (each *stream* is ordered in itself only):
//! * **conversation** (one stream both ways): [`Hello`] ↔ [`Welcome`] or [`Refusal`], then
//!   [`ToWorker`] ↔ [`ToMaster`].
//! * **one stream a blob**, master to worker: [`Kind::Blob`], a part of the scene.
//! * **one stream an answer**, worker to master: [`Kind::Answer`]. A big blob or a slow answer
//!   delays nothing else.
//!
//! Control bodies are bincode 1.3.3 (`DefaultOptions`: variable-length integers, nothing after the
//! end) within hard limits, without recursive or zero-sized types. Decoded questions are hostile
//! until [`check_question`] has seen them; scenes until [`crate::parts::join`] has.

mod check;
#[cfg(test)]
mod tests;

use std::sync::Arc;

use bincode::Options;
use scenes::Change;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use crate::answer::{Cost, CostStage};
use crate::identity::Proof;
use crate::parts::Hash;
use crate::question::{Question, WorldState};
use crate::schedule::QuestionId;
pub use check::check_question;

/// The version of everything in this file, of packed answers and scene parts, and of the light in them: workers of one
/// version give the same bits.
pub const VERSION: u16 = 18;

/// Bytes of a header.
pub const HEADER_LEN: usize = 12;

/// Application protocol of the TLS handshake (ALPN). Versions are told apart by headers, in words.
pub const ALPN: &[u8] = b"igi";

/// What a body is, and how long it may be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// [`Hello`].
    Hello = 1,
    /// [`Welcome`].
    Welcome = 2,
    /// [`Refusal`].
    Refusal = 3,
    /// [`ToWorker`].
    ToWorker = 4,
    /// [`ToMaster`].
    ToMaster = 5,
    /// SHA-256 and bytes of a scene part.
    Blob = 6,
    /// [`Answered`].
    Answer = 7,
}

/// The fixed first bytes of a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Header {
    /// What follows.
    pub kind: Kind,
    /// How many bytes follow.
    pub length: u32,
}

/// Bytes that are no message of ours.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum WireError {
    /// The peer speaks something else.
    #[error("this is no igi peer: its message does not begin with \"IGI\"")]
    Magic,
    /// The peer speaks another version.
    #[error(
        "the peer speaks version {theirs} of the igi protocol, this program version {VERSION}: install the same version on both sides"
    )]
    Version {
        /// What it speaks.
        theirs: u16,
    },
    /// A kind of this version that is not, or not here.
    #[error("a message of kind {0} has no place here")]
    Kind(u8),
    /// More bytes than the kind may have.
    #[error("a message claims {length} bytes where at most {limit} are allowed")]
    TooLong {
        /// What its header says.
        length: u32,
        /// What is allowed.
        limit: usize,
    },
    /// The body is not what its kind says, or out of range.
    #[error("a message is broken: {0}")]
    Broken(String),
}

/// The worker's first words.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Hello {
    /// That it has the token.
    pub proof: Proof,
    /// Questions it answers at a time.
    pub threads: u16,
    /// For people; at most [`NAME_MAX`] bytes.
    pub name: String,
    /// Of what its build computes.
    pub bits: Bits,
}

/// A hash of what a build computes: with other bits, pictures would depend on who has drawn which part.
pub type Bits = [u8; 8];

/// The master's first words.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Welcome {
    /// That it has the token.
    pub proof: Proof,
}

/// Why a peer is not talked to.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Refusal {
    /// One line for the person at the other side; at most [`REASON_MAX`] bytes.
    pub reason: String,
}

/// What the master says after the welcome.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum ToWorker {
    /// From now on, questions will be about this world.
    World {
        /// Which; its hash is that of its manifest, see [`crate::parts`].
        state: WorldState,
        /// What leads from revision 0 to this one.
        changes: Vec<Change>,
    },
    /// The world has been edited: from now on, questions will be about the new revision. What was asked before and not cancelled
    /// is to be answered before the edit is made.
    Changes {
        /// What is changed.
        from: WorldState,
        /// The new revision.
        revision: u32,
        /// What leads there.
        changes: Vec<Change>,
    },
    /// Answer this.
    Ask {
        /// The master's number for it.
        id: QuestionId,
        /// What is asked.
        question: Arc<Question>,
    },
    /// Nobody waits for these any more.
    Cancel {
        /// Numbers of questions.
        ids: Vec<QuestionId>,
    },
    /// The connection ends.
    Goodbye {
        /// One line.
        reason: String,
    },
}

/// What the worker says after its hello.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum ToMaster {
    /// Send these parts of the scene.
    Want {
        /// At most [`WANT_MAX`].
        hashes: Vec<Hash>,
    },
    /// How far the scene is here.
    Progress {
        /// Parts that are here.
        have: u32,
        /// Parts of the scene.
        of: u32,
    },
    /// The world is built: ask.
    Ready {
        /// Which.
        state: WorldState,
    },
    /// A question about a world that is not here.
    Missing {
        /// Its number.
        id: QuestionId,
    },
    /// A question that cannot be answered.
    Failed {
        /// Its number.
        id: QuestionId,
        /// One line.
        reason: String,
    },
    /// A question about something that its world does not have: no worker can answer it.
    Refused {
        /// Its number.
        id: QuestionId,
        /// One line.
        reason: String,
    },
    /// It computes nothing itself, and hands on what workers of its own answer: who they are now. It holds no question any
    /// more if that is nobody.
    Relaying(Behind),
    /// Some of what it has handed on is wrong: a worker of its own was found to compute wrongly.
    Retracted {
        /// Who, and how that is known: one line.
        reason: String,
    },
    /// Ask no more; what is not in this list was not begun.
    Leaving {
        /// Questions that will still be answered.
        started: Vec<QuestionId>,
    },
    /// The connection ends.
    Goodbye {
        /// One line.
        reason: String,
    },
}

/// Who is behind a relay and can be asked.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Behind {
    /// Workers that compute, on all levels.
    pub workers: u32,
    /// Questions that they answer at a time, 0..=[`RELAYED_MAX`].
    pub threads: u16,
    /// Relays on the longest way to one of them, this one counted: 1..=[`DEPTH_MAX`].
    pub depth: u8,
}

/// Most questions that workers behind one relay answer at a time; who has more behind it says so many.
pub const RELAYED_MAX: u16 = 1024;
/// Most relays on the way to a worker: relays that join each other in a circle find out by this.
pub const DEPTH_MAX: u8 = 4;

/// An answer on its way.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Answered {
    /// The number of the question.
    pub id: QuestionId,
    /// What it cost the worker.
    pub cost: Cost,
    /// Output of [`crate::pack::compress`].
    pub squeezed: Vec<u8>,
}

/// Longest name of a worker, bytes.
pub const NAME_MAX: usize = 64;
/// Longest reason, bytes.
pub const REASON_MAX: usize = 512;
/// Most parts that one [`ToMaster::Want`] lists.
pub const WANT_MAX: usize = 4096;
/// Longest body before the peer has proved itself, bytes.
pub const STRANGER_MAX: usize = 1024;
/// Longest control body, bytes.
pub const CONTROL_MAX: usize = 256 << 10;
/// Longest part of a scene, bytes: a texture of 16384² texels of four bytes, and its name.
pub const BLOB_MAX: usize = (1 << 30) + (1 << 16);
/// Most pixels that one tile may have.
pub const TILE_PIXELS_MAX: usize = 1 << 22;
/// Most pixels that one question for reference samples may have.
pub const REFERENCE_PIXELS_MAX: usize = 1 << 20;
/// Most reference samples that one question may ask for, over all its pixels: some minutes of a thread.
pub const REFERENCE_SAMPLES_MAX: u64 = 1 << 28;
/// Longest answer, bytes.
pub const ANSWER_MAX: usize = crate::pack::PACKED_MAX + 1024;
/// Largest width and height of a picture, pixels.
pub const PICTURE_SIDE_MAX: u32 = 1 << 16;

impl Kind {
    /// Longest body, bytes.
    pub const fn limit(self) -> usize {
        match self {
            Self::Hello | Self::Welcome | Self::Refusal => STRANGER_MAX,
            Self::ToWorker | Self::ToMaster => CONTROL_MAX,
            Self::Blob => BLOB_MAX + size_of::<Hash>(),
            Self::Answer => ANSWER_MAX,
        }
    }

    fn of(number: u8) -> Option<Self> {
        let all = [Self::Hello, Self::Welcome, Self::Refusal, Self::ToWorker, Self::ToMaster, Self::Blob, Self::Answer];
        all.into_iter().find(|kind| *kind as u8 == number)
    }
}

impl Header {
    /// The bytes of a header.
    pub fn bytes(self) -> [u8; HEADER_LEN] {
        let mut bytes = [0; HEADER_LEN];
        bytes[..3].copy_from_slice(MAGIC);
        bytes[3] = self.kind as u8;
        bytes[4..6].copy_from_slice(&VERSION.to_le_bytes());
        bytes[8..].copy_from_slice(&self.length.to_le_bytes());
        bytes
    }

    /// Reads a header.
    ///
    /// # Errors
    /// Another protocol, another version, an unknown kind, or a length beyond the kind's limit.
    pub fn parse(bytes: [u8; HEADER_LEN]) -> Result<Self, WireError> {
        if &bytes[..3] != MAGIC {
            return Err(WireError::Magic);
        }
        let theirs = u16::from_le_bytes([bytes[4], bytes[5]]);
        if theirs != VERSION {
            return Err(WireError::Version { theirs });
        }
        let kind = Kind::of(bytes[3]).ok_or(WireError::Kind(bytes[3]))?;
        let length = u32::from_le_bytes([bytes[8], bytes[9], bytes[10], bytes[11]]);
        if length as usize > kind.limit() {
            return Err(WireError::TooLong { length, limit: kind.limit() });
        }
        Ok(Self { kind, length })
    }
}

const MAGIC: &[u8; 3] = b"IGI";

/// A type whose bodies are bincode.
pub trait Control: Serialize + DeserializeOwned {
    /// Its kind.
    const KIND: Kind;

    /// Looks at decoded values: numbers in range, lists and names within bounds.
    ///
    /// # Errors
    /// [`WireError::Broken`] says what is wrong.
    fn check(&self) -> Result<(), WireError>;
}

impl Control for Hello {
    const KIND: Kind = Kind::Hello;

    fn check(&self) -> Result<(), WireError> {
        at_most("the name", self.name.len(), NAME_MAX)?;
        demand(self.threads > 0, "a worker without threads")
    }
}

impl Control for Welcome {
    const KIND: Kind = Kind::Welcome;

    fn check(&self) -> Result<(), WireError> {
        Ok(())
    }
}

impl Control for Refusal {
    const KIND: Kind = Kind::Refusal;

    fn check(&self) -> Result<(), WireError> {
        at_most("the reason", self.reason.len(), REASON_MAX)
    }
}

impl Control for ToWorker {
    const KIND: Kind = Kind::ToWorker;

    fn check(&self) -> Result<(), WireError> {
        match self {
            Self::Ask { question, .. } => check_question(question),
            Self::Goodbye { reason } => at_most("the reason", reason.len(), REASON_MAX),
            // Changes are checked when they are applied to a scene.
            Self::World { .. } | Self::Changes { .. } | Self::Cancel { .. } => Ok(()),
        }
    }
}

impl Control for ToMaster {
    const KIND: Kind = Kind::ToMaster;

    fn check(&self) -> Result<(), WireError> {
        match self {
            Self::Want { hashes } => at_most("the list of wanted parts", hashes.len(), WANT_MAX),
            Self::Failed { reason, .. }
            | Self::Refused { reason, .. }
            | Self::Retracted { reason }
            | Self::Goodbye { reason } => at_most("the reason", reason.len(), REASON_MAX),
            Self::Relaying(behind) => {
                demand(behind.threads <= RELAYED_MAX, "more than 1024 threads behind a relay")?;
                demand(
                    (1..=DEPTH_MAX).contains(&behind.depth),
                    "a depth of relays outside 1 … 4: do they join each other in a circle?",
                )
            }
            Self::Progress { .. } | Self::Ready { .. } | Self::Missing { .. } | Self::Leaving { .. } => Ok(()),
        }
    }
}

/// A whole message, header and body.
///
/// # Errors
/// [`WireError::TooLong`] if the body exceeds its kind's limit.
pub fn encode<T: Control>(message: &T) -> Result<Vec<u8>, WireError> {
    let limit = T::KIND.limit();
    let length = bincode_options(u64::MAX).serialized_size(message).map_err(broken)?;
    if length > limit as u64 {
        return Err(WireError::TooLong { length: u32::try_from(length).unwrap_or(u32::MAX), limit });
    }
    let mut bytes = Header { kind: T::KIND, length: length as u32 }.bytes().to_vec();
    bincode_options(limit as u64).serialize_into(&mut bytes, message).map_err(broken)?;
    Ok(bytes)
}

/// Reads the body of a message and checks it.
///
/// # Errors
/// [`WireError::Kind`] for a header of another kind, [`WireError::Broken`] for bytes that are no such message.
pub fn decode<T: Control>(kind: Kind, body: &[u8]) -> Result<T, WireError> {
    if kind != T::KIND {
        return Err(WireError::Kind(kind as u8));
    }
    let message: T = bincode_options(T::KIND.limit() as u64).deserialize(body).map_err(broken)?;
    message.check()?;
    Ok(message)
}

/// The options of all bincode in this crate.
pub(crate) fn bincode_options(limit: u64) -> impl Options {
    bincode::DefaultOptions::new().with_limit(limit)
}

#[derive(Serialize, Deserialize)]
struct AnswerHead {
    id: QuestionId,
    counters: [u64; 6],
    micros: [u64; CostStage::ALL.len()],
}

impl Answered {
    /// A whole message, header and body: `head length u8 , head (bincode) , squeezed answer`.
    pub fn encode(&self) -> Vec<u8> {
        let Cost { eye_rays, shadow_rays, light_rays, compensation_rays, photon_queries, dropped, micros } = self.cost;
        let counters = [eye_rays, shadow_rays, light_rays, compensation_rays, photon_queries, dropped];
        let head = bincode_options(255)
            .serialize(&AnswerHead { id: self.id, counters, micros })
            .expect("13 numbers take at most 117 bytes");
        let length = 1 + head.len() + self.squeezed.len();
        let header = Header { kind: Kind::Answer, length: length as u32 }.bytes();
        [&header[..], &[head.len() as u8], &head, &self.squeezed].concat()
    }

    /// Reads the body of a message. The answer itself is still packed, and hostile.
    ///
    /// # Errors
    /// [`WireError`] for anything that is no answer.
    pub fn decode(kind: Kind, body: &[u8]) -> Result<Self, WireError> {
        let (id, cost, squeezed) = Self::parts(kind, body)?;
        Ok(Self { id, cost, squeezed: squeezed.to_vec() })
    }

    /// The same without a copy: number, cost, and what [`crate::pack::decompress`] takes.
    ///
    /// # Errors
    /// [`WireError`] for anything that is no answer.
    pub fn parts(kind: Kind, body: &[u8]) -> Result<(QuestionId, Cost, &[u8]), WireError> {
        if kind != Kind::Answer {
            return Err(WireError::Kind(kind as u8));
        }
        let cut = || WireError::Broken("an answer ends within its head".into());
        let (&head_len, rest) = body.split_first().ok_or_else(cut)?;
        let (head, squeezed) = rest.split_at_checked(usize::from(head_len)).ok_or_else(cut)?;
        let AnswerHead { id, counters, micros } = bincode_options(255).deserialize(head).map_err(broken)?;
        let [eye_rays, shadow_rays, light_rays, compensation_rays, photon_queries, dropped] =
            counters.map(|count| count.min(COUNT_MAX));
        let micros = micros.map(|time| time.min(COUNT_MAX));
        let cost = Cost { eye_rays, shadow_rays, light_rays, compensation_rays, photon_queries, dropped, micros };
        Ok((id, cost, squeezed))
    }
}

/// A counter of one answer beyond this is a lie; sums over any number of answers must not overflow.
const COUNT_MAX: u64 = 1 << 40;

/// A whole message that carries a part of a scene: `SHA-256 , bytes`.
pub fn encode_blob_header(hash: &Hash, length: usize) -> [u8; HEADER_LEN + size_of::<Hash>()] {
    let header = Header { kind: Kind::Blob, length: (length + size_of::<Hash>()) as u32 };
    let mut bytes = [0; HEADER_LEN + size_of::<Hash>()];
    bytes[..HEADER_LEN].copy_from_slice(&header.bytes());
    bytes[HEADER_LEN..].copy_from_slice(hash);
    bytes
}

/// Cuts text to a number of bytes, at a character's end: for names and reasons.
pub fn cut(text: &str, limit: usize) -> String {
    let mut end = limit.min(text.len());
    while !text.is_char_boundary(end) {
        end -= 1;
    }
    text[..end].to_owned()
}

fn demand(ok: bool, what: &str) -> Result<(), WireError> {
    if ok { Ok(()) } else { Err(WireError::Broken(what.to_owned())) }
}

fn at_most(what: &str, length: usize, limit: usize) -> Result<(), WireError> {
    if length <= limit { Ok(()) } else { Err(WireError::Broken(format!("{what} is longer than {limit}"))) }
}

fn broken(error: bincode::Error) -> WireError {
    WireError::Broken(error.to_string())
}
