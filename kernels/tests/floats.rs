//! Halves in files of tensors.

use meissner_kernels::floats::{f16_to_f32, f32_to_f16};

#[test]
fn every_finite_half_and_no_other_value_is_written_as_one() {
    for bits in (0..=u16::MAX).filter(|bits| bits >> 10 & 0x1f != 0x1f) {
        assert_eq!(f32_to_f16(f16_to_f32(bits)), Some(bits));
    }
    for value in [0.1, 65_504.1, 65_536.0, 1e-8, 3e-8, f32::MIN_POSITIVE, f32::INFINITY, f32::NAN] {
        assert_eq!(f32_to_f16(value), None, "{value}");
    }
}

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
        assert!(found.to_bits() == (value as f32).to_bits() || found.is_nan() && value.is_nan(), "{bits:#x}");
    }
}
