//! How far the torque depends on what the scene leaves to choose: the object's mesh, the contact nodes along links, the
//! bending stiffness of the skin, the contact stiffness.
//!
//! Each is varied alone, in steps of a factor, and all variants are solved at the same configurations. A row's error is
//! the distance of its torque from that of the next variant: what one more step changes. If these distances fall as
//! h^p, the torque converges, and its error is `d / (r^p - 1)` for steps of a factor r. Mesh and nodes have a limit
//! that they approach as the spacing h falls. The skin approaches that of no bending stiffness, where torque does not
//! converge with the mesh; contact that of rigid contact. Both are properties of the body: the rows say how much they
//! matter, not how wrong they are.

use super::{Accuracy, AccuracyError, Cost, Row, Study, timed};
use crate::{
    contact::{Equilibrium, Model},
    object::Object,
    proxy::Chain,
    scene::{Scene, Shape, SkinSpec},
    sweep::{Backend, CpuBackend, reference::Reference},
};
use toml::{Table, Value};

/// Factors on the mean edge of the object, coarsest first; the scene's own is 1.
const EDGES: [f64; 4] = [4.0, 2.0, 1.0, 0.5];

/// Factors on the spacing of nodes along links.
const SPACINGS: [f64; 4] = [4.0, 2.0, 1.0, 0.5];

/// Factors on the bending stiffness of the skin.
const BENDINGS: [f64; 4] = [4.0, 1.0, 0.25, 0.0625];

/// Factors on the contact stiffness.
const STIFFNESSES: [f64; 4] = [0.25, 1.0, 4.0, 16.0];

/// Fewest nodes on a ring, and rings: fewer make no sphere.
const LEAST_RING: usize = 4;

/// A variant of the scene, and what is varied as a length or compliance that falls with refinement.
struct Variant {
    scene: Scene,
    /// Factor on the scene's own value.
    factor: f64,
    setting: String,
}

/// Returns the quantity that a study varies, in words.
pub(super) fn name(study: Study) -> &'static str {
    match study {
        Study::Mesh => "mesh",
        Study::Links => "link nodes",
        Study::Skin => "skin",
        _ => "contact compliance",
    }
}

/// All studies that the scene allows.
pub(super) fn studies(scene: &Scene, reference: &Reference, study: &mut Accuracy) -> Result<(), AccuracyError> {
    let studies = [
        (Study::Mesh, meshes(scene), "the object's mesh is varied for spheres alone: another mesh is what it is"),
        (Study::Links, links(scene)?, "the spacing of contact nodes is not varied: no nodes lie along a line"),
        (Study::Skin, skins(scene), "the object has no skin whose bending stiffness could be varied"),
        (Study::Stiffness, stiffnesses(scene)?, "contact stiffness is not varied: contact is rigid"),
    ];
    for (varied, variants, note) in studies {
        if variants.len() < 2 {
            study.notes.push(note.to_owned());
            continue;
        }
        compare(varied, &variants, reference, study)?;
    }
    Ok(())
}

/// Rows of `variants`, each against the next.
fn compare(
    varied: Study,
    variants: &[Variant],
    reference: &Reference,
    study: &mut Accuracy,
) -> Result<(), AccuracyError> {
    let mut found: Vec<(f64, usize, Cost, Vec<Equilibrium>)> = Vec::new();
    let own = variants.iter().position(|variant| variant.factor == 1.0).unwrap_or(0);
    for Variant { scene, factor, .. } in variants {
        let (object, chain) = (Object::build(&scene.object)?, Chain::new(&scene.proxy));
        let model = Model::reaching(&object, &chain, scene.contact, &reference.places)?;
        let mut backend = CpuBackend::new(&model, 0).map_err(crate::sweep::BackendError::from)?;
        let (cost, solved) =
            timed(study.rounds, || backend.solve(&reference.places)).unwrap_or_else(|never| match never {});
        let value = if varied == Study::Mesh { model.surface.mean_edge } else { *factor };
        found.push((value, object.rest.len(), cost, solved));
    }
    // Numbers of nodes are whole: the edge is measured.
    let own_edge = found[own].0;
    if varied == Study::Mesh {
        found.iter_mut().for_each(|(value, ..)| *value /= own_edge);
    }
    let baseline = found[own].2.least;
    for (pair, variant) in found.windows(2).zip(variants) {
        let [(value, nodes, cost, solved), (_, _, _, next)] = pair else { continue };
        let next = reference.with(next.iter().map(|equilibrium| equilibrium.torque).collect());
        let mut torques = solved.iter().map(|equilibrium| equilibrium.torque);
        let (rms, worst) = next.errors(|q| torques.next().unwrap_or(*q));
        study.rows.push(Row {
            study: varied,
            series: name(varied).to_owned(),
            setting: variant.setting.clone(),
            value: *value,
            points: *nodes,
            solved: 0,
            bytes: 0,
            cost: cost.over(baseline),
            unit: "N m",
            rms,
            worst,
            size: reference.torque,
        });
    }
    Ok(())
}

