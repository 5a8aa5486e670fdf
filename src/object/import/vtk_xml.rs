//! VTK files in XML: unstructured grids (`.vtu`) and polygonal data (`.vtp`), each of one or several pieces (VTK file
//! formats, "XML File Formats").
//!
//! Arrays are text, or bytes as base64 in their element, or bytes or base64 behind all elements; bytes may be compressed
//! by zlib or LZ4. Data that nodes and cells carry are left out.

use super::{
    elements::Elements,
    numbers::{Encoding, NumberType, Numbers},
    vtk,
};
use crate::xml;
use base64::{Engine as _, engine::general_purpose::STANDARD};
use flate2::read::ZlibDecoder;
use glam::DVec3;
use roxmltree::Node;
use std::io::Read;

/// Most bytes that a byte of the file stands for: compressed meshes have a tenth of it.
const MAX_RATIO: usize = 100;

/// Most bytes that a byte of LZ4 stands for (LZ4 block format: each further byte of a length adds 255).
const LZ4_RATIO: usize = 255;

/// Reads a file.
pub(super) fn read(bytes: &[u8], elements: &mut Elements<'_>) -> Result<(), String> {
    // What is appended may be no text: the elements before it are XML once the outermost is closed.
    const APPENDED: &[u8] = b"<AppendedData";
    let place = bytes.windows(APPENDED.len()).position(|window| window == APPENDED);
    let (head, appended) = bytes.split_at(place.unwrap_or(bytes.len()));
    let mut text = String::from_utf8_lossy(head.strip_prefix(b"\xef\xbb\xbf").unwrap_or(head)).into_owned();
    if place.is_some() {
        text.push_str("</VTKFile>");
    }
    let document = xml::parse(&text).map_err(|error| error.sentence(&text))?;
    let root = document.root_element();
    let kind = root.attribute("type").unwrap_or_default();
    if !root.has_tag_name("VTKFile") || !matches!(kind, "UnstructuredGrid" | "PolyData") {
        return Err(
            "it is no VTK file of type UnstructuredGrid or PolyData, which alone are read: extract a surface or \
                    tetrahedra (ParaView, PyVista)"
                .to_owned(),
        );
    }
    let after = appended.iter().position(|byte| *byte == b'_').map_or(&[][..], |mark| &appended[mark + 1..]);
    let is_base64 =
        appended.split(|byte| *byte == b'>').next().is_some_and(|tag| tag.windows(6).any(|word| word == b"base64"));
    let arrays = Arrays {
        text: &text,
        encoding: if root.attribute("byte_order") == Some("BigEndian") { Encoding::Big } else { Encoding::Little },
        header: if root.attribute("header_type") == Some("UInt64") { NumberType::U64 } else { NumberType::U32 },
        compressor: root.attribute("compressor").unwrap_or_default(),
        appended: if is_base64 { Bytes::Base64(after) } else { Bytes::Raw(after) },
        longest: bytes.len().saturating_mul(MAX_RATIO),
    };
    let pieces = root.descendants().filter(|node| node.has_tag_name("Piece"));
    pieces.into_iter().try_for_each(|piece| arrays.read_piece(piece, elements))
}

/// How arrays are written.
struct Arrays<'a> {
    text: &'a str,
    encoding: Encoding,
    /// Type of the lengths before the bytes of an array.
    header: NumberType,
    compressor: &'a str,
    /// What stands behind all elements.
    appended: Bytes<'a>,
    /// Most bytes of an array, uncompressed.
    longest: usize,
}

