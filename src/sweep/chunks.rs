//! The grid's points, chunk by chunk: free ones skipped, the others solved by the backend, all handed on to where they
//! are kept, by a thread of its own: checksums and the file wait for no solver, and no solver for them.

use super::{
    Backend, FreeSpace, Progress, Run, Sweep,
    error::{miscounted, no_memory, stopped},
    free_space::FreeGaps,
    part::Part,
    report::RunFacts,
    tally::Tally,
    tile::Tile,
};
use crate::{
    Error, JointVector,
    contact::{Equilibrium, SHARE, Work},
    dataset::Provenance,
    error,
    threads::spawn_scoped,
};
use std::{
    collections::VecDeque,
    ops::Range,
    panic::resume_unwind,
    path::PathBuf,
    sync::{
        atomic::Ordering,
        mpsc::{Receiver, SyncSender, sync_channel},
    },
    thread,
    time::{Duration, Instant},
};

/// How long a chunk is to take: so much work a killed bake loses, and so long a stop waits at most. A configuration
/// that takes longer makes it longer.
const CHUNK_TIME: Duration = Duration::from_millis(250);

/// Chunks that are kept in memory at most besides the current one: one waits while another is written.
pub(super) const BEHIND: usize = 2;

/// Where a sweep's results go as they come.
pub(super) enum Store<'a> {
    Part(&'a mut Part),
    /// In memory, as they come.
    Memory(&'a mut Vec<Tile<'static>>),
}

/// What is sent to a store.
#[expect(clippy::large_enum_variant, reason = "a few at a time; a box would be memory for every chunk")]
enum Entry {
    Tile(Tile<'static>),
    /// Something that provenance will tell.
    Notice(String),
}

impl Store<'_> {
    /// Keeps an entry, and leaves room for another tile.
    fn keep(&mut self, entry: Entry) -> Result<Option<Tile<'static>>, Error> {
        match (self, entry) {
            (Self::Part(part), Entry::Tile(tile)) => part.append(&tile).map(|()| Some(tile)),
            (Self::Part(part), Entry::Notice(notice)) => part.note(&notice).map(|()| None),
            (Self::Memory(tiles), Entry::Tile(tile)) => {
                tiles.push(tile);
                Ok(Some(Tile::default()))
            }
            (Self::Memory(_), Entry::Notice(_)) => Ok(None),
        }
    }
}

/// Results of a run.
pub(super) struct Solved {
    pub tally: Tally,
    pub facts: RunFacts,
    pub provenance: Provenance,
}

/// Most points of a chunk of which `solved` are to be solved: skipped ones cost little time, but the store should not
/// wait for millions of them.
pub(super) fn together(solved: usize) -> usize {
    solved.max(1 << 16)
}

/// Size of the next chunk in configurations: doubled and halved so that chunks take about [`CHUNK_TIME`].
struct ChunkSize {
    size: usize,
    /// A share for each thread, so that none is idle.
    least: usize,
    most: usize,
}

impl ChunkSize {
    /// Begins with the least for `threads` threads, since nothing is known of the time yet. At most `most`.
    fn new(most: usize, threads: usize) -> Self {
        let least = most.min(SHARE * threads);
        Self { size: least, least, most }
    }

    /// Takes in that a chunk with so many configurations took `time`.
    fn adapt(&mut self, configurations: usize, time: Duration) {
        if time > CHUNK_TIME {
            self.size = (self.size / 2).max(self.least);
        } else if configurations == self.size && 2 * time < CHUNK_TIME {
            self.size = self.size.saturating_mul(2).min(self.most);
        }
    }
}

/// A stretch of points under way.
struct Chunk {
    points: Range<usize>,
    /// Gaps of the points that are known to be free (m); nothing where free space is not looked for.
    free_gaps: Vec<Option<f32>>,
}

impl Chunk {
    /// The gap of a point that is known to be free (m).
    fn free_gap(&self, point: usize) -> Option<f32> {
        self.free_gaps.get(point - self.points.start).copied().flatten()
    }

    /// The points that are solved.
    fn solved(&self) -> impl Iterator<Item = usize> {
        self.points.clone().filter(|&point| self.free_gap(point).is_none())
    }
}

