//! TetGen files (Si, TetGen, ACM Transactions on Mathematical Software 41(2), 2015; manual, section 5.2): nodes in
//! `.node`, tetrahedra in `.ele`, which lie beside one another.
//!
//! Records of numbers, the first of which says how many follow; numbers of nodes begin from 0 or from 1.

use super::{
    Input, Mesh,
    cell::CellType,
    elements::Elements,
    numbers::{NumberType, Numbers},
    open,
};
use glam::DVec3;
use std::io::Read;

/// Gmsh's number of tetrahedra.
const TETRAHEDRA: u64 = 4;

/// Reads both files of a mesh. Regions are the first attributes of tetrahedra.
pub(super) fn read(input: &mut Input<'_>) -> Result<Mesh, String> {
    let bytes = |ending: &str| -> Result<Vec<u8>, String> {
        let file = input.path.with_extension(ending);
        let mut bytes = Vec::new();
        open(&file)
            .map_err(|error| format!("its nodes are in .node and its tetrahedra in .ele beside it: {error}"))?
            .read_to_end(&mut bytes)
            .map_err(|error| error.to_string())?;
        Ok(bytes)
    };
    let mut elements = Elements::new(input.wanted);
    let named = |ending: &'static str| move |reason: String| format!("{ending}: {reason}");
    let first = nodes(&bytes("node")?, &mut elements).map_err(named(".node"))?;
    tetrahedra(&bytes("ele")?, first, &mut elements).map_err(named(".ele"))?;
    elements.mesh()
}

/// `points dimension attributes has-marker`, then records of a number, a position, attributes and a marker; the number
/// of the first node.
fn nodes(bytes: &[u8], elements: &mut Elements<'_>) -> Result<i64, String> {
    let mut file = Numbers::text_with_remarks(bytes);
    let (count, dimension): (u64, u64) = (file.parse()?, file.parse()?);
    let others = file.parse::<u64>()?.saturating_add(file.parse()?);
    if dimension != 3 {
        return Err(file.error("the second number of the first line is the dimension, which must be 3"));
    }
    let mut first = 1;
    for node in 0..count {
        let number: i64 = file.parse()?;
        first = if node == 0 { number } else { first };
        if !matches!(first, 0 | 1) || number.checked_sub(first) != i64::try_from(node).ok() {
            return Err(file.error("nodes are numbered one after the other from 0 or 1: export the mesh again"));
        }
        elements.nodes.push(DVec3::from_array([file.parse()?, file.parse()?, file.parse()?]));
        (0..others).try_for_each(|_| file.parse::<f64>().map(drop))?;
    }
    Ok(first)
}

/// `tetrahedra nodes attributes`, then records of a number, the nodes and attributes. `first`: number of the first node.
fn tetrahedra(bytes: &[u8], first: i64, elements: &mut Elements<'_>) -> Result<(), String> {
    let mut file = Numbers::text_with_remarks(bytes);
    let (count, nodes, attributes): (u64, u64, u64) = (file.parse()?, file.parse()?, file.parse()?);
    if nodes != 4 {
        return Err(file.error("only tetrahedra of four nodes are read: run TetGen without -o2"));
    }
    let Some(cell) = CellType::of_gmsh(TETRAHEDRA) else { return Ok(()) };
    for _ in 0..count {
        file.parse::<i64>()?;
        let mut corners = [0; 4];
        for corner in &mut corners {
            let node = file.integer(NumberType::I32)?.checked_sub(first).and_then(|node| u32::try_from(node).ok());
            *corner = node.ok_or_else(|| file.error("there is no such node: export the mesh again"))?;
        }
        let mut region = 0;
        for attribute in 0..attributes {
            let value: f64 = file.parse()?;
            region = if attribute == 0 { value as u32 } else { region };
        }
        elements.add(cell, &corners, region).map_err(|reason| file.error(reason))?;
    }
    Ok(())
}
