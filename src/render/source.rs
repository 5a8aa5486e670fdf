//! Where the contact torque of a loop comes from: a dataset, a scene that is solved in every tick, or both: the dataset of a
//! real object and its twin.

use super::{
    live::{LiveScene, LiveSession},
    twinned::{TwinnedField, TwinnedSession},
};
use crate::{
    JointVector,
    contact::Slip,
    dataset::Grid,
    field::{Sample, TorqueField},
};
use std::sync::Arc;

/// What of it does not change from tick to tick. Sessions share it.
pub enum TorqueSource {
    /// Torque that was solved or measured before, interpolated.
    Dataset(TorqueField),
    /// Torque that is solved in every tick.
    Live(Arc<LiveScene>),
    /// Torque that was measured, and solved where it was not.
    Twinned(Arc<TwinnedField>),
}

/// What one session has of it.
pub enum ContactSession<'a> {
    /// See [`TorqueSource::Dataset`].
    Dataset(&'a TorqueField),
    /// See [`TorqueSource::Live`].
    Live(Box<LiveSession<'a>>),
    /// See [`TorqueSource::Twinned`].
    Twinned(Box<TwinnedSession<'a>>),
}

impl From<TorqueField> for TorqueSource {
    fn from(field: TorqueField) -> Self {
        Self::Dataset(field)
    }
}

impl From<TwinnedField> for TorqueSource {
    fn from(field: TwinnedField) -> Self {
        Self::Twinned(Arc::new(field))
    }
}

impl TorqueSource {
    /// The field of a dataset.
    #[must_use]
    pub fn field(&self) -> Option<&TorqueField> {
        match self {
            Self::Dataset(field) => Some(field),
            Self::Live(_) | Self::Twinned(_) => None,
        }
    }

    /// The scene that is solved in every tick, or where nothing was measured.
    #[must_use]
    pub fn live(&self) -> Option<&Arc<LiveScene>> {
        match self {
            Self::Dataset(_) => None,
            Self::Live(scene) => Some(scene),
            Self::Twinned(field) => Some(field.twin()),
        }
    }

    /// The dataset of a real object and its twin.
    #[must_use]
    pub fn twinned(&self) -> Option<&TwinnedField> {
        match self {
            Self::Dataset(_) | Self::Live(_) => None,
            Self::Twinned(field) => Some(field),
        }
    }

    /// The same for a loop with other gains; none where these choose how it is interpolated.
    pub(super) fn whatever_gains(&self) -> Option<Self> {
        match self {
            Self::Dataset(_) => None,
            Self::Live(scene) => Some(Self::Live(Arc::clone(scene))),
            Self::Twinned(field) => Some(Self::Twinned(Arc::clone(field))),
        }
    }

    /// Number of joints d.
    #[must_use]
    pub fn joints(&self) -> usize {
        self.grid().joints()
    }

    /// The region in which the torque is known.
    #[must_use]
    pub fn grid(&self) -> &Grid {
        match self {
            Self::Dataset(field) => field.grid(),
            Self::Live(scene) => scene.grid(),
            Self::Twinned(field) => field.twin().grid(),
        }
    }

    /// Whether the energy U is known.
    #[must_use]
    pub fn has_energy(&self) -> bool {
        match self {
            Self::Dataset(field) => field.has_energy(),
            Self::Live(_) | Self::Twinned(_) => true,
        }
    }

    /// Whether it is known how contacts slip.
    #[must_use]
    pub fn has_slip(&self) -> bool {
        match self {
            Self::Dataset(field) => field.has_slip(),
            Self::Live(_) => true,
            Self::Twinned(field) => field.has_slip(),
        }
    }

    /// Whether the torque is minus the gradient of that energy.
    #[must_use]
    pub fn is_potential(&self) -> bool {
        match self {
            Self::Dataset(field) => field.is_potential(),
            Self::Live(_) | Self::Twinned(_) => true,
        }
    }

    /// Stiffness of the torque relative to `slopes` (1): see [`TorqueField::relative_stiffness`], a bound, and
    /// [`LiveScene::relative_stiffness`], the greatest of many.
    #[must_use]
    pub fn relative_stiffness(&self, slopes: &JointVector) -> f64 {
        match self {
            Self::Dataset(field) => field.relative_stiffness(slopes),
            Self::Live(scene) => scene.relative_stiffness(slopes),
            Self::Twinned(field) => field.relative_stiffness(slopes),
        }
    }

    /// What a session needs of it.
    #[must_use]
    pub fn begin(&self) -> ContactSession<'_> {
        match self {
            Self::Dataset(field) => ContactSession::Dataset(field),
            Self::Live(scene) => ContactSession::Live(Box::new(LiveSession::new(scene))),
            Self::Twinned(field) => ContactSession::Twinned(Box::new(TwinnedSession::new(field))),
        }
    }
}

impl ContactSession<'_> {
    /// The contact at `q`, and how many ticks ago it was solved: none where `q` was solved, or looked up. Never
    /// allocates.
    pub(super) fn sample(&mut self, q: &[f64]) -> (Sample, u32) {
        match self {
            Self::Dataset(field) => (field.sample(q), 0),
            Self::Live(session) => session.sample(q),
            Self::Twinned(session) => session.sample(q),
        }
    }

    /// How the contacts slip at `q`, the configuration that was sampled last, of which `sample` is the field. Never
    /// allocates.
    pub(super) fn slip(&mut self, q: &[f64], sample: &Sample) -> Slip {
        match self {
            Self::Dataset(field) => field.slip(q, sample),
            Self::Live(session) => session.slip(q),
            Self::Twinned(session) => session.slip(q, sample),
        }
    }
}
