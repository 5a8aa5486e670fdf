//! How long each kernel takes, by the device's own clock, on a context that is opened for it ([`Context::open_timed`]).
//!
//! A timed dispatch has a pass of its own, whose begin and end the device stamps; what it has stamped is read when it
//! is asked for. On any other context nothing of this exists: dispatches that follow each other share one pass.

use super::{dispatch::Dispatch, error::GpuError};
use std::{
    ops::Range,
    sync::{Mutex, PoisonError},
};

/// Time of one kernel, all its dispatches together.
#[derive(Clone, Debug, PartialEq)]
pub struct KernelTime {
    /// The shader's name, and its entry point where it has several.
    pub name: String,
    /// Dispatches.
    pub dispatches: u64,
    /// Workgroups of all of them.
    pub workgroups: u64,
    /// Time by the device's clock (s).
    pub seconds: f64,
    /// Bytes that had to be read or written, each element once a dispatch; what is read again from a cache is not
    /// counted (B).
    pub bytes: u64,
}

/// What the search took for the configurations in contact, in all rounds: see `shaders/search_types.wgsl`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SearchCounts {
    /// Configurations.
    pub configurations: u64,
    /// Trials: rounds of a configuration.
    pub trials: u64,
    /// Proxy nodes that could touch.
    pub candidates: u64,
    /// Facets that were measured.
    pub facets: u64,
    /// Surface nodes displaced.
    pub displaced: u64,
    /// Pairs of these with nodes that carry force.
    pub displaced_pairs: u64,
    /// Iterations of linear solves.
    pub iterations: u64,
    /// Pairs of nodes that carry force, in products with C: where a state is judged, and where a step is made.
    pub judged_pairs: u64,
    /// The same where a step is made.
    pub stepped_pairs: u64,
    /// Steps of the eliminations that invert matrices.
    pub eliminations: u64,
}

/// The first of the words of a workspace that count, and how many there are.
pub(super) const COUNTED: Range<usize> = 21..30;

impl SearchCounts {
    /// Adds the words of one configuration that count.
    fn add(&mut self, words: [u32; COUNTED.end - COUNTED.start]) {
        let sums = [
            &mut self.trials,
            &mut self.candidates,
            &mut self.facets,
            &mut self.displaced,
            &mut self.displaced_pairs,
            &mut self.iterations,
            &mut self.judged_pairs,
            &mut self.stepped_pairs,
            &mut self.eliminations,
        ];
        sums.into_iter().zip(words).for_each(|(sum, word)| *sum += u64::from(word));
        self.configurations += 1;
    }
}

/// A device's clock, and what it has stamped so far.
#[derive(Default)]
pub(super) struct Stopwatch {
    stamped: Mutex<Vec<Stamped>>,
    counts: Mutex<SearchCounts>,
}

/// The timed dispatches of one submission.
struct Stamped {
    /// Without their times.
    kernels: Vec<KernelTime>,
    /// Begin and end of each, in ticks of the device's clock.
    ticks: wgpu::Buffer,
}

/// Bytes of one stamp.
const STAMP: u64 = wgpu::QUERY_SIZE as u64;

impl Stopwatch {
    /// Adds what a search took, from the words of the workspaces, `each` of every configuration.
    pub fn count(&self, words: &[u32], each: usize) {
        let mut counts = self.counts.lock().unwrap_or_else(PoisonError::into_inner);
        let counted = words.chunks_exact(each).filter_map(|words| words.get(COUNTED)?.try_into().ok());
        counted.for_each(|words| counts.add(words));
    }

    /// What was counted since the last call.
    pub fn take_counts(&self) -> SearchCounts {
        std::mem::take(&mut *self.counts.lock().unwrap_or_else(PoisonError::into_inner))
    }

    /// The time of every kernel since the last call, in the order in which they first ran. A tick of the clock takes
    /// `period` (s); `map` waits for the stamps and gives the host a view of them.
    pub fn take_times(
        &self,
        period: f64,
        map: impl Fn(&wgpu::Buffer) -> Result<wgpu::BufferView, GpuError>,
    ) -> Result<Vec<KernelTime>, GpuError> {
        let stamped = std::mem::take(&mut *self.stamped.lock().unwrap_or_else(PoisonError::into_inner));
        let mut times: Vec<KernelTime> = Vec::new();
        for Stamped { kernels, ticks } in stamped {
            let view = map(&ticks)?;
            let ticks: Vec<u64> = bytemuck::pod_collect_to_vec(&view);
            for (kernel, stamps) in kernels.into_iter().zip(ticks.chunks_exact(2)) {
                let known = times.iter().position(|time| time.name == kernel.name).unwrap_or_else(|| {
                    times.push(KernelTime { dispatches: 0, workgroups: 0, bytes: 0, ..kernel.clone() });
                    times.len() - 1
                });
                let time = &mut times[known];
                time.dispatches += kernel.dispatches;
                time.workgroups += kernel.workgroups;
                time.bytes += kernel.bytes;
                time.seconds += period * stamps[1].saturating_sub(stamps[0]) as f64;
            }
        }
        Ok(times)
    }

