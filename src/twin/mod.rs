//! The shape of a scanned object, from joint torques alone (the paper's future work: graphics models of haptized real
//! objects).
//!
//! The first touch of each approach ([`Approaches`]) is a place of the surface, less the radius of the node that
//! touched. A function in space through these places ([`RadialField`]) is about the distance to the surface. Where
//! nothing was measured the body ends ([`ScannedShape`]).

mod nets;
mod onset;
mod radial;
mod shape;

pub use onset::{Approaches, Onset};
pub use radial::RadialField;
pub use shape::{Carving, OBJ, ScannedShape, Touched};

#[cfg(test)]
mod tests;
