//! `haptize inspect`: one configuration in full.

use super::{Failure, Report, info, tell};
use crate::{
    JointVector,
    contact::Model,
    dataset::{self, Dataset},
    field::TorqueField,
    object::Object,
    proxy::Chain,
    scene::{self, Algorithm, AxisSpec, GRID_STEP_SLACK, GridSpec, Scene},
    sweep::{Inspection, build_object},
};
use clap::ValueEnum;
use glam::DVec3;
use std::{
    fmt::{self, Write},
    path::{Path, PathBuf},
};

/// Arguments of `haptize inspect`.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  haptize inspect sphere.haptize --q 0.1,1.65,-1.7
  haptize inspect sphere.toml --q=-0.34,1.6,-1.72     with = where the first coordinate is negative
  haptize inspect sphere.toml --q 50%,50%,90%         in parts of each joint's haptized range")]
pub struct Arguments {
    /// A scene or a dataset.
    file: PathBuf,
    /// The configuration: one coordinate per joint (rad or m), separated by commas, or a percentage of the range that
    /// the grid covers, from 0% at its first line to 100% at its last. Write --q=-0.3,... if the first is negative.
    #[arg(
        long,
        value_name = "A,B,C",
        value_delimiter = ',',
        num_args = 1,
        allow_hyphen_values = true,
        required = true,
        value_parser = coordinate
    )]
    q: Vec<Coordinate>,
}

/// A coordinate of the configuration.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Coordinate {
    /// As it is (rad or m).
    Absolute(f64),
    /// Fraction of the grid's range (1).
    Fraction(f64),
}

impl Coordinate {
    /// Returns the coordinate (rad or m); none for a fraction where there is no axis.
    fn on(self, axis: Option<&AxisSpec>) -> Option<f64> {
        match self {
            Self::Absolute(q) => Some(q),
            Self::Fraction(part) => axis.map(|axis| axis.start + part * (axis.count - 1) as f64 * axis.step),
        }
    }
}

/// Parses a coordinate: `-0.3` or `50%`.
fn coordinate(text: &str) -> Result<Coordinate, String> {
    let number =
        super::fraction(text).map_err(|_| "give a number [rad or m] such as -0.3, or a percentage such as 50%")?;
    Ok(if text.trim_end().ends_with('%') { Coordinate::Fraction(number) } else { Coordinate::Absolute(number) })
}

/// Solves the configuration. For a dataset, also reports what it interpolates there and what it stores at the nearest
/// grid point.
pub fn run(arguments: &Arguments) -> Result<Report, Failure> {
    let (scene, object, dataset) = read(&arguments.file)?;
    let chain = Chain::new(&scene.proxy);
    let given = &arguments.q;
    let names: Vec<_> = chain.joints.iter().map(|joint| joint.name.as_str()).collect();
    let wrong = || format!("--q must be {} finite numbers: {}", names.len(), names.join(","));
    if given.len() != names.len() {
        return Err(wrong().into());
    }
    let q: Option<Vec<f64>> = given.iter().enumerate().map(|(k, q)| q.on(scene.grid.axes.get(k))).collect();
    let q = &q.ok_or_else(|| {
        let file = arguments.file.display();
        format!("a percentage in --q is a part of the grid's range, and {file} has no [grid]: give it in rad or m")
    })?;
    if !q.iter().all(|x| x.is_finite()) {
        return Err(wrong().into());
    }
    let warnings = outside(&chain, &scene.grid, q);
    warnings.iter().for_each(|warning| tell(format_args!("haptize: note: {warning}")));
    let model = Model::reaching(&object, &chain, scene.contact, &[JointVector::from_slice(q)])?;
    let inspection = Inspection::new(&model, q);
    let mut json = serde_json::to_value(&inspection)?;
    json["warnings"] = warnings.into();
    let mut text = String::new();
    describe(&mut text, &inspection, &chain)?;
    object.warnings.iter().for_each(|warning| tell(format_args!("haptize: {warning}")));
    json["object_warnings"] = object.warnings.clone().into();
    let inclusions = info::inclusions(&scene.object);
    info::write_inclusions(&mut text, &mut json, &inclusions)?;
    if let Some(skin) = object.skin {
        json["skin"] = serde_json::to_value(skin)?;
        writeln!(text, "  skin         {skin}")?;
    }
    if let Some(error) = object.lattice_error(&scene.object, &model.compliance) {
        json["lattice"] = serde_json::to_value(error)?;
        writeln!(text, "  lattice      {error}")?;
    }
    if let Some(dataset) = &dataset {
        let haptics = &scene.haptics;
        let field =
            TorqueField::interpolated(dataset, haptics.interpolation, haptics.threshold, &haptics.boundary_slope)?;
        let sample = field.sample(q);
        let difference: Vec<f64> =
            sample.torque.iter().zip(&inspection.torque).map(|(felt, solved)| felt - solved).collect();
        json["interpolated"] = serde_json::json!({
            "interpolation": haptics.interpolation, "torque": *sample.torque, "contact": sample.contact,
            "difference": difference,
        });
        writeln!(text, "the dataset, interpolated here ({}):", haptics.interpolation.name())?;
        writeln!(text, "  torque       {}", efforts(&sample.torque, &chain))?;
        writeln!(text, "  difference   {} from what is solved", efforts(&difference, &chain))?;
    }
    if let Some(point) = dataset.as_ref().and_then(|dataset| dataset.grid.nearest(q).map(|point| (dataset, point))) {
        let (dataset, point) = point;
        let stored = dataset.grid.configuration(point);
        let status = format!("{:?}", dataset.status(point)).to_lowercase();
        json["stored"] = serde_json::json!({
            "point": point, "q": *stored, "status": status, "torque": dataset.torque(point),
            "forces": dataset.forces(point)
                .map(|f| serde_json::json!({"node": f.node, "force": f.force}))
                .collect::<Vec<_>>(),
        });
        writeln!(text, "stored at point {point}, q = {}: {status}", numbers(&stored))?;
        writeln!(text, "  torque       {}", efforts(dataset.torque(point), &chain))?;
        info::notices(&mut text, &dataset.provenance.notices)?;
    }
    Ok(Report { text, json, whole: true })
}

