//! Some devices that share the configurations of some work: a thread each takes sections of them from one queue, and
//! their results come back in order.
//!
//! A device that fails gives back what it had, and is as one that is not there.

use super::error::GpuError;
use crate::{
    JointVector,
    contact::{CHUNKS_IN_FLIGHT, Equilibrium, Work},
    threads::spawn_scoped,
};
use std::{
    collections::VecDeque,
    sync::{
        Condvar, Mutex, PoisonError,
        mpsc::{self, Sender},
    },
};

/// A device with two lanes. What is submitted is done in order.
pub(super) trait Device: Send {
    /// What it finds of a section.
    type Found;

    /// Most configurations of a section.
    fn section(&self) -> usize;

    /// Submits a section in a lane that is free. Does not wait.
    fn submit(&mut self, lane: usize, section: &[JointVector]);

    /// Waits for what was submitted in a lane, of `count` configurations.
    ///
    /// # Errors
    /// When the device fails.
    fn collect(&mut self, lane: usize, count: usize) -> Result<Self::Found, GpuError>;
}

/// Part of a chunk.
struct Section {
    /// Number of the chunk, counted from the first one of the work, and of the section in it.
    chunk: usize,
    number: usize,
    configurations: Vec<JointVector>,
}

/// Sections that wait for a device.
#[derive(Default)]
struct Queue {
    waiting: Mutex<(VecDeque<Section>, IsOver)>,
    changed: Condvar,
}

/// Whether no more sections come.
type IsOver = bool;

impl Queue {
    /// Changes what waits. A panic leaves nothing half-changed: sections are moved whole.
    fn change<T>(&self, change: impl FnOnce(&mut (VecDeque<Section>, IsOver)) -> T) -> T {
        let changed = change(&mut self.waiting.lock().unwrap_or_else(PoisonError::into_inner));
        self.changed.notify_all();
        changed
    }

    /// The next section; waits for it, until no more come, if `must_wait`.
    fn next(&self, must_wait: bool) -> Option<Section> {
        let mut waiting = self.waiting.lock().unwrap_or_else(PoisonError::into_inner);
        while must_wait && waiting.0.is_empty() && !waiting.1 {
            waiting = self.changed.wait(waiting).unwrap_or_else(PoisonError::into_inner);
        }
        waiting.0.pop_front()
    }
}

/// What a device's thread reports.
enum Report {
    /// The equilibria of a section, by its chunk and number.
    Solved(usize, usize, Vec<Equilibrium>),
    /// The device of this number has failed.
    Failed(usize, GpuError),
    /// A device's thread has panicked, which the scope passes on.
    Panicked,
}

/// Reports that the thread panics, so that nobody waits for what it had.
struct Watched<'s>(&'s Sender<Report>);

impl Drop for Watched<'_> {
    fn drop(&mut self) {
        if std::thread::panicking() {
            // Whoever listened has no more need of it.
            let _ = self.0.send(Report::Panicked);
        }
    }
}

/// The equilibria of a chunk's sections, as far as they are known.
type Chunk = Vec<Option<Vec<Equilibrium>>>;

