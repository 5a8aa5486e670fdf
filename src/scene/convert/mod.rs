//! From the tables of a scene file to a validated [`Scene`]: defaults filled, every number checked, one file per table.

mod haptics;
mod object;
mod proxy;
mod shape;
mod skin;

use super::check::Checker;
use super::error::SceneError;
use super::file::{ContactTable, NumberOr, SceneTable};
use super::graphics::GraphicsEntry;
use super::{
    Algorithm, ContactSpec, ContactSurface, GraphicsSpec, Interpolation, ProxySpec, Rendering, ScanScene, Scene,
};
use crate::names;
use std::mem::take;
use toml::Spanned;

/// Default relative residual of the contact solver, in the energy norm (1). Forces are promised to balance K u to 1e-6
/// of the largest, node by node, which a residual of 1e-6 misses by a third; the last steps converge fast, so two
/// digits more cost 8 % more iterations on the sphere (5.1 to 5.5).
const CONTACT_TOLERANCE: f64 = 1e-8;
/// Default cap on the contact solver's iterations (1).
const CONTACT_ITERATIONS: u32 = 400;

/// Validates `table`, read from the checker's text, as a scene with a virtual object.
pub(super) fn scene(checker: &Checker<'_>, mut table: SceneTable) -> Result<Scene, SceneError> {
    let rendering = rendering(checker, &mut table)?;
    let (Some(object), Some(contact_table)) = (rendering.object, table.contact) else {
        let message = "the scene needs [object] and [contact] to be baked; a scene of a real object, with [scan], is \
                       haptized by `haptize scan`";
        return Err(checker.error(0..0, message));
    };
    let Rendering { path, text, name, proxy, haptics, graphics, motion, .. } = rendering;
    let grid = table.grid.map(|grid| grid.check(checker, "grid", &proxy.joints)).transpose()?.unwrap_or_default();
    let contact = contact(checker, &contact_table, &proxy)?;
    Ok(Scene { path, text, name, object, contact, grid, haptics, graphics, motion, proxy })
}

/// Validates `table` as a scene with a real object.
pub(super) fn scan_scene(checker: &Checker<'_>, mut table: SceneTable) -> Result<ScanScene, SceneError> {
    let Some(scan) = table.scan.take() else {
        let message = "the scene has no [scan]: it says nothing of how a real object is haptized; a virtual one is \
                       haptized by `haptize bake`";
        return Err(checker.error(0..0, message));
    };
    let Rendering { text, name, proxy, haptics, device, .. } = rendering(checker, &mut table)?;
    if let Some((effect, place)) = haptics.effects.at_contacts() {
        let message = format!("{effect} needs the contact forces, which a real object does not tell: leave it out");
        return Err(checker.error(place.clone(), message));
    }
    Ok(ScanScene { text, name, scan: scan.check(checker, &proxy)?, device, proxy })
}

/// Validates what rendering needs of `table`, and takes it.
pub(super) fn rendering(checker: &Checker<'_>, table: &mut SceneTable) -> Result<Rendering, SceneError> {
    let proxy = proxy::convert(checker, &table.proxy)?;
    let joints = &proxy.joints;
    let object = table.object.as_ref().map(|object| object::convert(checker, object)).transpose()?;
    // A virtual object is drawn unless the scene says no; a real one moves by no forces that are known.
    let graphics = match table.graphics {
        Some(GraphicsEntry::Loop(graphics)) => Some(graphics),
        None => object.is_some().then(GraphicsSpec::default),
        Some(GraphicsEntry::Off) => None,
    };
    graphics.map_or(Ok(()), |graphics| graphics.check(checker, object.as_ref()))?;
    // What a solved dataset holds is the gradient of an energy, but for the paper's iteration; a measured one has no
    // energy.
    let solved = table.contact.as_ref().is_some_and(|own| own.get_ref().algorithm != Some(Algorithm::Paper));
    let interpolation = if object.is_some() && solved { Interpolation::Potential } else { Interpolation::Linear };
    let (motion, device) = (take(&mut table.motion), take(&mut table.device));
    motion.check(checker, joints)?;
    device.check(checker, &proxy)?;
    if let Some(name) = &table.name {
        names::check(name.get_ref()).map_err(|why| checker.error(name.span(), why))?;
    }
    let file_stem = checker.path.file_stem().map(|stem| names::escaped(&stem.to_string_lossy()).into_owned());
    Ok(Rendering {
        path: checker.path.to_owned(),
        text: checker.text.to_owned(),
        name: table.name.as_ref().map(|name| name.get_ref().clone()).or(file_stem).unwrap_or_default(),
        object,
        haptics: haptics::convert(checker, &table.haptics, joints, interpolation)?,
        graphics,
        motion,
        device,
        shapes: shape::convert(checker, &table.proxy.shape, joints)?,
        proxy,
    })
}

