//! Arms from the descriptions of robots, URDF and MJCF: a robot's file becomes a scene.
//!
//! [`Robot::load`] reads links and joints, [`Arm::new`] takes the chain from the root to a tip link, [`sample`] puts
//! contact nodes on the links' shapes, and [`write_scene`] writes the scene file that a person would have written.
//! Every error names the file, the line and the remedy; what is left out is said in [`Arm::notes`].
//!
//! | file | subject |
//! |---|---|
//! | `document.rs` | XML: elements, numbers, errors at their place |
//! | `description.rs` | links and joints of a robot, whatever its format |
//! | `urdf.rs`, `mjcf.rs` | these from the formats |
//! | `group.rs` | links that do not move against each other, as one body |
//! | `arm.rs` | the chain in world-parallel frames, fixed joints folded in |
//! | `package.rs` | files that `package://` names |
//! | `surface.rs` | triangles of boxes, cylinders, spheres and meshes |
//! | `nodes.rs` | contact nodes on these, at a spacing |
//! | `drawn.rs` | the shapes that the scene draws |
//! | `practice.rs` | a soft ball within reach, and a grid and a motion that press it |
//! | `text.rs` | the scene file |
//! | `shape.rs` | its end: what is drawn of the links |
//! | `urdf_writer.rs` | an arm as URDF, for programs that show robots |

mod arm;
mod description;
mod document;
mod drawn;
mod group;
mod mjcf;
mod nodes;
mod package;
mod practice;
mod shape;
mod surface;
mod text;
mod urdf;
mod urdf_writer;

pub use arm::{Arm, ArmJoint, Lock, Note};
pub use description::{Geometry, Inertial, Joint, JointType, Link, Mimic, Placed, Robot};
pub use drawn::drawn_shapes;
pub use nodes::{ContactNodes, sample};
pub use text::write_scene;
pub use urdf_writer::description;
