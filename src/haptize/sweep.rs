//! A sweep: equation (2) solved at every point of a grid in C-space, in chunks, by any [`Backend`].
//!
//! Each configuration is solved on its own, so the dataset depends neither on the number of threads nor on how the grid
//! is cut into chunks, and an interrupted sweep continues where it stopped (see [`Sweep::bake`]).

use super::{
    Backend, FreeSpace, SweepError, SweepReport,
    columns::Columns,
    part::{Binding, Part},
};
use crate::{
    JointVector,
    contact::{Model, Status},
    dataset::{Axis, Contacts, Dataset, Grid, Provenance, Surface},
    object::Object,
    scene::{JointKind, Scene},
};
use clap::ValueEnum;
use std::{
    ffi::OsString,
    path::{Path, PathBuf},
    sync::atomic::{AtomicBool, Ordering},
    time::{Duration, Instant},
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
    /// Points a second, of this run; 0 before the first chunk [1/s].
    pub rate: f64,
    /// Memory that the sweep takes.
    pub memory: Memory,
}

/// Memory of a sweep's results, known before it begins; chunks in flight and the object's compliance come on top.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct Memory {
    /// Where nothing touches anywhere [bytes].
    pub least: usize,
    /// Where every node of the proxy touches three nodes of the object everywhere [bytes].
    pub most: usize,
}

/// How a sweep is run; nothing of it changes the result.
pub struct Run<'a> {
    /// Configurations handed to the backend at once, at least 1.
    pub chunk: usize,
    /// When this becomes true the sweep stops after the chunk at hand.
    pub stop: &'a AtomicBool,
    /// Called at the start and after every chunk.
    pub progress: &'a mut dyn FnMut(Progress),
}

/// A sweep, ready to run.
pub struct Sweep {
    grid: Grid,
    surface_nodes: Vec<f64>,
    surface_triangles: Vec<u32>,
    scene: String,
    provenance: Provenance,
    with_forces: bool,
    warnings: Vec<String>,
    free_space: Option<FreeSpace>,
    /// Most object nodes that one configuration touches.
    most_contacts: usize,
    /// Time that finding it took.
    preparation: Duration,
}

/// Most points of a chunk, skipped ones included: they cost little time, but the part should not wait for millions of them.
const LARGEST_CHUNK: usize = 1 << 16;

impl Sweep {
    /// The sweep that `scene` asks for, over `object`, which was built from it.
    ///
    /// Provenance is given `backend` (`cpu` or `gpu`), `adapter` and `date` (ISO 8601, UTC): they are not measured here,
    /// so that the same sweep makes the same file.
    ///
    /// # Errors
    /// [`SweepError::Grid`].
    pub fn new(scene: &Scene, object: &Object, backend: &str, adapter: &str, date: &str) -> Result<Self, SweepError> {
        let axes = scene.proxy.joints.iter().zip(&scene.grid.axes).map(|(joint, axis)| Axis {
            name: joint.name.clone(),
            unit: match joint.kind {
                JointKind::Revolute => "rad".into(),
                JointKind::Prismatic => "m".into(),
            },
            start: axis.start,
            step: axis.step,
            count: axis.count,
        });
        let grid = Grid { axes: axes.collect() };
        if grid.joints() != scene.proxy.joints.len() {
            return Err(SweepError::Grid(format!("{} axes for {} joints", grid.joints(), scene.proxy.joints.len())));
        }
        grid.check().map_err(SweepError::Grid)?;
        let surface = &object.rest[..object.surface_nodes];
        Ok(Self {
            grid,
            surface_nodes: surface.iter().flat_map(|node| node.to_array()).collect(),
            surface_triangles: object.triangles.as_flattened().to_vec(),
            scene: scene.text.clone(),
            provenance: Provenance {
                version: env!("CARGO_PKG_VERSION").into(),
                algorithm: scene
                    .contact
                    .algorithm
                    .to_possible_value()
                    .map_or_else(String::new, |v| v.get_name().into()),
                tolerance: scene.contact.tolerance,
                backend: backend.into(),
                adapter: adapter.into(),
                date: date.into(),
                notices: Vec::new(),
            },
            with_forces: scene.graphics.is_some() || scene.haptics.effects.at_contacts().is_some(),
            warnings: object.warnings.clone(),
            free_space: None,
            most_contacts: scene
                .proxy
                .joints
                .iter()
                .map(|joint| 3 * joint.nodes.len())
                .sum::<usize>()
                .min(object.surface_nodes),
            preparation: Duration::ZERO,
        })
    }

