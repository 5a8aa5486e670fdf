//! The sweep of one shard, into a file of its own, and what all shards will take.

use super::{
    Backend, Run, Shard, Sweep, SweepReport,
    chunks::Store,
    error::{foreign, unwritable},
    merge::Contents,
    part::Part,
};
use crate::Error;
use std::{
    fs,
    path::{Path, PathBuf},
};

impl Sweep<'_> {
    /// Number of points that are not skipped, of each of `count` shards.
    pub(super) fn solved_of_shards(&self, count: usize) -> Result<Vec<usize>, Error> {
        let (points, any) = (self.binding.grid.points(), Shard { index: 0, count });
        let (mut solved, mut done) = (vec![0; count], 0);
        let free_space = self.free_space();
        while done < points {
            let slab = free_space.as_ref().map_or(0..points, |free_space| free_space.slab(done));
            let gaps = free_space.as_ref().map(|free_space| self.gaps(free_space, slab.clone())).transpose()?;
            for point in slab.clone().filter(|&point| gaps.as_ref().is_none_or(|gaps| gaps.gap(point).is_none())) {
                solved[any.having(point, points)] += 1;
            }
            done = slab.end;
        }
        Ok(solved)
    }

    /// Solves the points of `shard` into a file in `folder`, which is made where it is missing, and returns its path.
    /// Continues an interrupted run; a whole file is left as it is, and `None` returned with it.
    ///
    /// # Errors
    /// When it fails or is stopped; the part then keeps what is done.
    pub fn bake_shard<B: Backend>(
        &mut self,
        backend: &mut B,
        folder: &Path,
        shard: Shard,
        mut run: Run<'_>,
    ) -> Result<(PathBuf, Option<SweepReport>), Error> {
        self.binding.shard = shard;
        let mut binding = self.binding.clone();
        let failed = |source| unwritable(folder, &source);
        fs::create_dir_all(folder).map_err(failed)?;
        let file = folder.join(binding.file_name());
        let part_path = Self::part_of(&file);
        if file.exists() {
            if Contents::read(&file).map_err(|reason| foreign(&file, reason))?.is_whole_of(&binding)? {
                return Ok((file, None));
            }
            // Damaged: what is whole of it is kept, unless it is being solved again already.
            let removed = if part_path.exists() { fs::remove_file(&file) } else { fs::rename(&file, &part_path) };
            removed.map_err(failed)?;
        }
        let (mut part, tally) = Part::open(&part_path, true, &mut binding)?;
        // Whoever held the lock before may just have finished: what was opened is then the whole file, or a new one
        // that nobody needs.
        if file.exists() {
            let _ = fs::remove_file(&part_path);
            return Ok((file, None));
        }
        let solved = self.solve(backend, &mut run, (tally, binding.provenance), Store::Part(&mut part))?;
        part.finish(&file)?;
        Ok((file, Some(self.report(solved).0)))
    }
}
