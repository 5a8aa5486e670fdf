//! Tetrahedra from Gmsh files, ASCII of versions 2.2 and 4.1.
//!
//! Read are `$MeshFormat`, `$Nodes`, the physical volumes in `$Entities` (4.1) and the elements of type 4 (tetrahedra
//! of four nodes) in `$Elements`; points, lines and triangles, which Gmsh writes for boundaries, and all other sections
//! are read past. The surface is what it always is: the faces that belong to one tetrahedron only. Every error names
//! the line. Nothing is reserved for what a file announces before it is there.

use glam::DVec3;
use std::collections::HashMap;
use std::io::BufRead;

/// Nodes and tetrahedra, corners by position in `nodes`.
pub(super) struct Mesh {
    pub nodes: Vec<DVec3>,
    pub tetrahedra: Vec<[u32; 4]>,
    /// Physical volume of each tetrahedron, 0 outside all; empty if the file names none.
    pub regions: Vec<u32>,
}

/// Tetrahedra as they come.
#[derive(Default)]
struct Tetrahedra {
    corners: Vec<[u32; 4]>,
    regions: Vec<u32>,
    /// Physical volume of each volume of the geometry (version 4.1), by Gmsh's tags.
    volumes: HashMap<i64, u32>,
}

/// Gmsh's number for a tetrahedron of four nodes.
const TETRAHEDRON: u64 = 4;

/// Reads a file; errors begin with the number of the line.
pub(super) fn read(stream: &mut impl BufRead) -> Result<Mesh, String> {
    let mut lines = Lines { stream, number: 0, text: String::new() };
    let mut version = None;
    let mut nodes = Nodes::default();
    let mut tetrahedra = Tetrahedra::default();
    while lines.next()? {
        match lines.text.as_str() {
            "$MeshFormat" => version = Some(format(&mut lines)?),
            "$Nodes" => match version.ok_or_else(|| lines.error("$Nodes comes before $MeshFormat"))? {
                Version::Two => nodes_2(&mut lines, &mut nodes)?,
                Version::Four => nodes_4(&mut lines, &mut nodes)?,
            },
            "$Elements" => match version.ok_or_else(|| lines.error("$Elements comes before $MeshFormat"))? {
                Version::Two => elements_2(&mut lines, &nodes, &mut tetrahedra)?,
                Version::Four => elements_4(&mut lines, &nodes, &mut tetrahedra)?,
            },
            "$Entities" => match version.ok_or_else(|| lines.error("$Entities comes before $MeshFormat"))? {
                Version::Two => skip(&mut lines)?,
                Version::Four => entities(&mut lines, &mut tetrahedra.volumes)?,
            },
            section if section.starts_with('$') => skip(&mut lines)?,
            _ => return Err(lines.error("this is no section of a Gmsh file")),
        }
    }
    if version.is_none() {
        return Err("it has no $MeshFormat: it is no Gmsh file".to_owned());
    }
    let Tetrahedra { corners: tetrahedra, mut regions, .. } = tetrahedra;
    if tetrahedra.is_empty() {
        return Err("it has no tetrahedra of four nodes: mesh the volume in first order (gmsh -3 -order 1)".to_owned());
    }
    if regions.iter().all(|region| *region == 0) {
        regions.clear();
    }
    Ok(Mesh { nodes: nodes.positions, tetrahedra, regions })
}

#[derive(Clone, Copy)]
enum Version {
    Two,
    Four,
}

/// Nodes as they come, and their numbers by Gmsh's tags.
#[derive(Default)]
struct Nodes {
    positions: Vec<DVec3>,
    numbers: HashMap<u64, u32>,
}

impl Nodes {
    fn add(&mut self, lines: &Lines<'_, impl BufRead>, tag: u64, position: [f64; 3]) -> Result<(), String> {
        let number = u32::try_from(self.positions.len()).map_err(|_| lines.error("there are too many nodes"))?;
        if self.numbers.insert(tag, number).is_some() {
            return Err(lines.error(&format!("node {tag} is there twice")));
        }
        self.positions.push(DVec3::from_array(position));
        Ok(())
    }