/// Most updates of linearised contact (1): far more than where it settles, and still milliseconds for a configuration.
const MAX_UPDATES: u32 = 1000;

fn updates(checker: &Checker<'_>, table: &ContactTable) -> Result<u32, SceneError> {
    let Some(value) = &table.updates else { return Ok(0) };
    if table.algorithm != Some(Algorithm::Linearised) {
        let reason = "updates acts on linearised contact, whose geometry is frozen: \
                      add algorithm = \"linearised\", or leave it out";
        return Err(checker.error(value.span(), reason));
    }
    if *value.get_ref() > MAX_UPDATES {
        let reason = format!(
            "updates is {}: it must be at most {MAX_UPDATES}; where it does not settle with fewer, take algorithm \
             = \"energy\"",
            value.get_ref()
        );
        return Err(checker.error(value.span(), reason));
    }
    Ok(*value.get_ref())
}

/// Kc of a node (N/m), that of the mean node where the scene gives the stiffness of links per length, and that (N/m^2).
fn stiffness(
    checker: &Checker<'_>,
    table: &Spanned<ContactTable>,
    proxy: &ProxySpec,
) -> Result<(f64, Option<f64>), SceneError> {
    let span = table.span();
    let table = table.get_ref();
    let per_length = table.stiffness_per_length.as_ref();
    let per_length = per_length.map(|value| checker.positive("stiffness_per_length", value)).transpose()?;
    let lengths: Vec<f64> = proxy.joints.iter().flat_map(|joint| &joint.nodes).map(|node| node.length).collect();
    match (&table.stiffness, per_length) {
        (Some(value), None) => match value.get_ref() {
            NumberOr::Number(number) => {
                Ok((checker.positive("stiffness", &Spanned::new(value.span(), *number))?, None))
            }
            NumberOr::Word(_) => Ok((f64::INFINITY, None)),
        },
        (Some(value), Some(_)) => {
            let message = "contact has a stiffness of each node and one per length: leave out one of them";
            Err(checker.error(value.span(), message))
        }
        (None, Some(_)) if lengths.contains(&0.0) => {
            let message = "stiffness_per_length is of nodes along links, and the proxy has nodes { at = .. } besides: \
                           give stiffness [N/m] of each node instead";
            Err(checker.error(span, message))
        }
        (None, Some(per_length)) => {
            let mean = lengths.iter().sum::<f64>() / lengths.len() as f64;
            Ok((per_length * mean / 3.0, Some(per_length)))
        }
        (None, None) => {
            let message = "contact has no stiffness: add stiffness [N/m] of each node, or \"rigid\", or \
                           stiffness_per_length [N/m^2] of links";
            Err(checker.error(span, message))
        }
    }
}

fn contact(checker: &Checker<'_>, table: &Spanned<ContactTable>, proxy: &ProxySpec) -> Result<ContactSpec, SceneError> {
    let (stiffness, stiffness_per_length) = stiffness(checker, table, proxy)?;
    let table = table.get_ref();
    let tolerance = table.tolerance.as_ref().map(|value| checker.between("tolerance", value, 0.0, 1.0));
    let max_iterations = match &table.max_iterations {
        Some(value) if *value.get_ref() == 0 => {
            return Err(checker.error(value.span(), "max_iterations is 0: it must be at least 1"));
        }
        Some(value) => *value.get_ref(),
        None => CONTACT_ITERATIONS,
    };
    let algorithm = table.algorithm.unwrap_or(Algorithm::Energy);
    if let Some(value) = &table.surface
        && *value.get_ref() == ContactSurface::Smooth
        && algorithm == Algorithm::Paper
    {
        let message = "the algorithm \"paper\" is defined on the triangles: leave surface out, or take \"energy\"";
        return Err(checker.error(value.span(), message));
    }
    let balls = proxy.joints.iter().flat_map(|joint| &joint.nodes).any(|node| node.radius > 0.0);
    if let Some(value) = &table.surface
        && *value.get_ref() == ContactSurface::Facets
        && algorithm != Algorithm::Paper
        && balls
    {
        let message = "nodes with a radius do not balance where the closest triangle changes: leave surface out, and \
                       they touch the smooth surface";
        return Err(checker.error(value.span(), message));
    }
    let default = if algorithm == Algorithm::Paper { ContactSurface::Facets } else { ContactSurface::Smooth };
    Ok(ContactSpec {
        stiffness,
        stiffness_per_length,
        algorithm,
        tolerance: tolerance.unwrap_or(Ok(CONTACT_TOLERANCE))?,
        max_iterations,
        updates: updates(checker, table)?,
        surface: table.surface.as_ref().map_or(default, |value| *value.get_ref()),
    })
}
