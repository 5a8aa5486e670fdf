//! Everything that a dataset's rendering needs, built from the dataset alone: its scene's text gives chain and gains,
//! its surface the object. A scene that is solved live is rendered like a dataset in which nothing is stored; the dataset of
//! a real object with its twin has the surface and the object of the twin.

use super::{
    graphics::{ContactForces, Graphics},
    haptic::Haptics,
    live::LiveScene,
    npmi::Npmi,
    own_motion,
    passivity::{self, Advice, Bound},
    session::Plan,
    source::TorqueSource,
    twinned::TwinnedField,
};
use crate::{
    Error, JointVector,
    dataset::{Dataset, Grid, JointLabel},
    device::{Motion, SimulatedHand},
    error,
    field::{TorqueField, range::HaptizedRange},
    names::counted,
    object::Object,
    proxy::Chain,
    scene::{
        BOUNDARY_SLOPE, Checker, HapticsSpec, Interpolation, LEVER_ARM, LINEAR_RELAXATION, ProxyInertia, Rendering,
        THRESHOLD,
    },
};
use std::{collections::BTreeMap, sync::Arc};

/// A dataset, ready to be felt and drawn.
pub struct Setup {
    /// The dataset's scene.
    pub scene: Rendering,
    /// The proxy.
    pub chain: Chain,
    /// The haptic loop, which threads can share.
    pub haptics: Arc<Haptics>,
    /// The object; absent where the scene has no graphics or the dataset no surface.
    pub object: Option<Object>,
    /// All passivity bounds of the scene's gains.
    pub bounds: Vec<Bound>,
    /// Those that are exceeded.
    pub exceeded: Vec<Bound>,
    /// A warning about the gains, with values that would be passive; absent if all bounds hold.
    pub advice: Option<Advice>,
    /// The motions that the scene does not name, made from the dataset's own contact.
    pub made_motions: Vec<&'static str>,
}

impl Setup {
    /// Builds all that rendering `dataset` needs.
    ///
    /// # Errors
    /// When the dataset has no valid scene, or its parts do not fit.
    pub fn new(dataset: &Dataset) -> Result<Self, Error> {
        Self::of(dataset, None)
    }

    /// The same for a scene that is solved in every tick, and its [dataset](LiveScene::dataset).
    ///
    /// # Errors
    /// As [`Setup::new`].
    pub fn live(scene: Arc<LiveScene>, dataset: &Dataset) -> Result<Self, Error> {
        Self::of(dataset, Some(TorqueSource::Live(scene)))
    }

    /// The same for `dataset`, of a real object, [beside](LiveScene::beside) its twin: that moves in the picture, and
    /// answers where nothing was measured.
    ///
    /// # Errors
    /// As [`Setup::new`], or when the dataset holds no energy.
    pub fn twinned(twin: Arc<LiveScene>, dataset: &Dataset) -> Result<Self, Error> {
        Self::of(dataset, Some(TwinnedField::new(dataset, twin)?.into()))
    }

