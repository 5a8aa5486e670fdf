//! The scene file: what is haptized, with what, how finely, and how it is rendered.
//!
//! A scene is TOML. [`Scene::load`] parses it, fills defaults and validates every number; an error points at the
//! file, the line and the remedy. All quantities are SI: metres, radians, newtons, kilograms, seconds.

mod check;
mod contact;
mod device;
mod edit;
mod effects;
mod effort;
mod file;
mod gains;
mod graphics;
mod grid;
mod haptics;
mod inertia;
mod motion;
mod object;
mod own_text;
mod proxy;
mod relaxation;
mod scan;
mod shape;
mod skin;
pub(crate) mod text;
mod value;

pub use contact::{ContactLaw, ContactSpec, ContactSurface};
pub use device::DeviceSpec;
pub use edit::SceneText;
pub use effects::{EFFECTS, Effect, Tuning};
pub use effort::{EffortNorm, NormUnit, effort_norms, effort_unit, efforts};
pub(crate) use file::LINEAR_RELAXATION;
pub use graphics::{GraphicsEffects, GraphicsSpec, StiffeningSpec};
pub use grid::{AxisSpec, GRID_LINE, GRID_STEP_SLACK, GridSpec};
pub use haptics::{
    BOUNDARY_SLOPE, FourChannelSpec, FrictionSpec, GREATEST_INTERVAL, HandSpec, HapticsSpec, Interpolation, LEVER_ARM,
    ProxyInertia, THRESHOLD,
};
pub use motion::{MotionSpec, Waypoint};
pub use object::{
    ElasticSpec, GroundNodes, GroundSpec, GroundStiffness, InclusionPlace, InclusionSpec, Material, ObjectSpec,
    Placement, Shape, SpringKind, SpringSpec,
};
pub use proxy::{Follower, Follows, JointKind, JointSpec, MAX_CONTACT_NODES, ProxyNodeSpec, ProxySpec};
pub use relaxation::{MOST_TERMS, RelaxationSpec};
pub use scan::{
    Cover, HistorySpec, PlanAxis, PlanSpec, ScanControl, ScanLimits, ScanSpec, SpecimenSpec, WorkspacePlan,
};
pub use shape::{LinkForm, LinkShape, LinkSurface, MAX_SHAPES, MAX_SURFACE};
pub use skin::SkinSpec;

pub(crate) use inertia::positive_semidefinite;
#[cfg(feature = "viewer")]
pub(crate) use value::rotation;

use crate::{Error, ErrorKind, names};
pub(crate) use check::{Checker, find as find_key};
use clap::ValueEnum as _;
use std::path::{Path, PathBuf};

/// A whole scene, validated.
#[derive(Clone, Debug, PartialEq)]
pub struct Scene {
    /// Where it was read from; relative paths in it are relative to this file's folder.
    pub path: PathBuf,
    /// The text itself: stored in every dataset baked from it.
    pub text: String,
    /// For titles and lists.
    pub name: String,
    /// The deformable virtual object.
    pub object: ObjectSpec,
    /// The multi-link virtual proxy.
    pub proxy: ProxySpec,
    /// Equation (2) and how it is solved.
    pub contact: ContactSpec,
    /// Where in C-space it is solved.
    pub grid: GridSpec,
    /// The 1 kHz loop.
    pub haptics: HapticsSpec,
    /// The graphics loop. Absent where the scene says `graphics = false`: then no contact forces are stored.
    pub graphics: Option<GraphicsSpec>,
    /// Motions to play.
    pub motion: MotionSpec,
}

/// A scene with a real object, to be haptized by scanning (section 2.2): its file has `[scan]` in the place of
/// `[object]`, `[contact]` and `[grid]`.
#[derive(Clone, Debug, PartialEq)]
pub struct ScanScene {
    /// The text itself: stored in the scan's log.
    pub text: String,
    /// For titles and lists.
    pub name: String,
    /// The device that scans, which is the proxy that feels.
    pub proxy: ProxySpec,
    /// How it scans.
    pub scan: ScanSpec,
    /// How a real device stands to the proxy.
    pub device: DeviceSpec,
}

/// The part of a scene that rendering needs, whether its object is virtual, real, or only known from a log.
#[derive(Clone, Debug, PartialEq)]
pub struct Rendering {
    /// Where it was read from.
    pub path: PathBuf,
    /// The text itself.
    pub text: String,
    /// For titles and lists.
    pub name: String,
    /// The deformable virtual object, where there is one.
    pub object: Option<ObjectSpec>,
    /// The multi-link virtual proxy.
    pub proxy: ProxySpec,
    /// The shapes that are drawn for its links.
    pub shapes: Vec<LinkShape>,
    /// The 1 kHz loop.
    pub haptics: HapticsSpec,
    /// The graphics loop, where there is one.
    pub graphics: Option<GraphicsSpec>,
    /// Motions to play.
    pub motion: MotionSpec,
    /// How a real device stands to the proxy.
    pub device: DeviceSpec,
}

