//! Equilibria solved directly, wherever they are asked for: what a program calls that has no dataset, or wants to check
//! one.

use super::{Inspection, build_object, region::sampled, shaped_object};
use crate::{
    Error, JointVector,
    contact::{Model, Solvers, Status},
    error,
    field::check_rows,
    names::counted,
    object::Object,
    proxy::Chain,
    scene::Scene,
};

self_cell::self_cell!(
    struct Prepared {
        owner: (Object, Chain),
        #[covariant]
        dependent: Model,
    }
);

/// A scene, ready to be solved at any configuration. Threads can share it.
pub struct Direct(Prepared);

impl Direct {
    /// Builds object and proxy of `scene`. Of an object with more than [`Model::WHOLE`] surface nodes only those are
    /// prepared that the proxy reaches within the scene's grid; a configuration that reaches farther is
    /// [`Status::Overflow`].
    ///
    /// # Errors
    /// When the object cannot be built.
    pub fn new(scene: &Scene) -> Result<Self, Error> {
        Self::of(scene, build_object(scene)?)
    }

    /// The same with the `object` of the scene, which was built before.
    ///
    /// # Errors
    /// When its compliance cannot be formed.
    pub fn of(scene: &Scene, object: Object) -> Result<Self, Error> {
        Self::sampled(scene, object).map(|(direct, _)| direct)
    }

    /// The same, and configurations that stand for all that it is prepared for.
    pub(crate) fn sampled(scene: &Scene, object: Object) -> Result<(Self, Vec<JointVector>), Error> {
        let mut configurations = Vec::new();
        let prepared = Prepared::try_new((object, Chain::new(&scene.proxy)), |(object, chain)| {
            let (model, sample) = sampled(scene, object, chain)?;
            configurations = sample;
            Ok::<_, Error>(model)
        })?;
        Ok((Self(prepared), configurations))
    }

    /// Object and proxy of `scene` without a compliance: for who asks where they are, and solves nothing yet.
    ///
    /// # Errors
    /// When the object is refused.
    pub fn at_rest(scene: &Scene) -> Result<Self, Error> {
        let parts = (shaped_object(scene)?, Chain::new(&scene.proxy));
        Prepared::try_new(parts, |(object, chain)| Model::reaching(object, chain, scene.contact, &[])).map(Self)
    }

    /// The object and the proxy, prepared.
    #[must_use]
    pub fn model(&self) -> &Model<'_> {
        self.0.borrow_dependent()
    }

    /// Number of joints d.
    #[must_use]
    pub fn joints(&self) -> usize {
        self.model().chain.joints.len()
    }

    /// The equilibrium at `q` in full, one coordinate a joint (rad or m).
    ///
    /// # Errors
    /// When `q` is no configuration.
    pub fn inspect(&self, q: &[f64]) -> Result<Inspection, Error> {
        let (found, joints) = (q.len(), self.joints());
        if found != joints {
            return Err(error!(
                "{} given for a proxy of {}",
                counted(found, ["coordinate was", "coordinates were"]),
                counted(joints, ["joint", "joints"])
            ));
        }
        check_rows(q, joints)?;
        Inspection::new(self.model(), q)
    }

    /// Torques and statuses of many configurations, joint fastest as they are, on all cores (N m or N). Each is solved
    /// from rest; where there are several equilibria, a bake may have found a lower one from neighbouring grid points.
    ///
    /// # Errors
    /// When `configurations` are not whole rows of finite numbers.
    pub fn torques(&self, configurations: &[f64]) -> Result<(Vec<f64>, Vec<Status>), Error> {
        let joints = self.joints();
        check_rows(configurations, joints)?;
        let rows: Vec<&[f64]> = configurations.chunks_exact(joints).collect();
        let solvers = Solvers::new(self.model(), rayon::current_num_threads());
        let solved = solvers.map(&rows, |solver, q| {
            let equilibrium = solver.solve(q);
            (equilibrium.torque, equilibrium.status)
        });
        let torques = solved.iter().flat_map(|(torque, _)| torque.iter().copied()).collect();
        Ok((torques, solved.into_iter().map(|(_, status)| status).collect()))
    }
}
