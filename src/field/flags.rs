//! Remarks on a look-up, and on the tick that it serves.

use bitflags::bitflags;

bitflags! {
    /// Remarks on one tick. None set: everything is as it should be.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
    pub struct Flags: u8 {
        /// The proxy is outside the grid, in space that is known to be free.
        const OUTSIDE = 1;
        /// A grid point around the proxy was not computed or measured: it counts as zero torque.
        const ABSENT = 1 << 1;
        /// A grid point around the proxy is unconverged or overflowed: its torque is used, and not to be trusted. Where
        /// contact is solved in every tick, it was not in this one: the torque is the last that was solved.
        const UNCONVERGED = 1 << 2;
        /// The boundary layer holds the contact torque below the dataset's.
        const LAYER = 1 << 3;
        /// A joint of the proxy rests against its limit.
        const STOPPED = 1 << 4;
        /// The torque on the device was cut to its greatest size.
        const SIZE_LIMITED = 1 << 5;
        /// The torque on the device was cut to its greatest rate of change.
        const RATE_LIMITED = 1 << 6;
        /// The proxy is held at the border of the haptized range.
        const HELD = 1 << 7;
    }
}