/// The scene and its object, from either kind of file. A dataset holds both: neither scene nor mesh file is needed.
fn read(path: &Path) -> Result<(Scene, Object, Option<Dataset>), Failure> {
    let dataset = match Dataset::open(path) {
        Ok(dataset) => dataset,
        Err(dataset::Error::Foreign { .. }) => {
            let scene = Scene::load(path)?;
            let object = build_object(&scene)?;
            return Ok((scene, object, None));
        }
        Err(error) => return Err(error.into()),
    };
    let Some(surface) = dataset.surface.as_ref().filter(|_| !dataset.scene.is_empty()) else {
        return Err(format!(
            "{}: holds no scene to solve, it was made from measurements; use `haptize info`",
            path.display()
        )
        .into());
    };
    let wrong = |why: String| format!("{}: the scene in the dataset: {why}", path.display());
    let mut scene = Scene::parse(&dataset.scene, "scene").map_err(|error| wrong(error.to_string()))?;
    dataset.check_scene().map_err(wrong)?;
    let algorithm = &dataset.provenance.algorithm;
    scene.contact.algorithm = Algorithm::from_str(algorithm, true).map_err(|_| {
        wrong(format!(
            "it was solved by the algorithm `{}`, which is no more: bake it anew",
            crate::names::escaped(algorithm)
        ))
    })?;
    let object = surface.object(&scene.object)?;
    Ok((scene, object, Some(dataset)))
}

/// Returns a sentence for each joint of `q` beyond its limits or beyond the grid, where nothing is looked up.
fn outside(chain: &Chain, grid: &GridSpec, q: &[f64]) -> Vec<String> {
    let mut found = Vec::new();
    for (k, (joint, &q)) in chain.joints.iter().zip(q).enumerate() {
        let [least, greatest] = joint.limits;
        let (name, unit) = (&joint.name, joint.kind.unit());
        if q < least || q > greatest {
            found.push(format!("{name} = {q} {unit} is beyond the joint's limits, {least} to {greatest}"));
        } else if let Some(axis) = grid.axes.get(k) {
            let last = axis.start + (axis.count - 1) as f64 * axis.step;
            let slack = GRID_STEP_SLACK * axis.step;
            if q < axis.start - slack || q > last + slack {
                found.push(format!("{name} = {q} {unit} is beyond the grid, {:.4} to {last:.4}", axis.start));
            }
        }
    }
    found
}

fn describe(text: &mut String, inspection: &Inspection, chain: &Chain) -> fmt::Result {
    let Inspection { q, status, iterations, residual, energy, gap, torque, proxy_nodes, object_nodes } = inspection;
    writeln!(text, "q = {}: {status}", numbers(q))?;
    writeln!(text, "  torque       {}", efforts(torque, chain))?;
    writeln!(text, "  energy       {energy:.6} J")?;
    writeln!(text, "  gap          {:.3} mm to the surface at rest", gap * 1e3)?;
    writeln!(text, "  solved       in {iterations} iterations to a residual of {residual:.1e}")?;
    let untouched = proxy_nodes.iter().filter(|node| node.contact.is_none()).count();
    writeln!(
        text,
        "proxy nodes in contact: x [m] (force [N] on object nodes with weights, J by columns); {untouched} others are \
         free"
    )?;
    for (number, node) in proxy_nodes.iter().enumerate() {
        let Some(contact) = &node.contact else { continue };
        writeln!(text, "  {number:<3} {:<10} {}", node.link, numbers(&node.position.to_array()))?;
        let shown = contact.nodes.iter().zip(&contact.weights).filter(|(_, weight)| weight.abs() >= LEAST_WEIGHT);
        let carriers = shown.map(|(node, weight)| format!("{node} ({weight:.3})")).collect::<Vec<_>>().join(" ");
        writeln!(text, "      force {} on {carriers}", numbers(&contact.force.to_array()))?;
        let columns: Vec<_> = node.jacobian.iter().map(|column| numbers(&column.to_array())).collect();
        writeln!(text, "      J     {}", columns.join("  "))?;
    }
    writeln!(text, "object nodes pushed: n [m], displacement [mm], force [N]")?;
    for (number, node) in object_nodes.iter().enumerate().filter(|(_, node)| node.force != DVec3::ZERO) {
        let moved = (node.position - node.rest) * 1e3;
        let [position, moved, force] = [node.position, moved, node.force].map(|v| numbers(&v.to_array()));
        writeln!(text, "  {number:<5} {position} {moved} {force}")?;
    }
    Ok(())
}

/// Writes joint efforts, each with its unit.
fn efforts(values: &[f64], chain: &Chain) -> String {
    scene::efforts(values, chain.joints.iter().map(|joint| (joint.name.as_str(), joint.kind.unit())))
}

/// Least weight that is printed: smaller ones would read zero (1).
const LEAST_WEIGHT: f64 = 5e-4;

fn numbers(values: &[f64]) -> String {
    // Zero has no sign.
    let rounded = |value: &f64| (value * 1e5).round() / 1e5 + 0.0;
    let values: Vec<_> = values.iter().map(|value| format!("{:.5}", rounded(value))).collect();
    format!("[{}]", values.join(", "))
}
