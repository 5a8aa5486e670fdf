//! Counts of workgroups above the limit of one dimension are folded into two; the shader unfolds them and guards the
//! tail.

/// Most workgroups that one dimension of a dispatch may have: WebGPU's default limit.
pub const WORKGROUPS_PER_DIMENSION: u32 = 65_535;

/// Least two-dimensional grid of workgroups with at least `workgroups` of them, as square as the fold demands.
#[must_use]
pub fn fold(workgroups: u32) -> [u32; 2] {
    let rows = workgroups.div_ceil(WORKGROUPS_PER_DIMENSION).max(1);
    [workgroups.div_ceil(rows), rows]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn folding_covers_every_workgroup_and_stays_within_the_limit() {
        for workgroups in [1, 2, 65_534, 65_535, 65_536, 131_070, 131_071, 1 << 24, u32::MAX >> 1] {
            let [x, y] = fold(workgroups);
            assert!(x <= WORKGROUPS_PER_DIMENSION, "{workgroups}");
            assert!(u64::from(x) * u64::from(y) >= u64::from(workgroups), "{workgroups}");
            assert!(u64::from(x) * u64::from(y) < u64::from(workgroups) + u64::from(y), "{workgroups}: no wasted row");
        }
        assert_eq!(fold(65_535), [65_535, 1]);
    }
}
