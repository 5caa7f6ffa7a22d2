//! Elements of HDF5's arrays: integers of any size, and records of them.

use hdf5_reader::error::{ByteOrder, Error, Result};
use hdf5_reader::{Datatype, H5Type};

/// An integer of 1, 2, 4 or 8 bytes, or of an enumeration. Values from 2^63 on become negative.
#[derive(Clone, Copy)]
pub(super) struct Integer(pub(super) i64);

/// The integers `t`, `x`, `y` and `p` of a record.
#[derive(Clone, Copy)]
pub(super) struct Record(pub(super) [i64; 4]);

/// Position of an integer in an element, and its representation.
#[derive(Clone, Copy)]
struct Place {
    at: usize,
    size: usize,
    signed: bool,
    big: bool,
}

impl Place {
    /// The place of an integer of this type at byte `at`.
    fn of(dtype: &Datatype, at: usize) -> Result<Self> {
        match dtype {
            &Datatype::FixedPoint { size: size @ (1 | 2 | 4 | 8), signed, byte_order } => {
                Ok(Self { at, size: size.into(), signed, big: byte_order == ByteOrder::BigEndian })
            }
            Datatype::Enum { base, .. } => Self::of(base, at),
            other => Err(unfit(other)),
        }
    }

    /// The places of the fields of a record of `size` bytes.
    fn fields(dtype: &Datatype) -> Result<(usize, [Self; 4])> {
        let Datatype::Compound { size, fields } = dtype else { return Err(unfit(dtype)) };
        let size = *size as usize;
        let place = |name: &str| {
            let field = fields.iter().find(|field| field.name == name).ok_or_else(|| unfit(dtype))?;
            let place = Self::of(&field.datatype, field.byte_offset as usize)?;
            if place.at.saturating_add(place.size) > size { Err(unfit(dtype)) } else { Ok(place) }
        };
        Ok((size, [place("t")?, place("x")?, place("y")?, place("p")?]))
    }

    /// The integer at this position in `element`, which is long enough.
    #[inline]
    fn read(self, element: &[u8]) -> i64 {
        let Self { at, size, signed, big } = self;
        let mut word = [0; 8];
        match size {
            1 => word[0] = element[at],
            2 => word[..2].copy_from_slice(&element[at..at + 2]),
            4 => word[..4].copy_from_slice(&element[at..at + 4]),
            _ => word.copy_from_slice(&element[at..at + 8]),
        }
        // Placed at the highest bits, so that a shift back extends the sign.
        let shift = 64 - 8 * size as u32;
        let high = if big { u64::from_be_bytes(word) } else { u64::from_le_bytes(word) << shift };
        if signed { high as i64 >> shift } else { (high >> shift) as i64 }
    }
}

/// The error of a type of elements that is not read.
fn unfit(dtype: &Datatype) -> Error {
    let expected = "integers of 1, 2, 4 or 8 bytes, or records of them named t, x, y and p".to_owned();
    Error::TypeMismatch { expected, actual: format!("{dtype:?}") }
}

/// The first `count` integers of `N` bytes.
fn words<const N: usize>(raw: &[u8], count: usize, read: impl Fn([u8; N]) -> i64) -> Vec<Integer> {
    raw.as_chunks().0.iter().take(count).map(|&word| Integer(read(word))).collect()
}

impl H5Type for Integer {
    fn hdf5_type() -> Datatype {
        i64::hdf5_type()
    }

    fn from_bytes(bytes: &[u8], dtype: &Datatype) -> Result<Self> {
        one(Self::decode_vec(bytes, dtype, 1), dtype)
    }

    fn element_size(dtype: &Datatype) -> usize {
        Place::of(dtype, 0).map_or(8, |place| place.size)
    }

    fn decode_vec(raw: &[u8], dtype: &Datatype, count: usize) -> Option<Result<Vec<Self>>> {
        let place = Place::of(dtype, 0).ok()?;
        let read = |element: &[u8]| Self(place.read(element));
        // The usual types as loops without branches.
        let integers = match place {
            Place { size: 1, signed: false, .. } => words(raw, count, |[byte]| byte.into()),
            Place { size: 2, signed: false, big: false, .. } => {
                words(raw, count, |word| u16::from_le_bytes(word).into())
            }
            Place { size: 4, signed: false, big: false, .. } => {
                words(raw, count, |word| u32::from_le_bytes(word).into())
            }
            Place { size, .. } => raw.chunks_exact(size).take(count).map(read).collect(),
        };
        Some(Ok(integers))
    }
}

impl H5Type for Record {
    fn hdf5_type() -> Datatype {
        i64::hdf5_type()
    }

    fn from_bytes(bytes: &[u8], dtype: &Datatype) -> Result<Self> {
        one(Self::decode_vec(bytes, dtype, 1), dtype)
    }

    fn element_size(dtype: &Datatype) -> usize {
        Place::fields(dtype).map_or(8, |(size, _)| size)
    }

    fn decode_vec(raw: &[u8], dtype: &Datatype, count: usize) -> Option<Result<Vec<Self>>> {
        let (size, places) = Place::fields(dtype).ok()?;
        let records = raw.chunks_exact(size).take(count);
        Some(Ok(records.map(|record| Self(places.map(|place| place.read(record)))).collect()))
    }
}

/// The only element of `decoded`.
fn one<T: Copy>(decoded: Option<Result<Vec<T>>>, dtype: &Datatype) -> Result<T> {
    decoded.unwrap_or_else(|| Err(unfit(dtype)))?.first().copied().ok_or_else(|| unfit(dtype))
}