/// Takes all of `work` through `devices`; `conclude` makes equilibria of what one of them found of a section. Those
/// that fail are removed, the others go on.
///
/// # Errors
/// When the last device fails.
pub(super) fn solve_together<D: Device>(
    devices: &mut Vec<D>,
    work: &mut dyn Work,
    conclude: impl Fn(&[JointVector], D::Found) -> Vec<Equilibrium> + Sync,
) -> Result<(), GpuError> {
    let all = devices.len();
    let most = devices.iter().map(Device::section).min().unwrap_or(1);
    let queue = Queue::default();
    let mut failed = Vec::new();
    let solved = std::thread::scope(|scope| {
        let (sender, reports) = mpsc::channel();
        for (number, device) in devices.iter_mut().enumerate() {
            let (own, queue, conclude) = (sender.clone(), &queue, &conclude);
            let begun = spawn_scoped(scope, "device", move || {
                let _watched = Watched(&own);
                if let Err(error) = serve(device, queue, &own, conclude) {
                    // Whoever listened has no more need of it.
                    let _ = own.send(Report::Failed(number, error));
                }
            });
            if let Err(error) = begun {
                // It is listened to below.
                let _ = sender.send(Report::Failed(number, GpuError::NoThread(error)));
            }
        }
        drop(sender);
        let mut chunks = VecDeque::<Chunk>::new();
        let (mut asked, mut is_over) = (0, false);
        let result = loop {
            while let Some(chunk) = chunks.pop_front_if(|chunk| chunk.iter().all(Option::is_some)) {
                work.take(chunk.into_iter().flatten().flatten().collect());
            }
            while !is_over && chunks.len() < CHUNKS_IN_FLIGHT {
                let Some(configurations) = work.next() else {
                    is_over = true;
                    break;
                };
                let sections = configurations.chunks(most).enumerate().map(|(number, configurations)| Section {
                    chunk: asked,
                    number,
                    configurations: configurations.to_vec(),
                });
                let sections: Vec<Section> = sections.collect();
                chunks.push_back(sections.iter().map(|_| None).collect());
                asked += 1;
                queue.change(|(waiting, _)| waiting.extend(sections));
            }
            if chunks.front().is_some_and(|chunk| chunk.iter().all(Option::is_some)) {
                continue;
            }
            if chunks.is_empty() {
                break Ok(());
            }
            match reports.recv() {
                Ok(Report::Solved(chunk, number, equilibria)) => {
                    let place = chunk + chunks.len() - asked;
                    chunks[place][number] = Some(equilibria);
                }
                Ok(Report::Failed(number, error)) => {
                    failed.push(number);
                    if failed.len() == all {
                        break Err(error);
                    }
                    let place = number + 1;
                    work.note(format!("solved without graphics device {place} of {all}, which failed: {error}"));
                }
                Ok(Report::Panicked) => break Ok(()),
                Err(_) => break Err(GpuError::Lost("no device is left".to_owned())),
            }
        };
        queue.change(|(_, is_over)| *is_over = true);
        result
    });
    failed.sort_unstable();
    failed.into_iter().rev().for_each(|number| drop(devices.remove(number)));
    solved
}

