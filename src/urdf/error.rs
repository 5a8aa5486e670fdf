//! Why no scene can be made of a robot file.

use crate::scene::{Diagnostic, SceneError};
use std::path::PathBuf;

/// Why no scene can be made of a robot file, and what to do about it.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum UrdfError {
    /// The file cannot be read at all.
    #[error("{}: cannot read the robot: {reason}", .path.display())]
    Unreadable {
        /// The robot file.
        path: PathBuf,
        /// Why, and what to do.
        reason: String,
    },
    /// The text is not XML or not URDF, or has something that a scene cannot hold.
    #[error(transparent)]
    Invalid(Box<Diagnostic>),
    /// What is asked for is not in the file, or does not fit a scene.
    #[error("{}: {message}", .path.display())]
    Request {
        /// The robot file.
        path: PathBuf,
        /// What is wrong and what to do.
        message: String,
    },
    /// The scene that was written is not valid: a fault of this program.
    #[error("the scene made of the robot is not valid, a fault of this program: {0}")]
    Scene(#[from] SceneError),
}
