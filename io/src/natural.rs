//! Natural order of names: runs of digits count as numbers, so that `img2` comes before `img10`.

use std::cmp::Ordering;

/// Compares two names: digit runs by value, all else byte by byte; names that are equal so far (`img1`, `img01`)
/// byte by byte as a whole. A total order; O(length), numbers of any length.
pub(crate) fn compare(a: &[u8], b: &[u8]) -> Ordering {
    let (mut x, mut y) = (a, b);
    loop {
        let order = match (x.first(), y.first()) {
            (Some(i), Some(j)) if i.is_ascii_digit() && j.is_ascii_digit() => {
                let (m, n) = (number(&mut x), number(&mut y));
                m.len().cmp(&n.len()).then_with(|| m.cmp(n))
            }
            (Some(i), Some(j)) => {
                let order = i.cmp(j);
                (x, y) = (&x[1..], &y[1..]);
                order
            }
            (None, None) => return a.cmp(b),
            (i, j) => i.cmp(&j),
        };
        if order.is_ne() {
            return order;
        }
    }
}

/// Takes the digits that `text` starts with; without leading zeros.
fn number<'a>(text: &mut &'a [u8]) -> &'a [u8] {
    let length = text.iter().position(|b| !b.is_ascii_digit()).unwrap_or(text.len());
    let (digits, rest) = text.split_at(length);
    *text = rest;
    let zeros = digits.iter().position(|&b| b != b'0').unwrap_or(length);
    &digits[zeros..]
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::compare;

    #[test]
    fn numbers_in_names_count_by_value() {
        let sorted =
            ["a", "img", "img1", "img2", "img02b", "img10", "img010", "img11a9", "img11a10", "imh", "z1.5"];
        let mut names = sorted;
        names.reverse();
        names.sort_by(|a, b| compare(a.as_bytes(), b.as_bytes()));
        // `img010` and `img10` are the same number: then the bytes decide.
        let expected =
            ["a", "img", "img1", "img2", "img02b", "img010", "img10", "img11a9", "img11a10", "imh", "z1.5"];
        assert_eq!(names, expected);
    }

    #[test]
    fn numbers_beyond_64_bits_are_compared_too() {
        assert!(compare(b"99999999999999999999998", b"99999999999999999999999").is_lt());
        assert!(compare(b"99999999999999999999999", b"100000000000000000000000").is_lt());
    }

    proptest! {
        #[test]
        fn the_order_is_total(a in "[a-c0-2.]{0,6}", b in "[a-c0-2.]{0,6}", c in "[a-c0-2.]{0,6}") {
            let order = |x: &str, y: &str| compare(x.as_bytes(), y.as_bytes());
            prop_assert_eq!(order(&a, &b), order(&b, &a).reverse());
            prop_assert_eq!(order(&a, &b).is_eq(), a == b);
            if order(&a, &b).is_le() && order(&b, &c).is_le() {
                prop_assert!(order(&a, &c).is_le());
            }
        }
    }
}
