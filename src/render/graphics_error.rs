//! Why an object cannot be drawn.

use crate::object::FactorError;

/// The object cannot be drawn.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum GraphicsError {
    /// The dataset has no contact forces.
    #[error("the dataset holds no contact forces: name [graphics] in its scene and bake it again")]
    NoForces,
    /// The compressed rows of the contact forces are not consistent with the grid or with the object.
    #[error("the dataset's contact forces do not fit its grid and an object of {nodes} nodes: bake it again")]
    Rows {
        /// Nodes of the object.
        nodes: usize,
    },
    /// The time between frames is not a positive number.
    #[error("the time between frames is {0} s; it must be a positive number")]
    Period(f64),
    /// The system has no threads for the frames of a large object.
    #[error("no threads can be had for the object's frames: {0}")]
    Threads(String),
    /// No equilibrium can be solved for the forces.
    #[error("contact cannot be solved for what is drawn: {0}")]
    Solved(String),
    /// The object's matrix cannot be factorised.
    #[error(transparent)]
    Factor(#[from] FactorError),
}
