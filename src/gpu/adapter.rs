//! The adapters of this machine, and which of them is taken: the one that is asked for, or a hardware GPU before a
//! software rasteriser. Who has several names one in the environment, for drawing and for computing alike:
//! [`ADAPTER_VARIABLE`].

use super::GpuError;

/// Which adapters qualify.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum AdapterChoice {
    /// A GPU made of silicon: what automatic choice takes; a software rasteriser is slower than the CPU backend.
    Hardware,
    /// Any adapter, software Vulkan included.
    Any,
    /// This one, of [`adapters`], and no other.
    This(AdapterSummary),
}

/// Environment variable, the same as wgpu's own, with a part of the name of the only adapter that is to be used.
pub const ADAPTER_VARIABLE: &str = "WGPU_ADAPTER_NAME";

/// Returns the request of the environment, if any.
pub(super) fn asked_for() -> Option<String> {
    std::env::var(ADAPTER_VARIABLE).ok().filter(|part| !part.is_empty())
}

/// Whether an adapter called `name` may be used where `part` is asked for.
fn is_called(name: &str, part: Option<&str>) -> bool {
    part.is_none_or(|part| name.to_lowercase().contains(&part.to_lowercase()))
}

impl AdapterChoice {
    pub(super) fn takes(&self, adapter: &AdapterSummary, part: Option<&str>) -> bool {
        match self {
            Self::Hardware => adapter.hardware && is_called(&adapter.name, part),
            Self::Any => is_called(&adapter.name, part),
            Self::This(wanted) => adapter == wanted,
        }
    }

    /// Why none of the adapters that were `found` qualifies.
    pub(super) fn refusal(&self, found: &[String], part: Option<&str>) -> GpuError {
        let mut found = if found.is_empty() { "none".to_owned() } else { found.join("; ") };
        if let Some(part) = part {
            found += &format!(" (but {ADAPTER_VARIABLE} asks for {part:?}: set it to a part of a name, or unset it)");
        }
        match self {
            Self::Hardware => GpuError::NoAdapter { wanted: "hardware", found },
            Self::Any => GpuError::NoAdapter { wanted: "usable", found },
            Self::This(wanted) => GpuError::NotThere { wanted: wanted.to_string(), found },
        }
    }
}

/// One adapter, in words for `doctor` and for a dataset's provenance.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AdapterSummary {
    /// Such as `llvmpipe (LLVM 15.0.6, 256 bits)`.
    pub name: String,
    /// Driver and its version.
    pub driver: String,
    /// `Vulkan`, `Metal` or `Dx12`.
    pub interface: String,
    /// `discrete GPU`, `integrated GPU`, `virtual GPU`, `software` or `unknown`.
    pub kind: &'static str,
    /// True for a GPU made of silicon.
    pub hardware: bool,
    /// Largest buffer that one binding reaches [B].
    pub binding_limit: u64,
    /// Whether shaders may compute in f64: then contact or not is decided on the device, else within a band by the CPU.
    pub double: bool,
}

impl AdapterSummary {
    pub(super) fn of(adapter: &wgpu::Adapter) -> Self {
        let info = adapter.get_info();
        let kind = match info.device_type {
            wgpu::DeviceType::DiscreteGpu => "discrete GPU",
            wgpu::DeviceType::IntegratedGpu => "integrated GPU",
            wgpu::DeviceType::VirtualGpu => "virtual GPU",
            wgpu::DeviceType::Cpu => "software",
            wgpu::DeviceType::Other => "unknown",
        };
        Self {
            name: info.name,
            driver: format!("{} {}", info.driver, info.driver_info).trim().to_owned(),
            interface: format!("{:?}", info.backend),
            kind,
            hardware: preference(info.device_type) < preference(wgpu::DeviceType::Other),
            binding_limit: adapter.limits().max_storage_buffer_binding_size,
            double: adapter.features().contains(wgpu::Features::SHADER_F64),
        }
    }
}

impl std::fmt::Display for AdapterSummary {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} ({}, {}, {})", self.name, self.kind, self.interface, self.driver)
    }
}

/// Lower is better.
fn preference(kind: wgpu::DeviceType) -> u8 {
    match kind {
        wgpu::DeviceType::DiscreteGpu => 0,
        wgpu::DeviceType::IntegratedGpu => 1,
        wgpu::DeviceType::VirtualGpu => 2,
        wgpu::DeviceType::Other => 3,
        wgpu::DeviceType::Cpu => 4,
    }
}

pub(super) fn instance() -> wgpu::Instance {
    wgpu::Instance::new(wgpu::InstanceDescriptor {
        backends: wgpu::Backends::PRIMARY,
        ..wgpu::InstanceDescriptor::new_without_display_handle()
    })
}

/// All adapters of this machine that [`ADAPTER_VARIABLE`] lets be used, best first; empty where there is no driver.
/// Never fails.
#[must_use]
pub fn adapters() -> Vec<AdapterSummary> {
    let part = asked_for();
    let all = candidates(&instance());
    all.iter().map(AdapterSummary::of).filter(|adapter| is_called(&adapter.name, part.as_deref())).collect()
}

pub(super) fn candidates(instance: &wgpu::Instance) -> Vec<wgpu::Adapter> {
    let mut found = pollster::block_on(instance.enumerate_adapters(wgpu::Backends::PRIMARY));
    found.sort_by_key(|adapter| preference(adapter.get_info().device_type));
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_adapter_that_the_environment_names_is_the_only_one_taken() {
        let adapter = |name: &str, hardware| AdapterSummary {
            name: name.into(),
            driver: "driver 1".into(),
            interface: "Vulkan".into(),
            kind: if hardware { "discrete GPU" } else { "software" },
            hardware,
            binding_limit: 1 << 27,
            double: true,
        };
        let [fast, soft] = [adapter("GeForce", true), adapter("llvmpipe (LLVM)", false)];
        let taken = |choice: &AdapterChoice, part| [&fast, &soft].map(|adapter| choice.takes(adapter, part));
        assert_eq!(taken(&AdapterChoice::Any, None), [true, true]);
        assert_eq!(taken(&AdapterChoice::Any, Some("LLVMpipe")), [false, true]);
        assert_eq!(taken(&AdapterChoice::Any, Some("Radeon")), [false, false]);
        assert_eq!(taken(&AdapterChoice::Hardware, Some("llvmpipe")), [false, false]);
        // Who names one in the window knows best.
        assert_eq!(taken(&AdapterChoice::This(fast.clone()), Some("llvmpipe")), [true, false]);
        let refusal = AdapterChoice::Any.refusal(&[fast.to_string(), soft.to_string()], Some("Radeon")).to_string();
        for part in ["GeForce (discrete GPU", "llvmpipe (LLVM)", "WGPU_ADAPTER_NAME", "\"Radeon\""] {
            assert!(refusal.contains(part), "{refusal}");
        }
    }
}
