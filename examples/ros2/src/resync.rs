//! Words of EVT 3.0 after a packet that was lost.
//!
//! The words of a packet change time, row and base column, which the next packet takes over. After
//! a loss these are wrong until they are sent again: an event could get the row or the time of
//! another one. Until then, words of events are left out and counted. A camera sends its time every
//! 16 us at the latest, so that a few events are left out at most.

use std::borrow::Cow;

/// Bits 15-12 of the words that matter; the others change no state that an event needs.
mod word {
    pub(super) const Y: u16 = 0x0;
    pub(super) const X: u16 = 0x2;
    pub(super) const BASE: u16 = 0x3;
    pub(super) const VECTOR_12: u16 = 0x4;
    pub(super) const VECTOR_8: u16 = 0x5;
    pub(super) const TIME_LOW: u16 = 0x6;
    pub(super) const TIME_HIGH: u16 = 0x8;
}

/// What was sent again since the loss.
#[derive(Clone, Copy, Debug, Default)]
#[expect(clippy::struct_excessive_bools, reason = "each kind of word is sent again by itself")]
pub struct Resync {
    high: bool,
    low: bool,
    row: bool,
    base: bool,
    /// Events that were left out.
    unplaced: u64,
}

impl Resync {
    /// Whether every word means again what the camera meant.
    fn is_done(self) -> bool {
        self.high && self.low && self.row && self.base
    }

    /// The words of the next packet without those whose place or time is unknown. The bytes as they
    /// are, once all is known.
    pub fn words<'a>(&mut self, bytes: &'a [u8]) -> Cow<'a, [u8]> {
        if self.is_done() {
            return bytes.into();
        }
        let mut kept = Vec::with_capacity(bytes.len());
        let mut words = bytes.chunks_exact(2);
        for bytes in words.by_ref() {
            let word = u16::from_le_bytes([bytes[0], bytes[1]]);
            let is_placed = self.high && self.low && self.row;
            let is_kept = match word >> 12 {
                word::TIME_HIGH => {
                    self.high = true;
                    true
                }
                // The lower bits of the time before a new upper word belong to a time that is over.
                word::TIME_LOW => {
                    self.low |= self.high;
                    true
                }
                word::Y => {
                    self.row = true;
                    true
                }
                word::BASE => {
                    self.base = true;
                    true
                }
                word::X => self.place(is_placed, 1),
                word::VECTOR_12 => self.place(is_placed && self.base, (word & 0xfff).count_ones()),
                word::VECTOR_8 => self.place(is_placed && self.base, (word & 0xff).count_ones()),
                _ => true,
            };
            // A vector moves its base, also where its events are left out; a vector without any
            // does.
            match word >> 12 {
                _ if is_kept => kept.extend_from_slice(bytes),
                kind @ (word::VECTOR_12 | word::VECTOR_8) if self.base => {
                    kept.extend_from_slice(&(kind << 12).to_le_bytes());
                }
                _ => {}
            }
        }
        // Half a word is the decoder's error to tell.
        kept.extend_from_slice(words.remainder());
        kept.into()
    }

    fn place(&mut self, is_placed: bool, events: u32) -> bool {
        if !is_placed {
            self.unplaced += u64::from(events);
        }
        is_placed
    }

    /// Events that were left out since this was last asked.
    pub fn take_unplaced(&mut self) -> u64 {
        std::mem::take(&mut self.unplaced)
    }
}

#[cfg(test)]
mod tests {
    use std::borrow::Cow;

    use meissner_engine::{Event, Sensor};
    use meissner_io::EventPackets;

    use super::Resync;

    fn bytes(words: &[u16]) -> Vec<u8> {
        words.iter().flat_map(|word| word.to_le_bytes()).collect()
    }

    #[test]
    fn after_a_loss_no_event_gets_the_row_or_the_time_of_another() {
        let sensor = Sensor::new(640, 480);
        let mut packets = EventPackets::new("evt3", sensor).expect("a known encoding");
        let first = bytes(&[0x8001, 0x6005, 0x0007, 0x2803]);
        assert_eq!(packets.decode(0, &first).expect("good words"), [Event::new(4101, 3, 7, true)]);
        // The lost packet went on to time 0x002'000 and row 9. Each event before what is sent again
        // is left out.
        let mut resync = Resync::default();
        let next = bytes(&[
            0x2804, 0x6007, 0x2804, 0x8002, 0x2804, 0x6001, 0x2804, 0x4003, 0x000a, 0x2005, 0x4007, 0x3010,
            0x4005,
        ]);
        let kept = resync.words(&next);
        let expected = [(5, false), (16, false), (18, false)];
        let expected = expected.map(|(x, on)| Event::new(8193, x, 10, on));
        assert_eq!(packets.decode(0, &kept).expect("good words"), expected);
        assert_eq!(resync.take_unplaced(), 4 + 2 + 3);
        assert!(matches!(resync.words(&next), Cow::Borrowed(_)));
    }

    #[test]
    fn a_vector_whose_row_is_unknown_moves_its_base() {
        let mut packets = EventPackets::new("evt3", Sensor::new(640, 480)).expect("a known encoding");
        let mut resync = Resync::default();
        let next = bytes(&[0x8001, 0x6000, 0x3810, 0x4fff, 0x0002, 0x4001]);
        let kept = resync.words(&next);
        assert_eq!(packets.decode(0, &kept).expect("good words"), [Event::new(4096, 28, 2, true)]);
        assert_eq!(resync.take_unplaced(), 12);
    }
}
