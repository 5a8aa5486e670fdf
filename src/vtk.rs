//! VTK's XML files, as ParaView, PyVista and meshio read them: unstructured grids (.vtu), images (.vti), and lists of
//! files over time (.pvd).
//!
//! An array stands in base64 within the text: its length in bytes as a 64-bit number, then its numbers, little-endian
//! (VTK File Formats, VTK 9.3, "XML File Formats": inline binary data).

use crate::names::Xml;
use base64::{prelude::BASE64_STANDARD, write::EncoderWriter};
use bytemuck::NoUninit;
use glam::DVec3;
use std::io::{self, Write};

/// How every file begins.
pub(crate) const OPENING: &str = "<?xml version=\"1.0\"?>\n<!-- haptize ";

/// VTK's numbers of the cells that have one, two and three points: vertex, line and triangle.
const CELLS: [u8; 3] = [1, 3, 5];

/// A number, by VTK's name of its type.
pub(crate) trait Number: NoUninit {
    const NAME: &str;
}

impl Number for f64 {
    const NAME: &str = "Float64";
}
impl Number for f32 {
    const NAME: &str = "Float32";
}
impl Number for u32 {
    const NAME: &str = "UInt32";
}
impl Number for u8 {
    const NAME: &str = "UInt8";
}

/// Begins a file of `kind`, and says what it holds.
pub(crate) fn begin(out: &mut impl Write, kind: &str, what: &str) -> io::Result<()> {
    let what = what.replace("--", "- -");
    writeln!(out, "{OPENING}{}: {} -->", env!("CARGO_PKG_VERSION"), Xml(&what))?;
    writeln!(out, r#"<VTKFile type="{kind}" version="1.0" byte_order="LittleEndian" header_type="UInt64">"#)
}

/// Writes an array whose tuples have a number for each of `components`: their names, or empty ones.
pub(crate) fn array<T: Number>(out: &mut impl Write, name: &str, components: &[&str], values: &[T]) -> io::Result<()> {
    write!(out, r#"<DataArray type="{}" Name="{name}" NumberOfComponents="{}""#, T::NAME, components.len())?;
    for (number, component) in components.iter().enumerate().filter(|(_, component)| !component.is_empty()) {
        let component = Xml(component);
        write!(out, r#" ComponentName{number}="{component}""#)?;
    }
    write!(out, r#" format="binary">"#)?;
    let bytes = bytemuck::cast_slice::<T, u8>(values);
    let mut encoder = EncoderWriter::new(&mut *out, &BASE64_STANDARD);
    encoder.write_all(&(bytes.len() as u64).to_le_bytes())?;
    encoder.write_all(bytes)?;
    encoder.finish()?;
    drop(encoder);
    writeln!(out, "</DataArray>")
}

/// Writes an array of vectors.
fn vectors(out: &mut impl Write, name: &str, values: &[DVec3]) -> io::Result<()> {
    let flat: Vec<f64> = values.iter().flat_map(|value| value.to_array()).collect();
    array(out, name, &["x", "y", "z"], &flat)
}

/// Points, the cells between them, and what is known at each point.
pub(crate) struct Mesh<'a> {
    /// (m)
    pub points: &'a [DVec3],
    /// Numbers of one, two or three points each.
    pub cells: &'a [Vec<u32>],
    /// Name and vectors of each quantity.
    pub data: &'a [(&'a str, &'a [DVec3])],
}

/// Writes an unstructured grid.
pub(crate) fn grid(out: &mut impl Write, what: &str, mesh: &Mesh<'_>) -> io::Result<()> {
    let Mesh { points, cells, data } = *mesh;
    begin(out, "UnstructuredGrid", what)?;
    let counts = (points.len(), cells.len());
    writeln!(out, r#"<UnstructuredGrid><Piece NumberOfPoints="{}" NumberOfCells="{}">"#, counts.0, counts.1)?;
    writeln!(out, "<Points>")?;
    vectors(out, "Points", points)?;
    writeln!(out, "</Points>\n<Cells>")?;
    let ends = cells.iter().scan(0, |end, cell| {
        *end += cell.len() as u32;
        Some(*end)
    });
    array(out, "connectivity", &[""], &cells.concat())?;
    array(out, "offsets", &[""], &ends.collect::<Vec<u32>>())?;
    array(out, "types", &[""], &cells.iter().map(|cell| CELLS[cell.len() - 1]).collect::<Vec<u8>>())?;
    writeln!(out, "</Cells>\n<PointData>")?;
    data.iter().try_for_each(|(name, values)| vectors(out, name, values))?;
    writeln!(out, "</PointData>\n</Piece></UnstructuredGrid>\n</VTKFile>")
}

/// Writes a list of files, each with its time (s) and the number of the part that it shows.
pub(crate) fn series(out: &mut impl Write, files: &[(f64, usize, String)]) -> io::Result<()> {
    begin(out, "Collection", "a session")?;
    writeln!(out, "<Collection>")?;
    for (time, part, file) in files {
        writeln!(out, r#"<DataSet timestep="{time}" part="{part}" file="{}"/>"#, Xml(file))?;
    }
    writeln!(out, "</Collection>\n</VTKFile>")
}
