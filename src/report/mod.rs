//! Figures of a bake and of a press, drawn without a display, a GPU or a system font.
//!
//! The figures are functions of the library's types; none of them knows how the data came about.

pub mod force;
pub mod gridized;
pub mod hysteresis;
pub mod jitter;
pub mod mcap;
pub mod object;
pub mod page;
pub mod press;
pub mod scanned;
pub mod series;
pub mod slices;
pub mod space;
pub mod twinned;

use crate::{
    Error, ErrorKind,
    dataset::{Dataset, replace_file},
    draw::canvas::Canvas,
    proxy::Chain,
    render::{live::LiveScene, trace::Trace},
};
use rayon::prelude::*;
use std::{
    io::Write,
    ops::Deref,
    path::{Path, PathBuf},
    sync::{
        Arc,
        mpsc::{self, RecvTimeoutError},
    },
    time::Duration,
};

/// Pixels a point in PNG files: sharp on dense screens and in print.
pub const PIXELS: f64 = 2.0;

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

/// A figure to be drawn.
pub struct Figure<'a> {
    name: &'static str,
    /// What is made of pixels is no drawing, and has no SVG.
    is_drawing: bool,
    draw: Box<dyn FnOnce() -> Result<Canvas, Error> + Send + 'a>,
}

impl<'a> Figure<'a> {
    /// The figure `NAME.svg` and `NAME.png`.
    pub fn drawing(name: &'static str, draw: impl FnOnce() -> Canvas + Send + 'a) -> Self {
        Self { name, is_drawing: true, draw: Box::new(move || Ok(draw())) }
    }

    /// The figure `NAME.png`.
    fn picture(name: &'static str, draw: impl FnOnce() -> Result<Canvas, Error> + Send + 'a) -> Self {
        Self { name, is_drawing: false, draw: Box::new(draw) }
    }

    /// Returns its files.
    fn files(&self, folder: &Path) -> Vec<PathBuf> {
        let png = folder.join(self.name).with_extension("png");
        let svg = self.is_drawing.then(|| png.with_extension("svg"));
        svg.into_iter().chain([png]).collect()
    }
}

/// Returns all figures that the data allow. `live`: the scene of a recording whose contact was solved in every tick, of
/// which the dataset holds nothing, or where nothing was measured.
///
/// `cspace.png` (Fig. 3) and `torque.{svg,png}` show the dataset, where it holds something; with a recording of the proxy `chain` also
/// `motion.{svg,png}` (Fig. 5), `energy.{svg,png}`, with three joints of which the last link alone touches
/// `force.{svg,png}` (Fig. 8) and, where it has frames and the dataset a surface, `object.png` (Fig. 6).
pub fn figures<'a, D, C, T>(dataset: &D, recording: Option<(&C, &T)>, live: Option<&Arc<LiveScene>>) -> Vec<Figure<'a>>
where
    D: Deref<Target = Dataset> + Clone + Send + 'a,
    C: Deref<Target = Chain> + Clone + Send + 'a,
    T: Deref<Target = Trace> + Clone + Send + 'a,
{
    let mut figures = Vec::new();
    if live.is_none() || dataset.energy.is_some() {
        let shown = dataset.clone();
        figures.push(Figure::picture("cspace", move || Ok(space::space(&shown))));
        let (shown, deepest) = (dataset.clone(), recording.and_then(|(_, trace)| press::deepest(trace)));
        figures.push(Figure::drawing("torque", move || slices::slices(&shown, deepest.as_deref())));
    }
    let Some((chain, trace)) = recording else { return figures };
    let shown = trace.clone();
    figures.push(Figure::drawing("motion", move || press::press(&shown)));
    let shown = trace.clone();
    figures.push(Figure::drawing("energy", move || press::energy(&shown)));
    if let Some(end) = force::EndForce::new("", chain, trace) {
        let shown = trace.clone();
        figures.push(Figure::drawing("force", move || force::force(&[end], &shown)));
    }
    if !trace.frames.is_empty() && dataset.surface.is_some() {
        let (dataset, chain, trace, live) = (dataset.clone(), chain.clone(), trace.clone(), live.cloned());
        figures.push(Figure::picture("object", move || {
            let instants = object::instants(&dataset, &chain, &trace, INSTANTS, live)?;
            object::object(&dataset, &chain, &instants)
        }));
    }
    figures
}

