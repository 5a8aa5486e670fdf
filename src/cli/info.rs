//! `haptize info`: what a dataset holds. The whole file is checked first.

use super::{Failure, Report};
use crate::{
    contact::MeshRipple,
    dataset::{Axis, Dataset, MeasuredError, Refinement, Summary},
    names::escaped,
    object::Skin,
    scene::{Material, ObjectSpec, Rendering, SkinSpec},
};
use glam::DVec3;
use std::{
    fmt::{self, Write},
    path::PathBuf,
};

/// Arguments of `haptize info`.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  haptize info sphere.haptize
  haptize info sphere.haptize --json")]
pub struct Arguments {
    /// The dataset's file.
    dataset: PathBuf,
}

/// Opens and checks the file, and sums it up.
pub fn run(arguments: &Arguments) -> Result<Report, Failure> {
    let path = &arguments.dataset;
    let dataset = Dataset::open(path)?;
    let summary = dataset.summary();
    let file_bytes = std::fs::metadata(path)?.len();
    let mut json = serde_json::to_value(&summary)?;
    json["file"] = path.display().to_string().into();
    json["file_bytes"] = file_bytes.into();
    json["absent"] = dataset.absent().into();
    let contradiction = dataset.check_scene().err();
    json["contradiction"] = contradiction.clone().into();
    let mut text = String::new();
    let state = if contradiction.is_some() { "intact" } else { "sound" };
    writeln!(text, "{}: {} points, {:.1} MB, {state}", path.display(), summary.points, file_bytes as f64 / 1e6)?;
    if let Some(contradiction) = &contradiction {
        writeln!(text, "  scene        does not describe this dataset: {contradiction}")?;
        writeln!(text, "               no command but info and export takes it: bake the scene again")?;
    }
    describe(&mut text, &summary, &dataset.absent())?;
    let spec = Rendering::parse(&dataset.scene, "scene").ok().and_then(|scene| scene.object);
    write_inclusions(&mut text, &mut json, &spec.as_ref().map_or_else(Vec::new, inclusions))?;
    if let Some(skin) = spec.and_then(|spec| skin(&dataset, spec.skin?)) {
        json["skin"] = serde_json::to_value(skin)?;
        writeln!(text, "  skin         {skin}")?;
    }
    Ok(Report { text, json, whole: contradiction.is_none() })
}

/// Returns the inclusions of the object, one description each.
pub fn inclusions(object: &ObjectSpec) -> Vec<String> {
    match &object.material {
        Material::Elastic(elastic) => elastic.inclusions.iter().map(ToString::to_string).collect(),
        Material::Springs(_) | Material::Hollow => Vec::new(),
    }
}

/// Writes these, for people and for programs.
pub fn write_inclusions(text: &mut String, json: &mut serde_json::Value, inclusions: &[String]) -> fmt::Result {
    if !inclusions.is_empty() {
        json["inclusions"] = inclusions.into();
    }
    inclusions.iter().try_for_each(|inclusion| writeln!(text, "  inclusion    {inclusion}"))
}

/// The skin `spec` on the dataset's surface.
fn skin(dataset: &Dataset, spec: SkinSpec) -> Option<Skin> {
    let surface = dataset.surface.as_ref()?;
    let nodes: Vec<DVec3> = surface.nodes.chunks_exact(3).map(DVec3::from_slice).collect();
    let triangles: Vec<[u32; 3]> = surface.triangles.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect();
    Some(Skin::new(spec, &nodes, &triangles))
}

