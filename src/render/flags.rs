//! The flags of a tick beside its numbers: where the look-up was not to be trusted, what was limited, what failed.

pub use crate::field::Flags;

/// Why the torque on the device has been brought to zero, and what to do about it. Messages hold no comma: they are
/// fields of a CSV file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Fault {
    /// The device reports a position that is not a number, or beyond anything that is a position.
    #[error("the device reports a position that is not a number or beyond any reach: check its connection")]
    NotFinite,
    /// The device reports another number of joints than the dataset has.
    #[error("the device reports another number of joints than the dataset has: take the device that the scene is for")]
    Joints,
    /// The device's position is too old, or comes from the future.
    #[error("the device's position is too old or its age is negative: check its connection and the clocks")]
    Stale,
    /// The time between two ticks is too long, or not a positive number.
    #[error(
        "the time between two ticks was too long or not a positive number: give the loop real-time priority and a core; \
         if it has both, look for what holds the machine or the device's driver up"
    )]
    Late,
    /// The loop has missed most of its deadlines for a while.
    #[error("the loop keeps missing its deadlines: give it real-time priority or a core or lower its rate")]
    Overrun,
    /// The device moved faster than its `speed_limit`.
    #[error("the device leapt: look for lost encoder counts or raise speed_limit")]
    Leap,
    /// The device's port has given more energy than it took, by more than
    /// [`GREATEST_GIVEN_ENERGY`](super::haptic::GREATEST_GIVEN_ENERGY).
    #[error(
        "the loop gave the hand energy from nowhere: lower the gains to the bounds that were reported or name \
         passivity_control"
    )]
    Energy,
    /// Contact has not been solved for longer than a torque may rest on a position.
    #[error("contact was not solved in time: press less deep or bake the scene")]
    Unsolved,
    /// The torque came out as no number: gains beyond all measure.
    #[error("the torque is not a number: lower the gains")]
    Torque,
}
