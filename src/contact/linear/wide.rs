//! The same work in the widest registers that the processor has.
//!
//! Products and sums are not fused, and nothing is summed in another order for the width: results are the same on all
//! machines.

/// Work that loops over numbers side by side. Its `run`, and what that calls, is to be `#[inline(always)]`: only so is
/// it compiled again for each width.
pub trait Kernel {
    /// Type of the result.
    type Output;

    /// Does the work.
    fn run(self) -> Self::Output;
}

/// Runs `kernel`.
#[inline]
pub fn widest<K: Kernel>(kernel: K) -> K::Output {
    #[cfg(target_arch = "x86_64")]
    {
        if is_x86_feature_detected!("avx512f") {
            // SAFETY: the processor has what the function is compiled for.
            return unsafe { run_avx512(kernel) };
        }
        if is_x86_feature_detected!("avx2") {
            // SAFETY: the processor has what the function is compiled for.
            return unsafe { run_avx2(kernel) };
        }
    }
    kernel.run()
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f")]
fn run_avx512<K: Kernel>(kernel: K) -> K::Output {
    kernel.run()
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn run_avx2<K: Kernel>(kernel: K) -> K::Output {
    kernel.run()
}
