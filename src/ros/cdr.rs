//! CDR, the encoding of ROS 2 messages: numbers are aligned to their size, counted from the fifth byte; the first four
//! say in which byte order they are. A string is its length with the final zero, then its bytes; a sequence is its
//! length, then its elements.

/// Representation identifiers of plain CDR.
const LITTLE_ENDIAN: [u8; 4] = [0, 1, 0, 0];
const BIG_ENDIAN: [u8; 2] = [0, 0];

/// How a message begins that was compressed by zstd.
const ZSTD: [u8; 2] = [0x28, 0xb5];

/// Bytes before the body, from which alignment is counted.
const HEADER: usize = 4;

/// Writes a message, little-endian.
#[derive(Debug)]
pub(super) struct Encoder(Vec<u8>);

impl Encoder {
    pub fn new() -> Self {
        Self(LITTLE_ENDIAN.to_vec())
    }

    fn align(&mut self, size: usize) {
        while !(self.0.len() - HEADER).is_multiple_of(size) {
            self.0.push(0);
        }
    }

    pub fn u32(&mut self, value: u32) {
        self.align(4);
        self.0.extend(value.to_le_bytes());
    }

    pub fn u8(&mut self, value: u8) {
        self.0.push(value);
    }

    pub fn f32(&mut self, value: f32) {
        self.align(4);
        self.0.extend(value.to_le_bytes());
    }

    pub fn f64(&mut self, value: f64) {
        self.align(8);
        self.0.extend(value.to_le_bytes());
    }

    pub fn string(&mut self, text: &str) {
        self.u32(text.len() as u32 + 1);
        self.0.extend(text.as_bytes());
        self.0.push(0);
    }

    pub fn f64s(&mut self, values: &[f64]) {
        self.u32(values.len() as u32);
        values.iter().for_each(|value| self.f64(*value));
    }

    pub fn finish(self) -> Vec<u8> {
        self.0
    }
}

/// Reads a message. Lengths are compared with what is there before anything is allocated.
#[derive(Debug)]
pub(super) struct Decoder<'a> {
    body: &'a [u8],
    at: usize,
    big_endian: bool,
}

impl<'a> Decoder<'a> {
    pub fn new(message: &'a [u8]) -> Result<Self, String> {
        let (header, body) = message.split_at_checked(HEADER).ok_or("shorter than its header")?;
        match [header[0], header[1]] {
            order if order == BIG_ENDIAN => Ok(Self { body, at: 0, big_endian: true }),
            order if order == LITTLE_ENDIAN[..2] => Ok(Self { body, at: 0, big_endian: false }),
            ZSTD => {
                Err("it is compressed by zstd by itself: write messages without compression by `ros2 bag convert`"
                    .into())
            }
            other => Err(format!("encoding {other:?} is not plain CDR")),
        }
    }

    fn take(&mut self, count: usize) -> Result<&'a [u8], String> {
        let taken = self.body.get(self.at..).and_then(|rest| rest.get(..count)).ok_or("it ends too early")?;
        self.at += count;
        Ok(taken)
    }

    fn number<const SIZE: usize>(&mut self) -> Result<[u8; SIZE], String> {
        self.at = self.at.next_multiple_of(SIZE);
        let mut bytes = [0; SIZE];
        bytes.copy_from_slice(self.take(SIZE)?);
        if self.big_endian {
            bytes.reverse();
        }
        Ok(bytes)
    }

    pub fn u32(&mut self) -> Result<u32, String> {
        self.number().map(u32::from_le_bytes)
    }

    pub fn string(&mut self) -> Result<String, String> {
        let length = self.u32()? as usize;
        let bytes = self.take(length)?;
        let text = bytes.strip_suffix(&[0]).unwrap_or(bytes);
        String::from_utf8(text.to_vec()).map_err(|_| "a name is not text".into())
    }

    /// A sequence of at most `most` strings.
    pub fn strings(&mut self, most: usize) -> Result<Vec<String>, String> {
        let count = self.u32()?;
        if count as usize > most {
            return Err(format!("it names {count} joints, more than {most}"));
        }
        // Each takes four bytes at least.
        if count as usize > self.body.len() / 4 {
            return Err("it ends too early".into());
        }
        (0..count).map(|_| self.string()).collect()
    }

    pub fn f64s(&mut self) -> Result<Vec<f64>, String> {
        let count = self.u32()?;
        if count as usize > self.body.len() / 8 {
            return Err("it ends too early".into());
        }
        (0..count).map(|_| self.number().map(f64::from_le_bytes)).collect()
    }
}
