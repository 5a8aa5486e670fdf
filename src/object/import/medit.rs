//! MEDIT files (Frey, MEDIT: an interactive mesh visualization software, 2001), as text: fTetWild, Mmg, FreeFem.
//!
//! `Keyword`, a count, and so many records of numbers. Read are `Vertices`, faces and solid cells, whose last number is
//! a region; what else is made of numbers is read past.

use super::{
    cell::CellType,
    elements::Elements,
    numbers::{NumberType, Numbers},
};
use glam::DVec3;

/// Cells of first order, and their types in Gmsh's numbers.
const CELLS: [(&str, u64); 6] =
    [("Triangles", 2), ("Quadrilaterals", 3), ("Tetrahedra", 4), ("Hexahedra", 5), ("Prisms", 6), ("Pyramids", 7)];

/// Reads a file. Regions are the references of solid cells.
pub(super) fn read(bytes: &[u8], elements: &mut Elements<'_>) -> Result<(), String> {
    let mut file = Numbers::text_with_remarks(bytes);
    if file.word().is_none_or(|word| word != "MeshVersionFormatted") {
        return Err("it does not begin with MeshVersionFormatted: it is no MEDIT text; a binary one (.meshb) is not \
                    read"
            .to_owned());
    }
    file.parse::<u64>()?;
    while let Some(word) = file.word() {
        match &*word {
            "End" => return Ok(()),
            "Dimension" => {
                if file.parse::<u64>()? != 3 {
                    return Err(file.error("the mesh is flat: give one of three dimensions"));
                }
            }
            "Vertices" => {
                for _ in 0..file.parse::<u64>()? {
                    let position = [file.parse()?, file.parse()?, file.parse()?];
                    elements.nodes.push(DVec3::from_array(position));
                    file.parse::<f64>()?;
                }
            }
            word if word.contains("P2") || word.contains("Q2") => {
                return Err(file.error(format_args!("{word} are of second order: save the mesh in first order")));
            }
            word => {
                let cell = CELLS.iter().find(|(name, _)| *name == word).and_then(|(_, kind)| CellType::of_gmsh(*kind));
                match cell {
                    Some(cell) => cells(&mut file, cell, elements)?,
                    None if word.parse::<f64>().is_ok() => {}
                    None if word.starts_with(|c: char| c.is_ascii_alphabetic()) => {}
                    None => return Err(file.error("a keyword or a number belongs here: export the mesh again")),
                }
            }
        }
    }
    Ok(())
}

/// Reads the cells behind a keyword.
fn cells(file: &mut Numbers<'_>, cell: &CellType, elements: &mut Elements<'_>) -> Result<(), String> {
    for _ in 0..file.parse::<u64>()? {
        let mut nodes = Vec::new();
        for _ in 0..cell.nodes.unwrap_or(0) {
            let node = file.integer(NumberType::I32)?;
            let node = node.checked_sub(1).and_then(|node| u32::try_from(node).ok());
            nodes.push(node.ok_or_else(|| file.error("vertices are counted from 1: export the mesh again"))?);
        }
        let region = u32::try_from(file.parse::<i64>()?).unwrap_or(0);
        elements.add(cell, &nodes, region).map_err(|reason| file.error(reason))?;
    }
    Ok(())
}
