//! `haptize info`: what a dataset or a mesh holds. The whole file is checked first.

use super::{
    Failure,
    baked::describe_error,
    report::{Describe, Report, Text},
};
use crate::{
    ErrorKind,
    dataset::{Axis, Dataset, Provenance, Refinement, StatusCounts, Summary},
    names::{counted, escaped},
    object::{MeshSummary, Skin, mesh_endings},
    scene::{Material, ObjectSpec, Rendering, SkinSpec},
    toml_text::{coarse, list, number, significant},
};
use glam::DVec3;
use serde::Serialize;
use std::path::PathBuf;

/// Arguments of `haptize info`.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  haptize info sphere.haptize
  haptize info sphere.haptize --json
  haptize info organ.obj")]
pub struct Arguments {
    /// A dataset, or the file of a mesh: OBJ, STL, PLY, glTF, Gmsh, VTK, TetGen or MEDIT.
    #[arg(value_name = "FILE")]
    path: PathBuf,
}

/// What a dataset holds.
#[derive(Serialize)]
struct Info {
    #[serde(flatten)]
    summary: Summary,
    file: String,
    file_bytes: u64,
    /// Columns that it does not hold.
    absent: Vec<&'static str>,
    /// Why its scene does not describe it.
    contradiction: Option<String>,
    #[serde(flatten)]
    body: Body,
    /// Joints that follow others, one description each.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    followers: Vec<String>,
}

/// Opens and checks the file, and sums it up.
pub fn run(arguments: &Arguments) -> Result<Report, Failure> {
    let path = &arguments.path;
    if MeshSummary::is_mesh(path) {
        let mesh = MeshInfo { file: path.display().to_string(), mesh: MeshSummary::read(path)? };
        return Report::of(&mesh, mesh.mesh.defect.is_none());
    }
    let dataset = Dataset::open(path).map_err(|error| match error.kind() {
        ErrorKind::Foreign => format!("{error}, or a mesh whose name ends in {}", mesh_endings()).into(),
        _ => Failure::from(error),
    })?;
    let scene = Rendering::parse(&dataset.scene, "scene").ok();
    let followers = scene.iter().flat_map(|scene| &scene.proxy.followers).map(ToString::to_string).collect();
    let spec = scene.and_then(|scene| scene.object);
    let info = Info {
        summary: dataset.summary(),
        file: path.display().to_string(),
        file_bytes: std::fs::metadata(path)?.len(),
        absent: dataset.absent(),
        contradiction: dataset.check_scene().err(),
        body: spec.map_or_else(Body::default, |spec| Body {
            inclusions: inclusions(&spec),
            skin: spec.skin.and_then(|skin| skin_on(&dataset, skin)),
        }),
        followers,
    };
    Report::of(&info, info.contradiction.is_none())
}

/// What a mesh file holds.
#[derive(Serialize)]
struct MeshInfo {
    file: String,
    #[serde(flatten)]
    mesh: MeshSummary,
}

impl Describe for MeshInfo {
    fn describe(&self, text: &mut Text) {
        let Self { file, mesh } = self;
        let state = if mesh.defect.is_some() { "no closed surface" } else { "a closed surface" };
        text.line(format_args!("{file}: {}, {state}", counted(mesh.triangles, ["triangle", "triangles"])));
        text.row("nodes", format_args!("{} on the surface, {} in all", mesh.surface_nodes, mesh.nodes));
        if mesh.tetrahedra > 0 {
            text.row("tetrahedra", mesh.tetrahedra);
        }
        if mesh.parts > 1 {
            text.row("parts", format_args!("{} surfaces that are not connected", mesh.parts));
        }
        let [low, high, size] =
            [mesh.low, mesh.high, mesh.high - mesh.low].map(|corner| list(&corner.to_array(), |x| significant(*x)));
        text.row("size", format_args!("{size}, from {low} to {high}"));
        text.row("edges", format_args!("{} long on average", significant(mesh.mean_edge)));
        if let Some(unit) = mesh.unit {
            let (metres, name) = (unit.metres(), unit.name());
            let litres = coarse(1e3 * mesh.volume * metres.powi(3));
            let longest = significant(1e3 * metres * (mesh.high - mesh.low).max_element());
            let scale = number(metres, 4);
            text.row(
                "unit",
                format_args!("{name}, by its size: {longest} mm long and {litres} l with scale = {scale}"),
            );
        } else {
            text.row("unit", "its size fits neither metres nor millimetres: give its scale by hand");
        }
        mesh.warnings.iter().for_each(|warning| text.row("notice", escaped(warning)));
        mesh.defect.iter().for_each(|defect| text.row("defect", escaped(defect)));
    }
}

/// What an object consists of, beside its surface and material.
#[derive(Default, Serialize)]
pub struct Body {
    /// Inclusions, one description each.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub inclusions: Vec<String>,
    /// The skin.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub skin: Option<Skin>,
}

