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

/// A decimal number as it is written: a sign or none, digits, a point and more digits or none. No exponent.
#[derive(Clone, Copy)]
pub(super) struct Number<'a> {
    negative: bool,
    integer: &'a [u8],
    /// The digits after the point, where there is one.
    fraction: Option<&'a [u8]>,
}

impl<'a> Number<'a> {
    /// The number that `field` is; `None`: it is something else.
    pub(super) fn parse(field: &'a [u8]) -> Option<Self> {
        let (negative, digits) = match field {
            [b'-', rest @ ..] => (true, rest),
            [b'+', rest @ ..] => (false, rest),
            _ => (false, field),
        };
        let point = digits.iter().position(|&b| b == b'.');
        let integer = &digits[..point.unwrap_or(digits.len())];
        let fraction = point.map(|point| &digits[point + 1..]);
        let digits_only = |digits: &[u8]| digits.iter().all(u8::is_ascii_digit);
        let sound = !integer.is_empty() && digits_only(integer) && fraction.is_none_or(digits_only);
        sound.then_some(Self { negative, integer, fraction })
    }

    pub(super) fn has_point(self) -> bool {
        self.fraction.is_some()
    }

    /// Digits after the point.
    pub(super) fn decimals(self) -> usize {
        self.fraction.unwrap_or_default().len()
    }

    /// Whether the digits after the point are zeros.
    pub(super) fn is_whole(self) -> bool {
        self.fraction.unwrap_or_default().iter().all(|&b| b == b'0')
    }

    pub(super) fn is_zero(self) -> bool {
        self.is_whole() && self.integer.iter().all(|&b| b == b'0')
    }

    /// The number times 10^`power`, rounded to the nearest integer, halves away from zero; `None` beyond 128 bits.
    pub(super) fn scaled(self, power: i32) -> Option<i128> {
        let fraction = self.fraction.unwrap_or_default();
        let digit = |index: usize| {
            self.integer.get(index).or_else(|| fraction.get(index - self.integer.len())).copied()
        };
        // The digits before this one are kept, this one rounds.
        let end = self.integer.len() as i64 + i64::from(power);
        let kept = end.max(0) as usize;
        let digits = (0..kept).map(|index| digit(index).unwrap_or(b'0') - b'0');
        // So many digits fit in 64 bits, which are faster.
        let mut value = if kept <= 18 {
            digits.fold(0_u64, |value, digit| value * 10 + u64::from(digit)).into()
        } else {
            digits
                .into_iter()
                .try_fold(0_i128, |value, digit| value.checked_mul(10)?.checked_add(digit.into()))?
        };
        let rounds_up = usize::try_from(end).ok().and_then(digit).is_some_and(|digit| digit >= b'5');
        value = value.checked_add(i128::from(rounds_up))?;
        Some(if self.negative { -value } else { value })
    }

    /// The number where it is whole.
    fn whole(self) -> Option<i128> {
        self.scaled(0).filter(|_| self.is_whole())
    }
}

/// A column or row.
pub(super) fn coordinate(field: &[u8]) -> Result<u16, Refusal> {
    Number::parse(field)
        .and_then(Number::whole)
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
    match Number::parse(field).and_then(Number::whole) {
        Some(1) => Ok(true),
        Some(0 | -1) => Ok(false),
        _ if field.eq_ignore_ascii_case(b"true") => Ok(true),
        _ if field.eq_ignore_ascii_case(b"false") => Ok(false),
        _ => Err(Refusal::new("0, 1, -1 or +1", field)),
    }
}

#[cfg(test)]
mod tests {
    use super::Number;

    fn scaled(text: &str, power: i32) -> Option<i128> {
        Number::parse(text.as_bytes()).and_then(|number| number.scaled(power))
    }

    #[test]
    fn digits_beyond_microseconds_round_to_the_nearest_and_halves_away_from_zero() {
        for (text, power, expected) in [
            ("0.003811000", 6, 3811),
            ("0.0038114999999999", 6, 3811),
            ("0.0038115", 6, 3812),
            ("-0.0038115", 6, -3812),
            ("12", 6, 12_000_000),
            ("1.5", 3, 1500),
            ("1499", -3, 1),
            ("1500.0", -3, 2),
            ("499", -3, 0),
            ("500", -3, 1),
            ("49", -3, 0),
            ("-500", -3, -1),
            ("1468940293.922985", 6, 1_468_940_293_922_985),
        ] {
            assert_eq!(scaled(text, power), Some(expected), "{text}");
        }
        assert_eq!(scaled(&"9".repeat(50), 0), None);
        for wrong in ["", "-", ".5", "1e3", "1.2.3", "0x1", "1,5", "+-1"] {
            assert!(Number::parse(wrong.as_bytes()).is_none(), "{wrong}");
        }
    }
}
