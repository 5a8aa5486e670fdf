//! The contact law: depths with their derivatives, forces and Hessian.

pub mod depth;
pub mod springs;
