//! Words and numbers of a mesh file, one after the other, as text or as bytes.

use std::borrow::Cow;
use std::fmt::Display;
use std::str::FromStr;

/// How numbers are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Encoding {
    /// In digits, between white space.
    Text,
    /// In bytes, the least significant one first.
    Little,
    /// In bytes, the most significant one first.
    Big,
}

/// Types of numbers in bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum NumberType {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    I64,
    U64,
    F32,
    F64,
}

impl NumberType {
    /// Bytes of a number.
    pub fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::I64 | Self::U64 | Self::F64 => 8,
        }
    }
}

/// A place in a file, from which words and numbers are taken.
pub(super) struct Numbers<'a> {
    pub bytes: &'a [u8],
    /// Where the next one begins.
    pub at: usize,
    pub encoding: Encoding,
    /// Whether `#` begins a remark, which ends with the line.
    has_remarks: bool,
    /// Where the record ends from which words are taken.
    end: usize,
}

impl<'a> Numbers<'a> {
    /// A text, behind its byte-order mark if it has one.
    pub fn text(bytes: &'a [u8]) -> Self {
        let mark = b"\xef\xbb\xbf";
        let at = if bytes.starts_with(mark) { mark.len() } else { 0 };
        Self { bytes, at, encoding: Encoding::Text, has_remarks: false, end: bytes.len() }
    }

    /// A text in which `#` begins a remark, which ends with the line.
    pub fn text_with_remarks(bytes: &'a [u8]) -> Self {
        Self { has_remarks: true, ..Self::text(bytes) }
    }

    /// Bytes alone.
    pub fn binary(bytes: &'a [u8], encoding: Encoding) -> Self {
        Self { encoding, at: 0, ..Self::text(bytes) }
    }

    /// An error at this place.
    pub fn error(&self, what: impl Display) -> String {
        match self.encoding {
            Encoding::Text => {
                let line =
                    1 + self.bytes[..self.at.min(self.bytes.len())].iter().filter(|byte| **byte == b'\n').count();
                format!("line {line}: {what}")
            }
            Encoding::Little | Encoding::Big => format!("byte {}: {what}", self.at),
        }
    }

    /// The next word of a text.
    pub fn word(&mut self) -> Option<Cow<'a, str>> {
        loop {
            let rest = &self.bytes[self.at..self.end];
            self.at += rest.iter().position(|byte| !byte.is_ascii_whitespace()).unwrap_or(rest.len());
            if !self.has_remarks || self.at == self.end || self.bytes[self.at] != b'#' {
                break;
            }
            self.line();
        }
        let rest = &self.bytes[self.at..self.end];
        let length = rest.iter().position(u8::is_ascii_whitespace).unwrap_or(rest.len());
        self.at += length;
        (length > 0).then(|| String::from_utf8_lossy(&rest[..length]))
    }

    /// The rest of the line.
    pub fn line(&mut self) -> Cow<'a, str> {
        let rest = &self.bytes[self.at..self.end];
        let length = rest.iter().position(|byte| *byte == b'\n').map_or(rest.len(), |end| end + 1);
        self.at += length;
        String::from_utf8_lossy(rest[..length].trim_ascii())
    }

    /// Begins a record, which in a text is a line that is not empty.
    pub fn begin_record(&mut self) {
        if self.encoding == Encoding::Text {
            let rest = &self.bytes[self.at..];
            self.at += rest.iter().position(|byte| !byte.is_ascii_whitespace()).unwrap_or(rest.len());
            let rest = &self.bytes[self.at..];
            self.end = self.at + rest.iter().position(|byte| *byte == b'\n').unwrap_or(rest.len());
        }
    }

    /// Ends a record; whether words of it are left.
    pub fn end_record(&mut self) -> bool {
        let is_left = self.encoding == Encoding::Text && !self.bytes[self.at..self.end].trim_ascii().is_empty();
        if self.encoding == Encoding::Text {
            self.at = self.end;
        }
        self.end = self.bytes.len();
        is_left
    }

    /// The next word of a text, as a number.
    pub fn parse<T: FromStr>(&mut self) -> Result<T, String> {
        match self.word() {
            None if self.end < self.bytes.len() => Err(self.error("the line ends where a number belongs")),
            None => Err(self.error("the file ends where a number belongs: it was cut off; export the mesh again")),
            Some(word) => word.parse().map_err(|_| self.error("such a number as belongs here is expected")),
        }
    }

    /// The next number, in text or of type `of`.
    pub fn real(&mut self, of: NumberType) -> Result<f64, String> {
        use NumberType as T;
        if self.encoding == Encoding::Text {
            return self.parse();
        }
        Ok(match of {
            T::F32 => f64::from(f32::from_bits(self.raw(of)? as u32)),
            T::F64 => f64::from_bits(self.raw(of)?),
            T::U64 => self.raw(of)? as f64,
            T::I8 | T::U8 | T::I16 | T::U16 | T::I32 | T::U32 | T::I64 => self.integer(of)? as f64,
        })
    }

    /// The next whole number, in text or of type `of`; one beyond 63 bits is refused.
    pub fn integer(&mut self, of: NumberType) -> Result<i64, String> {
        use NumberType as T;
        if self.encoding == Encoding::Text {
            return self.parse();
        }
        let raw = self.raw(of)?;
        Ok(match of {
            T::I8 => i64::from(raw as u8 as i8),
            T::I16 => i64::from(raw as u16 as i16),
            T::I32 => i64::from(raw as u32 as i32),
            T::U8 | T::U16 | T::U32 => raw as i64,
            T::I64 => raw.cast_signed(),
            T::U64 => {
                i64::try_from(raw).map_err(|_| self.error("a whole number is too large: export the mesh again"))?
            }
            T::F32 | T::F64 => return Err(self.error("a whole number belongs here: export the mesh again")),
        })
    }

    /// Bytes of a number, in the lowest places.
    fn raw(&mut self, of: NumberType) -> Result<u64, String> {
        let bytes = self.take(of.size())?;
        let join = |number: u64, byte: &u8| number << 8 | u64::from(*byte);
        Ok(if self.encoding == Encoding::Big { bytes.iter().fold(0, join) } else { bytes.iter().rev().fold(0, join) })
    }

    /// The next `count` bytes.
    pub fn take(&mut self, count: usize) -> Result<&'a [u8], String> {
        let end = self.at.checked_add(count).filter(|end| *end <= self.bytes.len());
        let end = end.ok_or_else(|| self.error("the file ends too early: it was cut off; export the mesh again"))?;
        let bytes = &self.bytes[self.at..end];
        self.at = end;
        Ok(bytes)
    }
}
