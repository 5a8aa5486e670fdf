//! The grid's points, chunk by chunk: free ones skipped, the others solved by the backend, all handed on to where they
//! are kept, by a thread of its own: checksums and the file wait for no solver, and no solver for them.

use super::{
    Backend, Footprint, FreeSpace, Progress, Run, Sweep, SweepError,
    columns::{Columns, Width},
    free_space::FreeGaps,
    part::Part,
    report::RunFacts,
    tally::Tally,
};
use crate::{
    JointVector,
    contact::{Equilibrium, SHARE},
    dataset::Provenance,
};
use std::{
    ops::Range,
    panic::resume_unwind,
    path::{Path, PathBuf},
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
pub(super) trait Store: Send {
    /// Adds a chunk whose first point has number `first`.
    fn append(&mut self, first: usize, chunk: &Columns) -> Result<(), SweepError>;
    /// Adds something that provenance will tell.
    fn note(&mut self, notice: &str) -> Result<(), SweepError>;
    /// Where an interrupted sweep continues from.
    fn path(&self) -> Option<&Path>;
}

impl Store for Part {
    fn append(&mut self, first: usize, chunk: &Columns) -> Result<(), SweepError> {
        Part::append(self, first, chunk)
    }
    fn note(&mut self, notice: &str) -> Result<(), SweepError> {
        Part::note(self, notice)
    }
    fn path(&self) -> Option<&Path> {
        Some(Part::path(self))
    }
}

/// In memory, with room for all points.
impl Store for Columns {
    fn append(&mut self, _first: usize, chunk: &Columns) -> Result<(), SweepError> {
        let points = self.status.capacity();
        let each = |numbers: usize| numbers / chunk.points().max(1);
        let (joints, tangent) = (each(chunk.torque.len()), each(chunk.tangent.len()));
        let width = Width { joints, tangent, touches: each(chunk.touches.ends.len()) };
        let [contacts, touches] = [(&self.contacts, &chunk.contacts), (&self.touches, &chunk.touches)]
            .map(|(rows, more)| rows.nodes.len() + more.nodes.len());
        let bytes = Columns::bytes(points, width, contacts, touches);
        self.append(chunk).map_err(|source| SweepError::Memory { points, bytes, source })
    }
    fn note(&mut self, _notice: &str) -> Result<(), SweepError> {
        Ok(())
    }
    fn path(&self) -> Option<&Path> {
        None
    }
}

/// Memory of a store.
#[expect(clippy::large_enum_variant, reason = "a few at a time; a box would be memory for every chunk")]
enum Entry {
    /// Results of the points from this number on.
    Chunk(usize, Columns),
    Notice(String),
}

/// Hands `entries` to `store` until there are no more, or it fails; columns that are kept are given back as `room` for
/// others.
fn keep(store: &mut dyn Store, entries: Receiver<Entry>, room: SyncSender<Columns>) -> Result<(), SweepError> {
    entries.into_iter().try_for_each(|entry| match entry {
        Entry::Chunk(first, columns) => {
            store.append(first, &columns)?;
            // Where no other chunk follows nobody needs it.
            let _ = room.send(columns);
            Ok(())
        }
        Entry::Notice(notice) => store.note(&notice),
    })
}

/// Where chunks are sent to be kept, and columns come back from, a few in all.
struct Kept {
    entries: SyncSender<Entry>,
    room: Receiver<Columns>,
    columns: usize,
}

impl Kept {
    /// Empty columns; `None` where the store has failed.
    fn columns(&mut self) -> Option<Columns> {
        if self.columns <= BEHIND {
            self.columns += 1;
            return Some(Columns::default());
        }
        let mut columns = self.room.recv().ok()?;
        columns.clear();
        Some(columns)
    }

    /// Sends an entry; `None` where the store has failed.
    fn send(&self, entry: Entry) -> Option<()> {
        self.entries.send(entry).ok()
    }
}

/// State of a sweep before a run.
pub(super) struct Begun {
    pub tally: Tally,
    pub provenance: Provenance,
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
    /// Begins with the least, since nothing is known of the time yet. At most `most`.
    fn new(most: usize) -> Self {
        let least = most.min(SHARE * rayon::current_num_threads());
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
    /// Configurations that are to be solved.
    configurations: Vec<JointVector>,
}

impl Sweep<'_> {
    /// Solves the points that `begun` lacks.
    pub(super) fn solve<B: Backend>(
        &self,
        backend: &mut B,
        run: &mut Run<'_>,
        begun: Begun,
        footprint: Footprint,
        store: &mut dyn Store,
    ) -> Result<Solved, SweepError> {
        let part = store.path().map(Path::to_path_buf);
        let ((entries, to_keep), (back, room)) = (sync_channel(1 + BEHIND), sync_channel(1 + BEHIND));
        let kept = Kept { entries, room, columns: 0 };
        thread::scope(|scope| {
            let keeper = scope.spawn(move || keep(store, to_keep, back));
            let solved = self.solve_chunks(backend, run, begun, footprint, part, kept);
            // What a store says comes first: a sweep whose store has failed only knows that nobody takes its results.
            keeper.join().unwrap_or_else(|panic| resume_unwind(panic))?;
            solved
        })
    }

    /// Solves the points that `begun` lacks, and sends what is to be kept; `part` is where that is.
    fn solve_chunks<B: Backend>(
        &self,
        backend: &mut B,
        run: &mut Run<'_>,
        begun: Begun,
        footprint: Footprint,
        part: Option<PathBuf>,
        mut kept: Kept,
    ) -> Result<Solved, SweepError> {
        let Begun { mut tally, mut provenance } = begun;
        let (points, resumed, start) = (self.points(), tally.points, Instant::now());
        let left_before = backend.left_to_cpu();
        let (mesh_ripple, forecast) = (self.mesh_ripple(), self.forecast);
        let mut tell = |tally: &Tally, rate| {
            let (done, contact_points) = (tally.points, tally.statuses.in_contact());
            (run.progress)(Progress { done, points, contact_points, rate, footprint, forecast, mesh_ripple });
        };
        tell(&tally, 0.0);
        let (free_space, mut skipped) = (self.free_space(), 0);
        let mut size = ChunkSize::new(run.chunk.clamp(1, points.max(1)));
        let rest = |done| self.shard.rest(self.grid.points(), done);
        while tally.points < points {
            let whole = 0..self.grid.points();
            let slab = free_space.as_ref().map_or(whole, |free_space| free_space.slab(rest(tally.points).start));
            let gaps = free_space.as_ref().map(|free_space| self.gaps(free_space, slab.clone())).transpose()?;
            let free_gap = |point| gaps.as_ref()?.gap(point);
            while tally.points < points && rest(tally.points).start < slab.end {
                let (done, Range { start: first, end }) = (tally.points, rest(tally.points));
                let stopped = || SweepError::Stopped { done, points, part: part.clone() };
                if run.stop.load(Ordering::Relaxed) {
                    return Err(stopped());
                }
                let chunk = self.cut(first..end.min(slab.end), size.size, free_gap);
                let begun = Instant::now();
                let equilibria = solved(backend, &chunk.configurations, chunk.points.clone())?;
                size.adapt(chunk.configurations.len(), begun.elapsed());
                for notice in backend.notices() {
                    let notice = format!("from grid point {first} on: {notice}");
                    kept.send(Entry::Notice(notice.clone())).ok_or_else(stopped)?;
                    provenance.notices.push(notice);
                }
                let mut columns = kept.columns().ok_or_else(stopped)?;
                let mut equilibria = equilibria.iter();
                for point in chunk.points {
                    match free_gap(point) {
                        Some(gap) => columns.push_free(gap, self.shape),
                        None => equilibria.next().into_iter().for_each(|solved| columns.push(solved, self.shape)),
                    }
                }
                skipped += columns.points() - chunk.configurations.len();
                tally.add(&columns);
                kept.send(Entry::Chunk(first, columns)).ok_or_else(stopped)?;
                tell(&tally, (tally.points - resumed) as f64 / start.elapsed().as_secs_f64().max(f64::MIN_POSITIVE));
            }
        }
        let facts = RunFacts {
            footprint,
            skipped_points: skipped,
            resumed_points: resumed,
            solved_points: tally.points - resumed,
            left_to_cpu: backend.left_to_cpu() - left_before,
            lowered: None,
            solving: start.elapsed(),
            time: start.elapsed(),
        };
        Ok(Solved { tally, facts, provenance })
    }

    pub(super) fn gaps(&self, free_space: &FreeSpace<'_>, slab: Range<usize>) -> Result<FreeGaps, SweepError> {
        let (points, bytes) = (slab.len(), 4 * slab.len());
        free_space.find(slab).map_err(|source| SweepError::Memory { points, bytes, source })
    }

    /// The first points of `points`, so many that at most `most` of them are to be solved.
    fn cut(&self, points: Range<usize>, most: usize, free_gap: impl Fn(usize) -> Option<f32>) -> Chunk {
        let mut configurations = Vec::new();
        let end = points.end.min(points.start.saturating_add(together(most)));
        for point in points.start..end {
            if free_gap(point).is_none() {
                if configurations.len() == most {
                    return Chunk { points: points.start..point, configurations };
                }
                configurations.push(self.grid.configuration(point));
            }
        }
        Chunk { points: points.start..end, configurations }
    }
}

/// `configurations`, which lie among `points`, solved by `backend`.
pub(super) fn solved<B: Backend>(
    backend: &mut B,
    configurations: &[JointVector],
    points: Range<usize>,
) -> Result<Vec<Equilibrium>, SweepError> {
    let equilibria = backend.solve(configurations).map_err(|source| SweepError::Backend {
        first: points.start,
        last: points.end - 1,
        source: Box::new(source),
    })?;
    if equilibria.len() != configurations.len() {
        return Err(SweepError::Miscount { asked: configurations.len(), found: equilibria.len() });
    }
    Ok(equilibria)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// After 40 chunks in which a configuration takes `each`: the time of a chunk, and its configurations.
    fn settled(each: Duration) -> (Duration, usize) {
        let mut size = ChunkSize::new(1 << 14);
        for _ in 0..40 {
            size.adapt(size.size, each * size.size as u32);
        }
        (each * size.size as u32, size.size)
    }

    #[test]
    fn chunks_take_about_a_quarter_of_a_second_however_long_a_configuration_takes() {
        let least = SHARE * rayon::current_num_threads();
        assert_eq!(settled(Duration::from_micros(1)).1, 1 << 14);
        for each in [Duration::from_micros(30), Duration::from_micros(200), Duration::from_millis(1)] {
            let (time, size) = settled(each);
            assert!(time <= CHUNK_TIME && (2 * time >= CHUNK_TIME / 2 || size == least), "{each:?}: {time:?}, {size}");
        }
        assert_eq!(settled(Duration::from_secs(9)).1, least);
        // A chunk that skips free points is no reason for a larger one.
        let mut size = ChunkSize::new(1 << 14);
        size.adapt(1, Duration::ZERO);
        assert_eq!(size.size, least);
        assert_eq!(ChunkSize::new(3).size, 3);
    }
}
