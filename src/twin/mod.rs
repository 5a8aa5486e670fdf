//! The shape of a scanned object, from joint torques alone (the paper's future work: graphics models of haptized real
//! objects), and its twin: an object of the scene's own kind that explains the scan.
//!
//! The first touch of each approach ([`Approaches`]) is a place of the surface, less the radius of the node that
//! touched. A function in space through these places ([`RadialField`]) is about the distance to the surface. Where
//! nothing was measured the body ends ([`ScannedShape`]). Filled with an elastic solid ([`twin_scene`]), it has the
//! Young's modulus whose torques are nearest to the measured ones ([`Modulus`]).

mod draft;
mod modulus;
mod nets;
mod onset;
mod radial;
mod range;
mod shape;

pub use draft::{Given, twin_scene};
pub use modulus::{Modulus, Watched};
pub use onset::{Approaches, Onset};
pub use radial::RadialField;
pub use range::KnownRange;
pub use shape::{Carving, OBJ, ScannedShape, Touched};

#[cfg(test)]
mod tests;
