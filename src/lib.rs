//! Configuration-space haptization: contact between a multi-link virtual proxy and a deformable virtual object is
//! solved beforehand for every joint configuration, and felt at 1 kHz by interpolation.
//!
//! A [`scene`] says what is touched with what. An [`object`] deforms, a [`proxy`] moves its joints (it may come from a
//! robot's file, [`robot`]), and their equilibrium ([`contact`]) at every point of a grid over the joint angles q gives
//! a [`dataset`] ([`sweep`], on the CPU or through [`gpu`]): the joint torque tau(q), the stored energy U(q) and the
//! contact forces. [`render`] looks torques up in it, a thousand times a second, for the hand or log that [`device`]
//! stands for; [`report`] draws what came out. Data flows one way: a room knows only the rooms above it in the list
//! below.
//!
//! All quantities are SI: m, rad, N, N m, kg, s, J.
//!
//! # Example
//!
//! A finger of one joint presses a soft ball of 50 mm radius, at eight angles; then the torque is looked up between
//! them.
//!
//! ```
//! use haptize::{
//!     contact::Model,
//!     field::TorqueField,
//!     object::Object,
//!     proxy::Chain,
//!     scene::{Interpolation, Scene},
//!     sweep::{BackendChoice, ChosenBackend, Run, Sweep},
//! };
//! use std::sync::atomic::AtomicBool;
//!
//! let text = r#"
//!     [object]
//!     sphere = { radius = 0.05, rings = 10, segments = 10 }      # m
//!     springs = { kind = "isotropic", stiffness = 300.0 }        # N/m
//!     ground = { stiffness = 100.0 }                             # N/m, at every node
//!
//!     [[proxy.joint]]
//!     kind = "revolute"
//!     origin = [-0.1, 0.0, 0.06]                                 # m
//!     axis = [0.0, 1.0, 0.0]
//!     limits = [-0.5, 0.5]                                       # rad
//!     nodes = [{ at = [0.1, 0.0, 0.0] }]                         # the fingertip, 10 mm above the ball at q = 0
//!
//!     [contact]
//!     stiffness = 1000.0                                         # N/m
//!
//!     [grid]
//!     axes = [{ start = 0.0, stop = 0.28, count = 8 }]           # rad
//! "#;
//! let scene = Scene::parse(text, "finger.toml")?;
//! let object = Object::build(&scene.object)?;
//! let chain = Chain::new(&scene.proxy);
//! let model = Model::new(&object, &chain, scene.contact);
//!
//! let mut backend = ChosenBackend::open(BackendChoice::Cpu, &model)?;
//! let sweep = Sweep::new(&scene, &object, backend.name(), &backend.adapter(), "2026-01-01T00:00:00Z")?;
//! let run = Run { chunk: backend.chunk(), stop: &AtomicBool::new(false), progress: &mut |_| () };
//! let (dataset, report) = sweep.run(&mut backend, run)?;
//! assert_eq!((report.points, report.unconverged), (8, 0));
//!
//! let haptics = &scene.haptics;
//! let field =
//!     TorqueField::interpolated(&dataset, Interpolation::Linear, haptics.threshold, &haptics.boundary_slope)?;
//! let above = field.sample(&[0.05]);
//! assert_eq!(above.torque[0], 0.0); // the ball is not touched yet
//! let pressed = field.sample(&[0.22]);
//! assert!(pressed.contact && pressed.torque[0] < 0.0); // and pushes back against q
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod scene;

pub mod object;
pub mod proxy;

pub mod contact;

pub mod gpu;
pub mod robot;

pub mod dataset;
pub use dataset::store;

pub mod field;
pub mod fixtures;

pub mod sweep;

pub mod ros;

pub mod gridize;

pub mod logs;

pub mod device;

pub mod control;
pub mod scan;
pub mod twin;

pub mod render;

pub mod draw;
pub mod report;

pub mod paper;

pub mod studies;

#[cfg(feature = "viewer")]
pub mod viewer;

pub mod cli;

mod cache;
mod csv;
mod error;
mod input;
pub mod joint_matrix;
mod joint_vector;
pub mod memory;
mod names;
mod random;
pub mod threads;
mod toml_text;
mod vtk;
mod xml;

pub(crate) use error::error;
pub use error::{Error, ErrorKind, Location};
pub use joint_matrix::JointMatrix;
pub use joint_vector::{JointVector, MAX_AXES, MAX_JOINTS};
