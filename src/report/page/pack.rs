//! Arrays within a page: all in one block of bytes, deflated (RFC 1950) and in base64, each found by its type, place and
//! length.

use crate::Error;
use base64::{Engine, prelude::BASE64_STANDARD};
use bytemuck::NoUninit;
use flate2::{Compression, write::ZlibEncoder};
use serde::Serialize;
use std::io::Write;

/// Bytes to whose multiples arrays are moved: the size of the largest element.
const ALIGNMENT: usize = 4;

/// A number that a page holds, by the name that its script has for the type.
pub trait Element: NoUninit {
    /// The name.
    const NAME: &str;
}

impl Element for f32 {
    const NAME: &str = "f32";
}
impl Element for i16 {
    const NAME: &str = "i16";
}
impl Element for u32 {
    const NAME: &str = "u32";
}
impl Element for u8 {
    const NAME: &str = "u8";
}

/// Where an array lies in the block.
#[derive(Serialize)]
pub struct Span {
    #[serde(rename = "type")]
    element: &'static str,
    /// First byte.
    at: usize,
    /// Number of elements.
    length: usize,
}

/// The block.
#[derive(Default)]
pub struct Pack(Vec<u8>);

impl Pack {
    /// Appends `values`, and returns where they lie.
    pub fn put<T: Element>(&mut self, values: &[T]) -> Span {
        self.0.resize(self.0.len().next_multiple_of(ALIGNMENT), 0);
        let span = Span { element: T::NAME, at: self.0.len(), length: values.len() };
        self.0.extend(bytemuck::cast_slice::<T, u8>(values));
        span
    }

    /// Appends `values` in single precision, and returns where they lie.
    pub fn put_f32(&mut self, values: impl IntoIterator<Item = f64>) -> Span {
        self.put(&values.into_iter().map(|value| value as f32).collect::<Vec<_>>())
    }

    /// Returns the block as text.
    ///
    /// # Errors
    /// When memory ends.
    pub fn finish(self) -> Result<String, Error> {
        let mut encoder = ZlibEncoder::new(Vec::new(), Compression::best());
        let deflated = encoder.write_all(&self.0).and_then(|()| encoder.finish());
        Ok(BASE64_STANDARD.encode(deflated.map_err(|error| crate::error!("the page cannot be packed: {error}"))?))
    }
}
