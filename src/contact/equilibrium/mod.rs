//! Searches for the equilibrium: the minimum of the energy by damped Newton steps, with its tangent, and the paper's
//! iteration.

pub mod energy;
pub mod newton;
pub mod paper;
pub mod tangent;
mod woodbury;