/// Takes sections through `device` until no more come: while the device solves one, the one before is concluded.
fn serve<D: Device>(
    device: &mut D,
    queue: &Queue,
    sender: &Sender<Report>,
    conclude: &(impl Fn(&[JointVector], D::Found) -> Vec<Equilibrium> + Sync),
) -> Result<(), GpuError> {
    let (mut lane, mut under_way) = (0, None::<Section>);
    loop {
        let next = queue.next(under_way.is_none());
        if let Some(section) = &next {
            device.submit(1 - lane, &section.configurations);
        }
        match under_way {
            None if next.is_none() => return Ok(()),
            None => {}
            Some(section) => match device.collect(lane, section.configurations.len()) {
                Ok(found) => {
                    let equilibria = conclude(&section.configurations, found);
                    // Whoever listened has no more need of it.
                    let _ = sender.send(Report::Solved(section.chunk, section.number, equilibria));
                }
                Err(error) => {
                    queue
                        .change(|(waiting, _)| next.into_iter().chain([section]).for_each(|it| waiting.push_front(it)));
                    return Err(error);
                }
            },
        }
        (lane, under_way) = (1 - lane, next);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A device that finds the first coordinate of each configuration, and is lost when it is asked for what it found
    /// so often.
    struct First {
        lanes: [Vec<f64>; 2],
        section: usize,
        until_lost: usize,
    }

    impl First {
        fn new(section: usize, until_lost: usize) -> Self {
            Self { lanes: Default::default(), section, until_lost }
        }
    }

    impl Device for First {
        type Found = Vec<f64>;

        fn section(&self) -> usize {
            self.section
        }

        fn submit(&mut self, lane: usize, section: &[JointVector]) {
            assert!(section.len() <= self.section && self.lanes[lane].is_empty(), "the lane is not free");
            self.lanes[lane] = section.iter().map(|q| q[0]).collect();
        }

        fn collect(&mut self, lane: usize, count: usize) -> Result<Vec<f64>, GpuError> {
            let found = std::mem::take(&mut self.lanes[lane]);
            assert_eq!(found.len(), count, "another section has the lane");
            self.until_lost = self.until_lost.checked_sub(1).ok_or_else(|| GpuError::Lost("on purpose".into()))?;
            Ok(found)
        }
    }

    /// Chunks of these sizes, whose configurations are numbered; numbers that came back.
    #[derive(Default)]
    struct Numbers {
        sizes: VecDeque<usize>,
        given: usize,
        under_way: usize,
        most_under_way: usize,
        taken: Vec<Vec<f64>>,
        notices: Vec<String>,
    }

    impl Work for Numbers {
        fn next(&mut self) -> Option<Vec<JointVector>> {
            let size = self.sizes.pop_front()?;
            let chunk = (self.given..self.given + size).map(|number| JointVector::from_slice(&[number as f64]));
            self.given += size;
            self.under_way += 1;
            self.most_under_way = self.most_under_way.max(self.under_way);
            Some(chunk.collect())
        }

        fn rewind(&mut self) {}

        fn take(&mut self, equilibria: Vec<Equilibrium>) {
            self.under_way -= 1;
            self.taken.push(equilibria.iter().map(|equilibrium| equilibrium.gap).collect());
        }

        fn note(&mut self, notice: String) {
            self.notices.push(notice);
        }
    }

    const SIZES: [usize; 9] = [5, 0, 0, 0, 0, 0, 17, 1, 8];

    /// Returns what comes back of chunks of [`SIZES`], and whether the last device failed.
    fn solved(devices: &mut Vec<First>) -> (Numbers, Result<(), GpuError>) {
        let mut work = Numbers { sizes: SIZES.into(), ..Numbers::default() };
        let result = solve_together(devices, &mut work, |configurations, found| {
            assert!(found.iter().zip(configurations).all(|(number, q)| *number == q[0]));
            found.into_iter().map(|gap| Equilibrium::free(gap, 1)).collect()
        });
        (work, result)
    }

    fn expected() -> Vec<Vec<f64>> {
        let mut numbers = (0..).map(f64::from);
        SIZES.iter().map(|&size| numbers.by_ref().take(size).collect()).collect()
    }

    #[test]
    fn chunks_come_back_whole_and_in_order_from_any_number_of_devices() {
        for sections in [&[1][..], &[100], &[3, 3], &[1, 4, 2]] {
            let mut devices: Vec<First> = sections.iter().map(|&section| First::new(section, usize::MAX)).collect();
            let (work, result) = solved(&mut devices);
            assert!(result.is_ok() && work.notices.is_empty());
            assert_eq!(work.taken, expected(), "{sections:?}");
            assert!(work.most_under_way <= CHUNKS_IN_FLIGHT, "{}", work.most_under_way);
        }
    }

    #[test]
    fn the_others_solve_what_a_device_had_that_is_lost() {
        for until_lost in [0, 1, 4] {
            // The one that lasts may have solved all before the other one had its turn.
            let mut devices = vec![First::new(2, until_lost), First::new(2, usize::MAX)];
            let (work, result) = solved(&mut devices);
            assert!(result.is_ok());
            assert_eq!(work.taken, expected(), "lost after {until_lost}");
            assert_eq!(devices.len() + work.notices.len(), 2);
            assert!(work.notices.iter().all(|it| it.contains("device 1 of 2") && it.contains("on purpose")));
        }
    }

    #[test]
    fn the_last_device_fails_with_its_error_and_what_came_before_holds() {
        let mut devices = vec![First::new(2, 3), First::new(2, 0)];
        let (work, result) = solved(&mut devices);
        assert!(matches!(result, Err(GpuError::Lost(_))) && devices.is_empty());
        let [notice] = &work.notices[..] else { panic!("{:?}", work.notices) };
        assert!(notice.contains("of 2, which failed"), "{notice}");
        assert_eq!(work.taken[..], expected()[..work.taken.len()]);
    }
}
