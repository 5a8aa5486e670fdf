//! A session as a series of VTK files: the object with displacement and contact force at each node, and the arm.

use super::object::{Instant, links};
use crate::{
    Error,
    dataset::Dataset,
    proxy::{Chain, Triangles, shape_frame},
    render::{live::LiveScene, trace::Trace},
    vtk::{self, Mesh},
};
use glam::DVec3;
use std::{
    io,
    path::{Path, PathBuf},
    sync::Arc,
};

/// File that names all others.
pub const LIST: &str = "session.pvd";

/// Parts of a series, by the names of their files.
const PARTS: [&str; 2] = ["object", "arm"];

/// Files of a series of `frames`.
pub fn files(frames: usize) -> impl Iterator<Item = String> {
    let parts = (0..frames).flat_map(|frame| PARTS.map(|part| name(part, frame)));
    parts.chain([LIST.to_owned()])
}

fn name(part: &str, frame: usize) -> String {
    format!("{part}_{frame:04}.vtu")
}

/// Writes the frames of `trace` into `folder`, which is made if it is missing, and returns the files. `live`: the scene,
/// where its contact was solved in every tick.
///
/// # Errors
/// When the session has no frames or the dataset no surface, frames, dataset and chain do not belong together, or a file
/// cannot be written.
pub fn write(
    folder: &Path,
    dataset: &Dataset,
    chain: &Chain,
    trace: &Trace,
    live: Option<&Arc<LiveScene>>,
) -> Result<Vec<PathBuf>, Error> {
    let surface = dataset.surface.as_ref().filter(|_| !trace.frames.is_empty()).ok_or_else(|| {
        crate::error!("there is no deformed object to write as VTU: give the scene an object and a [graphics] table")
    })?;
    let rest: Vec<DVec3> = surface.places().collect();
    let triangles: Vec<Vec<u32>> = surface.facets().iter().map(|facet| facet.to_vec()).collect();
    let shapes = links(&dataset.scene);
    let (mut files, mut list) = (Vec::new(), Vec::new());
    for (number, instant) in
        super::object::instants_at(dataset, chain, trace, trace.frames.iter(), live.cloned())?.iter().enumerate()
    {
        let nodes = &instant.nodes[..rest.len()];
        let displacement: Vec<DVec3> = nodes.iter().zip(&rest).map(|(n, n0)| *n - *n0).collect();
        let mut force = vec![DVec3::ZERO; rest.len()];
        for at in &instant.forces {
            if let Some(force) = force.get_mut(at.node as usize) {
                *force = at.force;
            }
        }
        let data = [("displacement [m]", &displacement[..]), ("contact force [N]", &force)];
        let (points, cells) = arm(chain, instant, &shapes);
        let meshes = [
            Mesh { points: nodes, cells: &triangles, data: &data },
            Mesh { points: &points, cells: &cells, data: &[] },
        ];
        for (part, mesh) in meshes.iter().enumerate() {
            let what = format!("{} at {} s", PARTS[part], instant.time);
            let file = name(PARTS[part], number);
            files.push(write_file(folder.join(&file), |out| vtk::grid(out, &what, mesh))?);
            list.push((instant.time, part, file));
        }
    }
    files.push(write_file(folder.join(LIST), |out| vtk::series(out, &list))?);
    Ok(files)
}

fn write_file(path: PathBuf, content: impl FnOnce(&mut Vec<u8>) -> io::Result<()>) -> Result<PathBuf, Error> {
    let mut text = Vec::new();
    content(&mut text).map_err(|error| Error::at(&path, format_args!("cannot be written: {error}")))?;
    super::write(path, &text)
}

/// The arm at an instant: a line from joint to joint, a vertex for each contact node, and the triangles of the links.
fn arm(chain: &Chain, instant: &Instant, shapes: &[(Option<usize>, Triangles)]) -> (Vec<DVec3>, Vec<Vec<u32>>) {
    let pose = &instant.pose;
    let mut points: Vec<DVec3> = pose.origins.iter().chain(&pose.nodes).copied().collect();
    let joints = pose.origins.len() as u32;
    let mut cells: Vec<Vec<u32>> = (1..joints).map(|joint| vec![joint - 1, joint]).collect();
    for (number, node) in chain.nodes.iter().enumerate() {
        let number = joints + number as u32;
        cells.extend([vec![node.link as u32, number], vec![number]]);
    }
    for (joint, (nodes, triangles)) in shapes {
        let (frame, first) = (shape_frame(*joint, pose), points.len() as u32);
        points.extend(nodes.iter().map(|node| frame.transform_point3(*node)));
        cells.extend(triangles.iter().map(|triangle| triangle.map(|node| first + node).to_vec()));
    }
    (points, cells)
}