/// Bytes, or text for them.
#[derive(Clone, Copy)]
enum Bytes<'a> {
    Raw(&'a [u8]),
    Base64(&'a [u8]),
}

impl Bytes<'_> {
    /// The first `count` bytes.
    fn first(self, count: usize) -> Option<Vec<u8>> {
        match self {
            Self::Raw(bytes) => bytes.get(..count).map(<[u8]>::to_vec),
            Self::Base64(text) => {
                let mut bytes = STANDARD.decode(text.get(..count.checked_next_multiple_of(3)? / 3 * 4)?).ok()?;
                bytes.truncate(count);
                (bytes.len() == count).then_some(bytes)
            }
        }
    }

    /// What follows the first `count` bytes, which were written by themselves.
    fn after(self, count: usize) -> Option<Self> {
        Some(match self {
            Self::Raw(bytes) => Self::Raw(bytes.get(count..)?),
            Self::Base64(text) => Self::Base64(text.get(count.checked_next_multiple_of(3)? / 3 * 4..)?),
        })
    }
}

impl Arrays<'_> {
    /// Adds the nodes and cells of a piece.
    fn read_piece(&self, piece: Node<'_, '_>, elements: &mut Elements<'_>) -> Result<(), String> {
        let first = elements.nodes.len();
        let of = |parent: &str, is_array: fn(&Node<'_, '_>) -> bool| {
            let parent = piece.children().find(|node| node.has_tag_name(parent));
            parent.and_then(|parent| parent.children().find(|node| node.has_tag_name("DataArray") && is_array(node)))
        };
        if let Some(node) = of("Points", |_| true) {
            let reals = self.array(node, |numbers, of| numbers.real(of))?;
            elements.nodes.extend(reals.chunks_exact(3).map(DVec3::from_slice));
        }
        for (parent, kind) in [("Cells", None), ("Polys", Some(vtk::POLYGON)), ("Strips", Some(vtk::STRIP))] {
            let [nodes, ends, types] = [
                of(parent, |node| node.attribute("Name") == Some("connectivity")),
                of(parent, |node| node.attribute("Name") == Some("offsets")),
                of(parent, |node| node.attribute("Name") == Some("types")),
            ]
            .map(|node| node.map_or(Ok(Vec::new()), |node| self.array(node, |numbers, of| numbers.integer(of))));
            let (nodes, ends, types) = (nodes?, ends?, types?);
            if kind.is_none() && types.len() != ends.len() {
                return Err(self.error(piece, "there are not as many types as cells: export the mesh again"));
            }
            let kind = |cell: usize| kind.unwrap_or_else(|| types[cell].cast_unsigned());
            vtk::add(elements, first, kind, &ends, &nodes).map_err(|reason| self.error(piece, &reason))?;
        }
        Ok(())
    }

    /// The numbers of a `<DataArray>`.
    fn array<T>(
        &self,
        node: Node<'_, '_>,
        read: fn(&mut Numbers<'_>, NumberType) -> Result<T, String>,
    ) -> Result<Vec<T>, String> {
        use NumberType as N;
        let of = match node.attribute("type").unwrap_or_default() {
            "Int8" => N::I8,
            "UInt8" => N::U8,
            "Int16" => N::I16,
            "UInt16" => N::U16,
            "Int32" => N::I32,
            "UInt32" => N::U32,
            "Int64" => N::I64,
            "UInt64" => N::U64,
            "Float32" => N::F32,
            "Float64" => N::F64,
            _ => return Err(self.error(node, "a DataArray has no known type: export the mesh again")),
        };
        let text = || node.text().unwrap_or_default();
        let damaged = || self.error(node, "the bytes of a DataArray are damaged or cut off: export the mesh again");
        let mut all = Vec::new();
        let bytes = match node.attribute("format").unwrap_or("ascii") {
            "ascii" => {
                let mut words = Numbers::text(text().as_bytes());
                let bad = |_| self.error(node, "a DataArray has a word that is no such number: export the mesh again");
                while words.bytes[words.at..].iter().any(|byte| !byte.is_ascii_whitespace()) {
                    all.push(read(&mut words, of).map_err(bad)?);
                }
                return Ok(all);
            }
            "binary" => {
                let text: Vec<u8> = text().bytes().filter(|byte| !byte.is_ascii_whitespace()).collect();
                self.decoded(node, Bytes::Base64(&text))?
            }
            "appended" => {
                let offset = node.attribute("offset").and_then(|offset| offset.trim().parse::<usize>().ok());
                let bytes = match self.appended {
                    Bytes::Raw(bytes) => offset.and_then(|offset| bytes.get(offset..)).map(Bytes::Raw),
                    Bytes::Base64(text) => offset.and_then(|offset| text.get(offset..)).map(Bytes::Base64),
                };
                self.decoded(node, bytes.ok_or_else(damaged)?)?
            }
            _ => {
                return Err(
                    self.error(node, "a DataArray is neither ascii, binary nor appended: export the mesh again")
                );
            }
        };
        let mut numbers = Numbers::binary(&bytes, self.encoding);
        for _ in 0..bytes.len() / of.size() {
            all.push(read(&mut numbers, of).map_err(|_| damaged())?);
        }
        Ok(all)
    }

    /// The bytes of an array. Before them stands their count; before compressed ones stand the number of blocks, their
    /// size, that of the last one if it is another, and the compressed size of each.
    fn decoded(&self, node: Node<'_, '_>, bytes: Bytes<'_>) -> Result<Vec<u8>, String> {
        let damaged = || self.error(node, "the bytes of a DataArray are damaged or cut off: export the mesh again");
        let size = self.header.size();
        let lengths = |count: usize| {
            let head = bytes.first(count.checked_mul(size)?)?;
            let mut numbers = Numbers::binary(&head, self.encoding);
            (0..count)
                .map(|_| numbers.integer(self.header).ok().and_then(|n| usize::try_from(n).ok()))
                .collect::<Option<Vec<_>>>()
        };
        if self.compressor.is_empty() {
            let whole = lengths(1).and_then(|lengths| bytes.first(size.checked_add(lengths[0])?));
            return whole.map(|whole| whole[size..].to_vec()).ok_or_else(damaged);
        }
        let blocks = lengths(1).ok_or_else(damaged)?[0];
        let head = blocks.checked_add(3).ok_or_else(damaged)?;
        let lengths = lengths(head).ok_or_else(damaged)?;
        let (block, last, compressed) = (lengths[1], lengths[2], &lengths[3..]);
        let all = compressed.iter().try_fold(0_usize, |sum, length| sum.checked_add(*length));
        let packed = all.and_then(|all| bytes.after(head * size)?.first(all)).ok_or_else(damaged)?;
        let (mut unpacked, mut at) = (Vec::new(), 0);
        for (number, length) in compressed.iter().enumerate() {
            let expected = if number + 1 == blocks && last > 0 { last } else { block };
            if expected > self.longest.saturating_sub(unpacked.len()) {
                return Err(self.error(
                    node,
                    &format!(
                        "a DataArray has more than {MAX_RATIO} times the bytes of the file: export it uncompressed"
                    ),
                ));
            }
            let packed = &packed[at..at + length];
            at += length;
            let before = unpacked.len();
            match self.compressor {
                "vtkZLibDataCompressor" => {
                    let read = ZlibDecoder::new(packed).take(expected as u64 + 1).read_to_end(&mut unpacked);
                    read.map_err(|_| damaged())?;
                }
                "vtkLZ4DataCompressor" if expected <= packed.len().saturating_mul(LZ4_RATIO) => {
                    unpacked.extend(lz4_flex::block::decompress(packed, expected).map_err(|_| damaged())?);
                }
                "vtkLZ4DataCompressor" => return Err(damaged()),
                _ => {
                    return Err(
                        self.error(node, "it is compressed by other means than zlib or LZ4: export it by one of these")
                    );
                }
            }
            if unpacked.len() - before != expected {
                return Err(damaged());
            }
        }
        Ok(unpacked)
    }

    fn error(&self, node: Node<'_, '_>, what: &str) -> String {
        format!("line {}: {what}", xml::line(self.text, node.range().start))
    }
}
