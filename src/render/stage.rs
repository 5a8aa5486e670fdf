//! What a session needs of a scene and the dataset baked from it, built once: the proxy's chain, the object, the haptic
//! loop, and the graphics loop where the scene has one.

use super::{
    field::{FieldError, TorqueField},
    graphics::{Graphics, GraphicsError},
    haptic::Haptics,
    npmi::{InertiaError, Npmi},
};
use crate::{
    JointVector,
    dataset::{Axis, Dataset},
    object::{Object, ObjectError},
    proxy::Chain,
    scene::{GraphicsSpec, Scene},
};

/// A scene, ready to be felt and drawn.
pub struct Stage {
    /// The virtual proxy.
    pub chain: Chain,
    /// The virtual object, where the scene has graphics.
    pub object: Option<Object>,
    /// The haptic loop.
    pub haptics: Haptics,
    graphics: Option<GraphicsSpec>,
}

/// A scene and a dataset do not make a session.
#[derive(Debug, thiserror::Error)]
pub enum StageError {
    /// The dataset is another scene's.
    #[error("the dataset has {dataset} joints, the scene's proxy {scene}: bake the scene again")]
    Joints {
        /// Of the dataset.
        dataset: usize,
        /// Of the scene.
        scene: usize,
    },
    /// The contact torque cannot be interpolated.
    #[error(transparent)]
    Field(#[from] FieldError),
    /// The proxy cannot be moved.
    #[error(transparent)]
    Inertia(#[from] InertiaError),
    /// The object cannot be built.
    #[error(transparent)]
    Object(#[from] ObjectError),
}

impl Stage {
    /// The stage of `scene` with its `dataset`. The proxy's constant inertia is that at the middle of the grid.
    ///
    /// # Errors
    /// When the two do not belong together, or either is broken.
    pub fn new(scene: &Scene, dataset: &Dataset) -> Result<Self, StageError> {
        let chain = Chain::new(&scene.proxy);
        let joints = chain.degrees_of_freedom();
        if dataset.grid.joints() != joints {
            return Err(StageError::Joints { dataset: dataset.grid.joints(), scene: joints });
        }
        let middle = |axis: &Axis| axis.start.midpoint(axis.coordinate(axis.count.saturating_sub(1)));
        let q: Vec<f64> = dataset.grid.axes.iter().map(middle).collect();
        let mut pose = chain.new_pose();
        chain.pose(&JointVector::from_slice(&q), &mut pose);
        let limits: Vec<[f64; 2]> = chain.joints.iter().map(|joint| joint.limits).collect();
        let npmi = Npmi::new(&chain.inertia(&pose), &limits)?;
        let spec = &scene.haptics;
        let field = TorqueField::new(dataset, spec.threshold, &spec.boundary_slope)?;
        let object = scene.graphics.map(|_| Object::build(&scene.object)).transpose()?;
        Ok(Self { chain, object, haptics: Haptics::new(field, npmi, spec), graphics: scene.graphics })
    }

    /// The graphics loop, with the object at rest; `None` where the scene has none.
    ///
    /// # Errors
    /// When the dataset holds no contact forces, or not this object's.
    pub fn graphics(&self, dataset: &Dataset) -> Result<Option<Graphics<'_>>, GraphicsError> {
        let both = self.object.as_ref().zip(self.graphics);
        both.map(|(object, spec)| Graphics::new(dataset, object, spec.rate)).transpose()
    }
}
