//! Searches for the equilibrium: the minimum of the energy by damped Newton steps, with its tangent, and
//! contact with the surface at rest.

pub mod energy;
pub mod newton;
pub mod rest;
pub mod tangent;
mod woodbury;
