//! Which backend solves: one place for `bake`, the demo and programs that use this library.

use super::WithFallback;
use crate::{
    Error,
    contact::Model,
    error,
    gpu::{AdapterChoice, BatchCapacity, Context, GpuError, GpuSolver, asked_for, named_adapters},
    memory,
    scene::ContactLaw,
};

/// Choices of a backend.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum BackendChoice {
    /// The CPU for short work; for longer work all hardware GPUs of the fastest kind, if there are any. Hardware GPUs
    /// that WGPU_ADAPTER_NAME names are always taken.
    #[default]
    Auto,
    /// All cores, f64; never touches Vulkan.
    Cpu,
    /// Any graphics adapters, software Vulkan included; an error if there are none.
    Gpu,
}

/// Time that a GPU takes to begin (s). An H200's driver compiled the kernels for 6 s at the first start, and for 2 s at
/// later ones (benches/README.md). What the CPU solves meanwhile no GPU solves sooner.
const GPU_START: f64 = 6.0;

impl BackendChoice {
    /// The choice for work that takes the CPU `seconds` (s).
    pub(crate) fn for_work(self, seconds: f64) -> Self {
        if self == Self::Auto && asked_for().is_empty() && !is_worth_a_gpu(seconds) { Self::Cpu } else { self }
    }
}

/// Whether work that takes the CPU `seconds` (s) is worth the start of a GPU.
pub(crate) fn is_worth_a_gpu(seconds: f64) -> bool {
    seconds > GPU_START
}

/// The backend that was chosen: GPUs, thousands of configurations at a time, f32, and the CPU once they are lost for
/// good; or the CPU alone, all cores, f64.
pub type ChosenBackend<'a> = WithFallback<'a, GpuSolver<'a>>;

/// Memory of a thread (bytes): the 2 MiB of its stack, and half as much for what the system and Rust add at its start,
/// which ends the process where it does not fit.
const THREAD_MEMORY: usize = 3 << 20;

impl<'a> ChosenBackend<'a> {
    /// Opens the backend that `choice` asks for, to solve `model`.
    ///
    /// # Errors
    /// When there is none such, or it cannot be opened.
    pub fn open(choice: BackendChoice, model: &'a Model<'a>) -> Result<Self, Error> {
        match choice {
            BackendChoice::Cpu => Self::on_cpu(model),
            // No GPU takes it, so that none needs to be opened.
            BackendChoice::Auto if model.contact.law != ContactLaw::Rest => Self::on_cpu(model),
            BackendChoice::Gpu => Ok(Self::gpu(AdapterChoice::Any, model)?),
            BackendChoice::Auto => match Self::gpu(AdapterChoice::Hardware, model) {
                // Who names an adapter that is not there would not notice that the CPU took its place.
                Err(error @ GpuError::NoAdapter { .. }) if is_named_in_vain() => Err(error.into()),
                // Where the GPU cannot take the scene the CPU can.
                opened => opened.or_else(|_| Self::on_cpu(model)),
            },
        }
    }

    fn on_cpu(model: &'a Model<'a>) -> Result<Self, Error> {
        let threads = std::thread::available_parallelism().map_or(1, usize::from);
        memory::check(threads * THREAD_MEMORY)
            .map_err(|shortage| error!("no memory for threads to solve on: {shortage}"))?;
        Self::cpu_alone(model)
    }

    fn gpu(choice: AdapterChoice, model: &'a Model<'a>) -> Result<Self, GpuError> {
        let contexts = Context::open_all(&choice)?;
        Ok(Self::on(GpuSolver::on(contexts, model, BatchCapacity::default())?, model))
    }

    /// Devices that are open already, to solve `model`, with the CPU behind them.
    #[must_use]
    pub fn on(devices: GpuSolver<'a>, model: &'a Model<'a>) -> Self {
        let name = counted(devices.adapters().map(ToString::to_string));
        Self::new(devices, name, model)
    }

    /// A good [`super::Run::chunk`] for this backend.
    #[must_use]
    pub fn chunk(&self) -> usize {
        self.chunk_of(GpuSolver::chunk)
    }
}

/// Remedy for a GPU that fails, if the CPU cannot take its place.
pub const OTHER_ADAPTER: &str = "another adapter (set WGPU_ADAPTER_NAME)";

/// Returns `message`, in which a GPU's failure may name the option `--backend cpu`, with the remedy `instead` for whom
/// has no such option.
#[must_use]
pub fn remedied(message: &str, instead: &str) -> String {
    message.replace(", for --backend gpu without a GPU", "").replace("--backend cpu", instead)
}

/// Whether the environment names an adapter that this machine does not have.
fn is_named_in_vain() -> bool {
    named_adapters().iter().any(|(_, is_there)| !is_there)
}

/// Returns `names` in their order, each once and with its number where there are several: `2 x A; B`.
fn counted(names: impl Iterator<Item = String>) -> String {
    let mut counts: Vec<(String, usize)> = Vec::new();
    for name in names {
        match counts.iter_mut().find(|(other, _)| *other == name) {
            Some((_, count)) => *count += 1,
            None => counts.push((name, 1)),
        }
    }
    let told = counts.into_iter().map(|(name, count)| if count > 1 { format!("{count} x {name}") } else { name });
    told.collect::<Vec<_>>().join("; ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_gpu_is_taken_for_work_that_outlasts_its_start_unless_it_is_asked_for() {
        use BackendChoice::{Auto, Cpu, Gpu};
        for seconds in [0.0, 0.9 * GPU_START, 1.1 * GPU_START, f64::INFINITY] {
            assert_eq!((Cpu.for_work(seconds), Gpu.for_work(seconds)), (Cpu, Gpu));
            let decided = if seconds < GPU_START && asked_for().is_empty() { Cpu } else { Auto };
            assert_eq!(Auto.for_work(seconds), decided, "{seconds} s");
        }
    }
}
