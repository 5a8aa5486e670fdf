//! How long each kernel takes, by the device's own clock, on a context that is opened for it ([`Context::open_timed`]).
//!
//! A timed dispatch has a pass of its own, whose begin and end the device stamps; what it has stamped is read when it
//! is asked for. On any other context nothing of this exists: dispatches that follow each other share one pass.

use super::{dispatch::Dispatch, error::GpuError};
use std::sync::{Mutex, PoisonError};

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

/// A device's clock, and what it has stamped so far.
#[derive(Default)]
pub(super) struct Stopwatch {
    stamped: Mutex<Vec<Stamped>>,
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
        gpu::{AdapterChoice, Context, FrameUpdate, GpuSolver},
        object::Object,
        proxy::Chain,
        scene::{ContactLaw, ContactSpec, Scene},
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
    fn the_kernel_of_a_sweep_is_timed_where_that_is_asked_for() {
        let (scene, contexts) = sphere();
        let (object, chain) = (Object::build(&scene.object).unwrap(), Chain::new(&scene.proxy));
        let model = Model::new(&object, &chain, ContactSpec { law: ContactLaw::Rest, ..scene.contact });
        let configurations = sample(&scene);
        let [timed, plain] = contexts.map(|context| {
            let mut solver = GpuSolver::new(Arc::clone(&context), &model).unwrap();
            let begin = Instant::now();
            let equilibria = solver.solve(&configurations).unwrap();
            let times = context.kernel_times().unwrap();
            plausible(&times, begin.elapsed().as_secs_f64());
            assert_eq!(context.kernel_times().unwrap(), [], "told twice");
            let results = equilibria.into_iter().map(|e| (e.status, e.torque, e.energy)).collect::<Vec<_>>();
            (results, times)
        });
        assert_eq!(timed.0, plain.0, "results depend on the clock");
        assert_eq!(plain.1, []);
        let [kernel] = &timed.1[..] else { panic!("{:?}", timed.1) };
        assert_eq!((&kernel.name[..], kernel.workgroups), ("rest", configurations.len() as u64));
    }

    #[test]
    fn every_kernel_of_a_frame_is_timed() {
        let (scene, [context, _]) = sphere();
        let object = Object::build(&scene.object).unwrap();
        let forces = vec![DVec3::Z; object.rest.len()];
        let mut update = FrameUpdate::new(Arc::clone(&context), &object, 1.0 / 60.0).unwrap();
        let begin = Instant::now();
        for _ in 0..2 {
            update.step(&forces).unwrap();
        }
        update.read().unwrap();
        let times = context.kernel_times().unwrap();
        plausible(&times, begin.elapsed().as_secs_f64());
        let dispatches: Vec<_> = times.iter().map(|kernel| (&kernel.name[..], kernel.dispatches)).collect();
        assert_eq!(dispatches, [("frame load", 2), ("frame advance", 2)]);
    }

    /// The reported time is that of the work, not some constant.
    #[test]
    fn a_longer_dispatch_takes_longer() {
        let (scene, [context, _]) = sphere();
        let object = Object::build(&scene.object).unwrap();
        let mut update = FrameUpdate::new(Arc::clone(&context), &object, 1.0 / 60.0).unwrap();
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