    /// Skips the points that [`FreeSpace`] proves free: `model` is that of the scene. Nothing is changed but gaps farther than
    /// [`FreeSpace::MARGIN`] grid steps from any contact, which become lower bounds.
    ///
    /// # Errors
    /// [`SweepError::Memory`].
    pub fn skip_free_space(&mut self, model: &Model<'_>) -> Result<(), SweepError> {
        let start = Instant::now();
        let free_space = FreeSpace::find(model, &self.grid).map_err(|source| self.out_of_memory(source))?;
        self.free_space = Some(free_space);
        self.preparation = start.elapsed();
        Ok(())
    }

    /// The grid.
    #[must_use]
    pub fn grid(&self) -> &Grid {
        &self.grid
    }

    /// Memory of the finished columns with `contacts` contact forces at each point [bytes]; chunks in flight come on top.
    #[must_use]
    pub fn memory_needed(&self, contacts: usize) -> usize {
        let points = self.grid.points();
        let contacts = if self.with_forces { points.saturating_mul(contacts) } else { 0 };
        Columns::bytes(points, self.grid.joints(), contacts)
    }

    /// Memory of this sweep.
    #[must_use]
    pub fn memory(&self) -> Memory {
        let points = self.grid.points();
        let skipping = if self.free_space.is_some() { 4 * points } else { 0 };
        let needed = |contacts| self.memory_needed(contacts).saturating_add(skipping);
        Memory { least: needed(0), most: needed(self.most_contacts) }
    }

    /// Where [`Sweep::bake`] keeps what it has of `output`.
    #[must_use]
    pub fn part_of(output: &Path) -> PathBuf {
        let mut name = OsString::from(output);
        name.push(".part");
        name.into()
    }

    /// Sweeps in memory.
    ///
    /// # Errors
    /// [`SweepError::Memory`], [`SweepError::Backend`], [`SweepError::Stopped`].
    pub fn run<B: Backend>(&self, backend: &mut B, run: Run<'_>) -> Result<(Dataset, SweepReport), SweepError> {
        let columns = self.empty_columns()?;
        self.finish(backend, run, columns, self.provenance.clone(), None)
    }

    /// Sweeps into the file `output`, keeping what is done in [`Sweep::part_of`] it until the file is whole.
    ///
    /// With `resume` it continues from such a part; the file is then the same, bit for bit, as without the interruption,
    /// the date of the beginning included. Without a part it begins.
    ///
    /// # Errors
    /// Any [`SweepError`]; the part then keeps what is done, and an earlier file `output` is untouched.
    pub fn bake<B: Backend>(
        &self,
        backend: &mut B,
        output: &Path,
        resume: bool,
        run: Run<'_>,
    ) -> Result<(Dataset, SweepReport), SweepError> {
        let mut surface = crc32fast::Hasher::new();
        surface.update(bytemuck::cast_slice(&self.surface_nodes));
        surface.update(bytemuck::cast_slice(&self.surface_triangles));
        let mut binding = Binding {
            grid: self.grid.clone(),
            scene: self.scene.clone(),
            surface: surface.finalize(),
            provenance: self.provenance.clone(),
        };
        let mut columns = self.empty_columns()?;
        let mut part = Part::open(&Self::part_of(output), resume, &mut binding, &mut columns)?;
        if !binding.provenance.notices.is_empty() {
            let Provenance { backend, adapter, .. } = &self.provenance;
            let notice = format!("from grid point {} on: resumed on {backend} ({adapter})", columns.points());
            part.note(&notice)?;
            binding.provenance.notices.push(notice);
        }
        let finished = self.finish(backend, run, columns, binding.provenance, Some(&mut part))?;
        finished.0.save(output).map_err(|source| SweepError::Dataset { part: part.path().into(), source })?;
        part.remove()?;
        Ok(finished)
    }

    fn empty_columns(&self) -> Result<Columns, SweepError> {
        Columns::with_room(self.grid.points(), self.grid.joints()).map_err(|source| self.out_of_memory(source))
    }

    fn out_of_memory(&self, source: std::collections::TryReserveError) -> SweepError {
        SweepError::Memory { points: self.grid.points(), bytes: self.memory().least, source }
    }

