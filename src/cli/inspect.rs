//! `haptize inspect`: one configuration in full.

use super::{
    Failure,
    info::{self, Body},
    output::{self, Content, Written},
    report::{Describe, Report, Text},
    tell,
};
use crate::{
    ErrorKind, JointVector,
    contact::{MeshRipple, Model, NodeForce},
    dataset::{Dataset, JointLabel, Surface},
    field::TorqueField,
    names::counted,
    object::{LatticeError, Object},
    proxy::Chain,
    report::{
        self as figures,
        object::Instant,
        page::{self, Page},
        slices::Plane,
    },
    scene::{self, AxisSpec, GRID_STEP_SLACK, GridSpec, HapticsSpec, Interpolation, Scene},
    sweep::{Clearance, Inspection, build_object},
};
use glam::DVec3;
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Arguments of `haptize inspect`.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  haptize inspect sphere.haptize --q 0.1,1.65,-1.7
  haptize inspect sphere.toml --q=-0.34,1.6,-1.72     with = where the first coordinate is negative
  haptize inspect sphere.toml --q 50%,50%,90%         in parts of each joint's haptized range
  haptize inspect sphere.haptize --q 50%,50%,90% --html deep.html")]
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
    /// Write the configuration into this file as a page for a browser, which needs nothing beside it: object, arm and
    /// forces, turned by the mouse, and of a dataset a plane of C-space.
    #[arg(long, value_name = "FILE")]
    html: Option<PathBuf>,
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
    let check = |file| output::check(file, Content::Product, [arguments.file.as_path()]);
    let earlier_page = arguments.html.as_deref().map(check).transpose()?.flatten();
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
    let model = Model::at(&object, &chain, scene.contact, &JointVector::from_slice(q))?;
    let dataset = dataset.as_ref();
    let solved = Inspection::new(&model, q)?;
    let page = match &arguments.html {
        Some(file) => {
            let title = arguments.file.file_stem().unwrap_or_default().to_string_lossy().into_owned();
            let page = page(title, &scene, &object, &chain, dataset, &solved)?;
            figures::write(file.clone(), page.html()?.as_bytes())?;
            Some(Written { file: file.display().to_string(), replaced: earlier_page })
        }
        None => None,
    };
    let inspected = Inspected {
        page,
        clearance: solved.proxy_nodes.iter().all(|node| node.contact.is_none()).then(|| Clearance::near(&model, q)),
        interpolated: dataset.map(|dataset| Interpolated::new(dataset, &scene.haptics, &solved)).transpose()?,
        stored: dataset.and_then(|dataset| Stored::new(dataset, q)),
        lattice: object.lattice_error(&model.compliance),
        mesh_ripple: MeshRipple::new(&model),
        solved,
        warnings,
        body: Body { inclusions: info::inclusions(&scene.object), skin: object.skin },
        object_warnings: object.warnings,
        joints: chain.joints.iter().map(|joint| (joint.name.clone(), joint.kind.unit())).collect(),
    };
    Report::new(&inspected)
}

