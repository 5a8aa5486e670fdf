//! The shards of a sweep, read, compared, and put together into the dataset that one bake would have made.
//!
//! Tiles are copied in the order of the grid into the part of the output, which then lacks nothing: what
//! follows (the lowest equilibria, the error, the file) is what a bake does that is continued after its last point. So
//! the dataset has the same bits.

use super::{
    Backend, Progress, Run, Shard, SweepReport,
    bake::{model_of, sweep_of},
    build_object,
    error::other_part,
    grid_sweep::Sweep,
    part::{Binding, Found, Part},
    shard::{EXTENSION, ranges},
    tile::Tile,
};
use crate::{Error, ErrorKind, JointVector, contact::Equilibrium, error, input, proxy::Chain, scene::Scene};
use memmap2::Mmap;
use std::{
    collections::BTreeMap,
    convert::Infallible,
    fs,
    path::{Path, PathBuf},
    sync::atomic::AtomicBool,
};

/// A shard's file, mapped into memory and checked.
pub(super) struct Contents {
    path: PathBuf,
    map: Mmap,
    found: Found,
}

impl Contents {
    /// Reads the file at `path`. What is behind the first damage does not count.
    ///
    /// # Errors
    /// Says what shows that it is no shard.
    pub fn read(path: &Path) -> Result<Self, String> {
        let file = input::open(path).map_err(|error| error.to_string())?;
        // SAFETY: the mapping is read-only, and a shard that has its name is not written to any more. Another program
        // that truncates it ends this process, as it would with any mapped file; no haptic loop reads it.
        let map = unsafe { Mmap::map(&file) }.map_err(|error| error.to_string())?;
        let found = Found::read(&map)?.ok_or("its beginning is damaged")?;
        Ok(Self { path: path.into(), found, map })
    }

    /// Whether this is the whole shard that `binding` is of.
    pub fn is_whole_of(&self, binding: &Binding) -> Result<bool, Error> {
        let its = &self.found.binding;
        let different = binding.other_sweep(its).or((binding.shard != its.shard).then_some("another shard"));
        match different {
            Some(difference) => Err(other_part(&self.path, difference)),
            None => Ok(self.found.is_whole(&self.map)),
        }
    }
}

/// The shards of one sweep.
pub struct Merge {
    /// Whole ones, by index.
    shards: BTreeMap<usize, Contents>,
    /// Number of shards of the sweep.
    count: usize,
    /// Whole ones that are there twice, and damaged ones, a sentence without its full stop each.
    pub notes: Vec<String>,
}

impl Merge {
    /// Reads the shards at `paths`: files, and all that lie in folders.
    ///
    /// # Errors
    /// When there are none, one cannot be read, or two are of different bakes.
    pub fn gather(paths: &[PathBuf]) -> Result<Self, Error> {
        let (mut shards, mut notes, mut first) = (BTreeMap::<usize, Contents>::new(), Vec::new(), None);
        for file in files(paths)? {
            let shard = Contents::read(&file).map_err(|reason| {
                let remedy = "leave it out, or solve it again with `haptize bake --shard`";
                Error::at(&file, format_args!("is not a shard: {reason}; {remedy}"))
            })?;
            let (path, binding) = first.get_or_insert_with(|| (file.clone(), shard.found.binding.clone()));
            let is_other = binding.shard.count != shard.found.binding.shard.count;
            if let Some(difference) =
                binding.other_sweep(&shard.found.binding).or(is_other.then_some("another number of shards"))
            {
                return Err(different(&file, path, difference));
            }
            let Shard { index, .. } = shard.found.binding.shard;
            if !shard.found.is_whole(&shard.map) {
                notes.push(format!("{} is damaged: shard {index} counts as missing", file.display()));
            } else if let Some(kept) = shards.get(&index) {
                notes.push(format!("shard {index} is there twice: {} is taken", kept.path.display()));
            } else {
                shards.insert(index, shard);
            }
        }
        let Some((_, binding)) = first else {
            let what = format!(
                "holds no shards (files ending in .{EXTENSION}); name the folder that `haptize bake --shard` wrote to"
            );
            return Err(Error::at(paths.first().map_or(Path::new(""), PathBuf::as_path), what));
        };
        Ok(Self { shards, count: binding.shard.count, notes })
    }

    /// Number of shards of the sweep.
    #[must_use]
    pub fn count(&self) -> usize {
        self.count
    }

    /// Shards that are not there, ascending.
    #[must_use]
    pub fn missing(&self) -> Vec<usize> {
        (0..self.count).filter(|index| !self.shards.contains_key(index)).collect()
    }

    /// The error of a merge that lacks the shards `missing`.
    pub(crate) fn lacks(&self, missing: &[usize]) -> Error {
        let (missing, count) = (ranges(missing), self.count);
        error!(
            "shards {missing} of {count} are missing; solve them with `haptize bake --shard I/{count}`, then merge again"
        )
    }