    fn corners(&self, lines: &Lines<'_, impl BufRead>, tags: [u64; 4]) -> Result<[u32; 4], String> {
        let mut corners = [0; 4];
        for (corner, tag) in corners.iter_mut().zip(tags) {
            *corner = *self.numbers.get(&tag).ok_or_else(|| lines.error(&format!("there is no node {tag}")))?;
        }
        Ok(corners)
    }
}

/// The file line by line.
struct Lines<'a, R> {
    stream: &'a mut R,
    number: usize,
    /// Without white space at its ends.
    text: String,
}

impl<R: BufRead> Lines<'_, R> {
    /// Goes on to the next line that is not empty; false at the end.
    fn next(&mut self) -> Result<bool, String> {
        loop {
            self.text.clear();
            self.number += 1;
            let length = self.stream.read_line(&mut self.text).map_err(|error| self.error(&error.to_string()))?;
            if length == 0 {
                return Ok(false);
            }
            let trimmed = self.text.trim();
            if !trimmed.is_empty() {
                self.text = trimmed.to_owned();
                return Ok(true);
            }
        }
    }

    /// Goes on to a line that must be there.
    fn require(&mut self) -> Result<(), String> {
        if self.next()? { Ok(()) } else { Err(self.error("the file ends within a section")) }
    }

    fn end(&mut self, section: &str) -> Result<(), String> {
        self.require()?;
        if self.text == section { Ok(()) } else { Err(self.error(&format!("{section} is expected here"))) }
    }

    /// The first N numbers of the line, and how many there are in all.
    fn numbers<T: std::str::FromStr + Copy + Default, const N: usize>(&self) -> Result<([T; N], usize), String> {
        let mut numbers = [T::default(); N];
        let mut words = self.text.split_ascii_whitespace();
        for (found, number) in numbers.iter_mut().enumerate() {
            let word = words.next().ok_or_else(|| self.error(&format!("{found} numbers instead of {N}")))?;
            *number =
                word.parse().map_err(|_| self.error(&format!("{word:?} is not such a number as belongs here")))?;
        }
        Ok((numbers, N + words.count()))
    }

    /// Number k of the line.
    fn number_at<T: std::str::FromStr>(&self, k: usize) -> Result<T, String> {
        let word = self.text.split_ascii_whitespace().nth(k);
        word.and_then(|word| word.parse().ok())
            .ok_or_else(|| self.error(&format!("number {} is missing or none", k + 1)))
    }

    fn error(&self, reason: &str) -> String {
        let start: String = self.text.chars().take(60).collect();
        format!("line {}: {reason}: {start:?}", self.number)
    }
}

fn format(lines: &mut Lines<'_, impl BufRead>) -> Result<Version, String> {
    lines.require()?;
    let ([version, kind], _) = lines.numbers::<f64, 2>()?;
    let version = match (version, kind) {
        (2.2, 0.0) => Version::Two,
        (4.1, 0.0) => Version::Four,
        (2.2 | 4.1, _) => return Err(lines.error("the file is binary: save it as ASCII (gmsh -bin 0)")),
        _ => return Err(lines.error("only versions 2.2 and 4.1 are read (gmsh -format msh41)")),
    };
    lines.end("$EndMeshFormat")?;
    Ok(version)
}

/// Reads past a section.
fn skip(lines: &mut Lines<'_, impl BufRead>) -> Result<(), String> {
    let end = format!("$End{}", &lines.text[1..]);
    loop {
        lines.require()?;
        if lines.text == end {
            return Ok(());
        }
    }
}

