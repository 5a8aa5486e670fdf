//! Gmsh files of versions 2.2 and 4.1, as text or in bytes.
//!
//! Read are `$MeshFormat`, `$Nodes` (or `$ParametricNodes`), the physical volumes in `$Entities` and
//! `$PartitionedEntities` (4.1) and `$Elements`; all other sections are read past. Every error names the line, or the
//! byte. Nothing is reserved for what a file announces before it is there.

use super::{
    cell::CellType,
    elements::{Elements, region},
    numbers::{Encoding, NumberType, Numbers},
};
use glam::DVec3;
use std::collections::HashMap;

/// Tags of groups, entities and types of elements (`int`), counts and tags of nodes in version 4.1 (`size_t`),
/// coordinates (`double`).
const INT: NumberType = NumberType::I32;
const SIZE: NumberType = NumberType::U64;
const REAL: NumberType = NumberType::F64;

/// Refuses another version; the first one begins with its nodes.
const VERSIONS: &str = "only versions 2.2 and 4.1 are read (gmsh -format msh41)";

/// Bytes of a `size_t` and of a `double`.
const DATA_SIZE: u64 = 8;

/// Reads a file. Regions are physical volumes.
pub(super) fn read(bytes: &[u8], elements: &mut Elements<'_>) -> Result<(), String> {
    let mut reader = Reader { file: Numbers::text(bytes), elements, tags: HashMap::new(), volumes: HashMap::new() };
    let mut format = None;
    while reader.file.at < bytes.len() {
        let section = reader.file.line();
        if section.is_empty() {
            continue;
        }
        let start = reader.file.at;
        let refuse = |what: &str| {
            let mut file = Numbers::text(bytes);
            file.at = start - 1;
            Err(file.error(what))
        };
        // What is no Gmsh file is not quoted: a scene may come from anyone, and name any file.
        let Some(name) = section.strip_prefix('$') else {
            return refuse(if format.is_some() {
                "this is no section of a Gmsh file"
            } else {
                "no $MeshFormat comes first: it is no Gmsh file"
            });
        };
        let end = format!("$End{name}");
        match (name, format) {
            ("MeshFormat", _) => format = Some(reader.format()?),
            ("NOD", None) => return refuse(VERSIONS),
            ("Nodes" | "ParametricNodes" | "Entities" | "PartitionedEntities" | "Elements", None) => {
                return refuse(&format!("${name} comes before $MeshFormat"));
            }
            ("Nodes", Some((version, encoding))) => reader.nodes(version, encoding)?,
            ("ParametricNodes", Some((Version::Two, Encoding::Text))) => reader.nodes(Version::Two, Encoding::Text)?,
            ("Elements", Some((Version::Two, encoding))) => reader.elements_2(encoding)?,
            ("Elements", Some((Version::Four, encoding))) => reader.elements_4(encoding)?,
            ("Entities" | "PartitionedEntities", Some((Version::Four, encoding))) => {
                reader.entities(name == "PartitionedEntities", encoding)?;
            }
            _ => {
                let rest = &bytes[start..];
                let place = rest.windows(end.len()).position(|window| window == end.as_bytes());
                match place {
                    Some(place) => reader.file.at = start + place,
                    None if format.is_some() => {
                        return refuse(&format!("the section has no {end}: the file ends within it"));
                    }
                    None => return refuse("a section has no end: it is no Gmsh file"),
                }
            }
        }
        reader.file.encoding = Encoding::Text;
        if reader.file.word().is_none_or(|word| word != end) {
            return Err(reader.file.error(format_args!("{end} is expected here")));
        }
    }
    if format.is_none() { Err("it has no $MeshFormat: it is no Gmsh file".to_owned()) } else { Ok(()) }
}

#[derive(Clone, Copy)]
enum Version {
    Two,
    Four,
}

struct Reader<'a, 'b, 'c> {
    file: Numbers<'a>,
    elements: &'b mut Elements<'c>,
    /// Numbers of nodes, by Gmsh's tags.
    tags: HashMap<u64, u32>,
    /// Physical volume of each volume of the geometry (version 4.1), by Gmsh's tags.
    volumes: HashMap<i64, u32>,
}

