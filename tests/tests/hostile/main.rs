//! Bytes of strangers: everything that reads them is given the kept corpus (`tests/corpus`) and many mutations of it.
//! Nothing panics, hangs, or takes more memory than it may, as a counting allocator sees it.
//!
//! `IGI_FUZZ=N` mutates every file N times instead of 400, from `IGI_SEED` on. What does harm is written to the target
//! folder: it belongs into the corpus, and is replayed for ever.

mod corpus;
mod decoders;
mod meter;

use std::panic::AssertUnwindSafe;
use std::path::Path;
use std::time::{Duration, Instant};

use decoders::{DECODERS, Decoder};

/// Longest time over one input, on a machine that does other things.
const TIME: Duration = Duration::from_secs(5);

/// Random numbers by seed (SplitMix64, Steele et al. 2014).
struct Chance(u64);

impl Chance {
    fn draw(&mut self, below: usize) -> usize {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let x = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((x ^ (x >> 31)) % below.max(1) as u64) as usize
    }
}

/// Numbers at the edges of what fits.
const EDGES: [u64; 10] = [0, 1, 0x7f, 0xff, 0x7fff_ffff, 0x8000_0000, 0xffff_ffff, 1 << 40, u64::MAX >> 1, u64::MAX];
/// What formats stumble over.
const TOKENS: [&str; 14] =
    ["-1", "nan", "1e999", "-0.0", "4294967296", "\"", "{", "[[[[[[[[", "\0", "é", "\n", "//", "null", "../"];

/// One to four pieces of damage; `other` is another input of the same kind.
fn mutate(bytes: &[u8], other: &[u8], chance: &mut Chance) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    for _ in 0..=chance.draw(4) {
        let at = chance.draw(bytes.len());
        let end = (at + 1 + chance.draw(16)).min(bytes.len());
        match chance.draw(8) {
            0 => bytes.iter_mut().skip(at).take(1).for_each(|byte| *byte ^= 1 << chance.draw(8)),
            1 => bytes.iter_mut().skip(at).take(1).for_each(|byte| *byte = chance.draw(256) as u8),
            2 => bytes.truncate(at),
            3 => drop(bytes.drain(at.min(end)..end)),
            4 => {
                let piece = bytes[at.min(end)..end].repeat(1 + chance.draw(40));
                bytes.splice(at.min(end)..at.min(end), piece);
            }
            5 => {
                let width = [1, 2, 4, 8][chance.draw(4)];
                let edge = EDGES[chance.draw(EDGES.len())].to_le_bytes();
                bytes.iter_mut().skip(at).zip(&edge[..width]).for_each(|(byte, edge)| *byte = *edge);
            }
            6 => {
                let token = TOKENS[chance.draw(TOKENS.len())];
                bytes.splice(at..at, token.bytes());
            }
            _ => {
                let from = chance.draw(other.len());
                let to = (from + chance.draw(64)).min(other.len());
                bytes.splice(at..at, other[from.min(to)..to].iter().copied());
            }
        }
    }
    bytes
}

/// Gives it to the decoder; what is wrong with how it takes it, and what it took.
fn examine(decoder: &Decoder, bytes: &[u8], folder: &Path) -> (Result<bool, String>, usize) {
    let begun = Instant::now();
    let read = || std::panic::catch_unwind(AssertUnwindSafe(|| (decoder.read)(bytes, folder)));
    let (read, memory) = meter::peak(read);
    let took = begun.elapsed();
    let verdict = match read {
        Err(_) => Err("it panicked".to_owned()),
        Ok(_) if memory > decoder.memory => Err(format!("it took {memory} bytes, {} are allowed", decoder.memory)),
        Ok(_) if took > TIME => Err(format!("it took {took:?}, {TIME:?} is allowed")),
        Ok(is_sound) => Ok(is_sound),
    };
    (verdict, memory)
}

fn number(variable: &str) -> Option<u64> {
    std::env::var(variable).ok().map(|text| text.parse().unwrap_or_else(|_| panic!("{variable} is a number")))
}

/// One test, because the allocator counts for everybody.
#[test]
fn the_corpus_and_its_mutations_do_no_harm() {
    if std::env::var_os("IGI_WRITE_CORPUS").is_some() {
        for (decoder, name, bytes) in corpus::beginnings() {
            std::fs::create_dir_all(corpus::folder(decoder)).expect("a folder of the corpus");
            std::fs::write(corpus::folder(decoder).join(name), bytes).expect("a file of the corpus");
        }
    }
    let (times, seed) = (number("IGI_FUZZ").unwrap_or(400), number("IGI_SEED").unwrap_or(0));
    let temporary = tempfile::tempdir().expect("a folder");
    for decoder in &DECODERS {
        let files = corpus::files(decoder.name);
        assert!(!files.is_empty(), "no corpus for {}", decoder.name);
        let (mut taken, mut memory_max, begun) = (0, 0, Instant::now());
        let mut give = |bytes: &[u8], what: &str| {
            let (verdict, memory) = examine(decoder, bytes, temporary.path());
            memory_max = memory_max.max(memory);
            verdict.unwrap_or_else(|wrong| {
                let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("hostile-{}", decoder.name));
                std::fs::write(&path, bytes).expect("it can be kept");
                panic!("{}, {what}: {wrong}; the input is in {}", decoder.name, path.display());
            })
        };
        for (name, bytes) in &files {
            let is_sound = give(bytes, name);
            // What once did harm is named so.
            assert!(is_sound || name.contains("bomb") || name.contains("harm"), "{}/{name} is not sound", decoder.name);
        }
        for (which, (name, bytes)) in files.iter().enumerate() {
            for time in seed..seed + times {
                let mut chance = Chance(time << 8 | which as u64);
                let other = &files[chance.draw(files.len())].1;
                let mutated = mutate(bytes, other, &mut chance);
                taken += u64::from(give(&mutated, &format!("{name} with IGI_SEED={time}")));
            }
        }
        println!(
            "{:10} {} files, {} mutations, of which {taken} still sound; {} bytes at most, {:.1} s",
            decoder.name,
            files.len(),
            times * files.len() as u64,
            memory_max,
            begun.elapsed().as_secs_f64()
        );
    }
}
