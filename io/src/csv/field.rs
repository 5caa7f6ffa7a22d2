//! One field of text to one number, or to what was wrong with it.

/// What a field should have been, and what it is.
pub(super) struct Refusal {
    pub(super) expected: String,
    pub(super) actual: String,
}

impl Refusal {
    pub(super) fn new(expected: impl Into<String>, field: &[u8]) -> Self {
        Self { expected: expected.into(), actual: shown(field) }
    }
}

/// The field as an error shows it: quoted, and not longer than a person wants to read.
pub(crate) fn shown(field: &[u8]) -> String {
    const MOST: usize = 40;
    let dots = if field.len() > MOST { ".." } else { "" };
    format!("`{}{dots}`", field[..field.len().min(MOST)].escape_ascii())
}

/// Without the spaces and the quotes around it.
pub(crate) fn bare(field: &[u8]) -> &[u8] {
    let field = field.trim_ascii();
    match field {
        [b'"', inner @ .., b'"'] => inner.trim_ascii(),
        _ => field,
    }
}

/// A whole number: digits, a sign or none, and a fraction of zeros or none. `None`: it is something else.
fn whole(field: &[u8]) -> Option<i64> {
    let (negative, digits) = match field {
        [b'-', rest @ ..] => (true, rest),
        [b'+', rest @ ..] => (false, rest),
        _ => (false, field),
    };
    let mut value = 0_i64;
    for (index, &byte) in digits.iter().enumerate() {
        if byte == b'.' && index > 0 {
            return digits[index + 1..].iter().all(|&b| b == b'0').then_some(value);
        }
        let digit = byte.wrapping_sub(b'0');
        if digit > 9 {
            return None;
        }
        // Counted away from zero with its sign, so that the least time of all can be said.
        let digit = i64::from(if negative { -(digit as i8) } else { digit as i8 });
        value = value.checked_mul(10)?.checked_add(digit)?;
    }
    (!digits.is_empty()).then_some(value)
}

/// A time in microseconds.
pub(super) fn time(field: &[u8]) -> Result<i64, Refusal> {
    whole(field)
        .ok_or_else(|| Refusal::new("a whole number of microseconds (a fraction suggests seconds)", field))
}

/// A column or row.
pub(super) fn coordinate(field: &[u8]) -> Result<u16, Refusal> {
    whole(field)
        .and_then(|value| value.try_into().ok())
        .ok_or_else(|| Refusal::new("a whole number from 0 to 65535", field))
}

/// Whether the brightness rose.
pub(super) fn polarity(field: &[u8]) -> Result<bool, Refusal> {
    match field {
        b"1" | b"+1" => return Ok(true),
        b"0" | b"-1" => return Ok(false),
        _ => {}
    }
    match whole(field) {
        Some(1) => Ok(true),
        Some(0 | -1) => Ok(false),
        _ if field.eq_ignore_ascii_case(b"true") => Ok(true),
        _ if field.eq_ignore_ascii_case(b"false") => Ok(false),
        _ => Err(Refusal::new("0, 1, -1 or +1", field)),
    }
}
