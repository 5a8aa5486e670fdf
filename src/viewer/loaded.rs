//! The content of the window: a dataset with everything its rendering needs, and how it came to be.

use crate::{
    Error, JointVector,
    dataset::Dataset,
    device::Motion,
    gridize::with_energy,
    render::{graphics::ContactForces, haptic::Haptics, live::LiveScene, passivity::Advice, setup::Setup},
    scene::{HapticsSpec, Scene, Tuning},
    sweep::SweepReport,
};
use std::{path::PathBuf, sync::Arc};

/// A dataset that can be felt and seen. Cheap to clone: the data are shared.
#[derive(Clone)]
pub struct Loaded {
    /// For the window's title.
    pub name: String,
    /// The file it was read from; none for one that was just baked.
    pub file: Option<PathBuf>,
    /// The scene that it can be baked from again; none for a scanned dataset.
    pub scene: Option<Arc<Scene>>,
    /// The data.
    pub dataset: Arc<Dataset>,
    /// Proxy, haptic loop, object.
    pub setup: Arc<Setup>,
    /// Contact forces on the object; absent where there is no object to draw.
    pub forces: Option<Arc<ContactForces>>,
    /// The scene that is solved in every tick; absent where a dataset is felt.
    pub live: Option<Arc<LiveScene>>,
    /// The report of the bake, if this window baked it.
    pub report: Option<Arc<SweepReport>>,
    /// Whether the scene was changed here, and where the arm is to stand then, if elsewhere (rad or m).
    pub edited: bool,
    /// See `edited`.
    pub at: Option<JointVector>,
}

impl Loaded {
    /// Builds what rendering needs.
    ///
    /// # Errors
    /// When the dataset cannot be rendered.
    pub fn new(dataset: Dataset, scene: Option<Scene>, file: Option<PathBuf>) -> Result<Self, Error> {
        Self::of(Setup::new(&dataset)?, dataset, scene, file)
    }

    fn of(setup: Setup, dataset: Dataset, scene: Option<Scene>, file: Option<PathBuf>) -> Result<Self, Error> {
        let scene = scene.or_else(|| {
            let path = file.clone().unwrap_or_else(|| setup.scene.path.clone());
            Scene::of_dataset(&dataset.scene, path, &dataset.provenance.algorithm).ok()
        });
        let forces = setup.contact_forces(&dataset)?;
        Ok(Self {
            name: setup.scene.name.clone(),
            file,
            scene: scene.map(Arc::new),
            dataset: Arc::new(dataset),
            setup: Arc::new(setup),
            forces: forces.map(Arc::new),
            live: None,
            report: None,
            edited: false,
            at: None,
        })
    }

    /// A `scene` that is solved in every tick.
    ///
    /// # Errors
    /// When it cannot be solved or rendered.
    pub fn live(scene: Scene) -> Result<Self, Error> {
        let live = Arc::new(LiveScene::new(scene.clone())?);
        let dataset = live.dataset();
        let loaded = Self::of(Setup::live(Arc::clone(&live), &dataset)?, dataset, Some(scene), None)?;
        Ok(Self { live: Some(live), ..loaded })
    }

    /// A `dataset` of a real object in `file` with its `twin`.
    ///
    /// # Errors
    /// When the twin cannot be solved, or the dataset cannot be rendered.
    pub fn twinned(dataset: Dataset, twin: Scene, file: PathBuf) -> Result<Self, Error> {
        let twin = Arc::new(LiveScene::new(twin)?);
        let dataset = twin.beside(with_energy(dataset));
        Self::of(Setup::twinned(twin, &dataset)?, dataset, None, Some(file))
    }

    /// Gains and effects as its scene has them.
    #[must_use]
    pub fn tuning(&self) -> Tuning {
        let scene = &self.setup.scene;
        let drawn = self.setup.object.as_ref().and(scene.graphics.as_ref());
        Tuning { haptics: scene.haptics.clone(), graphics: drawn.map(|graphics| graphics.effects).unwrap_or_default() }
    }

    /// Returns the haptic loop with `gains`, and what is wrong with them where they are beyond their passivity bounds.
    ///
    /// # Errors
    /// When they do not make a loop.
    pub fn tuned(&self, gains: &HapticsSpec) -> Result<(Arc<Haptics>, Option<Advice>), Error> {
        let (haptics, advice) = self.setup.retuned(&self.dataset, gains)?;
        Ok((Arc::new(haptics), advice))
    }

    /// Whether the dataset knows which nodes of the object are in contact. What was measured on a real object does not.
    #[must_use]
    pub fn knows_nodes(&self) -> bool {
        self.dataset.contacts.is_some()
    }

    /// The scene's motions by name.
    #[must_use]
    pub fn motions(&self) -> Vec<(&'static str, Motion)> {
        let motion = &self.setup.scene.motion;
        let joints = self.setup.chain.joints.len();
        [("press", &motion.press), ("scrape", &motion.scrape)]
            .into_iter()
            .filter_map(|(name, waypoints)| Some((name, Motion::through(waypoints, joints).ok()?)))
            .collect()
    }

    /// Returns where the device is at first: where it is to stand, or at the beginning of the first motion, else in the
    /// middle of the grid.
    #[must_use]
    pub fn start(&self) -> JointVector {
        let begin = || self.motions().first().map_or_else(|| self.middle(), |(_, motion)| motion.at(0.0).0);
        self.at.unwrap_or_else(begin)
    }

    /// The middle of the grid.
    #[must_use]
    pub fn middle(&self) -> JointVector {
        let middles =
            self.dataset.grid.axes.iter().map(|axis| axis.coordinate(0) + 0.5 * axis.step * (axis.count - 1) as f64);
        JointVector::from_slice(&middles.collect::<Vec<_>>())
    }
}
