//! A sweep: equation (2) solved at every point of a grid in C-space, in chunks, by any [`Backend`].
//!
//! Each configuration is solved on its own, so the dataset depends neither on the number of threads nor on how the grid
//! is cut into chunks, and an interrupted sweep continues where it stopped (see [`Sweep::bake`]).

use super::{
    Backend, ChosenBackend, Footprint, Forecast, FreeSpace, SweepReport,
    assembly::{self, Results},
    chunks::{Solved, Store, together},
    error::{in_grid, in_part, no_memory, stopped, too_many_joints, unwritable},
    footprint::{self, Bounds},
    lowest,
    measured::{ErrorCheck, MOST_CONFIGURATIONS},
    part::{Binding, Part},
    shard::Shard,
    table::Table,
    tally::Tally,
    tile::Shape,
};
use crate::{
    Error, MAX_AXES,
    contact::{MeshRipple, Model},
    dataset::{self, Axis, Dataset, Extras, Grid, Heading, Provenance, Surface},
    error, memory,
    names::counted,
    object::{LatticeError, Object, Skin},
    scene::{HapticsSpec, Scene},
};
use std::{
    ffi::OsString,
    path::{Path, PathBuf},
    sync::atomic::{AtomicBool, Ordering},
    time::Instant,
};

/// How far a sweep has come.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Progress {
    /// Points done, those taken over from a part included.
    pub done: usize,
    /// Points in all.
    pub points: usize,
    /// Points done that are in contact.
    pub contact_points: usize,
    /// Points a second, of this run; 0 before the first chunk (1/s).
    pub rate: f64,
    /// Memory and disk that the sweep takes, at least and at most.
    pub footprint: Footprint,
    /// Expected cost of the sweep, if its points were sampled.
    pub forecast: Option<Forecast>,
}

/// How a sweep is run; nothing of it changes the result.
pub struct Run<'a> {
    /// Configurations handed to the backend at once, at least 1.
    pub chunk: usize,
    /// When this becomes true the sweep stops after the chunks that are with the backend, or while the file is put
    /// together.
    pub stop: &'a AtomicBool,
    /// Called at the start and after every chunk.
    pub progress: &'a mut dyn FnMut(Progress),
}

/// A sweep, ready to run.
pub struct Sweep<'a> {
    /// Everything on which its results depend.
    pub(super) binding: Binding,
    surface: Surface,
    /// Whether the dataset holds contact forces.
    pub(super) with_forces: bool,
    /// The object's skin.
    pub(super) skin: Option<Skin>,
    /// The error of the object's lattice.
    pub(super) lattice: Option<LatticeError>,
    /// Warnings about the object.
    pub(super) warnings: Vec<String>,
    /// By which free space is found; `None` where all points are solved.
    model: Option<&'a Model<'a>>,
    /// Whose lowest equilibria are found; `None` where those from rest are taken.
    pub(super) lowest: Option<&'a Model<'a>>,
    pub(super) error: Option<ErrorCheck<'a>>,
    /// See [`Progress::forecast`].
    pub(super) forecast: Option<Forecast>,
    /// Number of nodes of the proxy.
    pub(super) proxy_nodes: usize,
}

/// Says that a grid has other than one axis for each joint.
fn unlike(axes: usize, joints: usize) -> String {
    format!("{} for {}", counted(axes, ["axis", "axes"]), counted(joints, ["joint", "joints"]))
}

/// The grid of `scene`, with the names and units of its joints.
#[must_use]
pub fn grid_of(scene: &Scene) -> Grid {
    let axes = scene.proxy.joints.iter().zip(&scene.grid.axes).map(|(joint, axis)| Axis {
        name: joint.name.clone(),
        unit: joint.kind.unit().into(),
        start: axis.start,
        step: axis.step,
        count: axis.count,
    });
    Grid { axes: axes.collect() }
}

