//! Tetrahedra from Gmsh files, ASCII of versions 2.2 and 4.1.
//!
//! Read are `$MeshFormat`, `$Nodes` (or `$ParametricNodes`), the physical volumes in `$Entities` and
//! `$PartitionedEntities` (4.1) and the volume elements of first and second order in `$Elements`, which become
//! tetrahedra of that order; points, lines and triangles, which Gmsh writes for boundaries, and all other sections are
//! read past, and elements of higher order are refused. An element that is written once for each of its physical
//! volumes counts once. The surface is what it always is: the faces that belong to one tetrahedron only. Every error
//! names the line. Nothing is reserved for what a file announces before it is there.

use super::{
    division::{Kind, Middle},
    text,
};
use crate::object::element::TETRAHEDRON_EDGES;
use glam::DVec3;
use std::collections::{BTreeMap, HashMap};
use std::io::BufRead;

/// Nodes and tetrahedra, corners by position in `nodes`.
pub(super) struct Mesh {
    pub nodes: Vec<DVec3>,
    pub tetrahedra: Vec<[u32; 4]>,
    /// Nodes in the middles of their edges, in Gmsh's order; empty in first order.
    pub mid_nodes: Vec<[u32; 6]>,
    /// Physical volume of each tetrahedron, 0 outside all; empty if the file names none.
    pub regions: Vec<u32>,
}

/// Tetrahedra as they come.
struct Tetrahedra<'a> {
    corners: Vec<[u32; 4]>,
    /// As in [`Mesh`]; as many as there are tetrahedra, or none.
    mid_nodes: Vec<[u32; 6]>,
    regions: Vec<u32>,
    /// Their numbers, by their corners in ascending order.
    numbers: HashMap<[u32; 4], usize>,
    /// Nodes in the middles of edges that a division has made, by the ends of these in ascending order.
    middles: HashMap<[u32; 2], u32>,
    /// Physical volume of each volume of the geometry (version 4.1), by Gmsh's tags.
    volumes: HashMap<i64, u32>,
    /// Elements of other types, by Gmsh's numbers of these.
    others: BTreeMap<u64, u64>,
    /// Physical volumes that the scene names, the one that counts before others last.
    wanted: &'a [u32],
}

impl Tetrahedra<'_> {
    /// Adds an element of `kind`; `of_element` are its nodes, numbers of `nodes`.
    fn add(&mut self, kind: Kind, of_element: &[u32], region: u32, nodes: &mut Nodes) {
        for corners in kind.tetrahedra(of_element) {
            let tetrahedron = corners.map(|corner| of_element[corner]);
            let mut key = tetrahedron;
            key.sort_unstable();
            if let Some(&number) = self.numbers.get(&key) {
                let known = &mut self.regions[number];
                *known = choice(&[*known, region], self.wanted);
                continue;
            }
            self.numbers.insert(key, self.corners.len());
            self.corners.push(tetrahedron);
            self.regions.push(region);
            if kind.is_second_order() {
                let middle = |edge: [usize; 2]| match kind.middle(of_element, edge.map(|end| corners[end])) {
                    Middle::Node(node) => node,
                    Middle::Sum([a, b], sum) => *self.middles.entry([a.min(b), a.max(b)]).or_insert_with(|| {
                        let place = sum.iter().map(|&(node, weight)| weight * nodes.positions[node as usize]).sum();
                        nodes.positions.push(place);
                        nodes.positions.len() as u32 - 1
                    }),
                };
                self.mid_nodes.push(TETRAHEDRON_EDGES.map(middle));
            }
        }
    }

    /// Refuses a mesh of which the tetrahedra are not the whole.
    fn check(&self) -> Result<(), String> {
        let volumes: Vec<(u64, u64)> =
            self.others.iter().map(|(kind, count)| (*kind, *count)).filter(|(kind, _)| !is_boundary(*kind)).collect();
        let listed = |of: &[(u64, u64)]| {
            of.iter()
                .map(|(kind, count)| format!("{count} {} (type {kind})", name(*kind)))
                .collect::<Vec<_>>()
                .join(", ")
        };
        if !volumes.is_empty() {
            return Err(format!(
                "its volume has {}, of another order than the first and the second, which alone are read: save it in \
                 one of these (gmsh -3 -order 2)",
                listed(&volumes),
            ));
        }
        if !self.mid_nodes.is_empty() && self.mid_nodes.len() != self.corners.len() {
            return Err(
                "it has elements of first order beside some of second: save all in one order (gmsh -order 2)".into()
            );
        }
        if self.corners.is_empty() {
            let others: Vec<(u64, u64)> = self.others.iter().map(|(kind, count)| (*kind, *count)).collect();
            let only = if others.is_empty() { String::new() } else { format!(", but {}", listed(&others)) };
            return Err(format!(
                "it has no tetrahedra, hexahedra, prisms or pyramids{only}: mesh the volume (gmsh -3 -order 2); where there are \
                 physical groups, Gmsh saves only what is in one"
            ));
        }
        Ok(())
    }
}