impl Sweep<'_> {
    /// Solves the points that `tally` has not counted.
    pub(super) fn solve<B: Backend>(
        &self,
        backend: &mut B,
        run: &mut Run<'_>,
        (tally, provenance): (Tally, Provenance),
        mut store: Store<'_>,
    ) -> Result<Solved, Error> {
        let part = if let Store::Part(part) = &store { Some(part.path().to_path_buf()) } else { None };
        let ((entries, to_keep), (back, room)) = (sync_channel(1 + BEHIND), sync_channel(1 + BEHIND));
        // As many as there is room for: none waits.
        (0..=BEHIND).for_each(|_| drop(back.send(Tile::default())));
        let keep = move |entry| {
            // Where no other chunk follows nobody needs the room.
            store.keep(entry).map(|room| room.into_iter().for_each(|room| drop(back.send(room))))
        };
        thread::scope(|scope| {
            let keeper = spawn_scoped(scope, "keeper", move || to_keep.into_iter().try_for_each(keep))?;
            let solved = self.solve_chunks(backend, run, (tally, provenance), part, (entries, room));
            // What a store says comes first: a sweep whose store has failed only knows that nobody takes its results.
            keeper.join().unwrap_or_else(|panic| resume_unwind(panic))?;
            solved
        })
    }

    /// Solves the points that `tally` has not counted, and sends what is to be kept; `part` is where that is.
    fn solve_chunks<B: Backend>(
        &self,
        backend: &mut B,
        run: &mut Run<'_>,
        (tally, provenance): (Tally, Provenance),
        part: Option<PathBuf>,
        (entries, room): (SyncSender<Entry>, Receiver<Tile<'static>>),
    ) -> Result<Solved, Error> {
        let (start, left_before) = (Instant::now(), backend.left_to_cpu());
        let resumed = tally.points;
        let footprint = self.footprint(run.chunk, part.is_none());
        let mut course = Course {
            sweep: self,
            free_space: self.free_space(),
            gaps: None,
            cut: resumed,
            chunks: VecDeque::new(),
            given: 0,
            size: ChunkSize::new(run.chunk.clamp(1, self.points().max(1)), backend.threads()),
            run,
            facts: RunFacts { footprint, resumed_points: resumed, ..RunFacts::default() },
            tally,
            provenance,
            entries,
            room,
            part,
            start,
            taken: start,
            failure: None,
        };
        course.tell();
        let streamed = backend.stream(&mut course);
        course.finish(streamed)?;
        let Course { tally, provenance, facts, .. } = course;
        let (left_to_cpu, time) = (backend.left_to_cpu() - left_before, start.elapsed());
        let facts = RunFacts { left_to_cpu, solving: time, time, ..facts };
        Ok(Solved { tally, facts, provenance })
    }

    pub(super) fn gaps(&self, free_space: &FreeSpace<'_>, slab: Range<usize>) -> Result<FreeGaps, Error> {
        let (points, bytes) = (slab.len(), 4 * slab.len());
        free_space.find(slab).map_err(|why| no_memory(points, bytes, why))
    }
}

/// A sweep's points on their way through a backend: cut into chunks, and their results kept.
struct Course<'c, 'r> {
    sweep: &'c Sweep<'c>,
    run: &'c mut Run<'r>,
    free_space: Option<FreeSpace<'c>>,
    /// What was found of the gaps of some points.
    gaps: Option<FreeGaps>,
    /// Number of points that were cut off the sweep's so far.
    cut: usize,
    /// Chunks that have no results yet.
    chunks: VecDeque<Chunk>,
    /// How many of them the backend has.
    given: usize,
    size: ChunkSize,
    tally: Tally,
    provenance: Provenance,
    entries: SyncSender<Entry>,
    /// Tiles that were kept, to be filled again: a few in all.
    room: Receiver<Tile<'static>>,
    /// Where results are kept.
    part: Option<PathBuf>,
    facts: RunFacts,
    start: Instant,
    /// When the last chunk came back.
    taken: Instant,
    /// Why nothing more is wanted.
    failure: Option<Error>,
}

impl Course<'_, '_> {
    fn tell(&mut self) {
        let (tally, points) = (&self.tally, self.sweep.points());
        let seconds = self.start.elapsed().as_secs_f64().max(f64::MIN_POSITIVE);
        (self.run.progress)(Progress {
            done: tally.points,
            points,
            contact_points: tally.statuses.in_contact(),
            rate: (tally.points - self.facts.resumed_points) as f64 / seconds,
            footprint: self.facts.footprint,
            forecast: self.sweep.forecast,
        });
    }

    fn stopped(&self) -> Error {
        stopped(self.tally.points, self.sweep.points(), self.part.as_deref())
    }

    /// The points that are left to cut off, as far as they are consecutive.
    fn rest(&self) -> Range<usize> {
        self.sweep.binding.shard.rest(self.sweep.binding.grid.points(), self.cut)
    }

    /// Looks for free space about the next point, if that was not done.
    fn look_for_free_space(&mut self) -> Result<(), Error> {
        let first = self.rest().start;
        if let Some(free_space) = &self.free_space
            && self.gaps.as_ref().is_none_or(|gaps| !gaps.points().contains(&first))
        {
            // Of two slabs only one is kept.
            self.gaps = None;
            self.gaps = Some(self.sweep.gaps(free_space, free_space.slab(first))?);
        }
        Ok(())
    }

    /// Cuts off the next points, so many that at most [`ChunkSize::size`] of them are to be solved.
    fn cut_chunk(&mut self) -> Chunk {
        let (rest, most) = (self.rest(), self.size.size);
        let (mut solved, mut free_gaps) = (0, Vec::new());
        let end = rest.end.min(rest.start.saturating_add(together(most)));
        let end = self.gaps.as_ref().map_or(end, |gaps| end.min(gaps.points().end));
        let mut point = rest.start;
        while point < end {
            let free_gap = self.gaps.as_ref().and_then(|gaps| gaps.gap(point));
            if free_gap.is_none() {
                if solved == most {
                    break;
                }
                solved += 1;
            }
            if self.gaps.is_some() {
                free_gaps.push(free_gap);
            }
            point += 1;
        }
        self.cut += point - rest.start;
        Chunk { points: rest.start..point, free_gaps }
    }