    /// Records `dispatches`, in order, a pass each.
    pub fn record<'a>(
        &self,
        device: &wgpu::Device,
        encoder: &mut wgpu::CommandEncoder,
        dispatches: impl IntoIterator<Item = Dispatch<'a>>,
    ) {
        let dispatches: Vec<_> = dispatches.into_iter().filter(|dispatch| dispatch.workgroups > 0).collect();
        if dispatches.is_empty() {
            return;
        }
        let count = 2 * dispatches.len() as u32;
        let bytes = STAMP * u64::from(count);
        let query_set = device.create_query_set(&wgpu::QuerySetDescriptor {
            label: Some("stamps"),
            ty: wgpu::QueryType::Timestamp,
            count,
        });
        let buffer = |usage| {
            let usage = usage | wgpu::BufferUsages::COPY_DST;
            device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("stamps"),
                size: bytes,
                usage,
                mapped_at_creation: false,
            })
        };
        for (begin, dispatch) in (0..).step_by(2).zip(&dispatches) {
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
                label: None,
                timestamp_writes: Some(wgpu::ComputePassTimestampWrites {
                    query_set: &query_set,
                    beginning_of_pass_write_index: Some(begin),
                    end_of_pass_write_index: Some(begin + 1),
                }),
            });
            dispatch.record(&mut pass);
        }
        let resolved = buffer(wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC);
        let ticks = buffer(wgpu::BufferUsages::MAP_READ);
        encoder.resolve_query_set(&query_set, 0..count, &resolved, 0);
        encoder.copy_buffer_to_buffer(&resolved, 0, &ticks, 0, bytes);
        let kernels = dispatches.iter().map(|dispatch| KernelTime {
            name: dispatch.name.to_owned(),
            dispatches: 1,
            workgroups: dispatch.workgroups.into(),
            seconds: 0.0,
            bytes: dispatch.bytes,
        });
        self.stamped.lock().unwrap_or_else(PoisonError::into_inner).push(Stamped { kernels: kernels.collect(), ticks });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        contact::Model,
        gpu::{AdapterChoice, BatchCapacity, Context, FrameMethod, FrameUpdate, GpuSolver},
        object::Object,
        proxy::Chain,
        scene::{GraphicsEffects, Scene},
        sweep::{Backend, sample},
    };
    use glam::DVec3;
    use std::{sync::Arc, time::Instant};

    /// Work for a device, and the same on one that is not timed.
    fn sphere() -> (Scene, [Arc<Context>; 2]) {
        let text = include_str!("../../tests/scenes/sphere.toml").replace("count = 36", "count = 3");
        let scene = Scene::parse(&text, "sphere.toml").unwrap();
        let open = [Context::open_timed, Context::open];
        (scene, open.map(|open| Arc::new(open(AdapterChoice::Any).unwrap())))
    }

    /// Each took some time, all together no more than went by: `wall` (s).
    fn plausible(times: &[KernelTime], wall: f64) {
        for kernel in times {
            assert!(kernel.seconds > 0.0 && kernel.dispatches > 0 && kernel.workgroups > 0, "{kernel:?}");
            assert!(kernel.bytes > 0, "{kernel:?}");
        }
        let sum: f64 = times.iter().map(|kernel| kernel.seconds).sum();
        assert!(sum <= wall, "{sum} s of {wall} s: {times:?}");
    }

    #[test]
    fn the_words_that_count_are_those_of_the_shader() {
        let shader = include_str!("../../shaders/search_types.wgsl");
        let word = |name: &str| -> usize {
            let (_, rest) = shader.split_once(&format!("const {name}: u32 = ")).unwrap();
            rest.split_once("u;").unwrap().0.parse().unwrap()
        };
        assert_eq!(COUNTED, word("TRIALS")..word("MEMBER"));
    }

    #[test]
    fn every_kernel_of_a_sweep_is_timed_and_none_that_nobody_asks_for() {
        let (scene, contexts) = sphere();
        let (object, chain) = (Object::build(&scene.object).unwrap(), Chain::new(&scene.proxy));
        let model = Model::new(&object, &chain, scene.contact);
        let configurations = sample(&scene);
        let [timed, plain] = contexts.map(|context| {
            let room = BatchCapacity { double: false, ..BatchCapacity::default() };
            let mut solver = GpuSolver::with_room(Arc::clone(&context), &model, room).unwrap();
            let begin = Instant::now();
            let equilibria = solver.solve(&configurations).unwrap();
            let times = context.kernel_times().unwrap();
            plausible(&times, begin.elapsed().as_secs_f64());
            assert_eq!(context.kernel_times().unwrap(), [], "told twice");
            let results = equilibria.into_iter().map(|e| (e.status, e.torque, e.energy)).collect::<Vec<_>>();
            (results, times, context.search_counts())
        });
        assert_eq!(timed.0, plain.0, "results depend on the clock");
        assert_eq!(plain.1, []);
        let names: Vec<&str> = timed.1.iter().map(|kernel| kernel.name.as_str()).collect();
        assert_eq!(
            names,
            [
                "kinematics",
                "detection",
                "gap",
                "search_arm",
                "search_detect",
                "search_judge",
                "search_step",
                "search_unfinished",
                "search_results count",
                "search_results gather",
            ]
        );
        let touching = timed.0.iter().filter(|(status, ..)| *status != crate::contact::Status::Free).count() as u64;
        let counts = timed.2;
        assert_eq!(plain.2, SearchCounts::default());
        assert_eq!(counts.configurations, touching);
        assert!(counts.trials > 2 * touching && counts.facets > counts.candidates / 2 && counts.candidates > touching);
        assert!(counts.displaced_pairs > counts.displaced && counts.stepped_pairs > counts.judged_pairs, "{counts:?}");
        assert!(counts.iterations > touching && counts.eliminations >= counts.iterations / 8, "{counts:?}");
        // One workgroup a configuration, and for each of its nodes the place is written, then read and written.
        let [kinematics, detection, _, _, _, search, ..] = &timed.1[..] else { panic!("{names:?}") };
        assert!(search.workgroups >= touching && touching > 50, "{} for {touching}", search.workgroups);
        let places = (16 * chain.nodes.len() * configurations.len()) as u64;
        assert!(kinematics.bytes > places && kinematics.bytes < 2 * places);
        assert!(detection.bytes > 2 * places);
    }

    #[test]
    fn every_kernel_of_a_frame_is_timed() {
        let (scene, [context, _]) = sphere();
        let object = Object::build(&scene.object).unwrap();
        let forces = vec![DVec3::Z; object.rest.len()];
        let iterations = 5;
        for (method, dispatches) in [
            (FrameMethod::Inverse, vec![("frame load", 1), ("frame advance", 1)]),
            (FrameMethod::Iterations(iterations), {
                let [product, correct, turn] =
                    ["product", "correct", "turn"].map(|stage| (stage, u64::from(iterations)));
                vec![("begin", 1), product, correct, turn, ("finish", 1)]
            }),
        ] {
            let effects = GraphicsEffects::default();
            let mut update = FrameUpdate::new(Arc::clone(&context), &object, 1.0 / 60.0, method, &effects).unwrap();
            let begin = Instant::now();
            for _ in 0..2 {
                update.step(&forces).unwrap();
            }
            update.read().unwrap();
            let times = context.kernel_times().unwrap();
            plausible(&times, begin.elapsed().as_secs_f64());
            assert_eq!(times.len(), dispatches.len());
            for (kernel, (name, count)) in times.iter().zip(dispatches) {
                assert!(kernel.name.ends_with(name) && kernel.dispatches == 2 * count, "{kernel:?} is not {name}");
            }
        }
    }

    /// The reported time is that of the work, not some constant.
    #[test]
    fn a_longer_dispatch_takes_longer() {
        let (scene, [context, _]) = sphere();
        let object = Object::build(&scene.object).unwrap();
        let method = FrameMethod::Iterations(FrameMethod::USUAL_ITERATIONS);
        let effects = GraphicsEffects::default();
        let mut update = FrameUpdate::new(Arc::clone(&context), &object, 1.0 / 60.0, method, &effects).unwrap();
        let mut total = |frames| {
            (0..frames).for_each(|_| update.step(&[]).unwrap());
            update.read().unwrap();
            context.kernel_times().unwrap().iter().map(|kernel| kernel.seconds).sum::<f64>()
        };
        // Software Vulkan compiles what runs for the first time.
        total(1);
        // A busy machine only adds to a time.
        let few = (0..10).map(|_| total(2)).fold(f64::INFINITY, f64::min);
        let many = total(40);
        assert!(many > 3.0 * few, "{many} s for 40 frames, {few} s for 2");
    }
}
