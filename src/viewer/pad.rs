//! From what a gamepad's sticks, triggers and buttons report to the speeds of joints. Pure: whence the reports come is in
//! `gamepad.rs`.

/// A stick axis or a trigger.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Axis {
    LeftX,
    LeftY,
    RightX,
    RightY,
    LeftTrigger,
    RightTrigger,
}

/// A button.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Button {
    LeftBumper,
    RightBumper,
    /// The lowest of the four under the right thumb.
    South,
}

/// Greatest and least value that an axis reports.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Range {
    pub least: i32,
    pub greatest: i32,
}

/// Joints that a gamepad moves.
pub const JOINTS: usize = crate::MAX_JOINTS;

/// A gamepad as it is held.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Pad {
    ranges: [Range; AXES],
    /// Sticks from -1 to 1, triggers from 0 to 1.
    axes: [f64; AXES],
    bumpers: [bool; 2],
}

const AXES: usize = 6;

/// Share of an axis' way that counts as its middle: worn sticks rest at a tenth of theirs.
const DEAD_ZONE: f64 = 0.15;

impl Range {
    /// Where `value` lies, from 0 to 1; none in a range of no width.
    fn share(self, value: i32) -> Option<f64> {
        let [least, greatest, value] = [self.least, self.greatest, value].map(f64::from);
        (greatest > least).then(|| ((value - least) / (greatest - least)).clamp(0.0, 1.0))
    }
}

/// Without the dead zone, continuous at its end.
fn live(way: f64) -> f64 {
    way.signum() * (way.abs() - DEAD_ZONE).max(0.0) / (1.0 - DEAD_ZONE)
}

impl Pad {
    /// `axis` reports values in `range` and is at `value` now.
    pub fn set_up(&mut self, axis: Axis, range: Range, value: i32) {
        self.ranges[axis as usize] = range;
        self.turn(axis, value);
    }

    /// `axis` is moved to `value`. One that was not set up, or whose range has no width, stays at rest.
    pub fn turn(&mut self, axis: Axis, value: i32) {
        let way = match (axis, self.ranges[axis as usize].share(value)) {
            (_, None) => 0.0,
            (Axis::LeftTrigger | Axis::RightTrigger, Some(share)) => share,
            (_, Some(share)) => 2.0 * share - 1.0,
        };
        self.axes[axis as usize] = live(way);
    }

    /// `button` is pressed or let go; answers whether that asks for a reset.
    pub fn press(&mut self, button: Button, down: bool) -> bool {
        match button {
            Button::LeftBumper => self.bumpers[0] = down,
            Button::RightBumper => self.bumpers[1] = down,
            Button::South => return down,
        }
        false
    }

    /// How fast each joint is to move, as a share of the speed of keys, from -1 to 1. Sticks are pushed upward for more: their
    /// reports grow downward.
    #[must_use]
    pub fn speeds(&self) -> [f64; JOINTS] {
        let axis = |axis: Axis| self.axes[axis as usize];
        let [left, right] = self.bumpers.map(|down| f64::from(u8::from(down)));
        [
            axis(Axis::LeftX),
            -axis(Axis::LeftY),
            -axis(Axis::RightY),
            axis(Axis::RightX),
            axis(Axis::RightTrigger) - axis(Axis::LeftTrigger),
            right - left,
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use Axis::{LeftTrigger, LeftX, LeftY, RightTrigger, RightX, RightY};
    use proptest::prelude::*;

    const ALL: [Axis; AXES] = [LeftX, LeftY, RightX, RightY, LeftTrigger, RightTrigger];

    /// As a common one reports: sticks over 16 bits, triggers over 8.
    fn common() -> Pad {
        let mut pad = Pad::default();
        for axis in [LeftX, LeftY, RightX, RightY] {
            pad.set_up(axis, Range { least: -32768, greatest: 32767 }, 0);
        }
        for axis in [LeftTrigger, RightTrigger] {
            pad.set_up(axis, Range { least: 0, greatest: 255 }, 0);
        }
        pad
    }

    #[test]
    fn each_stick_trigger_and_bumper_moves_its_joint_both_ways() {
        assert_eq!(common().speeds(), [0.0; JOINTS], "at rest");
        for (axis, value, joint, speed) in [
            (LeftX, 32767, 0, 1.0),
            (LeftX, -32768, 0, -1.0),
            (LeftY, -32768, 1, 1.0),
            (LeftY, 32767, 1, -1.0),
            (RightY, -32768, 2, 1.0),
            (RightX, 32767, 3, 1.0),
            (RightTrigger, 255, 4, 1.0),
            (LeftTrigger, 255, 4, -1.0),
        ] {
            let mut pad = common();
            pad.turn(axis, value);
            let mut expected = [0.0; JOINTS];
            expected[joint] = speed;
            assert_eq!(pad.speeds(), expected, "{axis:?} at {value}");
            pad.turn(axis, 0);
            assert_eq!(pad.speeds(), [0.0; JOINTS], "{axis:?} let go");
        }
        let mut pad = common();
        assert!(!pad.press(Button::RightBumper, true));
        assert_eq!(pad.speeds()[5], 1.0);
        assert!(!pad.press(Button::LeftBumper, true));
        assert_eq!(pad.speeds()[5], 0.0);
        // A reset is asked for once, when the button goes down.
        assert!(pad.press(Button::South, true) && !pad.press(Button::South, false));
    }

    #[test]
    fn sticks_have_a_dead_zone_and_no_leap_at_its_end() {
        let mut pad = common();
        let edge = (DEAD_ZONE * 32768.0) as i32;
        pad.turn(LeftX, edge - 1);
        assert_eq!(pad.speeds()[0], 0.0);
        pad.turn(LeftX, edge + 33);
        assert!(pad.speeds()[0] > 0.0 && pad.speeds()[0] < 2e-3, "{:?}", pad.speeds());
        // The range is the device's own: half the way of another one is half the way.
        let way = |range: Range, value| {
            let mut pad = Pad::default();
            pad.set_up(RightX, range, value);
            pad.speeds()[3]
        };
        let half = way(Range { least: -128, greatest: 128 }, 64);
        assert_eq!(half, way(Range { least: 0, greatest: 1024 }, 768));
        assert!((half - (0.5 - DEAD_ZONE) / (1.0 - DEAD_ZONE)).abs() < 1e-15, "{half}");
    }

    #[test]
    fn what_has_no_range_does_not_move() {
        for range in [Range::default(), Range { least: 5, greatest: 5 }, Range { least: i32::MAX, greatest: i32::MIN }]
        {
            for value in [i32::MIN, -1, 0, 5, i32::MAX] {
                let mut pad = Pad::default();
                ALL.iter().for_each(|&axis| pad.set_up(axis, range, value));
                assert_eq!(pad.speeds(), [0.0; JOINTS], "{range:?} at {value}");
            }
        }
        // Nor what was never set up.
        let mut pad = Pad::default();
        pad.turn(LeftX, i32::MAX);
        assert_eq!(pad, Pad::default());
    }

    proptest! {
        #[test]
        fn no_report_moves_a_joint_faster_than_a_key(least: i32, greatest: i32, values: [i32; AXES], buttons: [bool; 3]) {
            let mut pad = Pad::default();
            for (axis, value) in ALL.into_iter().zip(values) {
                pad.set_up(axis, Range { least, greatest }, value);
            }
            for (button, down) in [Button::LeftBumper, Button::RightBumper, Button::South].into_iter().zip(buttons) {
                pad.press(button, down);
            }
            prop_assert!(pad.speeds().iter().all(|speed| speed.abs() <= 1.0), "{:?}", pad.speeds());
        }
    }
}