    /// Keeps the results of a chunk.
    fn keep(&mut self, chunk: &Chunk, equilibria: &[Equilibrium]) -> Result<(), Error> {
        let solved = chunk.solved().count();
        if equilibria.len() != solved {
            return Err(miscounted(solved, equilibria.len()));
        }
        let mut tile = self.room.recv().map_err(|_| self.stopped())?;
        tile.clear(chunk.points.start);
        let shape = self.sweep.binding.shape;
        let mut equilibria = equilibria.iter();
        for point in chunk.points.clone() {
            match chunk.free_gap(point) {
                Some(gap) => tile.push_free(gap, shape),
                None => equilibria.next().into_iter().for_each(|solved| tile.push(solved, shape)),
            }
        }
        self.facts.skipped_points += chunk.points.len() - solved;
        self.tally.add(&tile, 0..tile.points());
        self.entries.send(Entry::Tile(tile)).map_err(|_| self.stopped())?;
        self.size.adapt(solved, self.taken.elapsed());
        self.taken = Instant::now();
        self.tell();
        Ok(())
    }

    /// The outcome of the sweep, once the backend is done with it.
    fn finish(&mut self, streamed: Result<(), impl std::error::Error>) -> Result<(), Error> {
        if let Some(failure) = self.failure.take() {
            return Err(failure);
        }
        let under_way = self.chunks.front().zip(self.chunks.back());
        let (first, last) = under_way
            .map_or((self.cut, self.cut), |(first, last)| (first.points.start, last.points.end.saturating_sub(1)));
        streamed.map_err(|why| error!("the backend failed at grid points {first} to {last}: {why}"))?;
        if let Some(chunk) = self.chunks.front() {
            return Err(miscounted(chunk.points.len(), 0));
        }
        if self.tally.points < self.sweep.points() { Err(self.stopped()) } else { Ok(()) }
    }
}

impl Work for Course<'_, '_> {
    fn next(&mut self) -> Option<Vec<JointVector>> {
        if self.failure.is_some() {
            return None;
        }
        if self.given == self.chunks.len() {
            if self.cut >= self.sweep.points() || self.run.stop.load(Ordering::Relaxed) {
                return None;
            }
            if let Err(failure) = self.look_for_free_space() {
                self.failure = Some(failure);
                return None;
            }
            let chunk = self.cut_chunk();
            self.chunks.push_back(chunk);
        }
        let chunk = self.chunks.get(self.given)?;
        self.given += 1;
        Some(chunk.solved().map(|point| self.sweep.binding.grid.configuration(point)).collect())
    }

    fn rewind(&mut self) {
        self.given = 0;
    }

    fn take(&mut self, equilibria: Vec<Equilibrium>) {
        let Some(chunk) = self.chunks.pop_front() else { return };
        self.given = self.given.saturating_sub(1);
        if self.failure.is_none() {
            self.failure = self.keep(&chunk, &equilibria).err();
        }
    }

    fn note(&mut self, notice: String) {
        let first = self.chunks.front().map_or_else(|| self.rest().start, |chunk| chunk.points.start);
        let notice = format!("from grid point {first} on: {notice}");
        if self.entries.send(Entry::Notice(notice.clone())).is_err() && self.failure.is_none() {
            self.failure = Some(self.stopped());
        }
        self.provenance.notices.push(notice);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const THREADS: usize = 3;

    /// After 40 chunks in which a configuration takes `each`: the time of a chunk, and its configurations.
    fn settled(each: Duration) -> (Duration, usize) {
        let mut size = ChunkSize::new(1 << 14, THREADS);
        for _ in 0..40 {
            size.adapt(size.size, each * size.size as u32);
        }
        (each * size.size as u32, size.size)
    }

    #[test]
    fn chunks_take_about_a_quarter_of_a_second_however_long_a_configuration_takes() {
        let least = SHARE * THREADS;
        assert_eq!(settled(Duration::from_micros(1)).1, 1 << 14);
        for each in [Duration::from_micros(30), Duration::from_micros(200), Duration::from_millis(1)] {
            let (time, size) = settled(each);
            assert!(time <= CHUNK_TIME && (2 * time >= CHUNK_TIME / 2 || size == least), "{each:?}: {time:?}, {size}");
        }
        assert_eq!(settled(Duration::from_secs(9)).1, least);
        // A chunk that skips free points is no reason for a larger one.
        let mut size = ChunkSize::new(1 << 14, THREADS);
        size.adapt(1, Duration::ZERO);
        assert_eq!(size.size, least);
        assert_eq!(ChunkSize::new(3, THREADS).size, 3);
    }
}
