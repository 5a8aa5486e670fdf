//! Arms from URDF, the robot description of ROS (<http://wiki.ros.org/urdf/XML>): a robot's file becomes a scene.
//!
//! [`Robot::load`] reads links and joints, [`Arm::new`] takes the chain from the root to a tip link, [`sample`] puts
//! contact nodes on the links' shapes, and [`write_scene`] writes the scene file that a person would have written.
//! Every error names the file, the line and the remedy; what is left out is said in [`Arm::notes`].
//!
//! | file | subject |
//! |---|---|
//! | `document.rs` | XML: elements, numbers, errors at their place |
//! | `robot.rs` | links and joints as the file has them |
//! | `link.rs` | inertia and shapes of one link |
//! | `group.rs` | links that do not move against each other, as one body |
//! | `arm.rs` | the chain in world-parallel frames, fixed joints folded in |
//! | `package.rs` | files that `package://` names |
//! | `surface.rs` | triangles of boxes, cylinders, spheres and meshes |
//! | `nodes.rs` | contact nodes on these, at a spacing |
//! | `drawn.rs` | the shapes that the scene draws |
//! | `practice.rs` | a soft ball within reach, and a grid and a motion that press it |
//! | `text.rs` | the scene file |
//! | `shape.rs` | its end: what is drawn of the links |

mod arm;
mod description;
mod document;
mod drawn;
mod group;
mod link;
mod nodes;
mod package;
mod practice;
mod robot;
mod shape;
mod surface;
mod text;

pub use arm::{Arm, ArmJoint, Lock, Note};
pub use description::description;
pub use drawn::drawn_shapes;
pub use link::{Geometry, Inertial, Link, Placed};
pub use nodes::{ContactNodes, sample};
pub use robot::{Joint, JointType, Robot};
pub use text::write_scene;