    fn of(dataset: &Dataset, source: Option<TorqueSource>) -> Result<Self, Error> {
        if dataset.scene.trim().is_empty() {
            return Err(
                "the dataset holds no scene, so that its arm and gains are not known: gridize it again with --scene ARM.toml, \
                 a scene whose [[proxy.joint]] are the joints of the log in their order, or bake one"
                    .into(),
            );
        }
        let mut scene = scene_of(dataset)?;
        let chain = Chain::new(&scene.proxy);
        let (grid, joints) = (dataset.grid.joints(), chain.joints.len());
        if grid != joints {
            return Err(error!(
                "the dataset's grid has {} and the proxy of its scene {}: bake it again",
                counted(grid, ["axis", "axes"]),
                counted(joints, ["joint", "joints"])
            ));
        }
        dataset.check_scene().map_err(|what| error!("the dataset contradicts itself: {what}: bake it again"))?;
        let made_motions = own_motion::add(&mut scene, dataset);
        let is_live = source.is_some();
        // What is solved in every tick is drawn: its stiffness is factorised once.
        let solved = source.as_ref().and_then(TorqueSource::live).map(|live| live.direct().model().object.clone());
        if let Some(TorqueSource::Twinned(field)) = &source {
            let twin = field.twin().scene();
            (scene.object, scene.graphics) = (Some(twin.object.clone()), twin.graphics);
        }
        let Loop { haptics, bounds, gains, advice } = haptic_loop(dataset, &chain, &scene, &scene.haptics, source)?;
        // From here on the gains are as any others.
        scene.haptics = HapticsSpec { proxy_damping_is_free: false, ..gains };
        let exceeded = bounds.iter().filter(|bound| bound.is_exceeded()).cloned().collect();
        let is_known = is_live || ContactForces::known(dataset);
        let object = match (&scene.object, &scene.graphics, &dataset.surface) {
            (Some(object), Some(_), Some(surface)) if is_known => {
                let object = solved.map_or_else(|| surface.object(object), Ok);
                Some(object.map_err(|error| error.within("the object in the dataset"))?)
            }
            _ => match scene.graphics.and_then(|graphics| graphics.effects.named()) {
                Some(effect) => {
                    return Err(error!(
                        "the scene in the dataset: {effect} acts on the object that contact forces move, and the dataset \
                         does not hold the contact forces and the surface of one: bake a virtual object again with this \
                         scene, or leave {effect} out"
                    ));
                }
                None => None,
            },
        };
        let haptics = Arc::new(haptics);
        Ok(Self { scene, chain, haptics, object, bounds, exceeded, advice, made_motions })
    }

    /// Returns the haptic loop of `dataset`, from which this was made, with `gains` in the place of the scene's; and
    /// what is wrong with them where they are beyond their passivity bounds.
    ///
    /// # Errors
    /// When they do not make a loop.
    pub fn retuned(&self, dataset: &Dataset, gains: &HapticsSpec) -> Result<(Haptics, Option<Advice>), Error> {
        let source = self.haptics.source().whatever_gains();
        let Loop { haptics, advice, .. } = haptic_loop(dataset, &self.chain, &self.scene, gains, source)?;
        Ok((haptics, advice))
    }

    /// Puts gains that are passive in the place of those of the scene that are not, for `dataset`, from which this was
    /// made. Returns these, as a scene has them.
    ///
    /// # Errors
    /// When no coupling is passive with this device.
    pub fn make_passive(&mut self, dataset: &Dataset) -> Result<Vec<String>, Error> {
        let Some(Advice { passive, changes, .. }) = self.advice.take() else { return Ok(Vec::new()) };
        let Some(gains) = passive else {
            return Err("no stiffness of the coupling is passive: write the damping of the device in the scene, \
                        [haptics] device_damping"
                .into());
        };
        let source = self.haptics.source().whatever_gains();
        let Loop { haptics, bounds, gains, advice: left } =
            haptic_loop(dataset, &self.chain, &self.scene, &gains, source)?;
        self.exceeded = bounds.iter().filter(|bound| bound.is_exceeded()).cloned().collect();
        (self.haptics, self.bounds, self.scene.haptics, self.advice) = (Arc::new(haptics), bounds, gains, left);
        Ok(changes)
    }

    /// A simulated device in a hand that follows `motion`.
    ///
    /// # Errors
    /// When motion and device do not fit.
    pub fn hand(&self, motion: Motion) -> Result<SimulatedHand, Error> {
        SimulatedHand::new(&self.scene.haptics, motion)
    }

    /// The graphics loop of `dataset`, from which this was made; absent where the scene has none.
    ///
    /// # Errors
    /// When the dataset's contact forces do not fit the object.
    pub fn graphics(&self, dataset: &Dataset) -> Result<Option<Graphics<'_>>, Error> {
        match (&self.object, &self.scene.graphics, self.contact_forces(dataset)?) {
            (Some(object), Some(graphics), Some(forces)) => {
                Ok(Some(Graphics::new(forces, object, graphics, self.scene.haptics.relaxation.as_ref())?))
            }
            _ => Ok(None),
        }
    }

    /// The contact forces on the object that is drawn; absent where there is none.
    ///
    /// # Errors
    /// When the dataset's do not fit the object.
    pub fn contact_forces(&self, dataset: &Dataset) -> Result<Option<ContactForces>, Error> {
        let Some(object) = &self.object else { return Ok(None) };
        Ok(Some(match self.haptics.source().live() {
            Some(scene) => ContactForces::live(Arc::clone(scene)),
            None => ContactForces::new(dataset, object.rest.len())?,
        }))
    }

    /// A session of `seconds`, with `snapshots` shapes of the object spread evenly over it.
    #[must_use]
    pub fn plan(&self, dataset: &Dataset, seconds: f64, snapshots: usize) -> Plan {
        Plan::new(labels(&dataset.grid), self.haptics.period(), seconds, snapshots)
    }
}