/// Writes all [`figures`] that the data allow into `folder`, which is made if it is missing, and returns their paths.
///
/// # Errors
/// When a file cannot be written, or recording, chain and dataset do not belong together.
pub fn write_figures(
    folder: &Path,
    dataset: &Dataset,
    recording: Option<(&Chain, &Trace)>,
) -> Result<Vec<PathBuf>, Error> {
    let recording = recording.as_ref().map(|(chain, trace)| (chain, trace));
    let figures = figures(&dataset, recording, None);
    let files: Vec<PathBuf> = figures.iter().flat_map(|figure| figure.files(folder)).collect();
    let (told, written) = mpsc::channel();
    write_all(folder, figures, &told);
    drop(told);
    written.into_iter().try_for_each(|file| file.map(drop)).map(|()| files)
}

/// Writes `figures` into `folder` on all processors, drawings before what is made of pixels, and tells each file.
fn write_all(folder: &Path, figures: Vec<Figure<'_>>, told: &Told) {
    // Whom nobody listens to any more is left to finish.
    let tell = |file: Result<PathBuf, Error>| drop(told.send(file));
    let write_svg = |figure: Figure<'_>| -> Result<(&'static str, Canvas), Error> {
        let canvas = (figure.draw)()?;
        tell(write(folder.join(figure.name).with_extension("svg"), canvas.svg().as_bytes()));
        Ok((figure.name, canvas))
    };
    let (drawings, mut pictures): (Vec<_>, Vec<_>) = figures.into_iter().partition(|figure| figure.is_drawing);
    let drawn: Vec<_> = drawings.into_par_iter().with_max_len(1).map(write_svg).collect();
    for drawing in drawn {
        match drawing {
            Ok((name, canvas)) => pictures.push(Figure::picture(name, move || Ok(canvas))),
            Err(error) => tell(Err(error)),
        }
    }
    let write_pixels =
        |figure: Figure<'_>| tell((figure.draw)().and_then(|canvas| write_png(folder, figure.name, &canvas)));
    pictures.into_par_iter().with_max_len(1).for_each(write_pixels);
}

/// Where files are told once they are written.
type Told = mpsc::Sender<Result<PathBuf, Error>>;

/// Files of some figures.
#[derive(Debug)]
pub struct Files {
    /// Those that are written.
    pub written: Vec<PathBuf>,
    /// Those that are not.
    pub left_out: Vec<PathBuf>,
}

/// How often is looked whether it is late.
const LOOK: Duration = Duration::from_millis(20);

/// Writes `figures` into `folder`, drawings before what is made of pixels, and returns as soon as it `is_late`. The
/// rest is still being drawn then: who ends the process calls [`crate::dataset::discard_unfinished`].
///
/// # Errors
/// As [`write_figures`].
pub fn write_until(is_late: impl Fn() -> bool, folder: &Path, figures: Vec<Figure<'static>>) -> Result<Files, Error> {
    let all: Vec<PathBuf> = figures.iter().flat_map(|figure| figure.files(folder)).collect();
    let mut there = Vec::new();
    let (told, files) = mpsc::channel();
    let place = folder.to_owned();
    rayon::spawn(move || write_all(&place, figures, &told));
    loop {
        match files.recv_timeout(LOOK) {
            Ok(file) => there.push(file),
            Err(RecvTimeoutError::Timeout) => (),
            Err(RecvTimeoutError::Disconnected) => break,
        }
        if is_late() {
            break;
        }
    }
    let there: Vec<PathBuf> = there.into_iter().collect::<Result<_, _>>()?;
    let (written, left_out) = all.into_iter().partition(|file| there.contains(file));
    Ok(Files { written, left_out })
}

/// Writes `NAME.svg` and `NAME.png` into `folder`, which is made if it is missing.
///
/// # Errors
/// When a file cannot be written.
pub fn write_both(folder: &Path, name: &str, canvas: &Canvas) -> Result<[PathBuf; 2], Error> {
    let svg = write(folder.join(name).with_extension("svg"), canvas.svg().as_bytes())?;
    Ok([svg, write_png(folder, name, canvas)?])
}

/// Writes `NAME.png` into `folder`, which is made if it is missing.
///
/// # Errors
/// When the file cannot be written.
pub fn write_png(folder: &Path, name: &str, canvas: &Canvas) -> Result<PathBuf, Error> {
    write(folder.join(name).with_extension("png"), &canvas.pixels(PIXELS)?.png()?)
}

pub(crate) fn write(path: PathBuf, bytes: &[u8]) -> Result<PathBuf, Error> {
    let made = path.parent().map_or(Ok(()), std::fs::create_dir_all);
    match made.and_then(|()| replace_file(&path, |file| file.write_all(bytes))) {
        Ok(()) => Ok(path),
        Err(source) => {
            let remedy = "check that the folder exists, is writable and has room";
            Err(Error::at(&path, format_args!("cannot be written: {source}; {remedy}")).of(ErrorKind::File))
        }
    }
}