/// The group that counts of those that hold a tetrahedron: of those in `wanted` the last, else the first that is one.
fn choice(groups: &[u32], wanted: &[u32]) -> u32 {
    let named = wanted.iter().rev().find(|wanted| groups.contains(wanted));
    named.or_else(|| groups.iter().find(|group| **group != 0)).copied().unwrap_or(0)
}

/// Is that Gmsh's number for a point, a line, a triangle, a quadrangle or a polygon, of any order?
fn is_boundary(kind: u64) -> bool {
    matches!(kind, 1..=3 | 8..=10 | 15 | 16 | 20..=28 | 34 | 36..=70 | 84..=86 | 133..=135 | 138)
}

/// What Gmsh's manual calls the commonest types.
fn name(kind: u64) -> &'static str {
    match kind {
        1 | 8 => "lines",
        2 | 9 => "triangles",
        3 | 10 | 16 => "quadrangles",
        15 => "points",
        _ => "elements",
    }
}

/// Reads a file; errors begin with the number of the line. `wanted`: the physical volumes that the scene names, in its
/// order.
pub(super) fn read(stream: &mut impl BufRead, wanted: &[u32]) -> Result<Mesh, String> {
    let mut lines = Lines { stream, number: 0, text: String::new(), at: 0 };
    let mut version = None;
    let mut nodes = Nodes::default();
    let mut tetrahedra = Tetrahedra {
        corners: Vec::new(),
        mid_nodes: Vec::new(),
        regions: Vec::new(),
        numbers: HashMap::new(),
        middles: HashMap::new(),
        volumes: HashMap::new(),
        others: BTreeMap::new(),
        wanted,
    };
    while lines.next()? {
        let section = lines.text.clone();
        if section == "$MeshFormat" {
            version = Some(format(&mut lines)?);
            continue;
        }
        // What is no Gmsh file is not quoted: a scene may come from anyone, and name any file.
        let Some(version) = version else {
            match section.as_str() {
                "$Nodes" | "$ParametricNodes" | "$Entities" | "$PartitionedEntities" | "$Elements" => {
                    return Err(format!("line {}: {section} comes before $MeshFormat", lines.number));
                }
                section if section.starts_with('$') => skip(&mut lines)?,
                _ => return Err(format!("line {}: no $MeshFormat comes first: it is no Gmsh file", lines.number)),
            }
            continue;
        };
        match (section.as_str(), version) {
            ("$Nodes" | "$ParametricNodes", Version::Two) => nodes_2(&mut lines, &mut nodes)?,
            ("$Nodes", Version::Four) => nodes_4(&mut lines, &mut nodes)?,
            ("$Elements", Version::Two) => elements_2(&mut lines, &mut nodes, &mut tetrahedra)?,
            ("$Elements", Version::Four) => elements_4(&mut lines, &mut nodes, &mut tetrahedra)?,
            ("$Entities" | "$PartitionedEntities", Version::Four) => entities(&mut lines, &mut tetrahedra)?,
            _ if section.starts_with('$') => skip(&mut lines)?,
            _ => return Err(lines.error("this is no section of a Gmsh file")),
        }
    }
    if version.is_none() {
        return Err("it has no $MeshFormat: it is no Gmsh file".to_owned());
    }
    tetrahedra.check()?;
    let Tetrahedra { corners: tetrahedra, mid_nodes, mut regions, .. } = tetrahedra;
    if regions.iter().all(|region| *region == 0) {
        regions.clear();
    }
    Ok(Mesh { nodes: nodes.positions, tetrahedra, mid_nodes, regions })
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

    /// The nodes of an element of `count` nodes, whose tags begin with number `first` of the line.
    fn element(&self, lines: &Lines<'_, impl BufRead>, first: usize, count: usize) -> Result<Vec<u32>, String> {
        let node = |k: usize| -> Result<u32, String> {
            let tag: u64 = lines.number_at(first + k)?;
            self.numbers.get(&tag).copied().ok_or_else(|| lines.error(&format!("there is no node {tag}")))
        };
        (0..count).map(node).collect()
    }
}