/// One configuration in full.
#[derive(Serialize)]
struct Inspected {
    #[serde(flatten)]
    solved: Inspection,
    warnings: Vec<String>,
    object_warnings: Vec<String>,
    /// Where nothing touches: what is nearest.
    #[serde(skip_serializing_if = "Option::is_none")]
    clearance: Option<Clearance>,
    #[serde(flatten)]
    body: Body,
    /// Where a lattice fills the object, and is touched: the error that it makes there.
    #[serde(skip_serializing_if = "Option::is_none")]
    lattice: Option<LatticeError>,
    /// How much a contact point feels the mesh, where the compliance covers a facet.
    #[serde(skip_serializing_if = "Option::is_none")]
    mesh_ripple: Option<MeshRipple>,
    /// Where there is a dataset: what it answers here.
    #[serde(skip_serializing_if = "Option::is_none")]
    interpolated: Option<Interpolated>,
    /// What it stores at the nearest grid point.
    #[serde(skip_serializing_if = "Option::is_none")]
    stored: Option<Stored>,
    #[serde(skip_serializing_if = "Option::is_none")]
    page: Option<Written>,
    /// Name of each joint, and unit of its coordinate.
    #[serde(skip)]
    joints: Vec<(String, &'static str)>,
}

/// What a dataset answers at a configuration.
#[derive(Serialize)]
struct Interpolated {
    interpolation: Interpolation,
    torque: Vec<f64>,
    contact: bool,
    /// Torque less the solved one.
    difference: Vec<f64>,
}

impl Interpolated {
    fn new(dataset: &Dataset, haptics: &HapticsSpec, solved: &Inspection) -> Result<Self, Failure> {
        let interpolation = haptics.interpolation;
        let field = TorqueField::interpolated(dataset, interpolation, haptics.threshold, &haptics.boundary_slope)?;
        let sample = field.sample(&solved.q);
        let difference = sample.torque.iter().zip(&solved.torque).map(|(felt, solved)| felt - solved).collect();
        Ok(Self { interpolation, torque: sample.torque.to_vec(), contact: sample.contact, difference })
    }
}

/// What a dataset stores at a grid point.
#[derive(Serialize)]
struct Stored {
    point: usize,
    q: Vec<f64>,
    status: String,
    torque: Vec<f64>,
    forces: Vec<NodeForce>,
    #[serde(skip)]
    notices: Vec<String>,
}

impl Stored {
    fn new(dataset: &Dataset, q: &[f64]) -> Option<Self> {
        let point = dataset.grid.nearest(q)?;
        Some(Self {
            point,
            q: dataset.grid.configuration(point).to_vec(),
            status: format!("{:?}", dataset.status(point)).to_lowercase(),
            torque: dataset.torque(point).to_vec(),
            forces: dataset.forces(point).collect(),
            notices: dataset.provenance.notices.clone(),
        })
    }
}

/// The scene and its object, from either kind of file. A dataset holds both: neither scene nor mesh file is needed.
fn read(path: &Path) -> Result<(Scene, Object, Option<Dataset>), Failure> {
    let dataset = match Dataset::open(path) {
        Ok(dataset) => dataset,
        Err(error) if error.kind() == ErrorKind::Foreign => {
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
    let law = &dataset.provenance.algorithm;
    let scene = Scene::of_dataset(&dataset.scene, "scene", law).map_err(|error| wrong(error.to_string()))?;
    dataset.check_scene().map_err(wrong)?;
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

impl Describe for Inspected {
    fn describe(&self, text: &mut Text) {
        let Inspection { q, status, iterations, residual, energy, gap, torque, .. } = &self.solved;
        let Inspection { proxy_nodes, object_nodes, dent, .. } = &self.solved;
        let efforts =
            |values: &[f64]| scene::efforts(values, self.joints.iter().map(|(name, unit)| (name.as_str(), *unit)));
        text.line(format_args!("q = {}: {status}", numbers(q)));
        text.row("torque", efforts(torque));
        text.row("energy", format_args!("{energy:.6} J"));
        text.row("gap", format_args!("{:.3} mm to the surface at rest", gap * 1e3));
        self.clearance.iter().for_each(|clearance| text.row("nearest", clearance));
        if let Some(dent) = dent {
            text.row("dent", format_args!("{:.1} mm, over which an arm that slides leaves it", dent * 1e3));
        }
        text.row(
            "solved",
            format_args!("in {} to a residual of {residual:.1e}", counted(*iterations, ["iteration", "iterations"])),
        );
        let untouched = proxy_nodes.iter().filter(|node| node.contact.is_none()).count();
        text.line(format_args!(
            "proxy nodes in contact: x [m] (force [N] on object nodes with weights, J by columns); {} free",
            counted(untouched, ["other is", "others are"])
        ));
        for (number, node) in proxy_nodes.iter().enumerate() {
            let Some(contact) = &node.contact else { continue };
            text.line(format_args!("  {number:<3} {:<10} {}", node.link, numbers(&node.position.to_array())));
            let shown = contact.nodes.iter().zip(&contact.weights).filter(|(_, weight)| weight.abs() >= LEAST_WEIGHT);
            let carriers = shown.map(|(node, weight)| format!("{node} ({weight:.3})")).collect::<Vec<_>>().join(" ");
            text.line(format_args!("      force {} on {carriers}", numbers(&contact.force.to_array())));
            let columns: Vec<_> = node.jacobian.iter().map(|column| numbers(&column.to_array())).collect();
            text.line(format_args!("      J     {}", columns.join("  ")));
        }
        text.line("object nodes pushed: n [m], displacement [mm], force [N]");
        for (number, node) in object_nodes.iter().enumerate().filter(|(_, node)| node.force != DVec3::ZERO) {
            let moved = (node.position - node.rest) * 1e3;
            let [position, moved, force] = [node.position, moved, node.force].map(|v| numbers(&v.to_array()));
            text.line(format_args!("  {number:<5} {position} {moved} {force}"));
        }
        self.body.describe(text);
        self.lattice.iter().for_each(|error| text.row("lattice", error));
        self.mesh_ripple.describe(text);
        if let Some(Interpolated { interpolation, torque, difference, .. }) = &self.interpolated {
            text.line(format_args!("the dataset, interpolated here ({}):", interpolation.name()));
            text.row("torque", efforts(torque));
            text.row("difference", format_args!("{} from what is solved", efforts(difference)));
        }
        if let Some(Stored { point, q, status, torque, notices, .. }) = &self.stored {
            text.line(format_args!("stored at point {point}, q = {}: {status}", numbers(q)));
            text.row("torque", efforts(torque));
            info::describe_notices(text, notices);
        }
        if let Some(Written { file, replaced }) = &self.page {
            text.row("page", file);
            replaced.describe(text);
        }
    }
}

/// The page of a configuration.
fn page(
    title: String,
    scene: &Scene,
    object: &Object,
    chain: &Chain,
    dataset: Option<&Dataset>,
    solved: &Inspection,
) -> Result<Page<'static>, Failure> {
    let Inspection { q, status, energy, gap, torque, object_nodes, .. } = solved;
    let forces = object_nodes.iter().enumerate().filter(|(_, node)| node.force != DVec3::ZERO);
    let forces: Vec<_> = forces.map(|(node, at)| NodeForce { node: node as u32, force: at.force }).collect();
    let mut pose = chain.new_pose();
    chain.pose(q, &mut pose);
    // Of all nodes, where the solver needs those alone that the arm may reach.
    let mut loads = vec![DVec3::ZERO; object.rest.len()];
    forces.iter().for_each(|at| loads[at.node as usize] = at.force);
    let displacement = object.displacement_under(&loads)?;
    let nodes = object.rest.iter().zip(&displacement).map(|(rest, u)| *rest + *u).collect();
    let instant = Instant { time: 0.0, nodes, contact_nodes: forces.len() as u32, forces, pose };
    let joints = || chain.joints.iter().map(|joint| (joint.name.as_str(), joint.kind.unit()));
    let facts = [
        ("q", numbers(q)),
        ("status", status.clone()),
        ("torque", scene::efforts(torque, joints()).to_string()),
        ("energy", format!("{energy:.6} J")),
        ("gap", format!("{:.3} mm", gap * 1e3)),
    ];
    Ok(Page {
        title,
        facts: facts.map(|(what, value)| (what.to_owned(), value)).into(),
        joints: joints().map(|(name, unit)| JointLabel { name: name.into(), unit: unit.into() }).collect(),
        body: page::Body::new(&Surface::of(object), chain.clone(), &scene.text, vec![instant]),
        trace: None,
        plane: dataset.and_then(|dataset| Plane::of(dataset, Some(q))),
    })
}

/// Least weight that is printed: smaller ones would read zero (1).
const LEAST_WEIGHT: f64 = 5e-4;

fn numbers(values: &[f64]) -> String {
    // Zero has no sign.
    let rounded = |value: &f64| (value * 1e5).round() / 1e5 + 0.0;
    let values: Vec<_> = values.iter().map(|value| format!("{:.5}", rounded(value))).collect();
    format!("[{}]", values.join(", "))
}