fn describe(text: &mut String, summary: &Summary, absent: &[&str]) -> fmt::Result {
    for (axis, [least, greatest]) in summary.axes.iter().zip(&summary.torque) {
        let Axis { name, unit, start, step, count } = axis;
        let last = axis.coordinate(count - 1);
        let effort = axis.effort_unit();
        writeln!(text, "  {name:<12} {count} lines, {start:.4} to {last:.4} {unit} by {step:.4}")?;
        writeln!(text, "  {:<12} {least:.4} to {greatest:.4} {effort}", "")?;
    }
    if let Some(Refinement { nodes, bytes }) = &summary.refinement {
        let nodes: Vec<String> = nodes.iter().map(ToString::to_string).collect();
        writeln!(text, "  refined      {} nodes by level, {:.1} MB in memory", nodes.join(" + "), *bytes as f64 / 1e6)?;
    }
    let counts = &summary.statuses;
    write!(text, "  status       {} free, {} in contact", counts.free, counts.contact)?;
    for (count, word) in
        [(counts.unconverged, "unconverged"), (counts.overflow, "overflowed"), (counts.outside, "outside")]
    {
        if count > 0 {
            write!(text, ", {count} {word}")?;
        }
    }
    writeln!(text)?;
    if let (Some(contacts), Some(most), Some(force)) = (summary.contacts, summary.max_contacts, summary.max_force) {
        writeln!(text, "  contacts     {contacts} forces, at most {most} at a point and {force:.4} N on a node")?;
    }
    if let Some(depth) = summary.max_depth {
        writeln!(text, "  depth        at most {:.3} mm below the surface at rest", depth * 1e3)?;
    }
    if let Some(energy) = summary.max_energy {
        writeln!(text, "  energy       at most {energy:.5} J")?;
    }
    if let Some(residual) = summary.max_residual {
        writeln!(text, "  residual     at most {residual:.1e} where converged")?;
    }
    if let Some([nodes, triangles]) = summary.surface {
        writeln!(text, "  surface      {nodes} nodes, {triangles} triangles")?;
    }
    if !absent.is_empty() {
        writeln!(text, "  not there    {}", absent.join(", "))?;
    }
    let from = &summary.provenance;
    mesh_ripple(text, from.mesh_ripple)?;
    error(text, from.error.as_ref(), from.aim)?;
    let [date, version, algorithm, backend, adapter] =
        [&from.date, &from.version, &from.algorithm, &from.backend, &from.adapter].map(|text| escaped(text));
    write!(text, "  made         {date} by haptize {version}: {algorithm}")?;
    // Measured torques were not solved for: they have no residual.
    if from.tolerance > 0.0 {
        write!(text, " to {:.0e}", from.tolerance)?;
    }
    writeln!(text, " on {backend} ({adapter})")?;
    notices(text, &from.notices)
}

/// Writes what the user of a dataset should know, a line each.
pub fn notices(text: &mut String, notices: &[String]) -> fmt::Result {
    notices.iter().try_for_each(|notice| writeln!(text, "  notice       {}", escaped(notice)))
}

/// Writes how much a contact point feels the mesh, and what to do about it.
pub fn mesh_ripple(text: &mut String, ripple: Option<MeshRipple>) -> fmt::Result {
    let Some(ripple) = ripple else { return Ok(()) };
    writeln!(text, "  mesh ripple  {ripple}")?;
    ripple.remedy().map_or(Ok(()), |remedy| writeln!(text, "  {:<12} {remedy}", ""))
}

/// The error that the bake measured, and the one that its grid was chosen for.
pub fn error(text: &mut String, measured: Option<&MeasuredError>, aim: Option<f64>) -> fmt::Result {
    let Some(measured) = measured else { return writeln!(text, "  error        not measured") };
    for (number, line) in measured.lines().iter().enumerate() {
        writeln!(text, "  {:<12} {line}", if number == 0 { "error" } else { "" })?;
    }
    let MeasuredError { configurations, left_out, torque, unit, .. } = measured;
    if *configurations == 0 {
        return Ok(());
    }
    write!(text, "  {:<12} of the rms torque, {torque:.4} {unit}, at {configurations} random configurations", "")?;
    if *left_out > 0 {
        write!(text, "; {left_out} left out, which did not converge")?;
    }
    writeln!(text)?;
    let Some(aim) = aim else { return Ok(()) };
    let verdict = if measured.keeps(aim) { "kept" } else { "missed" };
    writeln!(text, "  {:<12} asked for: {:.2} % rms, {verdict}", "", 100.0 * aim)
}
