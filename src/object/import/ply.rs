//! PLY files, by `ply-rs-bw`.
//!
//! That reader panics on a number in the header that is no `u64`, and reserves memory for as many entries as a file
//! announces. So what is announced is held against what can be there before it is called: element counts against the
//! file's length, list lengths against the line (text) or the bytes that are left (binary).

use super::{Surface, check_coordinates, node_number, polygon};
use crate::names::counted;
use glam::DVec3;
use ply_rs_bw::parser::Parser;
use ply_rs_bw::ply::{ElementDef, Encoding, Header, Property, PropertyAccess, PropertyType, ScalarType};
use std::fs::File;
use std::io::{BufRead, BufReader, Read};

/// Nodes and triangles of a PLY file.
pub(super) fn read(stream: &mut BufReader<File>) -> Result<Surface, String> {
    let length = stream.get_ref().metadata().map_err(|error| error.to_string())?.len();
    let text = header_text(stream)?;
    let header = Parser::<PlyVertex>::new().read_header(&mut &text[..]).map_err(|error| error.to_string())?;
    let (mut nodes, mut faces) = (Vec::new(), Vec::new());
    for (name, element) in &header.elements {
        if element.count as u64 > length {
            return Err(format!("it announces {} {name} elements, more than it has bytes", element.count));
        }
        match name.as_str() {
            "vertex" => {
                nodes
                    .extend(elements::<PlyVertex>(stream, element, &header)?.into_iter().map(|vertex| vertex.position));
            }
            "face" => faces.extend(elements::<PlyFace>(stream, element, &header)?),
            // Other elements are read past.
            _ => drop(elements::<PlyFace>(stream, element, &header)?),
        }
    }
    nothing_follows(stream, header.encoding)?;
    node_number(nodes.len())?;
    check_coordinates(&nodes)?;
    let mut triangles = Vec::new();
    for (number, face) in faces.into_iter().enumerate() {
        let cut = match face.corners {
            Some(corners) => polygon::cut(&corners, &nodes),
            None => Err("it has no node numbers, or negative ones".to_owned()),
        };
        triangles.extend(cut.map_err(|reason| format!("face {number}, counted from 0: {reason}"))?);
    }
    Ok((nodes, triangles))
}

/// Refuses what stands behind the last element: blank lines alone may, in a text.
fn nothing_follows(stream: &mut BufReader<File>, encoding: Encoding) -> Result<(), String> {
    let mut rest = Vec::new();
    stream.read_to_end(&mut rest).map_err(|error| error.to_string())?;
    let rest = if encoding == Encoding::Ascii { rest.trim_ascii() } else { &rest };
    if rest.is_empty() {
        return Ok(());
    }
    Err(format!(
        "{} the last element that its header announces: the counts in the header are wrong, or another file \
         was put behind this one; export the mesh again",
        counted(rest.len(), ["byte follows", "bytes follow"])
    ))
}

/// Longest header (bytes).
const MAX_HEADER: u64 = 1 << 16;

/// Longest run of digits in it: more may be no `u64`.
const MAX_DIGITS: usize = 18;

/// The header, up to `end_header`, without remarks, a byte-order mark and numbers that the parser cannot hold.
fn header_text(stream: &mut impl BufRead) -> Result<Vec<u8>, String> {
    let (mut text, mut read) = (Vec::new(), 0);
    loop {
        let mut line = Vec::new();
        stream.take(MAX_HEADER - read).read_until(b'\n', &mut line).map_err(|error| error.to_string())?;
        if line.is_empty() {
            return Err(format!("it has no header that ends within {MAX_HEADER} bytes"));
        }
        let mark: &[u8] = if read == 0 { "\u{feff}".as_bytes() } else { b"" };
        read += line.len() as u64;
        let line = line.strip_prefix(mark).unwrap_or(&line);
        let words = line.trim_ascii();
        if words.contains(&b'\r') {
            return Err("its lines end by carriage returns alone: export the mesh again".to_owned());
        }
        // Remarks may be of any encoding and length.
        if words.starts_with(b"comment") || words.starts_with(b"obj_info") {
            continue;
        }
        if words.split(|byte| !byte.is_ascii_digit()).any(|digits| digits.len() > MAX_DIGITS) {
            return Err(format!("its header has a number of more than {MAX_DIGITS} digits"));
        }
        text.extend(line);
        if words == b"end_header" {
            return Ok(text);
        }
    }
}

