//! Numbers that look random, the same in every run.

use glam::DVec3;

/// A linear congruential generator, of which the upper 53 bits count (Knuth 1998, The Art of Computer Programming,
/// volume 2, section 3.3.4).
#[derive(Clone, Debug)]
pub struct Random(u64);

impl Random {
    /// Starts at `seed`.
    #[must_use]
    pub fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// Uniform in `[low, high)`.
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        low + (high - low) * (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Zero mean, unit variance, nearly normal: a sum of twelve uniform numbers.
    pub fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.between(-0.5, 0.5)).sum()
    }

    /// Uniform in the cube from -1 to 1.
    pub fn vector(&mut self) -> DVec3 {
        DVec3::new(self.between(-1.0, 1.0), self.between(-1.0, 1.0), self.between(-1.0, 1.0))
    }

    /// `count` of these from `seed`.
    #[must_use]
    pub fn vectors(count: usize, seed: u64) -> Vec<DVec3> {
        let mut random = Self::new(seed);
        (0..count).map(|_| random.vector()).collect()
    }
}

/// A number in `[-1, 1)` that looks random and follows from `number` alone: a permuted congruential generator (O'Neill
/// 2014), in integers that shaders have, too.
#[must_use]
pub fn scattered(number: u32) -> f64 {
    let state = number.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
    let word = ((state >> ((state >> 28) + 4)) ^ state).wrapping_mul(277_803_737);
    f64::from((word >> 22) ^ word) / 2_147_483_648.0 - 1.0
}

/// SplitMix64's finalizer (Steele, Lea and Flood, 2014).
#[must_use]
pub fn mix(value: u64) -> u64 {
    let mut z = value.wrapping_add(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// Numbers in `[-1, 1)`.
#[cfg(test)]
pub(crate) fn sequence(seed: u64) -> impl FnMut() -> f64 {
    let mut random = Random::new(seed);
    move || random.between(-1.0, 1.0)
}
