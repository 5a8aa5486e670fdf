//! Motions for a scene that names none: a press and a scrape made from where the dataset itself is in contact.
//!
//! Both move along grid lines, so that everything on the way is known to be free or in contact, and both begin and end
//! free of contact. A press moves one joint into contact and back. A scrape moves one joint into contact, then another
//! one through as many points in contact as there are in a row, then the first one out again.

use crate::{
    contact::Status,
    dataset::{Dataset, Grid},
    scene::{MotionSpec, Rendering, Waypoint},
};

/// Torque that a motion goes up to, over the greatest of the dataset, joint by joint, or twice the device's limit where
/// that is less (1).
const LOAD: f64 = 0.5;

/// Torque below which a scrape is hardly felt, in the same unit (1).
const LEAST_LOAD: f64 = 0.05;

/// Grid points of free space that a motion begins away from contact, where there are as many.
const CLEARANCE: usize = 4;

/// Lines along a joint from which on the first and the last one are left out.
const FEWEST_LINES: usize = 5;

/// Maximum number of points in contact that are tried, spread over the grid.
const TRIALS: usize = 1 << 14;

/// Adds the motions that `scene` lacks, and returns their names.
pub(super) fn add(scene: &mut Rendering, dataset: &Dataset) -> Vec<&'static str> {
    let MotionSpec { press, scrape } = &scene.motion;
    if !press.is_empty() && !scrape.is_empty() {
        return Vec::new();
    }
    let search = Search::new(dataset, &scene.haptics.torque_limit);
    let mut made = Vec::new();
    if scene.motion.press.is_empty() {
        scene.motion.press = search.press();
        made.extend((!scene.motion.press.is_empty()).then_some("press"));
    }
    if scene.motion.scrape.is_empty() {
        scene.motion.scrape = search.scrape();
        made.extend((!scene.motion.scrape.is_empty()).then_some("scrape"));
    }
    made
}

/// Whether line `line` along an axis of `count` lines is neither the first nor the last one, where there are lines
/// enough.
fn is_inside(count: usize, line: usize) -> bool {
    let border = usize::from(count >= FEWEST_LINES);
    (border..count - border).contains(&line)
}

/// A direction along a grid line.
#[derive(Clone, Copy)]
struct Along {
    joint: usize,
    upwards: bool,
}

/// The dataset that is searched.
struct Search<'a> {
    dataset: &'a Dataset,
    grid: &'a Grid,
    /// Torque of load one at each joint (N m or N).
    scale: Vec<f64>,
    /// Points in contact that are tried.
    trials: Vec<usize>,
}

impl<'a> Search<'a> {
    fn new(dataset: &'a Dataset, limits: &[f64]) -> Self {
        let (grid, joints) = (&dataset.grid, dataset.grid.joints());
        let inside =
            |point: usize| grid.axes.iter().zip(grid.lines(point)).all(|(axis, line)| is_inside(axis.count, line));
        let in_contact = |point: &usize| dataset.status(*point) == Status::Contact && inside(*point);
        let contacts = (0..grid.points()).filter(in_contact).count();
        let every = contacts.div_ceil(TRIALS).max(1);
        let trials: Vec<usize> = (0..grid.points()).filter(in_contact).step_by(every).collect();
        let greatest =
            |joint: usize| trials.iter().map(|&point| dataset.torque(point)[joint].abs()).fold(0.0, f64::max);
        let scale = (0..joints).map(|joint| greatest(joint).min(limits[joint] / LOAD)).collect();
        Self { dataset, grid, scale, trials }
    }

    /// Returns the torque at `point` over the greatest, of the joint where that is greatest (1).
    fn load(&self, point: usize) -> f64 {
        let pairs = self.dataset.torque(point).iter().zip(&self.scale);
        pairs.map(|(torque, scale)| if *scale > 0.0 { torque.abs() / scale } else { 0.0 }).fold(0.0, f64::max)
    }

