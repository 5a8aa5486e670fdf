//! Mutations of bytes and of text.

/// SplitMix64 (Steele et al. 2014).
pub struct Random(u64);

impl Random {
    pub fn new(seed: u64) -> Self {
        Self(seed)
    }

    pub fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// Less than `end`; 0 if that is 0.
    pub fn below(&mut self, end: usize) -> usize {
        (self.next() % end.max(1) as u64) as usize
    }

    fn of<'a, T>(&mut self, choices: &'a [T]) -> &'a T {
        &choices[self.below(choices.len())]
    }

    /// A range of `length` elements, mostly short.
    fn range(&mut self, length: usize) -> std::ops::Range<usize> {
        let start = self.below(length + 1);
        let most = if self.below(8) == 0 { length } else { length.min(24) };
        start..(start + self.below(most + 1)).min(length)
    }
}

/// Numbers that programs trip over.
const NUMBERS: [&str; 36] = [
    "0",
    "1",
    "-1",
    "2",
    "3",
    "7",
    "10",
    "255",
    "256",
    "-0.0",
    "0.5",
    "1e-3",
    "1e-12",
    "1e-30",
    "1e-320",
    "5e-324",
    "1e3",
    "1e6",
    "1e9",
    "1e15",
    "1e30",
    "1e300",
    "1e308",
    "-1e308",
    "1e999",
    "nan",
    "inf",
    "-inf",
    "65535",
    "2147483647",
    "4294967295",
    "4294967296",
    "9223372036854775807",
    "18446744073709551615",
    "99999999999999999999",
    "",
];

/// The same as bits.
const BITS: [u64; 12] = [
    0,
    1,
    u64::MAX,
    0x7ff0_0000_0000_0000,
    0x7ff8_0000_0000_0000,
    0x8000_0000_0000_0000,
    0x7fef_ffff_ffff_ffff,
    0x3ff0_0000_0000_0000,
    0x7f80_0000_7fc0_0000,
    0xffff_ffff,
    0x0010_0000_0000_0000,
    0x3f80_0000_3f80_0000,
];

/// Some mutations of `input`; `other` lends parts.
pub fn text(random: &mut Random, input: &[u8], other: &[u8]) -> Vec<u8> {
    several(random, input, other, |random| random.below(9))
}

/// The same for numbers that are not text.
pub fn binary(random: &mut Random, input: &[u8], other: &[u8]) -> Vec<u8> {
    several(random, input, other, |random| *random.of(&[0, 1, 2, 3, 8, 9, 9, 9]))
}

fn several(random: &mut Random, input: &[u8], other: &[u8], choose: impl Fn(&mut Random) -> usize) -> Vec<u8> {
    let mut bytes = input.to_vec();
    let count = 1 + random.below(2) * random.below(6);
    for _ in 0..count {
        let operation = choose(random);
        once(random, &mut bytes, other, operation);
    }
    bytes
}

fn once(random: &mut Random, bytes: &mut Vec<u8>, other: &[u8], operation: usize) {
    let length = bytes.len();
    match operation {
        0 if length > 0 => bytes[random.below(length)] ^= 1 << random.below(8),
        1 if length > 0 => bytes[random.below(length)] = *random.of(b"\0\n\r\t \"#%+,-./09:=AEe[]{}\x7f\x80\xff"),
        2 => drop(bytes.drain(random.range(length))),
        3 => {
            let copy = bytes[random.range(length)].to_vec();
            insert(random, bytes, &copy);
        }
        4 | 5 => {
            let number = *random.of(&NUMBERS);
            replace_word(random, bytes, |byte| byte.is_ascii_digit() || b"+-.".contains(byte), number.as_bytes());
        }
        6 => {
            let words: Vec<&[u8]> = other
                .split(|byte| !byte.is_ascii_alphanumeric() && *byte != b'_')
                .filter(|word| !word.is_empty())
                .collect();
            if !words.is_empty() {
                let word = random.of(&words).to_vec();
                replace_word(random, bytes, |byte| byte.is_ascii_alphanumeric() || *byte == b'_', &word);
            }
        }
        7 => {
            let mut lines: Vec<&[u8]> = bytes.split_inclusive(|byte| *byte == b'\n').collect();
            let (from, to) = (random.below(lines.len()), random.below(lines.len()));
            match random.below(3) {
                _ if lines.is_empty() => (),
                0 => drop(lines.remove(from)),
                1 => lines.insert(to, lines[from]),
                _ => lines.swap(from, to),
            }
            *bytes = lines.concat();
        }
        8 => {
            let part = other[random.range(other.len())].to_vec();
            insert(random, bytes, &part);
        }
        _ if length >= 8 => {
            let at = random.below(length / 4 - 1) * 4;
            let width = *random.of(&[1, 4, 8]);
            bytes[at..at + width].copy_from_slice(&random.of(&BITS).to_le_bytes()[..width]);
        }
        _ => (),
    }
}

fn insert(random: &mut Random, bytes: &mut Vec<u8>, part: &[u8]) {
    let at = random.below(bytes.len() + 1);
    bytes.splice(at..at, part.iter().copied());
}

/// Replaces a word of such characters as `belongs` by `word`.
fn replace_word(random: &mut Random, bytes: &mut Vec<u8>, belongs: impl Fn(&u8) -> bool, word: &[u8]) {
    let from = random.below(bytes.len() + 1);
    let Some(start) = bytes[from..].iter().position(&belongs).map(|start| from + start) else { return };
    let end = bytes[start..].iter().position(|byte| !belongs(byte)).map_or(bytes.len(), |end| start + end);
    bytes.splice(start..end, word.iter().copied());
}
