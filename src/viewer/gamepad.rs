//! The gamepad that moves the device's joints, where there is one. A thread of its own looks for it, reads it, and looks again
//! when it is gone, so that neither window nor hand ever waits for it.
//!
//! On Linux it is read from /dev/input. Elsewhere none is ever found.

use super::pad::{JOINTS, Pad};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// The motion that is asked of the hand.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Wish {
    /// How fast each joint is to move, as a share of the speed of keys.
    pub speeds: [f64; JOINTS],
    /// Whether the hand is to go back to where it was at first.
    pub reset: bool,
}

/// Whether there is a gamepad.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum Found {
    /// There is none.
    #[default]
    None,
    /// By its name.
    Connected(String),
    /// There is one, but the system does not let it be read: why, and what to do.
    Refused(String),
}

/// The gamepad, shared by the thread that reads it, the hand, and the window. Whether it is meant for the window is not known
/// here.
#[derive(Clone, Default)]
pub struct Gamepad {
    now: Arc<Mutex<(Wish, Found)>>,
}

impl Gamepad {
    /// One that is looked for and read until the last of its clones is gone.
    #[must_use]
    pub fn new() -> Self {
        let gamepad = Self::default();
        #[cfg(target_os = "linux")]
        super::gamepad_linux::read(&gamepad);
        gamepad
    }

    /// Returns the motion that is asked of the hand now; a reset is returned once.
    #[must_use]
    pub fn wish(&self) -> Wish {
        let mut now = self.lock();
        let reset = std::mem::take(&mut now.0.reset);
        Wish { reset, ..now.0 }
    }

    /// Whether there is one.
    #[must_use]
    pub fn found(&self) -> Found {
        self.lock().1.clone()
    }

    /// `found` is how it stands with gamepads now; nothing is asked of the hand any more.
    pub(super) fn tell(&self, found: Found) {
        *self.lock() = (Wish::default(), found);
    }

    /// The gamepad is held as `pad`; `reset`: its button was pressed.
    pub(super) fn hold(&self, pad: &Pad, reset: bool) {
        let mut now = self.lock();
        now.0.speeds = pad.speeds();
        now.0.reset |= reset;
    }

    /// Gives it, as long as somebody else has it.
    #[cfg(target_os = "linux")]
    pub(super) fn weak(&self) -> impl Fn() -> Option<Self> + Send + 'static {
        let now = Arc::downgrade(&self.now);
        move || Some(Self { now: now.upgrade()? })
    }

    fn lock(&self) -> MutexGuard<'_, (Wish, Found)> {
        // Plain values: a panic elsewhere leaves nothing half-written that would matter.
        self.now.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_gamepad_that_is_gone_asks_for_nothing_and_one_that_is_there_for_one_reset() {
        let gamepad = Gamepad::default();
        let mut pad = Pad::default();
        pad.press(super::super::pad::Button::RightBumper, true);
        gamepad.tell(Found::Connected("one".into()));
        gamepad.hold(&pad, true);
        let wish = gamepad.wish();
        assert!(wish.reset && wish.speeds[5] == 1.0, "{wish:?}");
        assert!(!gamepad.wish().reset && gamepad.wish().speeds[5] == 1.0, "a reset is told twice");
        // It is pulled out while a bumper is held.
        gamepad.tell(Found::None);
        assert_eq!((gamepad.wish(), gamepad.found()), (Wish::default(), Found::None));
    }
}