    /// Returns the neighbour of `point`, if there is one to go to: at the grid's border the proxy would be held.
    fn next(&self, point: usize, Along { joint, upwards }: Along) -> Option<usize> {
        let next = self.grid.beside(point, joint)[usize::from(upwards)]?;
        is_inside(self.grid.axes[joint].count, self.grid.lines(next)[joint]).then_some(next)
    }

    /// Returns the free point that is reached from `point` without leaving contact before, and its distance in points.
    fn lift(&self, point: usize, along: Along) -> Option<(usize, usize)> {
        let (mut here, mut steps) = (point, 0);
        while self.dataset.status(here) == Status::Contact {
            here = self.next(here, along)?;
            steps += 1;
        }
        (self.dataset.status(here) == Status::Free).then_some(())?;
        for _ in 1..CLEARANCE {
            match self.next(here, along).filter(|next| self.dataset.status(*next) == Status::Free) {
                Some(next) => here = next,
                None => break,
            }
        }
        Some((here, steps))
    }

    fn directions(&self) -> impl Iterator<Item = Along> + use<> {
        (0..self.grid.joints()).flat_map(|joint| [false, true].map(|upwards| Along { joint, upwards }))
    }

    fn path(&self, waypoints: &[(f64, usize)]) -> Vec<Waypoint> {
        waypoints.iter().map(|&(time, point)| Waypoint { time, q: self.grid.configuration(point) }).collect()
    }

    /// Returns the heaviest press within [`LOAD`], of these the shortest.
    fn press(&self) -> Vec<Waypoint> {
        let mut best: Option<(f64, usize, [usize; 2])> = None;
        for &point in &self.trials {
            let load = self.load(point);
            if load > LOAD || best.is_some_and(|(heaviest, ..)| load < heaviest) {
                continue;
            }
            for (free, steps) in self.directions().filter_map(|along| self.lift(point, along)) {
                if best.is_none_or(|(heaviest, fewest, _)| load > heaviest || steps < fewest) {
                    best = Some((load, steps, [free, point]));
                }
            }
        }
        best.map_or_else(Vec::new, |(_, _, [free, pressed])| {
            self.path(&[(0.0, free), (0.5, free), (2.0, pressed), (2.6, pressed), (4.1, free), (4.5, free)])
        })
    }

    /// Returns the scrape that goes farthest, as a fraction of the joint's range.
    fn scrape(&self) -> Vec<Waypoint> {
        let mut best: Option<(f64, [usize; 4])> = None;
        for &point in self.trials.iter().filter(|point| (LEAST_LOAD..=LOAD).contains(&self.load(**point))) {
            for joint in 0..self.grid.joints() {
                let [(first, back), (last, on)] =
                    [false, true].map(|upwards| self.slide(point, Along { joint, upwards }));
                let length = (back + on) as f64 / (self.grid.axes[joint].count - 1) as f64;
                if back + on == 0 || best.is_some_and(|(longest, _)| length <= longest) {
                    continue;
                }
                let ways = self.directions().filter(|along| along.joint != joint);
                let lifted = |along| Some([self.lift(first, along)?.0, first, last, self.lift(last, along)?.0]);
                if let Some(points) = ways.filter_map(lifted).next() {
                    best = Some((length, points));
                }
            }
        }
        best.map_or_else(Vec::new, |(_, [above, first, last, off])| {
            self.path(&[(0.0, above), (1.0, first), (4.0, last), (5.0, off)])
        })
    }

    /// Returns the last point from `point` on that is still in contact within [`LOAD`], and its distance in points.
    fn slide(&self, point: usize, along: Along) -> (usize, usize) {
        let (mut here, mut steps) = (point, 0);
        let felt = |point: &usize| self.dataset.status(*point) == Status::Contact && self.load(*point) <= LOAD;
        while let Some(next) = self.next(here, along).filter(felt) {
            here = next;
            steps += 1;
        }
        (here, steps)
    }
}