impl Describe for Body {
    fn describe(&self, text: &mut Text) {
        self.inclusions.iter().for_each(|inclusion| text.row("inclusion", inclusion));
        self.skin.iter().for_each(|skin| text.row("skin", skin));
    }
}

/// Returns the inclusions of the object, one description each.
pub fn inclusions(object: &ObjectSpec) -> Vec<String> {
    match &object.material {
        Material::Elastic(elastic) => elastic.inclusions.iter().map(ToString::to_string).collect(),
        Material::Springs(_) | Material::Hollow => Vec::new(),
    }
}

/// The skin `spec` on the dataset's surface.
fn skin_on(dataset: &Dataset, spec: SkinSpec) -> Option<Skin> {
    let surface = dataset.surface.as_ref()?;
    let (nodes, triangles): (Vec<DVec3>, _) = (surface.places().collect(), surface.facets());
    Some(Skin::new(spec, &nodes, triangles))
}

impl Describe for Info {
    fn describe(&self, text: &mut Text) {
        let Self { summary, file, file_bytes, absent, contradiction, body, followers } = self;
        let (points, size) = (summary.points, *file_bytes as f64 / 1e6);
        let state = if contradiction.is_some() { "intact" } else { "sound" };
        text.line(format_args!("{file}: {}, {size:.1} MB, {state}", counted(points, ["point", "points"])));
        if let Some(contradiction) = contradiction {
            text.row("scene", format_args!("does not describe this dataset: {contradiction}"));
            text.row("", "no command but info and export takes it: bake the scene again");
        }
        summary.describe(text);
        describe_absent(text, absent);
        summary.provenance.describe(text);
        body.describe(text);
        followers.iter().for_each(|follower| text.row("follower", follower));
    }
}

impl Describe for Summary {
    fn describe(&self, text: &mut Text) {
        for (axis, [least, greatest]) in self.axes.iter().zip(&self.torque) {
            let Axis { name, unit, start, step, count } = axis;
            let last = axis.coordinate(count - 1);
            let effort = axis.effort_unit();
            text.row(
                name,
                format_args!("{}, {start:.4} to {last:.4} {unit} by {step:.4}", counted(*count, ["line", "lines"])),
            );
            text.row("", format_args!("{least:.4} to {greatest:.4} {effort}"));
        }
        if let Some(Refinement { nodes, bytes }) = &self.refinement {
            let nodes: Vec<String> = nodes.iter().map(ToString::to_string).collect();
            let memory = *bytes as f64 / 1e6;
            text.row("refined", format_args!("{} nodes by level, {memory:.1} MB in memory", nodes.join(" + ")));
        }
        let StatusCounts { free, contact, unconverged, overflow, outside } = self.statuses;
        let others = [(unconverged, "unconverged"), (overflow, "overflowed"), (outside, "outside")];
        let others = others.iter().filter(|(count, _)| *count > 0).map(|(count, word)| format!(", {count} {word}"));
        text.row("status", format_args!("{free} free, {contact} in contact{}", others.collect::<String>()));
        if let (Some(contacts), Some(most), Some(force)) = (self.contacts, self.max_contacts, self.max_force) {
            text.row(
                "contacts",
                format_args!("{contacts} forces, at most {most} at a point and {force:.4} N on a node"),
            );
        }
        if let Some(depth) = self.max_depth {
            text.row("depth", format_args!("at most {:.3} mm below the surface at rest", depth * 1e3));
        }
        if let Some(energy) = self.max_energy {
            text.row("energy", format_args!("at most {energy:.5} J"));
        }
        if let Some(residual) = self.max_residual {
            text.row("residual", format_args!("at most {residual:.1e} where converged"));
        }
        if let Some([nodes, triangles]) = self.surface {
            text.row(
                "surface",
                format_args!(
                    "{}, {}",
                    counted(nodes, ["node", "nodes"]),
                    counted(triangles, ["triangle", "triangles"])
                ),
            );
        }
    }
}

/// Describes which columns a dataset does not hold.
pub fn describe_absent(text: &mut Text, absent: &[&str]) {
    if !absent.is_empty() {
        text.row("not there", absent.join(", "));
    }
}

impl Describe for Provenance {
    fn describe(&self, text: &mut Text) {
        self.mesh_ripple.describe(text);
        self.relaxation.describe(text);
        self.friction.describe(text);
        describe_error(text, self.error.as_ref(), self.aim);
        let [date, version, algorithm, backend, adapter] =
            [&self.date, &self.version, &self.algorithm, &self.backend, &self.adapter].map(|text| escaped(text));
        // Measured torques were not solved for: they have no residual.
        let residual = if self.tolerance > 0.0 { format!(" to {:.0e}", self.tolerance) } else { String::new() };
        text.row("made", format_args!("{date} by haptize {version}: {algorithm}{residual} on {backend} ({adapter})"));
        describe_notices(text, &self.notices);
    }
}

/// Describes what the user of a dataset should know.
pub fn describe_notices(text: &mut Text, notices: &[String]) {
    notices.iter().for_each(|notice| text.row("notice", escaped(notice)));
}
