//! The adapter that is chosen, the device opened on it, and every way in which they fail, as a `Result`.
//!
//! wgpu reports three kinds of failure besides returned errors: a lost device (callback), errors that no scope captures
//! (callback; wgpu's default is to panic), and waits that never end. All three end up in [`GpuError`]: the callbacks
//! store the first message, [`Context::check`] returns it, and every wait has a limit.

use super::{
    adapter::{AdapterChoice, AdapterSummary, asked_for, instance, qualified},
    compiled::Compiled,
    device::MOST_WORKGROUP_MEMORY,
    error::GpuError,
};
use std::{
    collections::HashMap,
    sync::{
        Arc, Mutex, MutexGuard, PoisonError,
        mpsc::{self, RecvTimeoutError},
    },
    time::Duration,
};

/// Longest wait for one submission. A dispatch is sized for tens of milliseconds; software Vulkan on a busy machine may
/// need a thousand times that. Beyond it the device hangs.
const WAIT_LIMIT: Duration = Duration::from_secs(120);

/// Longest wait for what a device that refuses something still does.
const LAST_WORK: Duration = Duration::from_secs(1);

/// First message of each kind of failure that arrives by callback.
#[derive(Default)]
struct Failures {
    lost: Option<String>,
    error: Option<GpuError>,
}

/// An open device.
pub struct Context {
    instance: wgpu::Instance,
    opened: wgpu::Adapter,
    pub(crate) device: wgpu::Device,
    pub(crate) queue: wgpu::Queue,
    adapter: AdapterSummary,
    failures: Arc<Mutex<Failures>>,
    /// Pipelines that have been compiled, by shader, entry point and override constants.
    pub(super) compiled: Mutex<HashMap<String, Compiled>>,
}

