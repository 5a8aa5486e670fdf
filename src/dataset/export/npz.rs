//! NumPy archive: every tensor of the file under its own name, and what the file has in its header as arrays.
//!
//! `q` (n1, .., nd, d) are the configurations, `q1` .. `qd` the grid lines of each axis, `joint_names` and
//! `joint_units` their names, `scene` and `provenance` texts. `units` and `axes` have a row for each array of numbers,
//! its name and then its unit, or what its axes are: `dict(archive["units"])["energy"]` is `J`. Arrays are streamed,
//! not compressed: numbers of a smooth field hardly are.

use super::{
    super::{Dataset, Stored, file, stored::units},
    lines, lines_name,
};
use npyz::{AutoSerialize, DType, TypeStr, WriterBuilder};
use safetensors::Dtype;
use std::io::{self, Seek, SeekFrom, Write};
use zip::{CompressionMethod, ZipWriter, write::SimpleFileOptions};

/// Room for the header of an array beside its data (bytes).
const ARRAY_HEADER: u64 = 1 << 16;

/// An output that fails once: afterwards nothing is written, and all is well. An archive that is dropped unfinished
/// would be finished in vain, and `zip` would print so.
struct Quiet<W> {
    out: W,
    position: u64,
    end: u64,
    failed: bool,
}

impl<W> Quiet<W> {
    /// `out` is at the beginning of a file that is empty.
    fn new(out: W) -> Self {
        Self { out, position: 0, end: 0, failed: false }
    }

    /// Does `work` on the output unless it has failed.
    fn unless_failed<T>(&mut self, or: T, work: impl FnOnce(&mut W) -> io::Result<T>) -> io::Result<T> {
        if self.failed {
            return Ok(or);
        }
        let done = work(&mut self.out);
        self.failed = done.as_ref().is_err_and(|error| error.kind() != io::ErrorKind::Interrupted);
        done
    }
}

impl<W: Write> Write for Quiet<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let written = self.unless_failed(bytes.len(), |out| out.write(bytes))?;
        self.position += written as u64;
        self.end = self.end.max(self.position);
        Ok(written)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.unless_failed((), W::flush)
    }
}

impl<W: Seek> Seek for Quiet<W> {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        let place = match to {
            SeekFrom::Start(place) => Some(place),
            SeekFrom::Current(by) => self.position.checked_add_signed(by),
            SeekFrom::End(by) => self.end.checked_add_signed(by),
        };
        let place = place.ok_or(io::ErrorKind::InvalidInput)?;
        self.position = self.unless_failed(place, |out| out.seek(SeekFrom::Start(place)))?;
        Ok(self.position)
    }
}

pub(super) fn write(dataset: &Dataset, out: impl Write + Seek) -> io::Result<()> {
    let (mut zip, grid) = (ZipWriter::new(Quiet::new(out)), &dataset.grid);
    for (_, tensor) in file::arrays(dataset) {
        let (name, shape) = (tensor.name, &tensor.shape);
        match tensor.dtype {
            Dtype::F64 => array(&mut zip, name, shape, bytemuck::cast_slice::<u8, f64>(tensor.contents)),
            Dtype::U64 => array(&mut zip, name, shape, bytemuck::cast_slice::<u8, u64>(tensor.contents)),
            Dtype::F32 => array(&mut zip, name, shape, bytemuck::cast_slice::<u8, f32>(tensor.contents)),
            Dtype::U32 => array(&mut zip, name, shape, bytemuck::cast_slice::<u8, u32>(tensor.contents)),
            _ => array(&mut zip, name, shape, tensor.contents),
        }?;
    }
    let mut shape = grid.counts();
    shape.push(grid.joints());
    let configurations = (0..grid.points()).map(|point| grid.configuration(point));
    let coordinates = configurations.flat_map(|q| (0..q.len()).map(move |joint| q[joint]));
    stream(&mut zip, "q", &shape, f64::default_dtype(), coordinates)?;
    for (k, axis) in grid.axes.iter().enumerate() {
        stream(&mut zip, &lines_name(k), &[axis.count], f64::default_dtype(), lines(axis))?;
    }
    let joints = [grid.joints()];
    texts(&mut zip, "joint_names", &joints, grid.axes.iter().map(|axis| axis.name.clone()).collect())?;
    texts(&mut zip, "joint_units", &joints, grid.axes.iter().map(|axis| axis.unit.clone()).collect())?;
    let (units, axes) = meanings(dataset);
    texts(&mut zip, "units", &[units.len(), 2], units.into_iter().flatten().collect())?;
    texts(&mut zip, "axes", &[axes.len(), 2], axes.into_iter().flatten().collect())?;
    texts(&mut zip, "scene", &[], vec![dataset.scene.clone()])?;
    texts(&mut zip, "provenance", &[], vec![serde_json::to_string(&dataset.provenance)?])?;
    zip.finish()?;
    Ok(())
}

