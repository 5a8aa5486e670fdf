//! Datasets for other programs: NumPy archives, HDF5, comma-separated text and VTK's image data.

mod csv;
mod hdf5;
mod npz;
mod vti;

use super::{Axis, Dataset, error::unwritable, replace_file};
use crate::Error;
use std::{
    fs::File,
    io::{self, BufWriter},
    path::{Path, PathBuf},
};

/// Format of an export.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Format {
    /// NumPy archive, uncompressed: `numpy.load(FILE)["torque"]`.
    Npz,
    /// HDF5, with units and axes: `h5py.File(FILE)["torque"]`, in MATLAB `h5read(FILE, "/torque")`.
    Hdf5,
    /// Comma-separated text, one row a grid point, and a second file with one row a contact force.
    Csv,
    /// VTK's image data, of two or three joints: torque, energy, gap and status as ParaView opens them.
    Vti,
}

impl Format {
    /// Returns the format that the command line calls `name`.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        clap::ValueEnum::from_str(name, false).ok()
    }

    /// The usual extension of such files.
    #[must_use]
    pub fn extension(self) -> &'static str {
        match self {
            Self::Npz => "npz",
            Self::Hdf5 => "h5",
            Self::Csv => "csv",
            Self::Vti => "vti",
        }
    }

    /// Returns the file that may be written beside the one at `path`.
    #[must_use]
    pub fn beside(self, path: &Path) -> Option<PathBuf> {
        (self == Self::Csv).then(|| csv::contacts_file(path))
    }
}

/// Name of the array with the grid lines of axis `k`.
fn lines_name(k: usize) -> String {
    format!("q{}", k + 1)
}

/// Returns the coordinates of the grid lines of `axis`.
fn lines(axis: &Axis) -> impl ExactSizeIterator<Item = f64> + '_ {
    (0..axis.count).map(|line| axis.coordinate(line))
}

/// Replaces the file at `path` by what `write` writes, whole or not at all.
fn replaced(path: &Path, write: impl FnOnce(&mut BufWriter<&File>) -> io::Result<()>) -> Result<(), Error> {
    replace_file(path, write).map_err(|source| unwritable(path, &source))
}

impl Dataset {
    /// Exports the dataset to `path`, replacing it whole or not at all; returns the files written.
    ///
    /// # Errors
    /// When the system refuses, or the format has no room for so many joints.
    pub fn export(&self, path: &Path, format: Format) -> Result<Vec<PathBuf>, Error> {
        match format {
            Format::Npz => replaced(path, |out| npz::write(self, out)),
            Format::Hdf5 => hdf5::export(self, path),
            Format::Csv => csv::export(self, path),
            Format::Vti => vti::export(self, path),
        }?;
        let beside = format.beside(path).filter(|_| self.contacts.is_some());
        Ok([path.to_path_buf()].into_iter().chain(beside).collect())
    }
}