/// `points curves surfaces volumes`, then one line for each; that of a volume has its tag, six bounds, the number of
/// its physical volumes and these, of which the first counts.
fn entities(lines: &mut Lines<'_, impl BufRead>, volumes: &mut HashMap<i64, u32>) -> Result<(), String> {
    lines.require()?;
    let ([points, curves, surfaces, count], _) = lines.numbers::<u64, 4>()?;
    for _ in 0..points.saturating_add(curves).saturating_add(surfaces) {
        lines.require()?;
    }
    for _ in 0..count {
        lines.require()?;
        if lines.number_at::<u64>(7)? > 0 {
            volumes.insert(lines.number_at(0)?, lines.number_at(8)?);
        }
    }
    lines.end("$EndEntities")
}

fn nodes_2(lines: &mut Lines<'_, impl BufRead>, nodes: &mut Nodes) -> Result<(), String> {
    lines.require()?;
    let ([count], _) = lines.numbers::<u64, 1>()?;
    for _ in 0..count {
        lines.require()?;
        let tag = lines.number_at(0)?;
        let position = [lines.number_at(1)?, lines.number_at(2)?, lines.number_at(3)?];
        nodes.add(lines, tag, position)?;
    }
    lines.end("$EndNodes")
}

/// `blocks nodes least greatest`, then blocks: `dimension entity parametric nodes`, their tags, their positions.
fn nodes_4(lines: &mut Lines<'_, impl BufRead>, nodes: &mut Nodes) -> Result<(), String> {
    lines.require()?;
    let ([blocks], _) = lines.numbers::<u64, 1>()?;
    for _ in 0..blocks {
        lines.require()?;
        let ([_, _, _, count], _) = lines.numbers::<i64, 4>()?;
        let mut tags = Vec::new();
        for _ in 0..count {
            lines.require()?;
            tags.push(lines.numbers::<u64, 1>()?.0[0]);
        }
        for tag in tags {
            lines.require()?;
            let (position, _) = lines.numbers::<f64, 3>()?;
            nodes.add(lines, tag, position)?;
        }
    }
    lines.end("$EndNodes")
}

fn elements_2(lines: &mut Lines<'_, impl BufRead>, nodes: &Nodes, tetrahedra: &mut Tetrahedra) -> Result<(), String> {
    lines.require()?;
    let ([count], _) = lines.numbers::<u64, 1>()?;
    for _ in 0..count {
        lines.require()?;
        // Number, type, count of labels, labels, nodes.
        let ([_, kind, labels], all) = lines.numbers::<u64, 3>()?;
        if kind == TETRAHEDRON {
            let first = usize::try_from(labels).unwrap_or(usize::MAX).saturating_add(3);
            if first.saturating_add(4) != all {
                return Err(lines.error("a tetrahedron must have four nodes"));
            }
            // The first label is the physical volume.
            let region = if labels > 0 { lines.number_at(3)? } else { 0 };
            let mut tags = [0; 4];
            for (k, tag) in tags.iter_mut().enumerate() {
                *tag = lines.number_at(first + k)?;
            }
            tetrahedra.corners.push(nodes.corners(lines, tags)?);
            tetrahedra.regions.push(region);
        }
    }
    lines.end("$EndElements")
}

/// `blocks elements least greatest`, then blocks: `dimension entity type elements`, and lines of a number and the
/// nodes.
fn elements_4(lines: &mut Lines<'_, impl BufRead>, nodes: &Nodes, tetrahedra: &mut Tetrahedra) -> Result<(), String> {
    lines.require()?;
    let ([blocks], _) = lines.numbers::<u64, 1>()?;
    for _ in 0..blocks {
        lines.require()?;
        let ([_, entity, kind, count], _) = lines.numbers::<i64, 4>()?;
        let region = tetrahedra.volumes.get(&entity).copied().unwrap_or(0);
        for _ in 0..count {
            lines.require()?;
            if kind == TETRAHEDRON as i64 {
                let ([_, tags @ ..], all) = lines.numbers::<u64, 5>()?;
                if all != 5 {
                    return Err(lines.error("a tetrahedron must have four nodes"));
                }
                tetrahedra.corners.push(nodes.corners(lines, tags)?);
                tetrahedra.regions.push(region);
            }
        }
    }
    lines.end("$EndElements")
}
