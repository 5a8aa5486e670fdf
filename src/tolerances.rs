//! Every numerical tolerance of the engine, each with its derivation. No other file holds a bare tolerance.

/// Stands for "no distance yet" in f32 kernels [m]: above any distance in a scene, and its square is still finite.
pub const GPU_FAR_AWAY: f32 = 1e18;

/// Least divisor in f32 kernels: a hundred times the least normal number (1.2e-38), below which a device may flush to
/// zero. Squared edge lengths stay above it down to 1e-18 m.
pub const GPU_LEAST_DIVISOR: f32 = 1e-36;
