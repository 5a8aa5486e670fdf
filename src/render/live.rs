//! Contact that is solved in every tick: the law at rest, of a scene for which nothing was baked.
//!
//! A tick has no time for more than [`LiveSolver`] bounds. Where contact is larger, or does not converge, the torque of
//! the last tick that was solved is felt on, for as long as a torque may rest on a position
//! ([`GREATEST_POSITION_AGE`](super::watchdog::GREATEST_POSITION_AGE)); then the loop fails
//! ([`Fault::Unsolved`](super::flags::Fault::Unsolved)).

use super::object_history::ObjectHistory;
use crate::{
    Error, JointMatrix, JointVector,
    contact::{Equilibrium, LiveContact, LiveSolver, Model, Slip, Solvers, Status},
    dataset::{Axis, Dataset, Grid, Surface},
    error,
    field::{Flags, Sample},
    joint_matrix::greatest_eigenvalue,
    object::Object,
    scene::{ContactLaw, EFFECTS, Effect, RelaxationSpec, Scene},
    sweep::{CpuBackend, Direct, build_object, remark_on_ripple, shallow},
};

/// Configurations at which the stiffness of the torque is looked at, spread over the grid (1). More: a steeper one is
/// found between them, at a price of a tenth of a millisecond each.
const STIFFNESS_SAMPLES: usize = 2048;

/// Lines of the grid along each joint (1): the region is all that is used of it.
const LINES: usize = 2;

/// A scene that is solved in every tick. Sessions share it.
pub struct LiveScene {
    scene: Scene,
    direct: Direct,
    grid: Grid,
    /// Tangents d tau/d q in shallow contact, over the scene's grid (N m/rad).
    tangents: Vec<JointMatrix>,
    follows: bool,
    /// Where the object remembers node by node: see [`LiveScene::remembering`].
    relaxation: Option<RelaxationSpec>,
}

impl LiveScene {
    /// Prepares `scene` with the law at rest, whatever law it names.
    ///
    /// # Errors
    /// When its object cannot be built, or its compliance cannot be formed.
    pub fn new(scene: Scene) -> Result<Self, Error> {
        let object = build_object(&scene)?;
        Self::of(scene, object)
    }

    /// The same with an object that relaxes node by node, with its whole history, and not by one number a term: the
    /// reference of the loop's own relaxation. Each sample lets a tick go by. Nothing is drawn.
    ///
    /// # Errors
    /// As [`LiveScene::new`]; when the scene names no relaxation.
    pub fn remembering(scene: &Scene) -> Result<Self, Error> {
        let Some(relaxation) = scene.haptics.relaxation.clone() else {
            return Err(error!(
                "{}: the scene names no [object.relaxation], so that its object has no memory",
                scene.path.display()
            ));
        };
        let felt = |effect: &Effect| effect.is_named(scene) && !effect.is_drawn() && effect.key != "relaxation";
        let others: Vec<Effect> = EFFECTS.into_iter().filter(felt).collect();
        Ok(Self { relaxation: Some(relaxation), ..Self::new(scene.with_effects(false, &others)?)? })
    }

    /// The same with the `object` of the scene, which was built before.
    ///
    /// # Errors
    /// When its compliance cannot be formed.
    pub fn of(mut scene: Scene, object: Object) -> Result<Self, Error> {
        let follows = scene.contact.law != ContactLaw::Rest;
        scene.contact.law = ContactLaw::Rest;
        let (direct, configurations) = Direct::sampled(&scene, object)?;
        remark_on_ripple(direct.model());
        let grid = region(&scene, direct.model().compliance.is_whole());
        let tangents = tangents(direct.model(), &configurations);
        Ok(Self { scene, direct, grid, tangents, follows, relaxation: None })
    }

    /// The scene.
    #[must_use]
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// Its object and its proxy, prepared.
    #[must_use]
    pub fn direct(&self) -> &Direct {
        &self.direct
    }

    /// The region in which the proxy stays: the joints' limits, or where the compliance is known around the scene's
    /// grid alone, that.
    #[must_use]
    pub fn grid(&self) -> &Grid {
        &self.grid
    }

    /// A dataset of its region in which nothing is stored.
    #[must_use]
    pub fn dataset(&self) -> Dataset {
        let (grid, points) = (self.grid.clone(), self.grid.points());
        let (torque, status) = (vec![0.0; points * grid.joints()], vec![Status::Outside as u8; points]);
        Dataset {
            surface: Some(Surface::of(self.direct.model().object)),
            scene: self.scene.text.clone(),
            provenance: CpuBackend::provenance(&self.scene),
            ..Dataset::bare(grid, torque, status)
        }
    }

    /// `dataset`, of the real object whose twin this is, with the surface of the twin.
    #[must_use]
    pub fn beside(&self, dataset: Dataset) -> Dataset {
        Dataset { surface: Some(Surface::of(self.direct.model().object)), ..dataset }
    }