impl Reader<'_, '_, '_> {
    /// `version is-binary data-size`, and in a binary file the number one, which tells the order of bytes.
    fn format(&mut self) -> Result<(Version, Encoding), String> {
        let file = &mut self.file;
        file.begin_record();
        let (version, is_binary, size): (f64, u64, u64) = (file.parse()?, file.parse()?, file.parse()?);
        let version = match version {
            2.2 => Version::Two,
            4.1 => Version::Four,
            _ => return Err(file.error(VERSIONS)),
        };
        file.end_record();
        if is_binary == 0 {
            return Ok((version, Encoding::Text));
        }
        if size != DATA_SIZE {
            return Err(file.error(format_args!(
                "its numbers have {size} bytes, and must have {DATA_SIZE}: save it as text (gmsh -bin 0)"
            )));
        }
        file.line();
        let encoding = match file.take(4)? {
            [1, 0, 0, 0] => Encoding::Little,
            [0, 0, 0, 1] => Encoding::Big,
            _ => {
                return Err(
                    file.error("the number one is expected here: it was damaged; save it as text (gmsh -bin 0)")
                );
            }
        };
        Ok((version, encoding))
    }

    /// A count, which may not be negative.
    fn count(&mut self, of: NumberType) -> Result<u64, String> {
        u64::try_from(self.file.integer(of)?).map_err(|_| self.file.error("a count is negative: save the mesh again"))
    }

    /// A list, which begins with its length.
    fn list(&mut self) -> Result<Vec<i64>, String> {
        (0..self.count(SIZE)?).map(|_| self.file.integer(INT)).collect()
    }

    /// `points curves surfaces volumes`, then a record for each: its tag; where the mesh is partitioned, the dimension
    /// and tag of what it is a part of and its partitions; its place or its six bounds; its physical groups; and, except
    /// for points, what bounds it. Where the mesh is partitioned, numbers of partitions and of ghost entities, and
    /// these, come first. A record may go on on the next line.
    fn entities(&mut self, is_partitioned: bool, encoding: Encoding) -> Result<(), String> {
        self.file.encoding = encoding;
        if is_partitioned {
            self.count(SIZE)?;
            for _ in 0..2 * self.count(SIZE)? {
                self.file.integer(INT)?;
            }
        }
        let counts = [self.count(SIZE)?, self.count(SIZE)?, self.count(SIZE)?, self.count(SIZE)?];
        for (dimension, count) in counts.into_iter().enumerate() {
            for _ in 0..count {
                let tag = self.file.integer(INT)?;
                if is_partitioned {
                    let _parent = [self.file.integer(INT)?, self.file.integer(INT)?];
                    self.list()?;
                }
                for _ in 0..if dimension == 0 { 3 } else { 6 } {
                    self.file.real(REAL)?;
                }
                let groups = self.list()?;
                if dimension > 0 {
                    self.list()?;
                }
                if dimension == 3 {
                    let groups: Result<Vec<u32>, String> = groups.into_iter().map(|group| self.group(group)).collect();
                    self.volumes.insert(tag, region(&groups?, self.elements.wanted));
                }
            }
        }
        Ok(())
    }

    /// The number of a physical group: negative where Gmsh has turned its elements.
    fn group(&self, group: i64) -> Result<u32, String> {
        u32::try_from(group.unsigned_abs()).map_err(|_| self.file.error("the number of a physical group is too large"))
    }

    /// Version 2: the count, then records of a tag, a position and, where nodes are parametric, more. Version 4: `blocks
    /// nodes least greatest`, then blocks: `dimension entity is-parametric nodes`, their tags, their positions with as
    /// many parameters as dimensions.
    fn nodes(&mut self, version: Version, encoding: Encoding) -> Result<(), String> {
        if let Version::Two = version {
            let count: u64 = self.file.parse()?;
            self.file.line();
            self.file.encoding = encoding;
            for _ in 0..count {
                self.file.begin_record();
                let tag = self.count(INT)?;
                self.node(tag)?;
                self.file.end_record();
            }
            return Ok(());
        }
        self.file.encoding = encoding;
        let [blocks, ..] = [self.count(SIZE)?, self.count(SIZE)?, self.count(SIZE)?, self.count(SIZE)?];
        for _ in 0..blocks {
            let [dimension, _, is_parametric] =
                [self.count(INT)?, self.file.integer(INT)?.unsigned_abs(), self.count(INT)?];
            let count = self.count(SIZE)?;
            let tags: Result<Vec<u64>, String> = (0..count).map(|_| self.count(SIZE)).collect();
            for tag in tags? {
                self.file.begin_record();
                self.node(tag)?;
                // In a text, parameters are the rest of the line.
                for _ in 0..if is_parametric == 0 || encoding == Encoding::Text { 0 } else { dimension } {
                    self.file.real(REAL)?;
                }
                self.file.end_record();
            }
        }
        Ok(())
    }

    /// Reads the position of the node `tag`.
    fn node(&mut self, tag: u64) -> Result<(), String> {
        let position = [self.file.real(REAL)?, self.file.real(REAL)?, self.file.real(REAL)?];
        let number =
            u32::try_from(self.elements.nodes.len()).map_err(|_| self.file.error("there are too many nodes"))?;
        if self.tags.insert(tag, number).is_some() {
            return Err(self.file.error(format_args!("node {tag} is there twice")));
        }
        self.elements.nodes.push(DVec3::from_array(position));
        Ok(())
    }

    /// As text, records of number, type, count of labels, labels and nodes; in bytes, blocks: type, elements, labels of
    /// each, and as many records of number, labels and nodes. The first label is the physical volume.
    fn elements_2(&mut self, encoding: Encoding) -> Result<(), String> {
        let count: u64 = self.file.parse()?;
        self.file.line();
        self.file.encoding = encoding;
        let mut read = 0;
        while read < count {
            self.file.begin_record();
            let (kind, labels, here) = if encoding == Encoding::Text {
                self.count(INT)?;
                (self.count(INT)?, self.count(INT)?, 1)
            } else {
                let [kind, here, labels] = [self.count(INT)?, self.count(INT)?, self.count(INT)?];
                (kind, labels, here)
            };
            if here == 0 {
                return Err(self.file.error("a block has no elements: save the mesh again"));
            }
            for _ in 0..here {
                if encoding != Encoding::Text {
                    self.count(INT)?;
                }
                let mut group = 0;
                for label in 0..labels {
                    let value = self.file.integer(INT)?;
                    group = if label == 0 { self.group(value)? } else { group };
                }
                self.element(kind, INT, group)?;
            }
            read += here;
        }
        Ok(())
    }

    /// `blocks elements least greatest`, then blocks: `dimension entity type elements`, and records of a number and the
    /// nodes.
    fn elements_4(&mut self, encoding: Encoding) -> Result<(), String> {
        self.file.encoding = encoding;
        let [blocks, ..] = [self.count(SIZE)?, self.count(SIZE)?, self.count(SIZE)?, self.count(SIZE)?];
        for _ in 0..blocks {
            let [_, entity, kind] = [self.file.integer(INT)?, self.file.integer(INT)?, self.file.integer(INT)?];
            let group = self.volumes.get(&entity).copied().unwrap_or(0);
            for _ in 0..self.count(SIZE)? {
                self.file.begin_record();
                self.count(SIZE)?;
                self.element(kind.unsigned_abs(), SIZE, group)?;
            }
        }
        Ok(())
    }

    /// Reads the nodes of an element, whose tags are of type `of`, and ends its record.
    fn element(&mut self, kind: u64, of: NumberType, group: u32) -> Result<(), String> {
        let Some(cell) = CellType::of_gmsh(kind) else {
            if self.file.encoding != Encoding::Text {
                let message =
                    format!("elements of type {kind} are not read: save them in first or second order (gmsh -order 2)");
                return Err(self.file.error(message));
            }
            self.file.end_record();
            self.elements.leave_out(format!("elements of type {kind}"), !is_boundary(kind));
            return Ok(());
        };
        let mut nodes = Vec::new();
        for _ in 0..cell.nodes.unwrap_or(0) {
            let tag = self.count(of)?;
            let node = self.tags.get(&tag).copied();
            nodes.push(
                node.ok_or_else(|| self.file.error(format_args!("there is no node {tag}: save the mesh again")))?,
            );
        }
        if self.file.end_record() {
            return Err(self.file.error(format_args!("an element of type {kind} must have {} nodes", nodes.len())));
        }
        self.elements.add(cell, &nodes, group).map_err(|reason| self.file.error(reason))
    }
}

/// Is that Gmsh's number for a point, a line, a triangle, a quadrangle or a polygon, of any order?
fn is_boundary(kind: u64) -> bool {
    matches!(kind, 1..=3 | 8..=10 | 15 | 16 | 20..=28 | 34 | 36..=70 | 84..=86 | 133..=135 | 138)
}
