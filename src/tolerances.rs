//! Every numerical tolerance of the engine, each with its derivation. No other file holds a bare tolerance.

/// Stands for "no distance yet" in f32 kernels [m]: above any distance in a scene, and its square is still finite.
pub const GPU_FAR_AWAY: f32 = 1e18;

/// Least divisor in f32 kernels: a hundred times the least normal number (1.2e-38), below which a device may flush to
/// zero. Squared edge lengths stay above it down to 1e-18 m.
pub const GPU_LEAST_DIVISOR: f32 = 1e-36;
/// Smallest height of a triangle over its longest edge, and of a closed surface's volume over its area times its extent
/// [1]. Coordinates in single precision, as STL files and the GPU hold them, round at 6e-8 of their size: below this
/// bound the triangle's normal would be uncertain by more than about 6 %, and its side a matter of luck.
pub const MIN_TRIANGLE_ASPECT: f64 = 1e-6;

/// Smallest accepted reciprocal condition number of K [1]. K (C f) equals f to about machine precision over this number,
/// and the equilibria that are stored promise 1e-6.
pub const MIN_RECIPROCAL_CONDITION: f64 = f64::EPSILON / 1e-6;

/// Shift, relative to the norm of K, under which the free motion of a singular K is sought [1]: the square root of
/// machine precision is far above the rounding of a factorisation and far below the stiffness of any spring that counts.
pub const MECHANISM_SHIFT: f64 = 1.5e-8;
