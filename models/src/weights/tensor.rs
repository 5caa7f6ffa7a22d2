//! One tensor of a weights file, and the floating-point types that its values may have in the file.
//!
//! Values become f32: exactly where f32 holds the value, else rounded to nearest.

use safetensors::Dtype;

/// A tensor of a weights file.
#[derive(Clone, Debug, PartialEq)]
pub struct Tensor {
    shape: Vec<usize>,
    values: Values,
}

#[derive(Clone, Debug, PartialEq)]
enum Values {
    Float(Vec<f32>),
    /// Values that no network reads: only their type is kept.
    Other(String),
}

impl Tensor {
    /// A tensor of `shape` in row-major order; `None` where `shape` has another number of values.
    pub fn new(shape: Vec<usize>, values: Vec<f32>) -> Option<Self> {
        let count = shape.iter().try_fold(1usize, |n, &d| n.checked_mul(d))?;
        (count == values.len()).then_some(Self { shape, values: Values::Float(values) })
    }

    /// A tensor whose values no network reads, with the name of their type.
    pub(super) fn other(shape: Vec<usize>, dtype: impl Into<String>) -> Self {
        Self { shape, values: Values::Other(dtype.into()) }
    }

    /// Its shape.
    pub fn shape(&self) -> &[usize] {
        &self.shape
    }

    /// Its values in row-major order; `None` where they are not floating-point numbers.
    pub fn values(&self) -> Option<&[f32]> {
        match &self.values {
            Values::Float(values) => Some(values),
            Values::Other(_) => None,
        }
    }

    /// Type of its values: "F32" for every floating-point type, else the file's name for it.
    pub fn dtype(&self) -> &str {
        match &self.values {
            Values::Float(_) => "F32",
            Values::Other(dtype) => dtype,
        }
    }
}

/// Whether values of this type become f32.
pub(super) fn is_float(dtype: Dtype) -> bool {
    matches!(dtype, Dtype::F16 | Dtype::BF16 | Dtype::F32 | Dtype::F64)
}

/// Little-endian value `index` of a floating-point type; `None` past the end and otherwise.
pub(super) fn float(dtype: Dtype, bytes: &[u8], index: usize) -> Option<f32> {
    let size = dtype.bitsize() / 8;
    let bytes = bytes.get(index.checked_mul(size)?..)?.get(..size)?;
    Some(match dtype {
        Dtype::F16 => f16_to_f32(u16::from_le_bytes(bytes.try_into().ok()?)),
        Dtype::BF16 => f32::from_bits(u32::from(u16::from_le_bytes(bytes.try_into().ok()?)) << 16),
        Dtype::F32 => f32::from_le_bytes(bytes.try_into().ok()?),
        Dtype::F64 => f64::from_le_bytes(bytes.try_into().ok()?) as f32,
        _ => return None,
    })
}

/// IEEE 754 binary16 as f32, exactly.
fn f16_to_f32(bits: u16) -> f32 {
    /// 2^-24, the smallest subnormal of binary16.
    const UNIT: f32 = 1.0 / 16_777_216.0;
    let sign = u32::from(bits & 0x8000) << 16;
    let exponent = u32::from(bits >> 10 & 0x1f);
    let mantissa = u32::from(bits & 0x3ff);
    let magnitude = match exponent {
        0 => (mantissa as f32 * UNIT).to_bits(),
        0x1f => 0x7f80_0000 | mantissa << 13,
        _ => (exponent + 127 - 15) << 23 | mantissa << 13,
    };
    f32::from_bits(sign | magnitude)
}

#[cfg(test)]
mod tests {
    use safetensors::Dtype;

    use super::{f16_to_f32, float};

    #[test]
    fn every_half_is_the_value_its_definition_gives() {
        for bits in 0..=u16::MAX {
            let (e, m) = (i32::from(bits >> 10 & 0x1f), f64::from(bits & 0x3ff));
            let magnitude = match e {
                0x1f if m == 0.0 => f64::INFINITY,
                0x1f => f64::NAN,
                0 => m * 2f64.powi(-24),
                _ => (1024.0 + m) * 2f64.powi(e - 25),
            };
            let value = if bits >> 15 == 1 { -magnitude } else { magnitude };
            let found = f16_to_f32(bits);
            assert!(
                found.to_bits() == (value as f32).to_bits() || found.is_nan() && value.is_nan(),
                "{bits:#x}"
            );
        }
    }

    #[test]
    fn a_value_past_the_end_is_none() {
        assert_eq!(float(Dtype::F32, &[0; 7], 1), None);
        assert_eq!(float(Dtype::F64, &[0; 8], usize::MAX / 4), None);
        assert_eq!(float(Dtype::BF16, &[0, 0, 0x80, 0x3f], 1), Some(1.0));
    }
}
