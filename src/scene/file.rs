//! The tables of a scene file, and what holds between them.

use super::check::Checker;
use super::contact::ContactTable;
use super::graphics::GraphicsEntry;
use super::grid::GridTable;
use super::object::ObjectTable;
use super::proxy::ProxyTable;
use super::scan::ScanTable;
use super::{DeviceSpec, GraphicsSpec, HapticsSpec, Interpolation, MotionSpec, Rendering, ScanScene, Scene, shape};
use crate::Error;
use crate::names;
use serde::Deserialize;
use std::mem::take;

/// A scene file as it is written. Unknown keys are refused with the list of the known ones.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SceneTable {
    pub name: Option<String>,
    pub object: Option<ObjectTable>,
    pub proxy: ProxyTable,
    pub contact: Option<ContactTable>,
    pub grid: Option<GridTable>,
    pub scan: Option<ScanTable>,
    #[serde(default)]
    pub haptics: HapticsSpec,
    pub graphics: Option<GraphicsEntry>,
    #[serde(default)]
    pub motion: MotionSpec,
    #[serde(default)]
    pub device: DeviceSpec,
}

/// Validates `table`, read from the checker's text, as a scene with a virtual object.
pub(super) fn scene(checker: &Checker<'_>, mut table: SceneTable) -> Result<Scene, Error> {
    let rendering = rendering(checker, &mut table)?;
    let (Some(object), Some(contact)) = (rendering.object, table.contact) else {
        let message = "the scene needs [object] and [contact] to be baked; a scene of a real object, with [scan], is \
                       haptized by `haptize scan`";
        return Err(checker.error(0..0, message));
    };
    let Rendering { path, text, name, proxy, haptics, graphics, motion, .. } = rendering;
    let grid = table.grid.map(|grid| grid.check(checker, "grid", &proxy.joints)).transpose()?.unwrap_or_default();
    let contact = contact.check(checker, &proxy)?;
    Ok(Scene { path, text, name, object, contact, grid, haptics, graphics, motion, proxy })
}

/// Validates `table` as a scene with a real object.
pub(super) fn scan_scene(checker: &Checker<'_>, mut table: SceneTable) -> Result<ScanScene, Error> {
    let Some(scan) = table.scan.take() else {
        let message = "the scene has no [scan]: it says nothing of how a real object is haptized; a virtual one is \
                       haptized by `haptize bake`";
        return Err(checker.error(0..0, message));
    };
    let Rendering { text, name, proxy, haptics, device, .. } = rendering(checker, &mut table)?;
    for (named, key) in
        [(haptics.friction.is_some(), "haptics.friction"), (haptics.relaxation.is_some(), "object.relaxation")]
    {
        if named {
            let message = "what a real object holds back and remembers is identified from [scan.history], not named: leave \
                           it out";
            return Err(checker.at(key, message));
        }
    }
    Ok(ScanScene { text, name, scan: scan.check(checker, &proxy)?, device, proxy })
}

/// Why a torque that is interpolated alone does not relax.
pub const LINEAR_RELAXATION: &str = "relaxation acts on the root of the object's energy, of which interpolation = \"linear\" is not the gradient, and \
     would give energy from nowhere: leave relaxation out, or set interpolation = \"potential\" in [haptics] for a \
     virtual object";

/// Validates what rendering needs of `table`, and takes it.
pub(super) fn rendering(checker: &Checker<'_>, table: &mut SceneTable) -> Result<Rendering, Error> {
    let proxy = table.proxy.check(checker)?;
    let joints = &proxy.joints;
    let mut object = take(&mut table.object);
    let is_measured = table.contact.is_none() && object.as_ref().is_some_and(ObjectTable::is_measured);
    let relaxation = object.as_mut().and_then(|object| object.relaxation.take());
    let relaxation = relaxation.map(|relaxation| relaxation.check(checker)).transpose()?;
    let object = object.filter(|_| !is_measured).map(|object| object.check(checker)).transpose()?;
    // A virtual object is drawn unless the scene says no; a real one moves by no forces that are known.
    let graphics = match table.graphics {
        Some(GraphicsEntry::Loop(graphics)) => Some(graphics),
        None => object.is_some().then(GraphicsSpec::default),
        Some(GraphicsEntry::Off) => None,
    };
    graphics.map_or(Ok(()), |graphics| graphics.check(checker, object.as_ref()))?;
    let mut haptics = take(&mut table.haptics);
    // What a solved dataset holds is the gradient of an energy; a measured one has an energy where it was learnt how the
    // object relaxes.
    if !(checker.has("haptics.interpolation") || is_measured || object.is_some() && table.contact.is_some()) {
        haptics.interpolation = Interpolation::Linear;
    }
    if relaxation.is_some() && !haptics.interpolation.is_potential() {
        return Err(checker.at("object.relaxation", LINEAR_RELAXATION));
    }
    haptics.relaxation = relaxation;
    haptics.check(checker, joints)?;
    let (motion, device) = (take(&mut table.motion), take(&mut table.device));
    motion.check(checker, joints)?;
    device.check(checker, &proxy)?;
    if let Some(name) = &table.name {
        names::check(name).map_err(|why| checker.at("name", why))?;
    }
    let file_stem = checker.path.file_stem().map(|stem| names::escaped(&stem.to_string_lossy()).into_owned());
    Ok(Rendering {
        path: checker.path.to_owned(),
        text: checker.text.to_owned(),
        name: take(&mut table.name).or(file_stem).unwrap_or_default(),
        object,
        haptics,
        graphics,
        motion,
        device,
        shapes: shape::check(checker, take(&mut table.proxy.shape), &proxy)?,
        proxy,
    })
}