/// Returns the torque field of `dataset` as its scene has it felt, or interpolated as `interpolation` says. A dataset
/// without a scene, of measurements, has the defaults of one: linear, [`THRESHOLD`], [`BOUNDARY_SLOPE`].
///
/// # Errors
/// When its scene is not valid, or the dataset lacks what the interpolation needs.
pub fn field(dataset: &Dataset, interpolation: Option<Interpolation>) -> Result<TorqueField, Error> {
    let (scene, threshold, slope);
    if dataset.scene.trim().is_empty() {
        let mut slopes = JointVector::zeros(dataset.grid.joints());
        let axes = slopes.iter_mut().zip(&dataset.grid.axes);
        axes.for_each(|(slope, axis)| {
            *slope = if axis.unit == "m" { BOUNDARY_SLOPE / (LEVER_ARM * LEVER_ARM) } else { BOUNDARY_SLOPE };
        });
        (scene, threshold, slope) = (Interpolation::Linear, THRESHOLD, slopes);
    } else {
        let haptics = scene_of(dataset)?.haptics;
        (scene, threshold, slope) = (haptics.interpolation, haptics.threshold, haptics.boundary_slope);
    }
    TorqueField::interpolated(dataset, interpolation.unwrap_or(scene), threshold, &slope)
}

/// The scene in `dataset`.
fn scene_of(dataset: &Dataset) -> Result<Rendering, Error> {
    Rendering::parse(&dataset.scene, "scene").map_err(|error| error.within(IN_DATASET))
}

/// The error of a scene in a dataset that names at `key` what cannot act.
fn refused(scene: &Rendering, key: &str, message: String) -> Error {
    Checker { path: &scene.path, text: &scene.text }.at(key, message).within(IN_DATASET)
}

/// Where such a scene stands.
const IN_DATASET: &str = "the scene in the dataset";

/// A haptic loop and what is known of its gains.
struct Loop {
    haptics: Haptics,
    bounds: Vec<Bound>,
    /// As they were given, those left to the dataset chosen.
    gains: HapticsSpec,
    advice: Option<Advice>,
}

/// Makes the haptic loop over `source`, by default the field of `dataset`, with `gains` in the place of those of its
/// `scene`.
fn haptic_loop(
    dataset: &Dataset,
    chain: &Chain,
    scene: &Rendering,
    gains: &HapticsSpec,
    source: Option<TorqueSource>,
) -> Result<Loop, Error> {
    let (source, range) = match source {
        Some(source) => {
            let range = HaptizedRange::of_grid(source.grid());
            (source, range)
        }
        None => {
            let HapticsSpec { interpolation, threshold, boundary_slope, .. } = gains;
            let field = TorqueField::interpolated(dataset, *interpolation, *threshold, boundary_slope)?;
            (field.into(), HaptizedRange::new(dataset, chain)?)
        }
    };
    let gains = if gains.proxy_damping_is_free { passivity::damped(gains, &source) } else { gains.clone() };
    let npmi = match gains.proxy_inertia {
        ProxyInertia::Configuration => Npmi::of_chain(chain)?,
        ProxyInertia::Constant => {
            let mut pose = chain.new_pose();
            chain.pose(&centre(&dataset.grid), &mut pose);
            let limits: Vec<[f64; 2]> = chain.joints.iter().map(|joint| joint.limits).collect();
            Npmi::new(&chain.inertia(&pose), &limits)?
        }
    };
    let bounds = passivity::bounds(&gains, &source, &labels(&dataset.grid));
    let advice = passivity::advice(&gains, &source, &bounds);
    if gains.relaxation.is_some() && !source.is_potential() {
        return Err(refused(scene, "object.relaxation", LINEAR_RELAXATION.to_owned()));
    }
    if gains.uses_slip() && !source.has_slip() {
        let (name, place) = match gains.friction {
            Some(_) => ("friction", "haptics.friction"),
            None => ("dent", "object.relaxation.dent"),
        };
        let message = format!(
            "{name} needs to know how contacts slip, which the dataset does not hold: bake a virtual object again with \
             this scene; scan a real one with strokes aside ([scan.history]), or leave {name} out"
        );
        return Err(refused(scene, place, message));
    }
    let haptics = Haptics::new(source, npmi, &gains)?.with_range(range);
    Ok(Loop { haptics, bounds, gains, advice })
}

