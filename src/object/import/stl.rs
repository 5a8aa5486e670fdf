//! Surfaces from STL files. A binary file is as long as its header says; any other is text.
//!
//! A file of several solids is read whole. Normals have no meaning here: the corners' order gives the side.

use super::{Surface, check_coordinates, node_number, text};
use crate::names::counted;
use glam::DVec3;
use std::io::Read;

/// Bytes of a binary file's header, its number of facets included.
const HEAD: usize = 84;

/// Bytes of a facet: a normal, three corners, two bytes of attributes.
const FACET: usize = 50;

/// Bytes in which a text names its solid and begins its first facet: a name is hardly longer.
const TEXT_HEAD: usize = 1024;

/// Bytes of a facet's normal.
const NORMAL: usize = 12;

/// Three nodes a facet, and triangles.
pub(super) fn read(stream: &mut impl Read) -> Result<Surface, String> {
    let mut bytes = Vec::new();
    stream.read_to_end(&mut bytes).map_err(|error| error.to_string())?;
    let announced = bytes.get(HEAD - 4..HEAD).map(|count| u32::from_le_bytes([count[0], count[1], count[2], count[3]]));
    let whole = announced.map(|count| (count, HEAD + FACET * count as usize));
    // Four characters of a text, read as a number, are more than half a billion facets: no text is as long as that.
    let nodes = match whole {
        Some((_, length)) if length == bytes.len() => binary(&bytes[HEAD..]),
        // A binary facet has bytes of zero, and a text has none unless something else was put into it.
        _ if !bytes.contains(&0) || is_text(&bytes) => ascii(&text::decode(&bytes))?,
        Some((count, length)) if length < bytes.len() => {
            return Err(format!(
                "{} the last of the {count} facets that it announces, as where files were put one after \
                 the other: export all parts as one mesh",
                counted(bytes.len() - length, ["byte follows", "bytes follow"])
            ));
        }
        Some((count, length)) => {
            return Err(format!(
                "it has {} bytes, but the {count} facets that it announces take {length}: it was cut off or is not an \
                 STL file; export the mesh again",
                bytes.len()
            ));
        }
        None => return Err("it is too short for an STL file: export the mesh again".to_owned()),
    };
    check_coordinates(&nodes)?;
    let triangles = (0..node_number(nodes.len())?).step_by(3).map(|node| [node, node + 1, node + 2]).collect();
    Ok((nodes, triangles))
}

/// Whether `bytes` begin as an STL text does: with a solid and its first facet, in letters.
fn is_text(bytes: &[u8]) -> bool {
    let (head, _) = bytes.split_at(bytes.len().min(TEXT_HEAD));
    let head = text::decode(head.split(|byte| *byte == 0).next().unwrap_or_default()).to_lowercase();
    head.trim_start().starts_with("solid") && head.lines().any(|line| line.trim_start().starts_with("facet normal"))
}

fn binary(facets: &[u8]) -> Vec<DVec3> {
    let coordinate = |bytes: &[u8]| f64::from(f32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]));
    let node = |bytes: &[u8]| DVec3::new(coordinate(bytes), coordinate(&bytes[4..]), coordinate(&bytes[8..]));
    facets.chunks_exact(FACET).flat_map(|facet| facet[NORMAL..NORMAL + 36].chunks_exact(12).map(node)).collect()
}

/// `solid NAME`, facets, `endsolid NAME`, as often as there are solids. Some programs write `end solid` in two words, and
/// colours of solids and facets on lines of their own.
fn ascii(text: &str) -> Result<Vec<DVec3>, String> {
    let (mut nodes, mut solid, mut facet) = (Vec::new(), None, None);
    for (number, line) in text::lines(text) {
        let bad = |what: &str| Err(format!("line {number}: {what}; export the mesh again"));
        if line.contains('\0') {
            return bad(
                "it holds bytes of zero, which no text has: the file was damaged or filled up, or a binary one was put \
                 behind it",
            );
        }
        let mut words = line.split_ascii_whitespace();
        let Some(keyword) = words.next() else { continue };
        let mut keyword = keyword.to_ascii_lowercase();
        if keyword == "end" {
            keyword += &words.next().unwrap_or_default().to_ascii_lowercase();
        }
        match (keyword.as_str(), solid, facet) {
            ("solid", None, _) => solid = Some(number),
            ("endsolid", Some(_), None) => solid = None,
            ("facet", Some(_), None) => facet = Some(nodes.len()),
            ("outer" | "endloop", Some(_), Some(_)) | ("color" | "colour", ..) => (),
            ("vertex", Some(_), Some(_)) => {
                let mut node = [0.0; 3];
                for coordinate in &mut node {
                    match words.next().and_then(|word| word.parse().ok()) {
                        Some(number) => *coordinate = number,
                        None => return bad("a vertex has three coordinates"),
                    }
                }
                nodes.push(DVec3::from_array(node));
            }
            ("endfacet", Some(_), Some(first)) if nodes.len() == first + 3 => facet = None,
            ("endfacet", Some(_), Some(_)) => return bad("a facet has three vertices"),
            (_, None, _) => return bad("a solid begins with `solid`: this is not an STL file"),
            _ => return bad("one of the words `facet`, `outer loop`, `vertex`, .. of an STL file is expected here"),
        }
    }
    match solid {
        Some(line) => Err(format!(
            "the solid that begins on line {line} has no `endsolid`: the file was cut off; export the mesh again"
        )),
        None => Ok(nodes),
    }
}
