//! VTK's files: a session as a series of grids, and C-space as an image. `docs/tools.py` has VTK and meshio read them.

use crate::report::{arm, counts, dataset, recording, sphere};
use base64::{Engine, prelude::BASE64_STANDARD};
use bytemuck::{Pod, pod_collect_to_vec};
use glam::DVec3;
use haptize::{dataset::Format, report::series};
use roxmltree::Document;
use std::{fs, path::Path};

/// Numbers of the array called `name`, which are of VTK's type `kind`.
fn array<T: Pod>(document: &Document<'_>, name: &str, kind: &str) -> Vec<T> {
    let is_it = |node: &roxmltree::Node<'_, '_>| node.attribute("Name") == Some(name);
    let node = document.descendants().find(is_it).unwrap_or_else(|| panic!("no array {name}"));
    assert_eq!((node.attribute("type"), node.attribute("format")), (Some(kind), Some("binary")), "{name}");
    let bytes = BASE64_STANDARD.decode(node.text().unwrap()).unwrap();
    let (length, numbers) = bytes.split_first_chunk().unwrap();
    assert_eq!(u64::from_le_bytes(*length) as usize, numbers.len(), "{name}");
    pod_collect_to_vec(numbers)
}

fn vectors(document: &Document<'_>, name: &str) -> Vec<DVec3> {
    array::<f64>(document, name, "Float64").chunks_exact(3).map(DVec3::from_slice).collect()
}

fn attribute(document: &Document<'_>, element: &str, name: &str) -> String {
    let element = document.descendants().find(|node| node.has_tag_name(element)).unwrap();
    element.attribute(name).unwrap().to_owned()
}

fn text(folder: &Path, file: &str) -> String {
    fs::read_to_string(folder.join(file)).unwrap()
}

#[test]
fn a_series_holds_the_object_of_each_frame_and_the_arm_beside_it() {
    let folder = tempfile::tempdir().unwrap();
    let (chain, object) = (arm(3), sphere());
    let (dataset, trace) = (dataset(&chain, &object, counts(3)), recording(&chain, &object, 1500));
    let written = series::write(folder.path(), &dataset, &chain, &trace, None).unwrap();
    let frames = trace.frames.len();
    assert_eq!(written.len(), 2 * frames + 1);
    assert!(series::files(frames).all(|file| written.contains(&folder.path().join(file))));

    let list = text(folder.path(), series::LIST);
    let list = Document::parse(&list).unwrap();
    let mut pose = chain.new_pose();
    let mut pushed = 0;
    for (number, entry) in list.descendants().filter(|node| node.has_tag_name("DataSet")).enumerate() {
        let (frame, part) = (&trace.frames[number / 2], number % 2);
        let entry = |name| entry.attribute(name).unwrap();
        assert_eq!((entry("timestep").parse(), entry("part").parse()), (Ok(frame.time), Ok(part)));
        let file = text(folder.path(), entry("file"));
        let grid = Document::parse(&file).unwrap();
        let points = vectors(&grid, "Points");
        let connectivity: Vec<u32> = array(&grid, "connectivity", "UInt32");
        let ends: Vec<u32> = array(&grid, "offsets", "UInt32");
        let types: Vec<u8> = array(&grid, "types", "UInt8");
        assert_eq!(attribute(&grid, "Piece", "NumberOfPoints"), points.len().to_string());
        assert_eq!(attribute(&grid, "Piece", "NumberOfCells"), types.len().to_string());
        assert!(connectivity.iter().all(|point| (*point as usize) < points.len()));
        // A vertex, a line and a triangle are VTK's types 1, 3 and 5.
        let begins = [0].into_iter().chain(ends.iter().copied());
        assert!(
            begins.zip(&ends).zip(&types).all(|((begin, end), kind)| [0, 1, 3, 5][(end - begin) as usize] == *kind)
        );
        assert_eq!(ends.last().map(|end| *end as usize), Some(connectivity.len()));
        if part == 1 {
            chain.pose(&frame.proxy, &mut pose);
            assert_eq!(points, [&pose.origins[..], &pose.nodes].concat());
            continue;
        }
        assert_eq!(points, frame.nodes);
        assert_eq!(connectivity, object.triangles.concat());
        let displacement = vectors(&grid, "displacement [m]");
        let forces = vectors(&grid, "contact force [N]");
        for (node, rest) in object.rest[..object.surface_nodes].iter().enumerate() {
            assert_eq!(displacement[node], frame.nodes[node] - *rest);
        }
        pushed += usize::from(forces.iter().any(|force| force.length() > 1e-3));
    }
    assert!(pushed > 10 && pushed < frames, "{pushed} of {frames}");

    let mut still = trace;
    still.frames.clear();
    let refused = series::write(folder.path(), &dataset, &chain, &still, None).unwrap_err().to_string();
    assert!(refused.contains("[graphics]"), "{refused}");
}

#[test]
fn c_space_is_an_image_whose_first_axis_runs_fastest() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("field.vti");
    for joints in [2, 3] {
        let dataset = dataset(&arm(joints), &sphere(), counts(joints));
        assert_eq!(dataset.export(&path, Format::Vti).unwrap(), std::slice::from_ref(&path));
        let text = text(folder.path(), "field.vti");
        let image = Document::parse(&text).unwrap();
        let numbers = |name| -> Vec<f64> {
            attribute(&image, "ImageData", name).split(' ').map(|number| number.parse().unwrap()).collect()
        };
        let (extent, origin, spacing) = (numbers("WholeExtent"), numbers("Origin"), numbers("Spacing"));
        let sides = [1, 3, 5].map(|end| extent[end] as usize + 1);
        let torque: Vec<f64> = array(&image, "torque", "Float64");
        let gap: Vec<f32> = array(&image, "gap [m]", "Float32");
        let status: Vec<u8> = array(&image, "status", "UInt8");
        let grid = &dataset.grid;
        assert_eq!((sides.iter().product::<usize>(), gap.len()), (grid.points(), grid.points()));
        for point in 0..grid.points() {
            let q = grid.configuration(point);
            let mut place = 0;
            for axis in (0..3).rev() {
                let line = q.get(axis).map_or(0, |q| ((q - origin[axis]) / spacing[axis]).round() as usize);
                place = place * sides[axis] + line;
            }
            assert_eq!(torque[joints * place..][..joints], *dataset.torque(point));
            assert_eq!(
                (gap[place], status[place]),
                (dataset.gap.as_ref().unwrap()[point], dataset.status(point) as u8)
            );
        }
        let names = image.descendants().find(|node| node.attribute("Name") == Some("torque")).unwrap();
        assert_eq!(names.attribute("ComponentName1"), Some("shoulder [N m]"));
    }
    for joints in [1, 4] {
        let refused =
            dataset(&arm(joints), &sphere(), counts(joints)).export(&path, Format::Vti).unwrap_err().to_string();
        assert!(refused.contains(&format!("the grid has {joints}")) && refused.contains("hdf5"), "{refused}");
    }
}