    /// Puts the dataset `output` together, with its error measured at `measured` configurations as in
    /// [`super::Bake::measured`]. What an interrupted merge has left is continued. The report is that of a bake that is
    /// continued after its last point.
    ///
    /// # Errors
    /// When shards are missing, the output cannot be written, or the merge is stopped; an earlier file
    /// `output` is then untouched.
    pub fn to_file(
        &self,
        output: &Path,
        measured: Option<usize>,
        stop: &AtomicBool,
        progress: &mut dyn FnMut(Progress),
    ) -> Result<SweepReport, Error> {
        let missing = self.missing();
        let Some(first) = self.shards.values().next().filter(|_| missing.is_empty()) else {
            return Err(self.lacks(&missing));
        };
        let mut binding = first.found.binding.clone();
        let dates = self.shards.values().map(|shard| shard.found.binding.provenance.date.clone());
        binding.provenance.date = dates.min().unwrap_or_default();
        let scene = Scene::of_dataset(&binding.scene, &binding.scene_path, &binding.provenance.algorithm)?;
        let (object, chain) = (build_object(&scene)?, Chain::new(&scene.proxy));
        let model = model_of(&scene, &object, &chain)?;
        let by = [&binding.provenance.backend, &binding.provenance.adapter, &binding.provenance.date];
        let sweep = sweep_of(&scene, &model, by.map(String::as_str), measured)?;
        if let Some(difference) = sweep.binding.other_sweep(&binding) {
            return Err(different(&first.path, &scene.path, difference));
        }
        self.copy(&sweep, output)?;
        let run = Run { chunk: 1, stop, progress };
        sweep.bake(&mut Idle, output, true, run).map_err(|error| match error.kind() {
            ErrorKind::Stopped => error!("stopped; the same command continues").of(ErrorKind::Stopped),
            _ => error,
        })
    }

    /// Copies what a part of `output` lacks into it.
    fn copy(&self, sweep: &Sweep<'_>, output: &Path) -> Result<(), Error> {
        let path = Sweep::part_of(output);
        let mut binding = sweep.binding.clone();
        let (mut part, tally) = Part::open(&path, true, &mut binding)?;
        let mut tiles: Vec<Tile<'_>> = self.shards.values().flat_map(|shard| shard.found.tiles(&shard.map)).collect();
        tiles.sort_unstable_by_key(|tile| tile.first);
        let begin = tiles.partition_point(|tile| tile.first < tally.points);
        let next = tiles.get(begin).map_or(binding.points(), |tile| tile.first);
        if next != tally.points {
            let what = "holds what an unfinished bake or a merge of other shards has left; delete it, or choose another \
                        output";
            return Err(Error::at(&path, what));
        }
        for tile in &tiles[begin..] {
            part.append(tile)?;
        }
        for notice in self.notices().get(binding.provenance.notices.len()..).unwrap_or_default() {
            part.note(notice)?;
        }
        Ok(())
    }

    /// Returns the notices of the merged dataset: shards solved by another backend than the first one, then the shards'
    /// own notices.
    fn notices(&self) -> Vec<String> {
        let mut solved_by = BTreeMap::<_, Vec<usize>>::new();
        for (&index, shard) in &self.shards {
            let by = &shard.found.binding.provenance;
            solved_by.entry((&by.backend, &by.adapter)).or_default().push(index);
        }
        let others =
            solved_by.into_iter().filter(|(_, shards)| !shards.contains(&0)).map(|((backend, adapter), shards)| {
                format!("shards {} of {} were solved on {backend} ({adapter})", ranges(&shards), self.count)
            });
        others.chain(self.shards.values().flat_map(|shard| shard.found.notices.clone())).collect()
    }
}

/// The error of a shard at `path` of another bake than `other` is of.
fn different(path: &Path, other: &Path, difference: &str) -> Error {
    let remedy = "merge the shards of one bake";
    Error::at(path, format_args!("does not belong to {}: it was begun with {difference}; {remedy}", other.display()))
}

/// The files among `paths`, and those in folders that end in [`EXTENSION`], sorted.
fn files(paths: &[PathBuf]) -> Result<Vec<PathBuf>, Error> {
    let mut files = Vec::new();
    for path in paths {
        let unreadable = |source| Error::unreadable(path, &source);
        if !fs::metadata(path).map_err(unreadable)?.is_dir() {
            files.push(path.clone());
            continue;
        }
        for entry in fs::read_dir(path).map_err(unreadable)? {
            let file = entry.map_err(unreadable)?.path();
            if file.extension().is_some_and(|extension| extension == EXTENSION) {
                files.push(file);
            }
        }
    }
    files.sort();
    files.dedup();
    Ok(files)
}

/// Solves nothing: all points are there.
struct Idle;

impl Backend for Idle {
    type Error = Infallible;

    fn solve(&mut self, _: &[JointVector]) -> Result<Vec<Equilibrium>, Infallible> {
        Ok(Vec::new())
    }
}
