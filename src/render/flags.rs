//! What a tick has to say beside its numbers: where the look-up was not to be trusted, what was limited, what failed.

use bitflags::bitflags;

bitflags! {
    /// Remarks on one tick. None set: everything is as it should be.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
    pub struct Flags: u8 {
        /// The proxy is outside the grid: its torque is that of the nearest grid cell, faded out over one cell.
        const OUTSIDE = 1;
        /// A grid point around the proxy was not computed or measured: it counts as zero torque.
        const ABSENT = 1 << 1;
        /// A grid point around the proxy is unconverged or overflowed: its torque is used, and not to be trusted.
        const UNCONVERGED = 1 << 2;
        /// The boundary layer holds the contact torque below the dataset's.
        const LAYER = 1 << 3;
        /// A joint of the proxy rests against its limit.
        const STOPPED = 1 << 4;
        /// The torque on the device was cut to its greatest size.
        const SIZE_LIMITED = 1 << 5;
        /// The torque on the device was cut to its greatest rate of change.
        const RATE_LIMITED = 1 << 6;
    }
}

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
    /// The device's position is too old.
    #[error("the device's position is too old: check its connection")]
    Stale,
    /// The time between two ticks is too long, or not a positive number.
    #[error(
        "the time between two ticks was too long or not a positive number: give the loop real-time priority or a core"
    )]
    Late,
    /// The loop has missed most of its deadlines for a while.
    #[error("the loop keeps missing its deadlines: give it real-time priority or a core or lower its rate")]
    Overrun,
    /// The device moved faster than its `speed_limit`.
    #[error("the device leapt: look for lost encoder counts or raise speed_limit")]
    Leap,
    /// The device's port has given more energy than it took, by more than
    /// [`GREATEST_GIVEN_ENERGY`](crate::tolerances::GREATEST_GIVEN_ENERGY).
    #[error(
        "the loop gave the hand energy from nowhere: lower the gains to the bounds that were reported or name passivity_control"
    )]
    Energy,
    /// The torque came out as no number: gains beyond all measure.
    #[error("the torque is not a number: lower the gains")]
    Torque,
}