    fn free_gap(&self, point: usize) -> Option<f32> {
        self.free_space.as_ref()?.gap(point)
    }

    /// Solves the points that `columns` lacks.
    fn finish<B: Backend>(
        &self,
        backend: &mut B,
        run: Run<'_>,
        mut columns: Columns,
        mut provenance: Provenance,
        mut part: Option<&mut Part>,
    ) -> Result<(Dataset, SweepReport), SweepError> {
        let (points, joints, resumed) = (self.grid.points(), self.grid.joints(), columns.points());
        let (start, memory) = (Instant::now(), self.memory());
        let mut contact_points = in_contact(&columns);
        (run.progress)(Progress { done: resumed, points, contact_points, rate: 0.0, memory });
        let mut configurations: Vec<JointVector> = Vec::new();
        while columns.points() < points {
            let first = columns.points();
            if run.stop.load(Ordering::Relaxed) {
                let part = part.map(|part| part.path().to_path_buf());
                return Err(SweepError::Stopped { done: first, points, part });
            }
            configurations.clear();
            let most = run.chunk.max(1);
            let mut last = first;
            for point in first..points.min(first.saturating_add(most.max(LARGEST_CHUNK))) {
                if self.free_gap(point).is_none() {
                    if configurations.len() == most {
                        break;
                    }
                    configurations.push(self.grid.configuration(point));
                }
                last = point;
            }
            let equilibria = backend.solve(&configurations).map_err(|source| SweepError::Backend {
                first,
                last,
                source: Box::new(source),
            })?;
            if equilibria.len() != configurations.len() {
                return Err(SweepError::Miscount { asked: configurations.len(), found: equilibria.len() });
            }
            for notice in backend.notices() {
                let notice = format!("from grid point {first} on: {notice}");
                if let Some(part) = &mut part {
                    part.note(&notice)?;
                }
                provenance.notices.push(notice);
            }
            let mut chunk = Columns::default();
            let mut solved = equilibria.iter();
            for point in first..=last {
                match self.free_gap(point) {
                    Some(gap) => chunk.push_free(gap, joints),
                    None => solved.next().into_iter().for_each(|solved| chunk.push(solved, joints, self.with_forces)),
                }
            }
            if let Some(part) = &mut part {
                part.append(first, &chunk)?;
            }
            columns.append(&chunk).map_err(|source| self.out_of_memory(source))?;
            contact_points += in_contact(&chunk);
            let rate = (columns.points() - resumed) as f64 / start.elapsed().as_secs_f64().max(f64::MIN_POSITIVE);
            (run.progress)(Progress { done: columns.points(), points, contact_points, rate, memory });
        }
        let dataset = self.dataset(columns, provenance);
        let skipped = self.free_space.as_ref().map_or(0, FreeSpace::skipped);
        let time = start.elapsed() + self.preparation;
        let warnings = self.warnings.iter().chain(&dataset.provenance.notices).cloned().collect();
        let report = SweepReport::of(&dataset, memory, skipped, resumed, time, warnings);
        Ok((dataset, report))
    }

    fn dataset(&self, columns: Columns, provenance: Provenance) -> Dataset {
        let offsets = std::iter::once(0).chain(columns.contacts.iter().scan(0, |sum, &count| {
            *sum += count;
            Some(*sum)
        }));
        let contacts = self.with_forces.then(|| Contacts {
            offsets: offsets.collect::<Vec<u64>>().into(),
            nodes: columns.nodes.into(),
            forces: columns.forces.into(),
        });
        Dataset {
            grid: self.grid.clone(),
            torque: columns.torque.into(),
            energy: Some(columns.energy.into()),
            gap: Some(columns.gap.into()),
            status: columns.status.into(),
            residual: Some(columns.residual.into()),
            iterations: Some(columns.iterations.into()),
            contacts,
            surface: Some(Surface {
                nodes: self.surface_nodes.clone().into(),
                triangles: self.surface_triangles.clone().into(),
            }),
            scene: self.scene.clone(),
            provenance,
        }
    }
}

/// Number of points at which something touches.
fn in_contact(columns: &Columns) -> usize {
    let untouched = [Status::Free as u8, Status::Outside as u8];
    columns.status.iter().filter(|status| !untouched.contains(status)).count()
}
