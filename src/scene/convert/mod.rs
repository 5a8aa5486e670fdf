//! From the tables of a scene file to a validated [`Scene`]: defaults filled, every number checked, one file per table.

mod device;
mod graphics;
mod grid;
mod haptics;
mod motion;
mod object;
mod proxy;
mod scan;
mod shape;
mod skin;

use super::check::Checker;
use super::error::SceneError;
use super::file::{ContactTable, GraphicsEntry, GraphicsTable, NumberOr, SceneTable};
use super::{Algorithm, ContactSpec, ContactSurface, GridSpec, Interpolation, ProxySpec, Rendering, ScanScene, Scene};
use crate::names;
use toml::Spanned;

/// Default relative residual of the contact solver, in the energy norm (1). Forces are promised to balance K u to 1e-6
/// of the largest, node by node, which a residual of 1e-6 misses by a third; the last steps converge fast, so two
/// digits more cost 8 % more iterations on the sphere (5.1 to 5.5).
const CONTACT_TOLERANCE: f64 = 1e-8;
/// Default cap on the contact solver's iterations (1).
const CONTACT_ITERATIONS: u32 = 400;

/// Validates `table`, read from the checker's text, as a scene with a virtual object.
pub(super) fn scene(checker: &Checker<'_>, table: &SceneTable) -> Result<Scene, SceneError> {
    let (Some(object), Some(contact_table)) = (&table.object, &table.contact) else {
        let message = "the scene needs [object] and [contact] to be baked; a scene of a real object, with [scan], is \
                       haptized by `haptize scan`";
        return Err(checker.error(0..0, message));
    };
    let Rendering { path, text, name, proxy, haptics, graphics, motion, .. } = rendering(checker, table)?;
    Ok(Scene {
        path,
        text,
        name,
        object: object::convert(checker, object)?,
        contact: contact(checker, contact_table, &proxy)?,
        grid: match &table.grid {
            Some(grid) => grid::convert(checker, grid, &proxy.joints)?,
            None => GridSpec { axes: Vec::new() },
        },
        haptics,
        graphics,
        motion,
        proxy,
    })
}

/// Validates `table` as a scene with a real object.
pub(super) fn scan_scene(checker: &Checker<'_>, table: &SceneTable) -> Result<ScanScene, SceneError> {
    let Some(scan) = &table.scan else {
        let message = "the scene has no [scan]: it says nothing of how a real object is haptized; a virtual one is \
                       haptized by `haptize bake`";
        return Err(checker.error(0..0, message));
    };
    let Rendering { text, name, proxy, haptics, device, .. } = rendering(checker, table)?;
    if let Some((effect, place)) = haptics.effects.at_contacts() {
        let message = format!("{effect} needs the contact forces, which a real object does not tell: leave it out");
        return Err(checker.error(place.clone(), message));
    }
    Ok(ScanScene { text, name, scan: scan::convert(checker, scan, &proxy)?, device, proxy })
}

/// Validates what rendering needs of `table`.
pub(super) fn rendering(checker: &Checker<'_>, table: &SceneTable) -> Result<Rendering, SceneError> {
    let proxy = proxy::convert(checker, &table.proxy)?;
    let joints = &proxy.joints;
    let object = table.object.as_ref().map(|object| object::convert(checker, object)).transpose()?;
    // A virtual object is drawn unless the scene says no; a real one moves by no forces that are known.
    let graphics = match &table.graphics {
        Some(GraphicsEntry::Loop(own)) => Some(graphics::convert(checker, own, object.as_ref())?),
        None if object.is_some() => Some(graphics::convert(checker, &GraphicsTable::default(), object.as_ref())?),
        None | Some(GraphicsEntry::Off) => None,
    };
    // What a solved dataset holds is the gradient of an energy, but for the paper's iteration; a measured one has no
    // energy.
    let is_paper =
        |own: &ContactTable| own.algorithm.as_ref().is_some_and(|named| named.get_ref() == Algorithm::Paper.name());
    let solved = table.contact.as_ref().is_some_and(|own| !is_paper(own.get_ref()));
    let interpolation = if object.is_some() && solved { Interpolation::Potential } else { Interpolation::Linear };
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
        motion: motion::convert(checker, &table.motion, joints)?,
        device: device::convert(checker, &table.device, &proxy)?,
        shapes: shape::convert(checker, &table.proxy.shape, joints)?,
        proxy,
    })
}

/// How contact is solved, which a scene may leave to the default.
fn algorithm(checker: &Checker<'_>, table: &ContactTable) -> Result<Algorithm, SceneError> {
    if let Some(value) = &table.updates {
        return Err(checker
            .error(value.span(), "updates acted on the algorithm \"linearised\", which is no more: leave it out"));
    }
    let Some(value) = &table.algorithm else { return Ok(Algorithm::Energy) };
    let name = value.get_ref();
    let known = <Algorithm as clap::ValueEnum>::value_variants();
    known.iter().copied().find(|known| known.name() == name).ok_or_else(|| {
        let names: Vec<String> = known.iter().map(|known| format!("`{}`", known.name())).collect();
        let reason = if name == LINEARISED {
            format!(
                "the algorithm {LINEARISED:?} is no more, its torque was not the gradient of its energy: take \"rest\""
            )
        } else {
            format!("unknown algorithm {name:?}: take one of {}", names.join(", "))
        };
        checker.error(value.span(), reason)
    })
}

/// What [`Algorithm::Rest`] took the place of; datasets of it are still read.
const LINEARISED: &str = "linearised";

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
    let algorithm = algorithm(checker, table)?;
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
        surface: table.surface.as_ref().map_or(default, |value| *value.get_ref()),
    })
}