/// Each array of numbers with its unit, and with its axes.
fn meanings(dataset: &Dataset) -> (Vec<[String; 2]>, Vec<[String; 2]>) {
    let grid = &dataset.grid;
    let axes = |array: Stored| array.axes(grid).0.join(", ");
    let arrays = file::arrays(dataset).map(|(array, _)| (array.name().to_owned(), array.unit(grid), axes(array)));
    let configurations = ("q".to_owned(), units(grid, |axis| axis.unit.clone()), axes(Stored::Torque));
    let arrays = arrays.chain([configurations]);
    let lines = grid.axes.iter().enumerate().map(|(k, axis)| (lines_name(k), axis.unit.clone(), axis.name.clone()));
    arrays.chain(lines).map(|(name, unit, axes)| ([name.clone(), unit], [name, axes])).unzip()
}

fn array<W: Write + Seek, T: AutoSerialize + Copy>(
    zip: &mut ZipWriter<W>,
    name: &str,
    shape: &[usize],
    values: &[T],
) -> io::Result<()> {
    stream(zip, name, shape, T::default_dtype(), values.iter().copied())
}

/// Text in NumPy has a fixed width: that of the longest, at least one character.
fn texts<W: Write + Seek>(zip: &mut ZipWriter<W>, name: &str, shape: &[usize], texts: Vec<String>) -> io::Result<()> {
    let width = texts.iter().map(|text| text.chars().count()).max().unwrap_or(0).max(1);
    let kind: TypeStr = format!("<U{width}").parse().map_err(io::Error::other)?;
    stream(zip, name, shape, DType::new_scalar(kind), texts.into_iter())
}

fn stream<W: Write + Seek, T: npyz::Serialize>(
    zip: &mut ZipWriter<W>,
    name: &str,
    shape: &[usize],
    kind: DType,
    values: impl Iterator<Item = T>,
) -> io::Result<()> {
    let shape: Vec<u64> = shape.iter().map(|&count| count as u64).collect();
    let bytes = shape.iter().product::<u64>() * kind.num_bytes().unwrap_or(1) as u64;
    let options = SimpleFileOptions::default()
        .compression_method(CompressionMethod::Stored)
        .large_file(bytes + ARRAY_HEADER > u32::MAX.into());
    zip.start_file(npyz::npz::file_name_from_array_name(name), options)?;
    let mut writer = npyz::WriteOptions::new().dtype(kind).shape(&shape).writer(zip).begin_nd()?;
    writer.extend(values)?;
    writer.finish()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Cursor;

    /// Room for so many bytes.
    struct Full(Cursor<Vec<u8>>, usize);

    impl Write for Full {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            if self.0.position() as usize + bytes.len() > self.1 {
                return Err(io::ErrorKind::StorageFull.into());
            }
            self.0.write(bytes)
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    impl Seek for Full {
        fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
            self.0.seek(to)
        }
    }

    #[test]
    fn an_archive_on_a_full_disk_fails_once_and_is_finished_in_silence() {
        let contents = |zip: &mut ZipWriter<Quiet<Full>>| {
            (0..3).try_for_each(|k| array(zip, &format!("a{k}"), &[100], &[k as f64; 100]))
        };
        let whole = {
            let mut zip = ZipWriter::new(Quiet::new(Full(Cursor::default(), usize::MAX)));
            contents(&mut zip).unwrap();
            zip.finish().unwrap().out.0.into_inner()
        };
        assert_eq!(zip::ZipArchive::new(Cursor::new(&whole[..])).unwrap().len(), 3);
        for room in (0..whole.len()).step_by(7) {
            let mut zip = ZipWriter::new(Quiet::new(Full(Cursor::default(), room)));
            match contents(&mut zip) {
                Err(error) => {
                    assert_eq!(error.kind(), io::ErrorKind::StorageFull, "{room}");
                    // As where it is dropped.
                    assert!(zip.finish().is_ok(), "{room}");
                }
                // There is no room for the directory: the second time, where it is dropped, all is well.
                Ok(()) => assert!(zip.finish().is_err(), "{room}"),
            }
        }
    }
}
