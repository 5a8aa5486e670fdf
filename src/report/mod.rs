//! Figures of a bake and of a press, drawn without a display, a GPU or a system font.
//!
//! [`canvas`] is the paper sheet (SVG, and the same sheet rasterised to PNG), [`plot`] draws charts and heat maps on
//! it, [`raster`] draws solid bodies. The figures themselves are functions of the library's types; none of them knows
//! how the data came about.

pub mod canvas;
pub mod chart;
pub mod colour;
pub mod diagram;
mod font;
pub mod force;
pub mod gridized;
pub mod hysteresis;
pub mod jitter;
pub mod object;
pub mod paper;
pub mod plot;
pub mod prediction;
pub mod press;
pub mod raster;
pub mod slices;
pub mod space;
pub(crate) mod ticks;

use crate::{
    dataset::{Dataset, replace_file},
    proxy::Chain,
    render::trace::Trace,
};
use canvas::Canvas;
use rayon::prelude::*;
use std::{
    io::Write,
    path::{Path, PathBuf},
};

/// Pixels a point in PNG files: sharp on dense screens and in print.
pub const PIXELS: f64 = 2.0;

/// Why a figure could not be drawn or written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReportError {
    /// The figure's file or folder could not be written.
    #[error("cannot write {}: {source}; check that the folder exists, is writable and has room", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// The system's message.
        source: std::io::Error,
    },
    /// The sheet could not be rasterised.
    #[error("cannot rasterise a figure of {width} x {height} pixels: {reason}; ask for a smaller scale")]
    Rasterise {
        /// Pixels across.
        width: u32,
        /// Pixels down.
        height: u32,
        /// The rasteriser's message.
        reason: String,
    },
    /// The data cannot be drawn at all: their parts contradict each other.
    #[error("cannot draw {figure}: {reason}")]
    Data {
        /// Which figure.
        figure: &'static str,
        /// The contradiction, and the remedy.
        reason: String,
    },
}

/// Files that [`write_figures`] may write.
pub const FIGURES: [&str; 10] = [
    "cspace.png",
    "torque.svg",
    "torque.png",
    "motion.svg",
    "motion.png",
    "energy.svg",
    "energy.png",
    "force.svg",
    "force.png",
    "object.png",
];

/// Instants shown of the deforming object.
const INSTANTS: usize = 6;

/// Figures of a folder.
#[derive(Debug)]
pub struct Figures {
    /// Their files.
    pub written: Vec<PathBuf>,
    /// How many were not begun.
    pub left_out: usize,
}

/// Writes all figures that the data allow into `folder`, which is made if it is missing, and returns their paths.
///
/// `cspace.png` (Fig. 3) and `torque.{svg,png}` show the dataset; with a recording of the proxy `chain` also
/// `motion.{svg,png}` (Fig. 5), `energy.{svg,png}`, with three joints of which the last link alone touches
/// `force.{svg,png}` (Fig. 8) and, where it has frames and the dataset a surface, `object.png` (Fig. 6).
///
/// # Errors
/// [`ReportError::Write`] when a file cannot be written, [`ReportError::Data`] when recording, chain and dataset do not
/// belong together.
pub fn write_figures(
    folder: &Path,
    dataset: &Dataset,
    recording: Option<(&Chain, &Trace)>,
) -> Result<Vec<PathBuf>, ReportError> {
    Ok(write_figures_while(&|| true, folder, dataset, recording)?.written)
}

/// Writes the same figures, on all processors, but leaves out those that are to begin when `goes_on` says no.
///
/// # Errors
/// As [`write_figures`].
pub fn write_figures_while(
    goes_on: &(dyn Fn() -> bool + Sync),
    folder: &Path,
    dataset: &Dataset,
    recording: Option<(&Chain, &Trace)>,
) -> Result<Figures, ReportError> {
    type Figure<'a> = Box<dyn Fn() -> Result<Vec<PathBuf>, ReportError> + Send + Sync + 'a>;
    let png = |name, canvas: Canvas| Ok(vec![write_png(folder, name, &canvas)?]);
    let both = |name, canvas: Canvas| Ok(write_both(folder, name, &canvas)?.into());
    let mut figures: Vec<Figure<'_>> = vec![
        Box::new(move || png("cspace", space::space(dataset))),
        Box::new(move || both("torque", slices::slices(dataset))),
    ];
    if let Some((chain, trace)) = recording {
        figures.push(Box::new(move || both("motion", press::press(trace))));
        figures.push(Box::new(move || both("energy", press::energy(trace))));
        if let Some(end) = force::EndForce::new("", chain, trace) {
            figures.push(Box::new(move || both("force", force::force(std::slice::from_ref(&end), trace))));
        }
        if !trace.frames.is_empty() && dataset.surface.is_some() {
            figures.push(Box::new(move || {
                let instants = object::instants(dataset, chain, trace, INSTANTS)?;
                png("object", object::object(dataset, chain, &instants)?)
            }));
        }
    }
    let draw = |figure: &Figure<'_>| goes_on().then(figure).transpose();
    let drawn: Result<Vec<Option<Vec<PathBuf>>>, ReportError> = figures.par_iter().with_max_len(1).map(draw).collect();
    let drawn = drawn?;
    let left_out = drawn.iter().filter(|files| files.is_none()).count();
    Ok(Figures { written: drawn.into_iter().flatten().flatten().collect(), left_out })
}

/// Writes `NAME.svg` and `NAME.png` into `folder`, which is made if it is missing.
///
/// # Errors
/// [`ReportError::Write`] when a file cannot be written.
pub fn write_both(folder: &Path, name: &str, canvas: &Canvas) -> Result<[PathBuf; 2], ReportError> {
    let svg = write(folder.join(name).with_extension("svg"), canvas.svg().as_bytes())?;
    Ok([svg, write_png(folder, name, canvas)?])
}

/// Writes `NAME.png` into `folder`, which is made if it is missing.
///
/// # Errors
/// [`ReportError::Write`] when the file cannot be written.
pub fn write_png(folder: &Path, name: &str, canvas: &Canvas) -> Result<PathBuf, ReportError> {
    write(folder.join(name).with_extension("png"), &canvas.pixels(PIXELS)?.png()?)
}

pub(crate) fn write(path: PathBuf, bytes: &[u8]) -> Result<PathBuf, ReportError> {
    let made = path.parent().map_or(Ok(()), std::fs::create_dir_all);
    match made.and_then(|()| replace_file(&path, |file| file.write_all(bytes))) {
        Ok(()) => Ok(path),
        Err(source) => Err(ReportError::Write { path, source }),
    }
}
