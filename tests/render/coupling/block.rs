//! The block, felt.

pub use haptize::fixtures::worlds::{BLOCK_STIFFNESS as STIFFNESS, block, block_scene as scene};
use haptize::{
    Error, JointVector,
    render::{
        haptic::{Inputs, Output, State},
        setup::Setup,
    },
};

/// The block, ready to be felt.
pub fn setup(haptics: &str) -> Result<Setup, Error> {
    Setup::new(&block(haptics))
}

/// Ticks of a millisecond with the device at `position(t)` for `seconds`, from rest at its first place.
pub fn felt(setup: &Setup, seconds: f64, position: impl Fn(f64) -> [f64; 2], mut each: impl FnMut(&Output)) -> State {
    let at = |k: usize| JointVector::from_slice(&position(1e-3 * k as f64));
    let mut state = setup.haptics.start(&at(0)).unwrap();
    for k in 0..(1e3 * seconds).round() as usize {
        let inputs = Inputs { position: at(k), age: 0.0, elapsed: 1e-3, interval: 1e-3 };
        each(&setup.haptics.tick(&mut state, &inputs));
    }
    state
}
