//! The dataset's file, put together from the results of all points: column after column, its pieces on all cores.
//! Memory does not grow with the grid.

use super::{
    columns::{Section, Shape},
    table::{Block, Table},
};
use crate::dataset::{
    self, CONTACTS, Heading, Surface, TOUCHES, Target, Tensor, TensorContents, surface_tensors, write_file,
};
use rayon::prelude::*;
use std::{
    io::{self, Write},
    ops::Range,
    sync::atomic::{AtomicBool, Ordering},
};

/// Points of a piece (1): enough that threads rarely go for another, and small enough for all threads to have some.
const PIECE: usize = 1 << 12;

/// Memory that it takes: the buffers before the file (bytes).
pub(super) fn buffers() -> usize {
    dataset::BUFFER + rayon::current_num_threads() * dataset::PIECE_BUFFER
}

/// The results of a sweep.
pub(super) struct Results<'a> {
    table: &'a Table<'a>,
    points: usize,
    shape: Shape,
    /// Contacts before each piece, and in all; the same of touches. Empty where they are not stored.
    rows: [Vec<usize>; 2],
    /// When this becomes true putting them together ends soon, in an error.
    stop: &'a AtomicBool,
}

impl<'a> Results<'a> {
    /// The results of all `points` points in `table`, as they go into a file of `shape`.
    pub fn new(table: &'a Table<'a>, points: usize, shape: Shape, stop: &'a AtomicBool) -> Self {
        let mut results = Self { table, points, shape, rows: Default::default(), stop };
        results.rows = [(shape.with_forces, Section::Ends), (shape.with_touches, Section::TouchEnds)]
            .map(|(stored, ends)| if stored { results.rows_before(ends) } else { Vec::new() });
        results
    }

    fn rows_before(&self, ends: Section) -> Vec<usize> {
        let rows = |piece| self.runs(piece).map(|(block, points)| block.rows(ends, points).len()).sum();
        let counts: Vec<usize> = (0..self.points.div_ceil(PIECE)).into_par_iter().map(rows).collect();
        let mut before = vec![0];
        before.extend(counts.into_iter().scan(0, |sum, count| {
            *sum += count;
            Some(*sum)
        }));
        before
    }

    fn runs(&self, piece: usize) -> impl Iterator<Item = (Block<'_>, Range<usize>)> {
        self.table.runs(piece * PIECE..self.points.min((piece + 1) * PIECE))
    }

    /// Bytes of an entry of a column.
    fn size(&self, section: Section) -> usize {
        self.shape.width().entries()[section as usize]
    }

    /// Contacts before each piece, or touches, whose ends are `ends`.
    fn before(&self, ends: Section) -> &[usize] {
        &self.rows[usize::from(ends == Section::TouchEnds)]
    }

    /// Writes all points as the dataset `output`.
    pub fn assemble(&self, output: Target<'_>, heading: Heading<'_>, surface: &Surface) -> Result<(), dataset::Error> {
        let of = |section| Contents::Section(self, section);
        let grid = heading.grid.counts();
        let mut tensors = vec![
            Tensor::new::<f64>("torque", [&grid[..], &[self.shape.joints]].concat(), of(Section::Torque)),
            Tensor::new::<u8>("status", grid.clone(), of(Section::Status)),
            Tensor::new::<f64>("energy", grid.clone(), of(Section::Energy)),
            Tensor::new::<f32>("gap", grid.clone(), of(Section::Gap)),
            Tensor::new::<f32>("residual", grid.clone(), of(Section::Residual)),
            Tensor::new::<u32>("iterations", grid, of(Section::Iterations)),
        ];
        if self.shape.with_tangent {
            let shape = [&heading.grid.counts()[..], &[self.shape.width().tangent]].concat();
            tensors.push(Tensor::new::<f32>("tangent", shape, of(Section::Tangent)));
        }
        let rows = [
            (CONTACTS, [Section::Ends, Section::Nodes, Section::Forces]),
            (TOUCHES, [Section::TouchEnds, Section::TouchNodes, Section::TouchForces]),
        ];
        for ((names, [ends, nodes, forces]), before) in rows.into_iter().zip(&self.rows) {
            if let Some(&count) = before.last() {
                tensors.push(Tensor::new::<u64>(names[0], vec![self.points + 1], of(ends)));
                tensors.push(Tensor::new::<u32>(names[1], vec![count], of(nodes)));
                tensors.push(Tensor::new::<f32>(names[2], vec![count, 3], of(forces)));
            }
        }
        tensors.extend(surface_tensors(surface).into_iter().map(|tensor| tensor.map(Contents::Held)));
        write_file(output, heading, tensors)
    }
}

enum Contents<'a> {
    Held(&'a [u8]),
    /// A column of all points; that of the ends of rows behind a 0.
    Section(&'a Results<'a>, Section),
}

impl TensorContents for Contents<'_> {
    fn pieces(&self) -> Vec<usize> {
        match self {
            Self::Held(bytes) => bytes.pieces(),
            Self::Section(results, section) => {
                let points = (0..results.points).step_by(PIECE);
                let first: Vec<usize> = match (section, section.ends()) {
                    (_, Some(ends)) => points.zip(results.before(ends)).map(|(_, &before)| before).collect(),
                    (Section::Ends | Section::TouchEnds, _) => {
                        points.map(|point| point + usize::from(point > 0)).collect()
                    }
                    _ => points.collect(),
                };
                first.into_iter().map(|entry| entry * results.size(*section)).collect()
            }
        }
    }

    fn write(&self, piece: usize, writer: &mut impl Write) -> io::Result<()> {
        let (results, section) = match self {
            Self::Held(bytes) => return bytes.write(piece, writer),
            Self::Section(results, section) => (results, *section),
        };
        let mut end =
            matches!(section, Section::Ends | Section::TouchEnds).then(|| results.before(section)[piece] as u64);
        if let (Some(end), 0) = (end, piece) {
            writer.write_all(&end.to_le_bytes())?;
        }
        for (block, points) in results.runs(piece) {
            if results.stop.load(Ordering::Relaxed) {
                return Err(io::Error::other("stopped"));
            }
            let bytes = block.bytes(section, points.clone(), results.size(section));
            let Some(before) = end else {
                writer.write_all(bytes)?;
                continue;
            };
            let shift = before.wrapping_sub(block.rows(section, points).start as u64);
            for bytes in bytes.as_chunks().0 {
                let shifted = shift.wrapping_add(u64::from_le_bytes(*bytes));
                writer.write_all(&shifted.to_le_bytes())?;
                end = Some(shifted);
            }
        }
        Ok(())
    }
}
