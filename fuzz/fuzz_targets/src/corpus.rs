//! The committed inputs of each target, and changed ones. Equal seeds give equal inputs.

use std::io;
use std::path::PathBuf;

use meissner_verify::Random;

/// Longest input.
const MAX: usize = 1 << 16;
/// Values that overwrite fields, cut to their lowest bytes to fit the field.
const WORDS: [u64; 10] =
    [0, 1, 0x7f, 0x7fff_ffff, 1 << 31, u32::MAX as u64, 1 << 40, 1 << 63, (1 << 63) - 1, u64::MAX];
/// Texts that overwrite numbers in texts.
const NUMBERS: [&str; 12] = [
    "0",
    "-1",
    "",
    "65536",
    "4294967296",
    "9223372036854775807",
    "-9223372036854775809",
    "1e309",
    "nan",
    "inf",
    "0.0000000001",
    "1_000",
];

/// Makes inputs from a corpus.
#[derive(Clone, Debug)]
pub struct Mutator<'c> {
    corpus: &'c [(String, Vec<u8>)],
    seed: u64,
}

impl<'c> Mutator<'c> {
    /// A mutator whose inputs depend on `seed`.
    ///
    /// # Panics
    /// If the corpus is empty.
    pub fn new(corpus: &'c [(String, Vec<u8>)], seed: u64) -> Self {
        assert!(!corpus.is_empty(), "a corpus has inputs");
        Self { corpus, seed }
    }

    /// Input `index`: up to six changes of an input of the corpus.
    pub fn input(&self, index: u64) -> Vec<u8> {
        let mut random = Random::new(self.seed ^ index.wrapping_mul(0xd6e8_feb8_6659_fd93));
        let mut bytes = self.pick(&mut random).to_vec();
        for _ in 0..=random.below(6) {
            self.change(&mut bytes, &mut random);
        }
        bytes.truncate(MAX);
        bytes
    }

    fn pick(&self, random: &mut Random) -> &'c [u8] {
        &self.corpus[random.below(self.corpus.len() as u64) as usize].1
    }

    fn change(&self, bytes: &mut Vec<u8>, random: &mut Random) {
        let at = random.below(bytes.len() as u64 + 1) as usize;
        let end = (at + random.below(64) as usize + 1).min(bytes.len());
        match random.below(12) {
            0 => bytes.truncate(at),
            1..=3 => {
                if let Some(byte) = bytes.get_mut(at) {
                    *byte ^= 1 << random.below(8);
                }
            }
            4 => {
                if let Some(byte) = bytes.get_mut(at) {
                    *byte = random.bits() as u8;
                }
            }
            5 | 6 => {
                let word = WORDS[random.below(WORDS.len() as u64) as usize];
                let width = 1 << random.below(4);
                let ends = [word.to_le_bytes()[..width].to_vec(), word.to_be_bytes()[8 - width..].to_vec()];
                if let Some(field) = bytes.get_mut(at..at + width) {
                    field.copy_from_slice(&ends[random.below(2) as usize]);
                }
            }
            7 => {
                let other = self.pick(random);
                bytes.truncate(at);
                bytes.extend(&other[random.below(other.len() as u64 + 1) as usize..]);
            }
            8 => {
                let copied = bytes[at..end].to_vec();
                let to = random.below(bytes.len() as u64 + 1) as usize;
                for _ in 0..=random.below(4) {
                    bytes.splice(to..to, copied.iter().copied());
                }
            }
            9 => drop(bytes.drain(at..end)),
            10 => {
                let length = random.below(16) as usize;
                let noise: Vec<u8> = (0..length).map(|_| random.bits() as u8).collect();
                bytes.splice(at..at, noise);
            }
            _ => {
                // The next number of a text.
                let Some(start) = bytes[at..].iter().position(u8::is_ascii_digit).map(|n| at + n) else {
                    return;
                };
                let digits = bytes[start..].iter().take_while(|b| b.is_ascii_digit()).count();
                let number = NUMBERS[random.below(NUMBERS.len() as u64) as usize];
                bytes.splice(start..start + digits, number.bytes());
            }
        }
    }
}

/// The folder of the corpora, one in it for each target.
pub fn folder() -> PathBuf {
    PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../corpus"))
}

/// The inputs of a target with the names of their files, by name.
///
/// # Errors
/// The target has no corpus, or a file of it cannot be read.
pub fn read(target: &str) -> io::Result<Vec<(String, Vec<u8>)>> {
    let mut inputs = Vec::new();
    for entry in std::fs::read_dir(folder().join(target))? {
        let entry = entry?;
        inputs.push((entry.file_name().to_string_lossy().into_owned(), std::fs::read(entry.path())?));
    }
    inputs.sort();
    Ok(inputs)
}
