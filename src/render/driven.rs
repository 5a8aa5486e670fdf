//! What a program holds that ticks a loop, or asks a scene for its contact, itself: with the session that each needs.

use super::{
    flags::Fault,
    haptic::{Haptics, Inputs, Output, State},
    live::{LiveScene, LiveSession},
    source::ContactSession,
};
use crate::{JointVector, dataset::Grid, field::Sample};
use std::sync::Arc;

self_cell::self_cell!(
    struct LoopWithSession {
        owner: Arc<Haptics>,
        #[covariant]
        dependent: ContactSession,
    }
);

/// A haptic loop that its holder ticks. One thread at a time may use it.
pub struct DrivenLoop {
    of: LoopWithSession,
    state: State,
}

impl DrivenLoop {
    /// Device and proxy at rest at `position`.
    ///
    /// # Errors
    /// When that is not a position of the device.
    pub fn new(haptics: Arc<Haptics>, position: &JointVector) -> Result<Self, Fault> {
        let state = haptics.start(position)?;
        Ok(Self { of: LoopWithSession::new(haptics, |haptics| haptics.source().begin()), state })
    }

    /// The loop.
    #[must_use]
    pub fn haptics(&self) -> &Haptics {
        self.of.borrow_owner()
    }

    /// Begins anew at `position`, after a fault too; see [`Haptics::restart`].
    ///
    /// # Errors
    /// When that is not a position of the device; the fault then stays.
    pub fn restart(&mut self, position: &JointVector) -> Result<(), Fault> {
        self.of.borrow_owner().restart(&mut self.state, position)
    }

    /// One tick. Never allocates.
    pub fn tick(&mut self, inputs: &Inputs) -> Output {
        let Self { of, state } = self;
        of.with_dependent_mut(|haptics, contact| haptics.tick_with(state, inputs, contact))
    }

    /// Why the loop has let go, if it has.
    #[must_use]
    pub fn fault(&self) -> Option<Fault> {
        self.state.fault()
    }
}

self_cell::self_cell!(
    struct SceneWithSession {
        owner: LiveScene,
        #[covariant]
        dependent: LiveSession,
    }
);

/// The contact of a scene for which nothing was baked, wherever its holder asks for it: see [`LiveScene`]. One thread
/// at a time may use it.
pub struct LiveField(SceneWithSession);

impl LiveField {
    /// Room for all that is solved of `scene`.
    #[must_use]
    pub fn new(scene: LiveScene) -> Self {
        Self(SceneWithSession::new(scene, |scene| LiveSession::new(scene)))
    }

    /// The region in which the proxy is expected: see [`LiveScene::grid`].
    #[must_use]
    pub fn grid(&self) -> &Grid {
        self.0.borrow_owner().grid()
    }

    /// The contact at the joint coordinates `q` (rad or m). Where it is larger than what is solved, or `q` is none,
    /// that of the last configuration that was solved, flagged as unconverged. Never allocates.
    pub fn sample(&mut self, q: &[f64]) -> Sample {
        self.0.with_dependent_mut(|_, session| session.sample(q).0)
    }
}