    /// Returns what is felt other than the scene says, as a sentence without its full stop.
    #[must_use]
    pub fn notice(&self) -> Option<&'static str> {
        self.follows.then_some(
            "contact is solved live before the surface at rest, where the scene names a law that follows the \
             deformation: in deep contact the two differ by some percent; bake the scene to feel its own",
        )
    }

    /// Greatest stiffness of the torque relative to `slopes` that was seen in shallow contact at the configurations
    /// looked at: the greatest eigenvalue of `S^-1/2 H S^-1/2`, S = diag(slopes), H = -d tau/d q (1). A step of the
    /// loop errs by half of H in its direction: where that is negative, and next to a ridge of the depth it has no
    /// bound, the step takes energy.
    #[must_use]
    pub fn relative_stiffness(&self, slopes: &JointVector) -> f64 {
        let joints = slopes.len();
        let relative = |tangent: &JointMatrix| {
            let mut stiffness = JointMatrix::default();
            for (a, b) in (0..joints).flat_map(|a| (0..joints).map(move |b| (a, b))) {
                stiffness[a][b] = -0.5 * (tangent[a][b] + tangent[b][a]) / (slopes[a] * slopes[b]).sqrt();
            }
            greatest_eigenvalue(&stiffness, joints)
        };
        self.tangents.iter().map(relative).fold(0.0, f64::max)
    }
}

/// A grid of few lines over the joints' limits where contact `is_known` anywhere or the scene has no grid, else over
/// that of the scene's.
fn region(scene: &Scene, is_known: bool) -> Grid {
    let axes = scene.proxy.joints.iter().enumerate().map(|(a, joint)| {
        let ends = scene
            .grid
            .axes
            .get(a)
            .filter(|_| !is_known)
            .map(|axis| [axis.start, axis.start + axis.step * (axis.count - 1) as f64]);
        let [start, last] = ends.unwrap_or(joint.limits);
        let step = (last - start) / (LINES - 1) as f64;
        Axis { name: joint.name.clone(), unit: joint.kind.unit().into(), start, step, count: LINES }
    });
    Grid { axes: axes.collect() }
}

/// The tangents at some of `configurations`, spread over them, where there is shallow contact: next to the middle of
/// the object, where the depth has its ridges, they are as large as one is near.
fn tangents(model: &Model<'_>, configurations: &[JointVector]) -> Vec<JointMatrix> {
    let mut model = model.clone();
    model.with_tangent = true;
    let every = configurations.len().div_ceil(STIFFNESS_SAMPLES).max(1);
    let some: Vec<JointVector> = configurations.iter().step_by(every).copied().collect();
    let solvers = Solvers::new(&model, rayon::current_num_threads());
    let depth = shallow(model.object);
    let tangent = |found: Equilibrium| found.tangent.filter(|_| -found.gap <= depth);
    solvers.map(&some, |solver, q| tangent(solver.solve(q))).into_iter().flatten().collect()
}

/// The contact of a [`LiveScene`] in one session.
pub struct LiveSession<'a> {
    model: &'a Model<'a>,
    solver: LiveSolver<'a>,
    history: Option<ObjectHistory>,
    /// What was felt last, and how many ticks ago it was solved.
    felt: Sample,
    age: u32,
    slip: Slip,
}

impl<'a> LiveSession<'a> {
    /// Room for all that a session solves.
    #[must_use]
    pub fn new(scene: &'a LiveScene) -> Self {
        let model = scene.direct.model();
        let felt = Sample { torque: JointVector::zeros(model.chain.joints.len()), share: 1.0, ..Sample::default() };
        let period = 1.0 / scene.scene.haptics.rate;
        let history = scene.relaxation.as_ref().map(|spec| ObjectHistory::new(spec, period, model));
        Self { model, solver: LiveSolver::new(model), history, felt, age: 0, slip: Slip::default() }
    }

    /// Contact at `q`, and how many ticks ago it was solved. Never allocates.
    pub(super) fn sample(&mut self, q: &[f64]) -> (Sample, u32) {
        if let Some(history) = &mut self.history {
            self.solver.stand(history.standing());
        }
        let LiveContact { status, mut energy, torque, contact_nodes, .. } = self.solver.solve(q);
        if matches!(status, Status::Free | Status::Contact) {
            if let Some(history) = &mut self.history {
                energy += history.pass(self.model, &self.solver);
            }
            let contact = status == Status::Contact;
            let (index, flags) = (f64::from(u8::from(contact)), Flags::empty());
            self.felt = Sample { torque, index, contact, contact_nodes, energy, share: 1.0, twin: 0.0, flags };
            self.age = 0;
        } else {
            self.felt.flags = Flags::UNCONVERGED;
            self.age += 1;
        }
        (self.felt, self.age)
    }

    /// How the contacts slip at `q`, where contact was sampled last; as long as that is not solved, as they did before.
    /// Never allocates.
    pub(super) fn slip(&mut self, q: &[f64]) -> Slip {
        if self.age == 0 {
            self.slip = self.solver.slip(q);
        }
        self.slip
    }
}