impl<'a> Sweep<'a> {
    /// The sweep that `scene` asks for, over `object`, which was built from it.
    ///
    /// Provenance is given `backend` (`cpu` or `gpu`), `adapter` and `date` (ISO 8601, UTC): they are not measured
    /// here, so that the same sweep makes the same file.
    ///
    /// # Errors
    /// When the scene has no grid, or not one for the proxy's joints.
    pub fn new(scene: &Scene, object: &Object, backend: &str, adapter: &str, date: &str) -> Result<Self, Error> {
        let grid = grid_of(scene);
        check_given(scene)?;
        if grid.joints() != scene.proxy.joints.len() {
            return Err(in_grid(unlike(grid.joints(), scene.proxy.joints.len())));
        }
        grid.check().map_err(in_grid)?;
        let with_forces = scene.graphics.is_some();
        let binding = Binding {
            shape: Shape {
                joints: grid.joints(),
                surface_nodes: object.surface_nodes,
                extras: Extras { forces: with_forces, tangent: false, slip: scene.haptics.uses_slip() },
            },
            grid,
            shard: Shard::WHOLE,
            object: crc32fast::hash(object.key()),
            scene: scene.text.clone(),
            scene_path: std::path::absolute(&scene.path).unwrap_or_default().to_string_lossy().into_owned(),
            provenance: provenance(scene, [backend, adapter, date]),
        };
        Ok(Self {
            binding,
            surface: Surface::of(object),
            with_forces,
            skin: object.skin,
            lattice: None,
            warnings: object.warnings.clone(),
            model: None,
            lowest: None,
            error: None,
            forecast: None,
            proxy_nodes: scene.proxy.contact_nodes(),
        })
    }

    /// States how much a contact point of `model` feels the mesh, which is that of the scene.
    pub fn diagnose(&mut self, model: &Model<'_>) {
        self.binding.provenance.mesh_ripple = MeshRipple::new(model);
    }

    /// Skips the points that [`FreeSpace`] proves free: `model` is that of the scene. Nothing is changed but gaps
    /// farther than [`FreeSpace::MARGIN`] grid steps from any contact, which become lower bounds.
    ///
    /// # Errors
    /// When the model's proxy has other joints.
    pub fn skip_free_space(&mut self, model: &'a Model<'a>) -> Result<(), Error> {
        // The depth below a rounded surface may change by more than its node moves.
        self.model = Some(self.fitting(model)?).filter(|model| model.rounded.is_none());
        Ok(())
    }

    /// Replaces equilibria by lower ones that are reached from those of neighbouring points, where the scene's
    /// law minimises the energy: U then has no jumps. `model` is that of the scene.
    ///
    /// # Errors
    /// When the model's proxy has other joints.
    pub fn find_lowest(&mut self, model: &'a Model<'a>) -> Result<(), Error> {
        if lowest::applies(model.contact.law) {
            self.lowest = Some(self.fitting(model)?);
            self.binding.shape.extras.forces = true;
        }
        Ok(())
    }

    /// Measures the dataset's error at random configurations; see [`super::Bake::measured`]. `model` and `haptics` are
    /// those of the scene.
    ///
    /// # Errors
    /// When the model's proxy has other joints, or there are too many configurations.
    pub fn measure_error(
        &mut self,
        model: &'a Model<'a>,
        haptics: &HapticsSpec,
        configurations: Option<usize>,
    ) -> Result<(), Error> {
        let (threshold, slope) = (haptics.threshold, haptics.boundary_slope);
        let (model, lowest) = (self.fitting(model)?, self.lowest.is_some());
        if let Some(asked) = configurations.filter(|asked| *asked > MOST_CONFIGURATIONS) {
            return Err(error!(
                "the error cannot be measured at {asked} configurations: {MOST_CONFIGURATIONS} are the most"
            ));
        }
        let interpolation = haptics.interpolation;
        self.error = Some(ErrorCheck { model, threshold, slope, interpolation, configurations, lowest });
        Ok(())
    }

    /// Names another backend in the provenance. A forecast of time no longer holds where a GPU solves.
    pub(crate) fn solved_by(&mut self, backend: &ChosenBackend<'_>) {
        self.binding.provenance.backend = backend.name().into();
        self.binding.provenance.adapter = backend.adapter();
        if let (Some(forecast), false) = (&mut self.forecast, backend.is_cpu_alone()) {
            (forecast.seconds, forecast.after) = (None, None);
        }
    }

    /// Tangents are stored where the model that solves gives them.
    fn fitting(&mut self, model: &'a Model<'a>) -> Result<&'a Model<'a>, Error> {
        let joints = model.chain.joints.len();
        if joints != self.binding.grid.joints() {
            return Err(in_grid(unlike(self.binding.grid.joints(), joints)));
        }
        self.binding.shape.extras.tangent = model.with_tangent;
        Ok(model)
    }

    /// The grid.
    #[must_use]
    pub fn grid(&self) -> &Grid {
        &self.binding.grid
    }

