//! The few Python literals that a header is made of, one token at a time.

use crate::bytes::Bytes;
use crate::error::IoError;

/// A position in the text of the header.
///
/// There is no recursion: the header's grammar is fixed, so the text cannot nest the parser deeper.
pub(super) struct Scanner<'a> {
    file: Bytes<'a>,
    text: &'a [u8],
    /// Byte of the file at which `text` starts.
    start: usize,
    at: usize,
}

impl<'a> Scanner<'a> {
    /// The text of `length` bytes at byte `start` of the file.
    pub(super) fn new(file: Bytes<'a>, start: usize, length: usize) -> Result<Self, IoError> {
        Ok(Self { file, text: file.get("header", start, length)?, start, at: 0 })
    }

    /// The next byte that is not a space, without taking it.
    pub(super) fn peek(&mut self) -> Option<u8> {
        while self.text.get(self.at).is_some_and(u8::is_ascii_whitespace) {
            self.at += 1;
        }
        self.text.get(self.at).copied()
    }

    /// Takes the byte if it comes next.
    pub(super) fn eat(&mut self, byte: u8) -> bool {
        let comes = self.peek() == Some(byte);
        self.at += usize::from(comes);
        comes
    }

    pub(super) fn expect(&mut self, byte: u8) -> Result<(), IoError> {
        if self.eat(byte) { Ok(()) } else { Err(self.error(&format!("`{}`", byte.escape_ascii()))) }
    }

    /// A string in quotes of either kind. Escapes are refused: no name of a field needs one.
    pub(super) fn string(&mut self) -> Result<&'a [u8], IoError> {
        let Some(quote @ (b'\'' | b'"')) = self.peek() else {
            return Err(self.error("a string"));
        };
        let tail = &self.text[self.at + 1..];
        let length = tail.iter().position(|&b| b == quote || b == b'\\');
        match length {
            Some(length) if tail[length] == quote => {
                self.at += length + 2;
                Ok(&tail[..length])
            }
            _ => Err(self.error("a string with an end and without escapes")),
        }
    }

    /// An integer that is not negative.
    pub(super) fn number(&mut self) -> Result<u64, IoError> {
        self.peek();
        let tail = &self.text[self.at..];
        let length = tail.iter().take_while(|b| b.is_ascii_digit()).count();
        let parsed = std::str::from_utf8(&tail[..length]).ok().and_then(|digits| digits.parse().ok());
        let number = parsed.ok_or_else(|| self.error("an integer from 0 to 2^64 - 1"))?;
        self.at += length;
        Ok(number)
    }

    /// A name such as `True`.
    pub(super) fn word(&mut self) -> &'a [u8] {
        self.peek();
        let tail = &self.text[self.at..];
        let length = tail.iter().take_while(|b| b.is_ascii_alphanumeric()).count();
        self.at += length;
        &tail[..length]
    }

    /// What stands here is not `expected`.
    pub(super) fn error(&self, expected: &str) -> IoError {
        let tail = &self.text[self.at.min(self.text.len())..];
        let actual = match &tail[..tail.len().min(24)] {
            [] => "the end of the header".to_owned(),
            some => format!("`{}`", some.escape_ascii()),
        };
        self.file.malformed("header", self.start + self.at, expected, actual)
    }
}