fn lock(failures: &Mutex<Failures>) -> MutexGuard<'_, Failures> {
    // A message is stored whole or not at all, so a panic elsewhere leaves nothing half-written.
    failures.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Context {
    /// Opens the best adapter that qualifies.
    ///
    /// # Errors
    /// [`GpuError::NoAdapter`] or [`GpuError::NotThere`] with what was found; [`GpuError::NoDevice`] when none of them
    /// gives a device.
    pub fn open(choice: AdapterChoice) -> Result<Self, GpuError> {
        let instance = instance();
        let mut refusal = None;
        for (adapter, summary) in qualified(&instance, &choice)? {
            match Self::open_on(&instance, &adapter, summary) {
                Ok(context) => return Ok(context),
                Err(error) => refusal = refusal.or(Some(error)),
            }
        }
        Err(refusal.unwrap_or_else(|| choice.refusal(&[], &[])))
    }

    /// Opens all adapters that qualify and are named by the environment or, if it names none, those of the best kind.
    ///
    /// # Errors
    /// As [`Context::open`], and where one that is named gives no device.
    pub fn open_all(choice: &AdapterChoice) -> Result<Vec<Arc<Self>>, GpuError> {
        let instance = instance();
        let named = !asked_for().is_empty();
        let (mut opened, mut refusal) = (Vec::<Arc<Self>>::new(), None);
        for (adapter, summary) in qualified(&instance, choice)? {
            if !summary.joins(opened.iter().map(|context| &context.adapter), named) {
                continue;
            }
            match Self::open_on(&instance, &adapter, summary) {
                Ok(context) => opened.push(Arc::new(context)),
                Err(error) if named => return Err(error),
                Err(error) => refusal = refusal.or(Some(error)),
            }
        }
        if opened.is_empty() { Err(refusal.unwrap_or_else(|| choice.refusal(&[], &[]))) } else { Ok(opened) }
    }

    fn open_on(instance: &wgpu::Instance, adapter: &wgpu::Adapter, summary: AdapterSummary) -> Result<Self, GpuError> {
        let offered = adapter.limits();
        // WebGPU's defaults, which every device has, but for the sizes that decide which objects and contacts fit.
        let limits = wgpu::Limits {
            max_compute_workgroup_storage_size: offered.max_compute_workgroup_storage_size.min(MOST_WORKGROUP_MEMORY),
            max_storage_buffer_binding_size: offered.max_storage_buffer_binding_size,
            max_buffer_size: offered.max_buffer_size,
            ..wgpu::Limits::default()
        };
        let descriptor =
            wgpu::DeviceDescriptor { label: Some("haptize"), required_limits: limits, ..Default::default() };
        let (device, queue) = pollster::block_on(adapter.request_device(&descriptor))
            .map_err(|error| GpuError::NoDevice { adapter: summary.to_string(), reason: error.to_string() })?;
        let failures = Arc::new(Mutex::new(Failures::default()));
        let on_lost = Arc::clone(&failures);
        device.set_device_lost_callback(move |reason, message| {
            let why = format!("{reason:?}: {message}");
            lock(&on_lost).lost.get_or_insert_with(|| why.trim_end_matches([':', ' ']).to_lowercase());
        });
        let on_error = Arc::clone(&failures);
        device.on_uncaptured_error(Arc::new(move |error| {
            lock(&on_error).error.get_or_insert_with(|| GpuError::from(error));
        }));
        Ok(Self {
            instance: instance.clone(),
            opened: adapter.clone(),
            device,
            queue,
            adapter: summary,
            failures,
            compiled: Mutex::default(),
        })
    }

    /// The adapter in use.
    #[must_use]
    pub fn adapter(&self) -> &AdapterSummary {
        &self.adapter
    }

    /// Instance, adapter, device and queue, for a window that draws on the device which computes.
    #[must_use]
    pub fn shared(&self) -> (wgpu::Instance, wgpu::Adapter, wgpu::Device, wgpu::Queue) {
        (self.instance.clone(), self.opened.clone(), self.device.clone(), self.queue.clone())
    }

    /// Largest buffer that one binding reaches (B).
    #[must_use]
    pub fn binding_limit(&self) -> u64 {
        let limits = self.device.limits();
        limits.max_storage_buffer_binding_size.min(limits.max_buffer_size)
    }

    /// Workgroup memory that a kernel may have (B).
    #[must_use]
    pub(super) fn workgroup_memory(&self) -> u32 {
        self.device.limits().max_compute_workgroup_storage_size
    }

    /// The failure that a callback stored, if any. A lost device stays lost; another error is reported once.
    ///
    /// # Errors
    /// That failure.
    pub fn check(&self) -> Result<(), GpuError> {
        // Some losses show in a poll alone; it does not wait.
        let _ = self.device.poll(wgpu::PollType::Poll);
        let mut failures = lock(&self.failures);
        if let Some(message) = &failures.lost {
            return Err(GpuError::Lost(message.clone()));
        }
        failures.error.take().map_or(Ok(()), Err)
    }

    /// Waits until `submission` is done and its callbacks have run.
    ///
    /// # Errors
    /// When the device was lost, refused a command, or does not answer.
    pub fn wait(&self, submission: &wgpu::SubmissionIndex) -> Result<(), GpuError> {
        let wait = wgpu::PollType::Wait { submission_index: Some(submission.clone()), timeout: Some(WAIT_LIMIT) };
        let outcome = self.device.poll(wait);
        self.check()?;
        match outcome {
            Ok(_) => Ok(()),
            Err(wgpu::PollError::Timeout) => Err(GpuError::TimedOut(WAIT_LIMIT)),
            Err(error) => Err(GpuError::Lost(error.to_string())),
        }
    }

    /// Maps the first `bytes` bytes of `buffer` for reading once `submission` is done, and waits for it. Not only for
    /// the submission: of several threads that poll one device, the one that finds the mapping complete runs its
    /// callback, and that may be another one, a little later.
    ///
    /// # Errors
    /// When the device was lost, refused a command, or does not answer.
    pub(crate) fn map(
        &self,
        buffer: &wgpu::Buffer,
        bytes: u64,
        submission: &wgpu::SubmissionIndex,
    ) -> Result<wgpu::BufferView, GpuError> {
        let (sender, receiver) = mpsc::channel();
        buffer.map_async(wgpu::MapMode::Read, ..bytes, move |outcome| {
            // The receiver waits below; if it is gone, so is the need.
            let _ = sender.send(outcome);
        });
        self.wait(submission)?;
        match receiver.recv_timeout(WAIT_LIMIT) {
            Ok(outcome) => outcome.map_err(|error| GpuError::Lost(error.to_string()))?,
            Err(RecvTimeoutError::Timeout) => return Err(GpuError::TimedOut(WAIT_LIMIT)),
            Err(RecvTimeoutError::Disconnected) => return Err(GpuError::Lost("a mapping was dropped".to_owned())),
        }
        buffer.get_mapped_range(..bytes).map_err(|error| GpuError::Refused(error.to_string()))
    }

    /// Runs `work`, which creates objects on the device, and turns what the device refuses into an error.
    pub(crate) fn scoped<T>(&self, work: impl FnOnce(&wgpu::Device) -> T) -> Result<T, GpuError> {
        let memory = self.device.push_error_scope(wgpu::ErrorFilter::OutOfMemory);
        let internal = self.device.push_error_scope(wgpu::ErrorFilter::Internal);
        let validation = self.device.push_error_scope(wgpu::ErrorFilter::Validation);
        let made = work(&self.device);
        let refused = [validation, internal, memory].map(|scope| pollster::block_on(scope.pop()));
        let refused = refused.into_iter().flatten().next();
        if refused.is_some() {
            // A device that is lost refuses everything, and says why once it has nothing to do any more.
            let _ = self.device.poll(wgpu::PollType::Wait { submission_index: None, timeout: Some(LAST_WORK) });
        }
        self.check()?;
        refused.map_or(Ok(made), |error| Err(error.into()))
    }
}