/// The file line by line.
struct Lines<'a, R> {
    stream: &'a mut R,
    number: usize,
    /// Without white space at its ends.
    text: String,
    /// Where the next word begins that [`Lines::word`] gives.
    at: usize,
}

impl<R: BufRead> Lines<'_, R> {
    /// Goes on to the next line that is not empty; false at the end.
    fn next(&mut self) -> Result<bool, String> {
        let mut bytes = Vec::new();
        loop {
            bytes.clear();
            self.text.clear();
            self.at = 0;
            self.number += 1;
            let read = self.stream.read_until(b'\n', &mut bytes);
            if read.map_err(|error| self.error(&error.to_string()))? == 0 {
                return Ok(false);
            }
            text::decode(&bytes).trim().clone_into(&mut self.text);
            if !self.text.is_empty() {
                return Ok(true);
            }
        }
    }

    /// Goes on to a line that must be there.
    fn require(&mut self) -> Result<(), String> {
        if self.next()? { Ok(()) } else { Err(self.error("the file ends within a section")) }
    }

    /// The next number, on this line or on one of the next.
    fn word<T: std::str::FromStr>(&mut self) -> Result<T, String> {
        while self.text[self.at..].trim_start().is_empty() {
            self.require()?;
        }
        let rest = self.text[self.at..].trim_start();
        let word = rest.split_ascii_whitespace().next().unwrap_or_default();
        self.at = self.text.len() - rest.len() + word.len();
        word.parse().map_err(|_| self.error(&format!("{word:?} is not such a number as belongs here")))
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

/// `points curves surfaces volumes`, then a record for each: its tag; where the mesh is partitioned, the dimension and
/// tag of what it is a part of and its partitions; its place or its six bounds; its physical groups; and, except for
/// points, what bounds it. Where the mesh is partitioned, numbers of partitions and of ghost entities, and these, come
/// first. Each list begins with its length. A record may go on on the next line.
fn entities(lines: &mut Lines<'_, impl BufRead>, tetrahedra: &mut Tetrahedra<'_>) -> Result<(), String> {
    let end = format!("$End{}", &lines.text[1..]);
    let is_partitioned = lines.text == "$PartitionedEntities";
    fn list(lines: &mut Lines<'_, impl BufRead>) -> Result<Vec<i64>, String> {
        let count: u64 = lines.word()?;
        (0..count).map(|_| lines.word()).collect()
    }
    lines.require()?;
    if is_partitioned {
        let _partitions: u64 = lines.word()?;
        for _ in 0..lines.word::<u64>()? {
            let _ghost: [i64; 2] = [lines.word()?, lines.word()?];
        }
    }
    let counts: [u64; 4] = [lines.word()?, lines.word()?, lines.word()?, lines.word()?];
    for (dimension, count) in counts.into_iter().enumerate() {
        for _ in 0..count {
            let tag: i64 = lines.word()?;
            if is_partitioned {
                let _parent: [i64; 2] = [lines.word()?, lines.word()?];
                list(lines)?;
            }
            for _ in 0..if dimension == 0 { 3 } else { 6 } {
                lines.word::<f64>()?;
            }
            let groups = list(lines)?;
            if dimension > 0 {
                list(lines)?;
            }
            if dimension == 3 {
                let groups: Result<Vec<u32>, String> = groups.into_iter().map(|group| region(lines, group)).collect();
                tetrahedra.volumes.insert(tag, choice(&groups?, tetrahedra.wanted));
            }
        }
    }
    lines.end(&end)
}

/// The number of a physical group: negative where Gmsh has turned its elements.
fn region(lines: &Lines<'_, impl BufRead>, group: i64) -> Result<u32, String> {
    u32::try_from(group.unsigned_abs()).map_err(|_| lines.error("the number of a physical group is too large"))
}

/// `nodes`, then lines of a number, a position and, where nodes are parametric, more.
fn nodes_2(lines: &mut Lines<'_, impl BufRead>, nodes: &mut Nodes) -> Result<(), String> {
    let end = format!("$End{}", &lines.text[1..]);
    lines.require()?;
    let ([count], _) = lines.numbers::<u64, 1>()?;
    for _ in 0..count {
        lines.require()?;
        let tag = lines.number_at(0)?;
        let position = [lines.number_at(1)?, lines.number_at(2)?, lines.number_at(3)?];
        nodes.add(lines, tag, position)?;
    }
    lines.end(&end)
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

fn elements_2(
    lines: &mut Lines<'_, impl BufRead>,
    nodes: &mut Nodes,
    tetrahedra: &mut Tetrahedra<'_>,
) -> Result<(), String> {
    lines.require()?;
    let ([count], _) = lines.numbers::<u64, 1>()?;
    for _ in 0..count {
        lines.require()?;
        // Number, type, count of labels, labels, nodes.
        let ([_, kind, labels], all) = lines.numbers::<u64, 3>()?;
        if let Some(element) = Kind::of(kind) {
            let first = usize::try_from(labels).unwrap_or(usize::MAX).saturating_add(3);
            if first.saturating_add(element.nodes) != all {
                return Err(lines.error(&format!("an element of type {kind} must have {} nodes", element.nodes)));
            }
            // The first label is the physical volume.
            let region = if labels > 0 { region(lines, lines.number_at(3)?)? } else { 0 };
            let of_element = nodes.element(lines, first, element.nodes)?;
            tetrahedra.add(element, &of_element, region, nodes);
        } else {
            *tetrahedra.others.entry(kind).or_default() += 1;
        }
    }
    lines.end("$EndElements")
}

/// `blocks elements least greatest`, then blocks: `dimension entity type elements`, and lines of a number and the
/// nodes.
fn elements_4(
    lines: &mut Lines<'_, impl BufRead>,
    nodes: &mut Nodes,
    tetrahedra: &mut Tetrahedra<'_>,
) -> Result<(), String> {
    lines.require()?;
    let ([blocks], _) = lines.numbers::<u64, 1>()?;
    for _ in 0..blocks {
        lines.require()?;
        let ([_, entity, kind, count], _) = lines.numbers::<i64, 4>()?;
        let kind = kind.unsigned_abs();
        let region = tetrahedra.volumes.get(&entity).copied().unwrap_or(0);
        for _ in 0..count {
            lines.require()?;
            if let Some(element) = Kind::of(kind) {
                let (_, all) = lines.numbers::<u64, 1>()?;
                if all != element.nodes + 1 {
                    return Err(lines.error(&format!("an element of type {kind} must have {} nodes", element.nodes)));
                }
                let of_element = nodes.element(lines, 1, element.nodes)?;
                tetrahedra.add(element, &of_element, region, nodes);
            } else {
                *tetrahedra.others.entry(kind).or_default() += 1;
            }
        }
    }
    lines.end("$EndElements")
}
