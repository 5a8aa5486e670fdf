//! A sweep watched: what it is going to take, its progress, and whether anything touches.

use super::{Failure, bar::Bar, interrupt, tell};
use crate::{
    dataset::Dataset,
    names::{counted, duration},
    scene::Scene,
    sweep::{BackendChoice, Bake, Bounds, Clearance, Footprint, Forecast, MOST_CONFIGURATIONS, Progress},
};
use clap::builder::RangedU64ValueParser;
use std::time::{Instant, SystemTime};

/// Reads a number of random configurations at which an error is measured: too large a one is told before hours of work.
pub fn configurations() -> RangedU64ValueParser<usize> {
    RangedU64ValueParser::new().range(..=MOST_CONFIGURATIONS as u64)
}

/// Runs `bake`, dated now, with a progress bar. Ctrl-C stops it.
pub fn watched<T, E: Into<Failure>>(
    scene: &Scene,
    backend: BackendChoice,
    bake: impl FnOnce(Bake<'_>) -> Result<T, E>,
) -> Result<T, Failure> {
    let stop = interrupt::stop_flag();
    let bar = Bar::new("points", "{wide_bar} {pos}/{len} points, {msg}");
    let mut begun = None;
    let mut progress = |progress: Progress| {
        let begun = *begun.get_or_insert_with(|| {
            interrupt::kept();
            announce(&progress);
            Begun { at: Instant::now(), contact_points: progress.contact_points }
        });
        let message = format!("{} in contact, {:.0}/s", progress.contact_points, progress.rate);
        bar.set(
            progress.done as u64,
            progress.points as u64,
            message,
            begun.left(begun.at.elapsed().as_secs_f64(), &progress),
        );
    };
    let date = humantime::format_rfc3339_seconds(SystemTime::now()).to_string();
    let result = bake(Bake { scene, backend, measured: None, aim: None, date: &date, stop, progress: &mut progress });
    bar.finish();
    interrupt::over();
    result.map_err(Into::into)
}

/// Where a sweep stood when it was begun or taken up.
#[derive(Clone, Copy)]
struct Begun {
    at: Instant,
    contact_points: usize,
}

impl Begun {
    /// Time left after `elapsed`, by the points in contact that are expected: those in free space cost next to nothing, and
    /// may come first. None where no more are expected (s).
    fn left(self, elapsed: f64, progress: &Progress) -> Option<f64> {
        let Forecast { contact_fraction, seconds, .. } = progress.forecast?;
        let expected = (contact_fraction * progress.points as f64) as usize;
        let left = expected.checked_sub(progress.contact_points).filter(|left| *left > 0)?;
        match progress.contact_points.saturating_sub(self.contact_points) {
            0 => seconds.map(|seconds| seconds * left as f64 / expected as f64),
            solved => Some(elapsed * left as f64 / solved as f64),
        }
    }
}

/// What a dataset is that touches nothing, and what to do about it.
const FREE: &str = "nothing touches: at none of the grid's points does the arm meet the object";

/// Says where contact is to be looked for.
const REMEDY: &str = "`haptize place SCENE --move --write` moves the object before the arm and makes a grid there; \
                      `haptize reach SCENE` prints a grid over contact that the joints reach as it is";

/// Warns of `dataset` if arm and object touch at no grid point, and returns their least gap.
pub fn warn_of_free_space(dataset: &Dataset) -> Result<Option<Clearance>, Failure> {
    let clearance = Clearance::of(dataset)?;
    if let Some(clearance) = &clearance {
        tell(format_args!("haptize: {FREE}; {clearance}. {REMEDY}"));
    }
    Ok(clearance)
}

/// Prints what the sweep is going to take, before it begins.
fn announce(progress: &Progress) {
    let Progress { points, done, footprint: Footprint { memory, disk }, forecast, .. } = progress;
    let resumed = if *done > 0 { format!(", {done} of them done") } else { String::new() };
    let size = match (disk, forecast) {
        (Bounds { most: 0, .. }, _) => None,
        (_, Some(forecast)) => {
            Some(format!("about {} of disk (twice that for a moment at the end)", megabytes(forecast.disk)))
        }
        // Few points, or a shard, which is not put together at the end.
        (Bounds { least, most }, None) => match [least, most].map(|bytes| megabytes(*bytes)) {
            [least, most] if least == most => Some(format!("{most} of disk")),
            [least, most] => Some(format!("{least} to {most} of disk")),
        },
    };
    let size = size.map_or(String::new(), |size| format!(" and {size}"));
    tell(format_args!(
        "haptize: {}{resumed}; results take at most {} of memory{size}",
        counted(*points, ["point", "points"]),
        megabytes(memory.most)
    ));
    let Some(Forecast { contact_fraction, seconds, after, sampled, .. }) = forecast else { return };
    let time = seconds.zip(*after).map(|(seconds, after)| {
        let left = seconds * points.saturating_sub(*done) as f64 / *points as f64;
        format!(
            ", solved from rest in about {}; with the search for lower equilibria and the measurement of accuracy that \
             follow, at most about {}",
            duration(left),
            duration(left + after)
        )
    });
    let time = time.unwrap_or_default();
    let percent = 100.0 * contact_fraction;
    let digits = if percent < 1.0 { 2 } else { 0 };
    tell(format_args!("haptize: predicted from a sample of {sampled}: {percent:.digits$} % in contact{time}"));
}

/// Rounded up, with unit.
pub fn megabytes(bytes: usize) -> String {
    format!("{} MB", (bytes as f64 / 1e6).ceil())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_time_left_goes_by_points_in_contact() {
        let forecast =
            Forecast { contact_fraction: 0.1, seconds: Some(50.0), after: None, disk: 0, part: 0, sampled: 500 };
        let left = |done, contact_points, before| {
            let footprint = Footprint::default();
            let progress =
                Progress { done, points: 1000, contact_points, rate: 0.0, footprint, forecast: Some(forecast) };
            Begun { at: Instant::now(), contact_points: before }.left(6.0, &progress)
        };
        // Nine tenths are free, and done at once: what was predicted is still to come.
        assert_eq!(left(900, 0, 0), Some(50.0));
        assert_eq!(left(930, 30, 0), Some(14.0));
        // Taken up at 20: ten have taken these six seconds.
        assert_eq!(left(930, 30, 20), Some(42.0));
        assert_eq!(left(990, 100, 0), None);
    }
}