    /// Returns the memory and disk space of a sweep in memory, or else into a file, with chunks of `chunk`
    /// configurations.
    #[must_use]
    pub fn footprint(&self, chunk: usize, in_memory: bool) -> Footprint {
        let points = self.points();
        let solved = chunk.clamp(1, points.max(1));
        let free_space = self.free_space();
        let together = points.min(if free_space.is_some() { together(solved) } else { solved });
        let slab = free_space.map_or(0, |free_space| 4 * free_space.largest_slab());
        let results = |touching| footprint::results(points, touching, self.binding.shape);
        let memory = |touching| {
            let chunk = footprint::chunk(solved, together, touching, self.binding.shape).saturating_add(slab);
            // In memory as they were solved, and once more as columns.
            chunk.saturating_add(if in_memory { results(touching).saturating_mul(2) } else { assembly::buffers() })
        };
        // A shard holds the forces from which lower equilibria are searched for.
        let stored = if self.binding.shard == Shard::WHOLE { self.stored() } else { self.binding.shape };
        let disk = |touching| if in_memory { 0 } else { footprint::results(points, touching, stored) };
        Footprint { memory: Bounds::of(self.proxy_nodes, memory), disk: Bounds::of(self.proxy_nodes, disk) }
    }

    /// Returns where [`Sweep::bake`] keeps what it has of `output`.
    #[must_use]
    pub fn part_of(output: &Path) -> PathBuf {
        let mut name = OsString::from(output);
        name.push(".part");
        name.into()
    }

    /// Sweeps in memory.
    ///
    /// # Errors
    /// When there is no memory, the backend fails, or the sweep is stopped.
    pub fn run<B: Backend>(&self, backend: &mut B, mut run: Run<'_>) -> Result<(Dataset, SweepReport), Error> {
        let (points, bytes) = (self.binding.grid.points(), self.footprint(run.chunk, true).memory.least);
        memory::check(bytes).map_err(|shortage| {
            error!(
                "the grid's {points} points do not fit in memory: {shortage}; or haptize into a file (`haptize bake`), \
                 which takes little memory whatever the grid"
            )
        })?;
        let mut tiles = Vec::new();
        let begun = (Tally::default(), self.binding.provenance.clone());
        let solved = self.solve(backend, &mut run, begun, Store::Memory(&mut tiles))?;
        let mut table = Table::new(self.binding.shape, tiles);
        let (report, provenance) = self.complete(solved, &mut table, run.stop, None)?;
        // Nothing stops it halfway.
        let never = AtomicBool::new(false);
        let mut results = Results::new(&table, points, self.stored(), &never);
        let dataset =
            Dataset::of(&mut results, self.binding.grid.clone()).map_err(|why| no_memory(points, bytes, why))?;
        Ok((
            Dataset { surface: Some(self.surface.clone()), scene: self.binding.scene.clone(), provenance, ..dataset },
            report,
        ))
    }

    /// Sweeps into the file `output`, keeping what is done in [`Sweep::part_of`] it until the file is whole. Memory does
    /// not grow with the grid.
    ///
    /// With `resume` it continues from such a part; the file is then the same, bit for bit, as without the
    /// interruption, the date of the beginning included. Without a part it begins. Without `resume` a part that holds
    /// results is an error.
    ///
    /// # Errors
    /// When it fails or is stopped; the part then keeps what is done, and an earlier file `output` is untouched.
    pub fn bake<B: Backend>(
        &self,
        backend: &mut B,
        output: &Path,
        resume: bool,
        mut run: Run<'_>,
    ) -> Result<SweepReport, Error> {
        if output.is_dir() {
            return Err(Error::at(output, "is a folder; name a file in it (-o)"));
        }
        // The part grows beside the file that a link leads to: only there can that be replaced.
        let output = &dataset::resolved(output).map_err(|source| unwritable(output, &source))?;
        dataset::check_place(output)?;
        let mut binding = self.binding.clone();
        let (mut part, tally) = Part::open(&Self::part_of(output), resume, &mut binding)?;
        let mut provenance = binding.provenance;
        if !provenance.notices.is_empty() && tally.points < self.points() {
            let Provenance { backend, adapter, .. } = &self.binding.provenance;
            let notice = format!("from grid point {} on: resumed on {backend} ({adapter})", tally.points);
            part.note(&notice)?;
            provenance.notices.push(notice);
        }
        let stop = run.stop;
        let kept_in = part.path().to_path_buf();
        let unwritten = |why: Error, points| {
            if stop.load(Ordering::Relaxed) {
                return stopped(points, points, Some(&kept_in));
            }
            let part = kept_in.display();
            error!("{why}; all points are kept in {part}: afterwards give the same command, a bake with --resume")
        };
        let solved = self.solve(backend, &mut run, (tally, provenance), Store::Part(&mut part))?;
        let map = part.map().map_err(|source| in_part(&kept_in, &source))?;
        let mut table = part.table(&map, self.binding.shape)?;
        let (report, provenance) = self.complete(solved, &mut table, stop, Some(&kept_in))?;
        let Binding { grid, scene, .. } = &self.binding;
        let heading = Heading { grid, provenance: &provenance, scene, store: None };
        let results = Results::new(&table, report.points, self.stored(), stop);
        results.assemble(output, heading, &self.surface).map_err(|source| unwritten(source, report.points))?;
        drop(map);
        part.remove()?;
        Ok(report)
    }