/// All of one kind of element, lists checked before they are read.
fn elements<E: PropertyAccess>(
    stream: &mut BufReader<File>,
    element: &ElementDef,
    header: &Header,
) -> Result<Vec<E>, String> {
    let parser = Parser::<E>::new();
    if header.encoding != Encoding::Ascii {
        let mut elements = Vec::new();
        for _ in 0..element.count {
            let bytes = binary_element(stream, element, header.encoding)?;
            let read = match header.encoding {
                Encoding::BinaryBigEndian => parser.read_big_endian_element(&mut &bytes[..], element),
                _ => parser.read_little_endian_element(&mut &bytes[..], element),
            };
            elements.push(read.map_err(|error| error.to_string())?);
        }
        return Ok(elements);
    }
    let mut elements = Vec::new();
    let mut line = String::new();
    for number in 0..element.count {
        line.clear();
        stream.read_line(&mut line).map_err(|error| error.to_string())?;
        let bad = |what: &str| {
            let start: String = line.chars().take(60).collect();
            format!("{} {number}, counted from 0, {what}: {:?}", element.name, start.trim_end())
        };
        if !lists_fit(&line, element) {
            return Err(bad("has a line that is too short"));
        }
        elements.push(parser.read_ascii_element(&line, element).map_err(|_| bad("is not a line of finite numbers"))?);
    }
    Ok(elements)
}

/// The bytes of the next element; nothing is reserved for what its lists announce before it is there.
fn binary_element(stream: &mut impl Read, element: &ElementDef, encoding: Encoding) -> Result<Vec<u8>, String> {
    let mut bytes = Vec::new();
    let mut take = |length: u64| {
        let start = bytes.len();
        let read = stream.by_ref().take(length).read_to_end(&mut bytes).map_err(|error| error.to_string())?;
        if read as u64 == length {
            Ok(bytes[start..].to_vec())
        } else {
            Err(format!("it ends within a {}: it was cut off; export the mesh again", element.name))
        }
    };
    for property in element.properties.values() {
        match &property.data_type {
            PropertyType::Scalar(kind) => drop(take(size(kind))?),
            PropertyType::List(count, kind) => {
                let mut digits = take(size(count))?;
                if encoding == Encoding::BinaryBigEndian {
                    digits.reverse();
                }
                let is_signed = matches!(count, ScalarType::Char | ScalarType::Short | ScalarType::Int);
                if is_signed && digits.last().is_some_and(|digit| *digit > i8::MAX as u8) {
                    return Err(format!("a {} announces a negative number of entries", element.name));
                }
                let count = digits.iter().rev().fold(0, |count: u64, digit| count << 8 | u64::from(*digit));
                take(count.saturating_mul(size(kind)))?;
            }
        }
    }
    Ok(bytes)
}

/// Bytes of a number.
fn size(kind: &ScalarType) -> u64 {
    match kind {
        ScalarType::Char | ScalarType::UChar => 1,
        ScalarType::Short | ScalarType::UShort => 2,
        ScalarType::Int | ScalarType::UInt | ScalarType::Float => 4,
        ScalarType::Double => 8,
    }
}

/// Does the line have an entry for each property, and for each entry that its lists announce?
fn lists_fit(line: &str, element: &ElementDef) -> bool {
    let mut entries = line.split_ascii_whitespace();
    element.properties.values().all(|property| match (&property.data_type, entries.next()) {
        (_, None) => false,
        (PropertyType::Scalar(_), Some(_)) => true,
        (PropertyType::List(..), Some(count)) => {
            let count = count.parse::<usize>().unwrap_or(usize::MAX);
            count == 0 || (count <= line.len() && entries.nth(count - 1).is_some())
        }
    })
}

/// A vertex; a coordinate that the file lacks stays NaN, which the surface's check refuses.
struct PlyVertex {
    position: DVec3,
}

impl PropertyAccess for PlyVertex {
    fn new() -> Self {
        Self { position: DVec3::NAN }
    }

    fn set_property(&mut self, key: &String, property: Property) {
        let axis = match key.as_str() {
            "x" => 0,
            "y" => 1,
            "z" => 2,
            _ => return,
        };
        self.position[axis] = match property {
            Property::Float(value) => value.into(),
            Property::Double(value) => value,
            Property::Char(value) => value.into(),
            Property::UChar(value) => value.into(),
            Property::Short(value) => value.into(),
            Property::UShort(value) => value.into(),
            Property::Int(value) => value.into(),
            Property::UInt(value) => value.into(),
            _ => return,
        };
    }
}

/// A face; `None` where a corner is not a node number, or there are no corners.
struct PlyFace {
    corners: Option<Vec<u32>>,
}

impl PropertyAccess for PlyFace {
    fn new() -> Self {
        Self { corners: None }
    }

    fn set_property(&mut self, key: &String, property: Property) {
        fn numbers<T: TryInto<u32>>(values: Vec<T>) -> Option<Vec<u32>> {
            values.into_iter().map(|value| value.try_into().ok()).collect()
        }
        if key == "vertex_indices" || key == "vertex_index" {
            self.corners = match property {
                Property::ListChar(values) => numbers(values),
                Property::ListUChar(values) => numbers(values),
                Property::ListShort(values) => numbers(values),
                Property::ListUShort(values) => numbers(values),
                Property::ListInt(values) => numbers(values),
                Property::ListUInt(values) => Some(values),
                _ => None,
            };
        }
    }
}
