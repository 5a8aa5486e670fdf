//! The contact law: depths with their derivatives, forces and Hessian.

pub mod depth;
pub mod rounded;
pub mod springs;