    /// Number of points that are solved.
    pub(super) fn points(&self) -> usize {
        self.binding.shard.points(self.binding.grid.points())
    }

    /// Columns of the dataset.
    pub(super) fn stored(&self) -> Shape {
        Shape { extras: Extras { forces: self.with_forces, ..self.binding.shape.extras }, ..self.binding.shape }
    }

    /// Finds the lowest equilibria and measures the error, as far as the sweep was asked to.
    fn complete(
        &self,
        mut solved: Solved,
        table: &mut Table<'_>,
        stop: &AtomicBool,
        part: Option<&Path>,
    ) -> Result<(SweepReport, Provenance), Error> {
        let (start, points) = (Instant::now(), self.binding.grid.points());
        let stopped = || stopped(points, points, part);
        if let Some(model) = self.lowest {
            let lowered =
                lowest::correct(&self.binding.grid, model, self.binding.shape, table, stop).ok_or_else(stopped)?;
            if lowered.points > 0 {
                solved.tally = Tally::default();
                table.runs(0..points).for_each(|(tile, rows)| solved.tally.add(tile, rows));
            }
            solved.facts.lowered = Some(lowered);
        }
        if let Some(error) = self.error {
            let contacts = solved.tally.statuses.in_contact();
            match error.measure(&self.binding.grid, table, contacts, stop) {
                Ok(Some(measured)) => {
                    solved.provenance.error = Some(measured.error);
                    solved.provenance.notices.extend(measured.notice);
                }
                Ok(None) => {}
                Err(error) => solved.provenance.notices.push(format!("the error was not measured: {error}")),
            }
        }
        if stop.load(Ordering::Relaxed) {
            return Err(stopped());
        }
        solved.facts.time += start.elapsed();
        Ok(self.report(solved))
    }

    pub(super) fn report(&self, solved: Solved) -> (SweepReport, Provenance) {
        let Solved { tally, facts, provenance } = solved;
        (SweepReport::of(self, &tally, facts, &provenance), provenance)
    }

    /// Returns how free space is found, where it is.
    pub(super) fn free_space(&self) -> Option<FreeSpace<'_>> {
        self.model.map(|model| FreeSpace::new(model, &self.binding.grid))
    }
}

/// Where results come from that solve `scene`; `solved`: by which backend, on which adapter, when.
pub(super) fn provenance(scene: &Scene, solved: [&str; 3]) -> Provenance {
    let [backend, adapter, date] = solved.map(str::to_owned);
    let (version, algorithm) = (env!("CARGO_PKG_VERSION").into(), scene.contact.law.name().into());
    let tolerance = scene.contact.tolerance;
    Provenance { version, algorithm, tolerance, backend, adapter, date, ..Provenance::default() }
}

/// Checks that `scene` has a grid.
pub(super) fn check_given(scene: &Scene) -> Result<(), Error> {
    check_axes(scene)?;
    if scene.grid.axes.is_empty() {
        return Err("the scene leaves the grid out; `haptize reach SCENE --write` finds one and writes it there".into());
    }
    Ok(())
}

/// Checks that the arm has no more joints than a grid has axes.
pub(super) fn check_axes(scene: &Scene) -> Result<(), Error> {
    let joints = scene.proxy.joints.len();
    if joints > MAX_AXES { Err(too_many_joints(joints)) } else { Ok(()) }
}
