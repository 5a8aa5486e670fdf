//! The dataset's file, put together from the results of all points: column after column, its pieces on all cores.
//! Memory does not grow with the grid.

use super::{
    table::Table,
    tile::{Shape, Tile},
};
use crate::Error;
use crate::dataset::{
    self, Column, Element, Heading, RESULTS, Source, Stored, Surface, Tensor, TensorContents, surface_tensors,
    write_file,
};
use rayon::prelude::*;
use std::{
    io::{self, Write},
    ops::Range,
    path::Path,
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
    /// Contacts before each piece, and in all; empty where they are not stored.
    before: Vec<usize>,
    /// When this becomes true putting them together ends soon, in an error.
    stop: &'a AtomicBool,
}

impl<'a> Results<'a> {
    /// The results of all `points` points in `table`, as they go into a file of `shape`.
    pub fn new(table: &'a Table<'a>, points: usize, shape: Shape, stop: &'a AtomicBool) -> Self {
        let mut results = Self { table, points, shape, before: Vec::new(), stop };
        if shape.extras.forces {
            results.before = results.contacts_before();
        }
        results
    }

    fn contacts_before(&self) -> Vec<usize> {
        let rows = |piece| self.runs(piece).map(|(tile, points)| tile.rows(points).len()).sum();
        let counts: Vec<usize> = (0..self.points.div_ceil(PIECE)).into_par_iter().map(rows).collect();
        let mut before = vec![0];
        before.extend(counts.into_iter().scan(0, |sum, count| {
            *sum += count;
            Some(*sum)
        }));
        before
    }

    fn runs(&self, piece: usize) -> impl Iterator<Item = (&Tile<'_>, Range<usize>)> {
        self.table.runs(piece * PIECE..self.points.min((piece + 1) * PIECE))
    }

    /// Bytes of an entry of a column.
    fn size(&self, array: Stored) -> usize {
        self.shape.bytes(array)
    }

    /// Bytes of a column in the file.
    fn bytes(&self, array: Stored) -> usize {
        let entries = match array {
            _ if array.is_of_contacts() => self.before.last().copied().unwrap_or(0),
            Stored::ContactOffsets => self.points + 1,
            _ => self.points,
        };
        entries * self.size(array)
    }

    /// Writes all points as the dataset `output`.
    pub fn assemble(&self, output: &Path, heading: Heading<'_>, surface: &Surface) -> Result<(), Error> {
        let tensor =
            |array: Stored| Tensor::stored(array, heading.grid, self.bytes(array), Contents::Results(self, array));
        let stored = RESULTS.into_iter().filter(|array| self.shape.extras.store(*array));
        let mut tensors: Vec<_> = stored.map(tensor).collect();
        tensors.extend(surface_tensors(heading.grid, surface).into_iter().map(|tensor| tensor.map(Contents::Held)));
        write_file(output, heading, tensors)
    }
}

/// Columns of all points in memory.
impl Source for Results<'_> {
    fn take<T: Element>(&mut self, array: Stored) -> Result<Option<Column<T>>, String> {
        if !RESULTS.contains(&array) || !self.shape.extras.store(array) {
            return Ok(None);
        }
        let (mut numbers, count) = (Vec::new(), self.bytes(array) / size_of::<T>());
        numbers.try_reserve_exact(count).map_err(|why| why.to_string())?;
        numbers.resize(count, T::zeroed());
        let mut rest = bytemuck::cast_slice_mut(&mut numbers);
        let contents = Contents::Results(self, array);
        for piece in 0..self.points.div_ceil(PIECE) {
            // What is written is as long as the column.
            let _ = contents.write(piece, &mut rest);
        }
        Ok(Some(numbers.into()))
    }
}

enum Contents<'a> {
    Held(&'a [u8]),
    /// A column of all points; that of the ends of rows behind a 0.
    Results(&'a Results<'a>, Stored),
}

impl TensorContents for Contents<'_> {
    fn pieces(&self) -> Vec<usize> {
        match self {
            Self::Held(bytes) => bytes.pieces(),
            Self::Results(results, array) => {
                let points = (0..results.points).step_by(PIECE);
                let first: Vec<usize> = match *array {
                    _ if array.is_of_contacts() => points.zip(&results.before).map(|(_, &before)| before).collect(),
                    Stored::ContactOffsets => points.map(|point| point + usize::from(point > 0)).collect(),
                    _ => points.collect(),
                };
                first.into_iter().map(|entry| entry * results.size(*array)).collect()
            }
        }
    }

    fn write(&self, piece: usize, writer: &mut impl Write) -> io::Result<()> {
        let (results, array) = match self {
            Self::Held(bytes) => return bytes.write(piece, writer),
            Self::Results(results, array) => (results, *array),
        };
        let mut end = (array == Stored::ContactOffsets).then(|| results.before[piece] as u64);
        if let (Some(end), 0) = (end, piece) {
            writer.write_all(&end.to_le_bytes())?;
        }
        for (tile, points) in results.runs(piece) {
            if results.stop.load(Ordering::Relaxed) {
                return Err(io::Error::other("stopped"));
            }
            let bytes = tile.column(array, points.clone(), results.size(array));
            let Some(before) = end else {
                writer.write_all(bytes)?;
                continue;
            };
            let shift = before.wrapping_sub(tile.rows(points).start as u64);
            for bytes in bytes.as_chunks().0 {
                let shifted = shift.wrapping_add(u64::from_le_bytes(*bytes));
                writer.write_all(&shifted.to_le_bytes())?;
                end = Some(shifted);
            }
        }
        Ok(())
    }
}
