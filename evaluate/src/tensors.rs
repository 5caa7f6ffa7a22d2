//! Tensors of streams in a safetensors file, read with their types and shapes checked.

use safetensors::tensor::{Dtype, SafeTensors};

use crate::error::StreamsError;

/// A value of `list` that is not as `expected`.
pub(crate) fn value(list: &str, index: usize, expected: String, found: String) -> StreamsError {
    StreamsError::Value { list: list.to_owned(), index, expected, found }
}

/// Bounds of streams among `count` events or times.
pub(crate) fn bounds(start: &[i64], count: usize) -> Result<Vec<usize>, StreamsError> {
    let mut bounds = Vec::with_capacity(start.len());
    let mut least = 0;
    for (i, &at) in start.iter().enumerate() {
        let most = if i == 0 { 0 } else { count };
        let least_here = if i + 1 == start.len() { count } else { least };
        match usize::try_from(at) {
            Ok(at) if (least_here..=most).contains(&at) => {
                bounds.push(at);
                least = at;
            }
            _ => return Err(value("start", i, format!("{least_here} to {most}"), at.to_string())),
        }
    }
    Ok(bounds)
}

/// The values of a vector of I64, `count` of them where that is known.
pub(crate) fn integers(
    file: &SafeTensors<'_>,
    name: &str,
    count: Option<usize>,
) -> Result<Vec<i64>, StreamsError> {
    let expected = || match count {
        Some(count) => format!("I64 ({count})"),
        None => "I64 (any number)".to_owned(),
    };
    let wrong = |found: String| StreamsError::Tensor { tensor: name.to_owned(), expected: expected(), found };
    let view = file.tensor(name).map_err(|_| wrong("nothing".to_owned()))?;
    let fits = view.shape().len() == 1 && count.is_none_or(|count| view.shape() == [count]);
    if view.dtype() != Dtype::I64 || !fits {
        return Err(wrong(format!("{:?} {:?}", view.dtype(), view.shape())));
    }
    let value = |bytes: &[u8]| bytes.iter().rev().fold(0, |value, &byte| value << 8 | i64::from(byte));
    Ok(view.data().chunks_exact(8).map(value).collect())
}
