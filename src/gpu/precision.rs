//! The numbers that a stage computes in: f64 where the device has it, or f32.

/// Numbers of a device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Precision {
    /// f32.
    Single,
    /// f64.
    Double,
}

impl Precision {
    /// Bytes of a number (B).
    #[must_use]
    pub const fn size(self) -> usize {
        match self {
            Self::Single => size_of::<f32>(),
            Self::Double => size_of::<f64>(),
        }
    }

    /// The one of the two, of which the second is for f64, that computes in it.
    #[must_use]
    pub const fn of<T>(self, both: &[T; 2]) -> &T {
        &both[self as usize]
    }

    /// The bytes of `numbers`; in f32 each is rounded.
    #[must_use]
    pub fn encode(self, numbers: &[f64]) -> Vec<u8> {
        match self {
            Self::Single => numbers.iter().flat_map(|&number| (number as f32).to_ne_bytes()).collect(),
            Self::Double => bytemuck::cast_slice(numbers).to_vec(),
        }
    }

    /// The numbers that `bytes` are.
    #[must_use]
    pub fn decode(self, bytes: &[u8]) -> Vec<f64> {
        match self {
            Self::Single => bytemuck::pod_collect_to_vec::<u8, f32>(bytes).into_iter().map(f64::from).collect(),
            Self::Double => bytemuck::pod_collect_to_vec(bytes),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_come_back_rounded_to_their_precision() {
        let numbers = [0.1, -1e30, 0.0, 3.0];
        assert_eq!(Precision::Double.decode(&Precision::Double.encode(&numbers)), numbers);
        let single = Precision::Single.encode(&numbers);
        assert_eq!(single.len(), numbers.len() * Precision::Single.size());
        assert_eq!(Precision::Single.decode(&single), numbers.map(|number| f64::from(number as f32)));
    }
}
