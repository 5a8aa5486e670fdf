//! VTK files of the legacy format, versions 1 to 5, as text or in bytes (VTK file formats, "Simple Legacy Formats").
//!
//! Read are points and cells of an unstructured grid, and points and polygons of polygonal data; the data that these
//! carry are left out.

use super::{
    cell::CellType,
    elements::Elements,
    numbers::{Encoding, NumberType, Numbers},
};
use glam::DVec3;

/// VTK's numbers of polygons and of strips of triangles.
pub(super) const POLYGON: u64 = 7;
pub(super) const STRIP: u64 = 6;

/// Reads a file.
pub(super) fn read(bytes: &[u8], elements: &mut Elements<'_>) -> Result<(), String> {
    let mut file = Numbers::text(bytes);
    let head = file.line();
    let Some(version) = head.to_lowercase().strip_prefix("# vtk datafile version").map(|rest| rest.trim().to_owned())
    else {
        return Err("it does not begin with `# vtk DataFile Version`: it is no VTK file of the legacy format".into());
    };
    // What the next line says is a remark.
    file.line();
    let encoding = match file.word().unwrap_or_default().to_uppercase().as_str() {
        "ASCII" => Encoding::Text,
        "BINARY" => Encoding::Big,
        _ => return Err(file.error("ASCII or BINARY belongs here: export the mesh again")),
    };
    let mut reader = Reader { file, encoding, has_offsets: !version.starts_with(['1', '2', '3', '4']), cells: None };
    while let Some(keyword) = reader.file.word() {
        match keyword.to_uppercase().as_str() {
            "DATASET" => {
                let kind = reader.file.word().unwrap_or_default().to_uppercase();
                if !["POLYDATA", "UNSTRUCTURED_GRID"].contains(&kind.as_str()) {
                    return Err(reader.file.error(
                        "only POLYDATA and UNSTRUCTURED_GRID are read: extract a surface or tetrahedra (ParaView, \
                         PyVista)",
                    ));
                }
            }
            "POINTS" => elements.nodes.extend(reader.points()?),
            "CELLS" => reader.cells = Some(reader.lists()?),
            "CELL_TYPES" => {
                let count: usize = reader.file.parse()?;
                let types = reader.numbers(count, NumberType::I32)?;
                let Some((ends, nodes)) = reader.cells.take().filter(|(ends, _)| ends.len() == count) else {
                    return Err(reader.file.error("there are not as many types as cells: export the mesh again"));
                };
                add(elements, 0, |cell| types[cell].cast_unsigned(), &ends, &nodes)
                    .map_err(|reason| reader.file.error(reason))?;
            }
            keyword @ ("POLYGONS" | "TRIANGLE_STRIPS" | "LINES" | "VERTICES") => {
                let (ends, nodes) = reader.lists()?;
                let kind = match keyword {
                    "POLYGONS" => POLYGON,
                    "TRIANGLE_STRIPS" => STRIP,
                    _ => continue,
                };
                add(elements, 0, |_| kind, &ends, &nodes).map_err(|reason| reader.file.error(reason))?;
            }
            // It ends with an empty line.
            "METADATA" => {
                reader.file.line();
                while !reader.file.line().is_empty() {}
            }
            "FIELD" => reader.skip_field()?,
            "CELL_DATA" | "POINT_DATA" => break,
            _ => return Err(reader.file.error("this is no keyword of a VTK file that is read: export the mesh again")),
        }
    }
    Ok(())
}

/// Adds cells, whose types VTK's numbers name, with their nodes, where each ends among these, and what is added to each.
pub(super) fn add(
    elements: &mut Elements<'_>,
    first: usize,
    kind: impl Fn(usize) -> u64,
    ends: &[i64],
    nodes: &[i64],
) -> Result<(), String> {
    let mut start = 0;
    for (number, end) in ends.iter().enumerate() {
        let bad = |what: &str| format!("cell {number}, counted from 0: {what}");
        let of_cell = usize::try_from(*end).ok().and_then(|end| nodes.get(start..end).inspect(|_| start = end));
        let of_cell = of_cell.ok_or_else(|| bad("its nodes are not there: export the mesh again"))?;
        let of_cell: Option<Vec<u32>> =
            of_cell.iter().map(|node| u32::try_from(node.checked_add(first as i64)?).ok()).collect();
        let of_cell =
            of_cell.ok_or_else(|| bad("the number of a node is negative or too large: export the mesh again"))?;
        match CellType::of_vtk(kind(number)) {
            Some(cell) => elements.add(cell, &cell.ordered(&of_cell), 0).map_err(|reason| bad(&reason))?,
            None => elements.leave_out(format!("cells of type {}", kind(number)), true),
        }
    }
    Ok(())
}

