//! The virtual proxy: a serial chain of revolute and prismatic joints with contact nodes on its links.
//!
//! Link i's frame sits at joint i and is parallel to the world at q = 0. Frame i follows from frame i - 1 (the world
//! for the first) by o_i = o_(i-1) + R_(i-1) origin_i, and R_i = R_(i-1) Rot(axis_i, q_i) for a revolute joint, or o_i
//! += q_i R_(i-1) axis_i for a prismatic one. Where joint i follows another, q_i is an affine function of that one's
//! coordinate. Nothing here allocates once a [`Pose`] has its size.

mod chain;
mod drawn;
mod dynamics;
mod gravity;
mod inertia;
pub mod inverse_kinematics;
mod jacobian;
mod links;
mod posture;
mod press;
#[cfg(test)]
mod random;
mod transmission;

pub use chain::{Chain, Node, Pose};
pub use drawn::{Triangles, block, capsule, cylinder, shape_frame, shape_triangles, sphere};
pub use dynamics::Dynamics;
pub use links::Links;
pub(crate) use posture::outer;
pub use posture::{Posture, of_last_link, tip};
pub use press::{PRESS_GAP, Press};
pub use transmission::ChainLink;