/// Spheres of other mean edges. Springs keep the stiffness of a continuous shell: between nodes as they are, to the
/// ground in proportion to the area of a node.
fn meshes(scene: &Scene) -> Vec<Variant> {
    let mut variants: Vec<Variant> = Vec::new();
    for factor in EDGES {
        let mut scene = scene.clone();
        let fewer = |count: usize, least: usize| ((count as f64 / factor).round() as usize).max(least);
        let share = match &mut scene.object.shape {
            Shape::Sphere { rings, segments, .. } => {
                let before = (*rings * *segments + 2) as f64;
                (*rings, *segments) = (fewer(*rings, LEAST_RING), fewer(*segments, LEAST_RING));
                before / (*rings * *segments + 2) as f64
            }
            Shape::Icosphere { divisions, .. } => {
                let before = *divisions;
                *divisions = fewer(before, 1);
                (before as f64 / *divisions as f64).powi(2)
            }
            _ => return Vec::new(),
        };
        scene.object.ground.iter_mut().for_each(|ground| ground.stiffness *= share);
        if variants.last().is_none_or(|last| last.scene.object != scene.object) {
            variants.push(Variant { scene, factor, setting: format!("{factor} of the mean edge") });
        }
    }
    variants
}

/// Skins of other bending stiffness.
fn skins(scene: &Scene) -> Vec<Variant> {
    let Some(skin) = scene.object.skin.filter(|skin| skin.bending > 0.0) else { return Vec::new() };
    let variant = |factor: f64| {
        let mut scene = scene.clone();
        scene.object.skin = Some(SkinSpec { bending: factor * skin.bending, ..skin });
        Variant { scene, factor, setting: format!("bending stiffness {:.2e} N m", factor * skin.bending) }
    };
    BENDINGS.into_iter().map(variant).collect()
}

/// Other spacings of nodes along links. Contact stiffness is that of the link: where the scene gives it per node, it is
/// scaled.
fn links(scene: &Scene) -> Result<Vec<Variant>, AccuracyError> {
    let text: Table = scene.text.parse().unwrap_or_default();
    let mut variants = Vec::new();
    for factor in SPACINGS {
        let (mut text, mut varied) = (text.clone(), false);
        let joints = text.get_mut("proxy").and_then(|proxy| proxy.get_mut("joint")).and_then(Value::as_array_mut);
        let nodes = joints.into_iter().flatten().filter_map(|joint| joint.get_mut("nodes")?.as_array_mut()).flatten();
        for line in nodes.filter_map(Value::as_table_mut) {
            if let Some(spacing) = line.get("spacing").and_then(number) {
                line.insert("spacing".into(), (factor * spacing).into());
                varied = true;
            } else if let Some(count) = line.get("count").and_then(Value::as_integer).filter(|&count| count > 1) {
                let steps = ((count - 1) as f64 / factor).round().max(1.0) as i64;
                line.insert("count".into(), Value::Integer(steps + 1));
                varied = true;
            }
        }
        if !varied {
            return Ok(Vec::new());
        }
        if let Some(contact) = text.get_mut("contact").and_then(Value::as_table_mut)
            && let Some(stiffness) = contact.get("stiffness").and_then(number)
        {
            contact.insert("stiffness".into(), (factor * stiffness).into());
        }
        let scene = Scene::parse(&text.to_string(), &scene.path)?;
        variants.push(Variant { scene, factor, setting: format!("{factor} of the spacing of nodes") });
    }
    Ok(variants)
}

/// Other contact stiffnesses.
fn stiffnesses(scene: &Scene) -> Result<Vec<Variant>, AccuracyError> {
    let text: Table = scene.text.parse().unwrap_or_default();
    let mut variants = Vec::new();
    for factor in STIFFNESSES {
        let mut text = text.clone();
        let contact = text.get_mut("contact").and_then(Value::as_table_mut);
        let key = ["stiffness", "stiffness_per_length"].into_iter().find_map(|key| {
            let stiffness = number(contact.as_ref()?.get(key)?)?;
            Some((key, stiffness))
        });
        let (Some(contact), Some((key, stiffness))) = (contact, key) else { return Ok(Vec::new()) };
        contact.insert(key.into(), (factor * stiffness).into());
        let scene = Scene::parse(&text.to_string(), &scene.path)?;
        let setting = format!("{:.2e} ({key})", factor * stiffness);
        // Compliance, which rigid contact has none of.
        variants.push(Variant { scene, factor: 1.0 / factor, setting });
    }
    Ok(variants)
}

fn number(value: &Value) -> Option<f64> {
    value.as_float().or_else(|| value.as_integer().map(|whole| whole as f64))
}