struct Reader<'a> {
    file: Numbers<'a>,
    encoding: Encoding,
    /// Whether lists are written as in version 5.
    has_offsets: bool,
    /// Cells whose types have not come yet.
    cells: Option<(Vec<i64>, Vec<i64>)>,
}

impl Reader<'_> {
    /// The type of numbers that the next word names.
    fn number_type(&mut self) -> Result<NumberType, String> {
        use NumberType as T;
        let word = self.file.word().unwrap_or_default().to_lowercase();
        Ok(match word.as_str() {
            "char" | "signed_char" => T::I8,
            "unsigned_char" => T::U8,
            "short" => T::I16,
            "unsigned_short" => T::U16,
            "int" | "vtkidtype" => T::I32,
            "unsigned_int" => T::U32,
            "long" | "vtktypeint64" => T::I64,
            "unsigned_long" | "vtktypeuint64" => T::U64,
            "float" => T::F32,
            "double" => T::F64,
            _ => return Err(self.file.error("a type of numbers, such as float, belongs here: export the mesh again")),
        })
    }

    /// As many whole numbers, from the next line on.
    fn numbers(&mut self, count: usize, of: NumberType) -> Result<Vec<i64>, String> {
        self.data(count, |file| file.integer(of))
    }

    /// As many things, from the next line on.
    fn data<T>(
        &mut self,
        count: usize,
        read: impl Fn(&mut Numbers<'_>) -> Result<T, String>,
    ) -> Result<Vec<T>, String> {
        self.file.line();
        self.file.encoding = self.encoding;
        let all = (0..count).map(|_| read(&mut self.file)).collect();
        self.file.encoding = Encoding::Text;
        all
    }

    /// `count type`, then positions.
    fn points(&mut self) -> Result<Vec<DVec3>, String> {
        let count: usize = self.file.parse()?;
        let of = self.number_type()?;
        self.data(count, |file| Ok(DVec3::from_array([file.real(of)?, file.real(of)?, file.real(of)?])))
    }

    /// Lists of nodes: all of them, and where each list ends. `lists numbers`, then for each list its length and its
    /// nodes; from version 5 on `offsets nodes`, then the offsets and the nodes, each behind a line with their type.
    fn lists(&mut self) -> Result<(Vec<i64>, Vec<i64>), String> {
        let (count, size): (usize, usize) = (self.file.parse()?, self.file.parse()?);
        if self.has_offsets {
            let mut array = |name: &str, count: usize| {
                if self.file.word().is_none_or(|word| word != name) {
                    return Err(self.file.error(format_args!("{name} belongs here: export the mesh again")));
                }
                let of = self.number_type()?;
                self.numbers(count, of)
            };
            let offsets = array("OFFSETS", count)?;
            let nodes = array("CONNECTIVITY", size)?;
            return Ok((offsets.into_iter().skip(1).collect(), nodes));
        }
        let numbers = self.numbers(size, NumberType::I32)?;
        let (mut ends, mut nodes, mut at) = (Vec::new(), Vec::new(), 0);
        for _ in 0..count {
            let length = numbers.get(at).and_then(|length| usize::try_from(*length).ok());
            let list = length.and_then(|length| numbers.get(at + 1..(at + 1).checked_add(length)?));
            let list = list.ok_or_else(|| {
                self.file.error("the lists of nodes are longer than is announced: export the mesh again")
            })?;
            nodes.extend(list);
            ends.push(nodes.len() as i64);
            at += 1 + list.len();
        }
        Ok((ends, nodes))
    }

    /// Reads past `name arrays`, then for each array `name components tuples type` and its numbers.
    fn skip_field(&mut self) -> Result<(), String> {
        self.file.word();
        for _ in 0..self.file.parse::<u64>()? {
            self.file.word();
            let (components, tuples): (usize, usize) = (self.file.parse()?, self.file.parse()?);
            let of = self.number_type()?;
            let count = components.saturating_mul(tuples);
            self.data(1, |file| (0..count).try_for_each(|_| file.real(of).map(drop)))?;
        }
        Ok(())
    }
}
