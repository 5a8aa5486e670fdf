//! The contact law: depths with their derivatives, what each facet takes of a node's spring, forces and Hessian.

pub mod depth;
pub mod series;
pub mod springs;
