//! Settings of the scene that are solved at the reference's configurations, away from any grid: how contact is solved,
//! and what the scene leaves to choose, which are the object's mesh, the contact nodes along links, the bending
//! stiffness of the skin and the contact stiffness.
//!
//! Tolerance and law err against the reference. The others are varied in steps of a factor, and a row's error is
//! the distance of its torque from that of the next variant: what one more step changes. If these distances fall as
//! h^p, the torque converges, and its error is `d / (r^p - 1)` for steps of a factor r. Mesh and nodes have a limit
//! that they approach as the spacing h falls. The skin approaches that of no bending stiffness, where torque does not
//! converge with the mesh; contact that of rigid contact. Both are properties of the body: the rows say how much they
//! matter, not how wrong they are.

use super::{Accuracy, Row, Study, in_turns};
use crate::{
    Error, JointVector,
    contact::{Model, Status},
    object::Object,
    proxy::Chain,
    scene::{ContactLaw, ContactSpec, GroundSpec, GroundStiffness, Scene, Shape, SkinSpec},
    sweep::{
        build_object,
        reference::{Reference, equilibria},
    },
};
use toml::{Table, Value};

/// Relative residuals that are asked for.
const TOLERANCES: [f64; 6] = [0.3, 0.1, 1e-2, 1e-3, 1e-5, 1e-8];

/// Factors on the mean edge of the object and on the spacing of nodes along links, coarsest first; the scene's own
/// is 1.
const SPACINGS: [f64; 4] = [4.0, 2.0, 1.0, 0.5];

/// Factors on the bending stiffness of the skin, and on the contact's compliance.
const SOFTER: [f64; 4] = [4.0, 1.0, 0.25, 0.0625];

/// Fewest nodes on a ring, and rings: fewer make no sphere.
const LEAST_RING: usize = 4;

/// The scene with one setting changed.
pub(super) struct Variant {
    pub(super) scene: Scene,
    pub(super) series: &'static str,
    pub(super) setting: String,
    pub(super) value: f64,
}

/// What is varied in all studies that the scene allows; of the others `study` notes why.
pub(super) fn variants(scene: &Scene, study: &mut Accuracy) -> Result<Vec<(Study, Vec<Variant>)>, Error> {
    let studies = [
        (Study::Tolerance, tolerances(scene), ""),
        (Study::Law, laws(scene), ""),
        (Study::Mesh, meshes(scene), "the object's mesh is varied for spheres alone: another mesh is what it is"),
        (Study::Links, links(scene)?, "the spacing of contact nodes is not varied: no nodes lie along a line"),
        (Study::Skin, skins(scene), "the object has no skin whose bending stiffness could be varied"),
        (Study::Stiffness, stiffnesses(scene)?, "contact stiffness is not varied: contact is rigid"),
    ];
    let mut possible = Vec::new();
    for (varied, variants, note) in studies {
        if variants.len() < 2 {
            study.notes.push(note.to_owned());
        } else {
            possible.push((varied, variants));
        }
    }
    Ok(possible)
}

/// Rows of `variants`, which take turns with the scene as it is.
pub(super) fn compare(
    own: &Scene,
    varied: Study,
    variants: &[Variant],
    reference: &Reference,
    study: &mut Accuracy,
) -> Result<(), Error> {
    let scenes: Vec<&Scene> = variants.iter().map(|variant| &variant.scene).chain([own]).collect();
    let built: Vec<(Object, Chain)> = scenes
        .iter()
        .map(|scene| Ok((build_object(scene)?, Chain::new(&scene.proxy))))
        .collect::<Result<_, Error>>()?;
    let models: Vec<Model<'_>> = scenes
        .iter()
        .zip(&built)
        .map(|(scene, (object, chain))| Model::reaching(object, chain, scene.contact, &reference.places))
        .collect::<Result<_, _>>()?;
    let answers =
        in_turns(study.rounds, scenes.len(), |k| equilibria(&models[k], scenes[k].contact, &reference.places))?;
    let torques: Vec<Vec<JointVector>> =
        answers.iter().map(|(_, found)| found.iter().map(|equilibrium| equilibrium.torque).collect()).collect();
    for (k, Variant { series, setting, value, .. }) in variants.iter().enumerate() {
        let exact = match varied {
            Study::Tolerance | Study::Law => &reference.exact,
            // The last variant has no next one.
            _ if k + 1 == variants.len() => break,
            _ => &torques[k + 1],
        };
        let mut own_torques = torques[k].iter();
        let (rms, worst) = reference.with(exact.clone()).errors(|q| *own_torques.next().unwrap_or(q));
        let (seconds, found) = &answers[k];
        let unconverged = found.iter().filter(|equilibrium| equilibrium.status == Status::Unconverged).count();
        let lost = match unconverged {
            0 => String::new(),
            lost => format!(", {lost} of {} not converged", reference.in_contact),
        };
        study.rows.push(Row {
            study: varied,
            series: (*series).to_owned(),
            setting: format!("{setting}{lost}"),
            value: *value,
            points: built[k].0.rest.len(),
            solved: 0,
            bytes: 0,
            cost: seconds / answers[variants.len()].0,
            rms,
            worst,
        });
    }
    Ok(())
}

