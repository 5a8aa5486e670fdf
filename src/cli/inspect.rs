//! `haptize inspect`: one configuration in full.

use super::{Failure, Report};
use crate::{
    JointVector,
    contact::Model,
    dataset::{self, Dataset},
    haptize::Inspection,
    object::Object,
    proxy::Chain,
    scene::{Algorithm, Scene},
};
use clap::ValueEnum;
use glam::DVec3;
use std::{
    fmt::{self, Write},
    path::{Path, PathBuf},
};

/// What to look at, and where.
#[derive(clap::Args)]
pub struct Arguments {
    /// A scene's or a dataset's file.
    file: PathBuf,
    /// The configuration: one coordinate a joint [rad or m], separated by commas.
    #[arg(
        long,
        value_name = "A,B,C",
        value_delimiter = ',',
        num_args = 1,
        allow_hyphen_values = true,
        required = true
    )]
    q: Vec<f64>,
}

/// Solves the configuration anew, and beside it tells what a dataset has stored at the nearest grid point.
pub fn run(arguments: &Arguments) -> Result<Report, Failure> {
    let q = &arguments.q;
    let (scene, object, dataset) = read(&arguments.file)?;
    let chain = Chain::new(&scene.proxy);
    if q.len() != chain.joints.len() || !q.iter().all(|x| x.is_finite()) {
        let names: Vec<_> = chain.joints.iter().map(|joint| joint.name.as_str()).collect();
        return Err(format!("--q must be {} finite numbers: {}", names.len(), names.join(",")).into());
    }
    let model = Model::reaching(&object, &chain, scene.contact, &[JointVector::from_slice(q)])?;
    let inspection = Inspection::new(&model, q);
    let mut json = serde_json::to_value(&inspection)?;
    let mut text = String::new();
    describe(&mut text, &inspection)?;
    if let Some(skin) = object.skin {
        json["skin"] = serde_json::to_value(skin)?;
        writeln!(text, "  skin         {skin}")?;
    }
    if let Some(point) = dataset.as_ref().and_then(|dataset| dataset.grid.nearest(q).map(|point| (dataset, point))) {
        let (dataset, point) = point;
        let stored = dataset.grid.configuration(point);
        let status = format!("{:?}", dataset.status(point)).to_lowercase();
        json["stored"] = serde_json::json!({
            "point": point, "q": *stored, "status": status, "torque": dataset.torque(point),
            "forces": dataset.forces(point).map(|f| serde_json::json!({"node": f.node, "force": f.force})).collect::<Vec<_>>(),
        });
        writeln!(text, "stored at point {point}, q = {}: {status}", numbers(&stored))?;
        writeln!(text, "  torque       {}", numbers(dataset.torque(point)))?;
    }
    Ok(Report { text, json, whole: true })
}

/// The scene and its object, from either kind of file. A dataset holds both: neither scene nor mesh file is needed.
fn read(path: &Path) -> Result<(Scene, Object, Option<Dataset>), Failure> {
    let dataset = match Dataset::open(path) {
        Ok(dataset) => dataset,
        Err(dataset::Error::Foreign { .. }) => {
            let scene = Scene::load(path)?;
            let object = Object::build(&scene.object)?;
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
    let mut scene = Scene::parse(&dataset.scene, path)?;
    scene.contact.algorithm = Algorithm::from_str(&dataset.provenance.algorithm, true)?;
    let object = surface.object(&scene.object)?;
    Ok((scene, object, Some(dataset)))
}

fn describe(text: &mut String, inspection: &Inspection) -> fmt::Result {
    let Inspection { q, status, iterations, residual, energy, gap, torque, proxy_nodes, object_nodes } = inspection;
    writeln!(text, "q = {}: {status}", numbers(q))?;
    writeln!(text, "  torque       {}", numbers(torque))?;
    writeln!(text, "  energy       {energy:.6} J")?;
    writeln!(text, "  gap          {:.3} mm to the surface at rest", gap * 1e3)?;
    writeln!(text, "  solved       in {iterations} iterations to a residual of {residual:.1e}")?;
    writeln!(text, "proxy nodes: x [m] (force [N] on object nodes with weights, J by columns)")?;
    for (number, node) in proxy_nodes.iter().enumerate() {
        writeln!(text, "  {number:<3} {:<10} {}", node.link, numbers(&node.position.to_array()))?;
        for contact in &node.contacts {
            let carriers =
                contact.nodes.iter().zip(&contact.weights).map(|(node, weight)| format!("{node} ({weight:.3})"));
            let carriers = carriers.collect::<Vec<_>>().join(" ");
            writeln!(text, "      force {} on {carriers}", numbers(&contact.force.to_array()))?;
        }
        if !node.contacts.is_empty() {
            let columns: Vec<_> = node.jacobian.iter().map(|column| numbers(&column.to_array())).collect();
            writeln!(text, "      J     {}", columns.join("  "))?;
        }
    }
    writeln!(text, "object nodes pushed: n [m], displacement [mm], force [N]")?;
    for (number, node) in object_nodes.iter().enumerate().filter(|(_, node)| node.force != DVec3::ZERO) {
        let moved = (node.position - node.rest) * 1e3;
        let [position, moved, force] = [node.position, moved, node.force].map(|v| numbers(&v.to_array()));
        writeln!(text, "  {number:<5} {position} {moved} {force}")?;
    }
    Ok(())
}

fn numbers(values: &[f64]) -> String {
    let values: Vec<_> = values.iter().map(|value| format!("{value:.5}")).collect();
    format!("[{}]", values.join(", "))
}