impl Scene {
    /// Reads and validates the scene file at `path`, and checks that the mesh file it names is there.
    ///
    /// # Errors
    /// When a file cannot be read, or the scene is not valid; the message names the line and the remedy.
    pub fn load(path: impl AsRef<Path>) -> Result<Self, Error> {
        let path = path.as_ref();
        let text = read_text(path)?;
        let scene = Self::parse(&text, path)?;
        let (file, place) = match &scene.object.shape {
            Shape::Mesh { file, .. } => (file, "object.mesh.file"),
            Shape::Tetrahedra { file, .. } => (file, "object.tetrahedra.file"),
            Shape::Sphere { .. } | Shape::Icosphere { .. } => return Ok(scene),
        };
        if let Err(error) = std::fs::metadata(file) {
            let message =
                format!("the mesh file {} cannot be opened: {error}", names::escaped(&file.to_string_lossy()));
            return Err(Checker { path, text: &text }.at(place, message));
        }
        Ok(scene)
    }

    /// Whether `path` names a scene rather than a dataset: by its ending, `.toml`.
    #[must_use]
    pub fn is_at(path: &Path) -> bool {
        path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("toml"))
    }

    /// Whether the loop interpolates torque with its tangent d tau/d q, so that each equilibrium is to come with it.
    #[must_use]
    pub fn uses_tangent(&self) -> bool {
        self.haptics.interpolation.is_potential()
    }

    /// Validates the text of a scene. `path` is where it came from: messages name it, and relative paths in the scene
    /// are relative to its folder. No file is opened.
    ///
    /// # Errors
    /// When the scene is not valid; the message names the line and the remedy.
    pub fn parse(text: &str, path: impl AsRef<Path>) -> Result<Self, Error> {
        let checker = Checker { path: path.as_ref(), text };
        file::scene(&checker, checker.read()?)
    }

    /// The scene of a dataset: its `text`, with the law of contact by which the dataset says that it was solved.
    ///
    /// # Errors
    /// When the scene is not valid, or the law was removed; the message names the remedy.
    pub fn of_dataset(text: &str, path: impl AsRef<Path>, law: &str) -> Result<Self, Error> {
        let mut scene = Self::parse(text, &path)?;
        let law = ContactLaw::from_str(law, true).map_err(|_| {
            let message =
                format!("it was solved by `{}`, which is no law of a scene: bake it anew", crate::names::escaped(law));
            Checker { path: path.as_ref(), text }.at("contact", message)
        })?;
        scene.contact = scene.contact.by(law);
        Ok(scene)
    }
}

impl ScanScene {
    /// Reads and validates the scene file at `path`.
    ///
    /// # Errors
    /// When the file cannot be read, or has no valid `[scan]`; the message names the line and the remedy.
    pub fn load(path: impl AsRef<Path>) -> Result<Self, Error> {
        let path = path.as_ref();
        Self::parse(&read_text(path)?, path)
    }

    /// Validates the text of a scene; messages name `path`.
    ///
    /// # Errors
    /// When the scene has no valid `[scan]`; the message names the line and the remedy.
    pub fn parse(text: &str, path: impl AsRef<Path>) -> Result<Self, Error> {
        let checker = Checker { path: path.as_ref(), text };
        file::scan_scene(&checker, checker.read()?)
    }
}

impl Rendering {
    /// Reads and validates the scene file at `path`.
    ///
    /// # Errors
    /// When the file cannot be read, or the scene is not valid; the message names the line and the remedy.
    pub fn load(path: impl AsRef<Path>) -> Result<Self, Error> {
        let path = path.as_ref();
        Self::parse(&read_text(path)?, path)
    }

    /// Validates the text of a scene; messages name `path`. No file is opened.
    ///
    /// # Errors
    /// When the scene is not valid; the message names the line and the remedy.
    pub fn parse(text: &str, path: impl AsRef<Path>) -> Result<Self, Error> {
        let checker = Checker { path: path.as_ref(), text };
        file::rendering(&checker, &mut checker.read()?)
    }
}

/// The text of the scene file at `path`.
fn read_text(path: &Path) -> Result<String, Error> {
    let unreadable = |reason| Error::at(path, format_args!("cannot read the scene: {reason}")).of(ErrorKind::File);
    text::read(path).map_err(unreadable)
}