/// Names and units of the grid's joints.
#[must_use]
pub fn labels(grid: &Grid) -> Vec<JointLabel> {
    grid.axes.iter().map(|axis| JointLabel { name: axis.name.clone(), unit: axis.unit.clone() }).collect()
}

/// Returns the stiffness with which the device is held at the border of the haptized range, that of the coupling (Kvc),
/// in words: one for each unit, or one for each joint where joints of a unit differ.
#[must_use]
pub fn border_stiffness(gains: &HapticsSpec, grid: &Grid) -> String {
    let mut of_units = BTreeMap::new();
    let mut alike = true;
    let of_joints = gains.coupling_stiffness.iter().zip(&grid.axes).map(|(stiffness, axis)| {
        let unit = format!("{}/{}", axis.effort_unit(), axis.unit);
        alike &= *of_units.entry(unit.clone()).or_insert(*stiffness) == *stiffness;
        format!("{} {stiffness} {unit}", axis.name)
    });
    let of_joints: Vec<String> = of_joints.collect();
    if alike {
        of_units.iter().map(|(unit, stiffness)| format!("{stiffness} {unit}")).collect::<Vec<_>>().join(", ")
    } else {
        of_joints.join(", ")
    }
}

fn centre(grid: &Grid) -> JointVector {
    let mut q = JointVector::zeros(grid.joints());
    for (q, axis) in q.iter_mut().zip(&grid.axes) {
        *q = 0.5 * (axis.start + axis.last());
    }
    q
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::grids::{grid, half_space};

    #[test]
    fn the_borders_stiffness_is_told_once_where_joints_are_alike() {
        let mut grid = grid(&[(-0.6, 0.1, 13), (-0.06, 0.01, 13), (0.0, 0.1, 2)]);
        let scene = Rendering::parse(include_str!("../../datasets/sphere.toml"), "scene").unwrap();
        let mut gains = scene.haptics;
        gains.coupling_stiffness = JointVector::from_slice(&[20.0, 20.0, 2000.0]);
        for (axis, name) in grid.axes.iter_mut().zip(["yaw", "pitch", "lift"]) {
            axis.name = name.into();
        }
        grid.axes[2].unit = "m".into();
        assert_eq!(border_stiffness(&gains, &grid), "20 N m/rad, 2000 N/m");
        gains.coupling_stiffness[1] = 10.0;
        assert_eq!(border_stiffness(&gains, &grid), "yaw 20 N m/rad, pitch 10 N m/rad, lift 2000 N/m");
    }

    #[test]
    fn a_dataset_without_a_scene_is_felt_with_the_defaults() {
        let mut data = half_space(grid(&[(-0.6, 0.1, 13), (-0.06, 0.01, 13)]), 5.0);
        data.grid.axes[1].unit = "m".into();
        let slopes = JointVector::from_slice(&[BOUNDARY_SLOPE, 100.0 * BOUNDARY_SLOPE]);
        let (found, expected) = (
            field(&data, None).unwrap(),
            TorqueField::interpolated(&data, Interpolation::Linear, THRESHOLD, &slopes).unwrap(),
        );
        assert_eq!(found.sample(&[0.33, 0.033]), expected.sample(&[0.33, 0.033]));
        assert!(found.sample(&[0.33, 0.033]).contact);
        assert!(field(&data, Some(Interpolation::Potential)).unwrap().is_potential());
        data.scene = "not a scene".into();
        assert_eq!(field(&data, None).err().map(|error| error.kind()), Some(crate::ErrorKind::Scene));
    }
}
