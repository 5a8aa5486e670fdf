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
    /// The request does not fit the file or a scene.
    #[error("{}: {message}", .path.display())]
    Request {
        /// The robot file.
        path: PathBuf,
        /// Problem and remedy, in words.
        message: String,
    },
    /// The scene that was written is not valid: a fault of this program.
    #[error("the scene made of the robot is not valid, a fault of this program: {0}")]
    Scene(#[from] SceneError),
}
