//! Conversions between f32 and other types, little-endian, as in files of tensors.

/// The smallest binary16 above 0, 2^-24.
const UNIT: f32 = 1.0 / 16_777_216.0;

/// IEEE 754 binary16 as f32, exactly.
pub fn f16_to_f32(bits: u16) -> f32 {
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

/// The bits of the finite binary16 that has the value of `value` exactly, if there is one.
pub fn f32_to_f16(value: f32) -> Option<u16> {
    let bits = value.to_bits();
    let magnitude = match (bits >> 23 & 0xff) as i32 - 127 + 15 {
        ..=0 => (value.abs() / UNIT) as u32,
        31.. => return None,
        exponent => (exponent as u32) << 10 | bits >> 13 & 0x3ff,
    };
    let half = (bits >> 16 & 0x8000 | magnitude) as u16;
    (f16_to_f32(half).to_bits() == bits).then_some(half)
}

/// The values of binary16 numbers. Remaining bytes are ignored, here and below.
pub fn from_f16(bytes: &[u8]) -> Vec<f32> {
    bytes.as_chunks().0.iter().map(|&bytes| f16_to_f32(u16::from_le_bytes(bytes))).collect()
}

/// The values of f32 numbers.
pub fn from_f32(bytes: &[u8]) -> Vec<f32> {
    bytes.as_chunks().0.iter().copied().map(f32::from_le_bytes).collect()
}

/// The binary16 numbers that have these values exactly, if there is one for each.
pub fn to_f16(values: &[f32]) -> Option<Vec<u8>> {
    let mut bytes = Vec::with_capacity(2 * values.len());
    for &value in values {
        bytes.extend(f32_to_f16(value)?.to_le_bytes());
    }
    Some(bytes)
}

/// f32 numbers.
pub fn to_f32(values: &[f32]) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(4 * values.len());
    values.iter().for_each(|value| bytes.extend(value.to_le_bytes()));
    bytes
}