/// The energy form with other tolerances.
fn tolerances(scene: &Scene) -> Vec<Variant> {
    let variant = |tolerance| {
        let mut scene = scene.clone();
        scene.contact = ContactSpec { tolerance, ..scene.contact.by(ContactLaw::Following) };
        Variant { scene, series: ContactLaw::Following.name(), setting: format!("{tolerance:.0e}"), value: tolerance }
    };
    TOLERANCES.into_iter().map(variant).collect()
}

/// Both laws of contact.
fn laws(scene: &Scene) -> Vec<Variant> {
    let variant = |law: ContactLaw| {
        let mut scene = scene.clone();
        scene.contact = scene.contact.by(law);
        Variant { scene, series: law.name(), setting: law.name().to_owned(), value: 0.0 }
    };
    [ContactLaw::Following, ContactLaw::Rest].into_iter().map(variant).collect()
}

/// Spheres of other mean edges. Springs keep the stiffness of a continuous shell: between nodes as they are, to the
/// ground in proportion to the area of a node.
fn meshes(scene: &Scene) -> Vec<Variant> {
    let mut variants: Vec<Variant> = Vec::new();
    for factor in SPACINGS {
        let mut scene = scene.clone();
        let fewer = |count: usize, least: usize| ((count as f64 / factor).round() as usize).max(least);
        // Area of a node over that in the scene as it is: numbers of nodes are whole.
        let area = match &mut scene.object.shape {
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
        if let Some(GroundSpec { stiffness: GroundStiffness::PerNode(k), .. }) = &mut scene.object.ground {
            *k *= area;
        }
        if variants.last().is_none_or(|last| last.scene.object != scene.object) {
            let (value, setting) = (area.sqrt(), format!("{factor} of the mean edge"));
            variants.push(Variant { scene, series: "mesh", setting, value });
        }
    }
    variants
}

/// Skins of other bending stiffness.
fn skins(scene: &Scene) -> Vec<Variant> {
    let Some(skin) = scene.object.skin.filter(|skin| skin.bending > 0.0) else { return Vec::new() };
    let variant = |factor: f64| {
        let mut scene = scene.clone();
        let bending = factor * skin.bending;
        scene.object.skin = Some(SkinSpec { bending, ..skin });
        Variant { scene, series: "skin", setting: format!("bending stiffness {bending:.2e} N m"), value: factor }
    };
    SOFTER.into_iter().map(variant).collect()
}

/// Other spacings of nodes along links. Contact stiffness is that of the link: where the scene gives it per node, it is
/// scaled.
fn links(scene: &Scene) -> Result<Vec<Variant>, Error> {
    let mut variants = Vec::new();
    for factor in SPACINGS {
        let (mut text, mut varied): (Table, _) = (scene.text.parse().unwrap_or_default(), false);
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
        scale_contact(&mut text, &["stiffness"], factor);
        let scene = Scene::parse(&text.to_string(), &scene.path)?;
        let setting = format!("{factor} of the spacing of nodes");
        variants.push(Variant { scene, series: "link nodes", setting, value: factor });
    }
    Ok(variants)
}

/// Other contact stiffnesses. Their value is the compliance, which rigid contact has none of.
fn stiffnesses(scene: &Scene) -> Result<Vec<Variant>, Error> {
    let mut variants = Vec::new();
    for factor in SOFTER {
        let mut text: Table = scene.text.parse().unwrap_or_default();
        let scaled = scale_contact(&mut text, &["stiffness", "stiffness_per_length"], 1.0 / factor);
        let Some((key, stiffness)) = scaled else { return Ok(Vec::new()) };
        let scene = Scene::parse(&text.to_string(), &scene.path)?;
        let setting = format!("{stiffness:.2e} ({key})");
        variants.push(Variant { scene, series: "contact compliance", setting, value: factor });
    }
    Ok(variants)
}

/// Scales the first of `keys` that the scene's contact has, by `factor`: the key and its new value.
fn scale_contact<'k>(text: &mut Table, keys: &[&'k str], factor: f64) -> Option<(&'k str, f64)> {
    let contact = text.get_mut("contact")?.as_table_mut()?;
    let (key, stiffness) = keys.iter().find_map(|key| Some((*key, number(contact.get(*key)?)?)))?;
    contact.insert(key.into(), (factor * stiffness).into());
    Some((key, factor * stiffness))
}

fn number(value: &Value) -> Option<f64> {
    value.as_float().or_else(|| value.as_integer().map(|whole| whole as f64))
}
