//! The dataset's file, put together from a part: column after column is copied through a buffer, so that memory does
//! not grow with the grid.

use super::{
    columns::{Replaced, Section, Shape},
    part::{self, Part},
};
use crate::dataset::{
    self, CONTACTS, Heading, Surface, TOUCHES, Target, Tensor, TensorContents, surface_tensors, write_file,
};
use std::{
    io::{self, Read, Write},
    sync::atomic::{AtomicBool, Ordering},
};

/// Memory that it takes: the buffers between part and file [bytes].
pub(super) const BUFFERS: usize = part::BUFFER + dataset::BUFFER;

/// The results of a sweep on the disk.
pub(super) struct Results<'a> {
    pub part: &'a Part,
    pub shape: Shape,
    /// New results of single points.
    pub replaced: &'a Replaced,
    /// Contacts and touches of all points, the new results among them.
    pub forces: [usize; 2],
    /// When this becomes true putting them together ends soon, in an error.
    pub stop: &'a AtomicBool,
}

impl Results<'_> {
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
            (self.shape.with_forces, CONTACTS, [Section::Ends, Section::Nodes, Section::Forces]),
            (self.shape.with_touches, TOUCHES, [Section::TouchEnds, Section::TouchNodes, Section::TouchForces]),
        ];
        for ((stored, names, [ends, nodes, forces]), count) in rows.into_iter().zip(self.forces) {
            if stored {
                let offsets = vec![heading.grid.points() + 1];
                tensors.push(Tensor::new::<u64>(names[0], offsets, Contents::Offsets(self, ends)));
                tensors.push(Tensor::new::<u32>(names[1], vec![count], of(nodes)));
                tensors.push(Tensor::new::<f32>(names[2], vec![count, 3], of(forces)));
            }
        }
        tensors.extend(surface_tensors(surface).into_iter().map(|tensor| tensor.map(Contents::Held)));
        write_file(output, heading, tensors)
    }

    /// Hands a column of all points, block by block, to `take`.
    fn column(&self, section: Section, take: &mut dyn FnMut(&mut dyn Read) -> io::Result<()>) -> io::Result<()> {
        self.part.column(section, self.shape.width(), self.replaced, &mut |column| {
            if self.stop.load(Ordering::Relaxed) { Err(io::Error::other("stopped")) } else { take(column) }
        })
    }
}

enum Contents<'a> {
    Held(&'a [u8]),
    /// A column of all points.
    Section(&'a Results<'a>, Section),
    /// A column of the ends of rows, behind a 0.
    Offsets(&'a Results<'a>, Section),
}

impl TensorContents for Contents<'_> {
    fn write(&self, writer: &mut impl Write) -> io::Result<()> {
        match self {
            Self::Held(bytes) => writer.write_all(bytes),
            Self::Section(results, section) => {
                results.column(*section, &mut |column| io::copy(column, writer).map(drop))
            }
            Self::Offsets(results, ends) => {
                let mut before = 0_u64;
                writer.write_all(&before.to_le_bytes())?;
                results.column(*ends, &mut |column| {
                    let mut ends = Vec::new();
                    column.read_to_end(&mut ends)?;
                    let mut end = before;
                    for bytes in ends.as_chunks().0 {
                        end = before.wrapping_add(u64::from_le_bytes(*bytes));
                        writer.write_all(&end.to_le_bytes())?;
                    }
                    before = end;
                    Ok(())
                })
            }
        }
    }
}
