//! The adapters of this machine, and which of them are taken: those that are asked for, or a hardware GPU before a
//! software rasteriser. Who has several names them in the environment, for drawing and for computing alike:
//! [`ADAPTER_VARIABLE`]. The first of them draws; all of them solve.

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

/// Environment variable, the same as wgpu's own, with the only adapters that are to be used: parts of their names, or
/// the ends of their addresses ([`AdapterSummary::address`]), with commas between.
pub const ADAPTER_VARIABLE: &str = "WGPU_ADAPTER_NAME";

/// Returns what the environment asks for; nothing if any adapter will do.
pub(crate) fn asked_for() -> Vec<String> {
    let list = std::env::var(ADAPTER_VARIABLE).unwrap_or_default();
    list.split(',').map(str::trim).filter(|part| !part.is_empty()).map(str::to_owned).collect()
}

impl AdapterChoice {
    pub(super) fn takes(&self, adapter: &AdapterSummary, names: &[String]) -> bool {
        match self {
            Self::Hardware => adapter.hardware && adapter.is_among(names),
            Self::Any => adapter.is_among(names),
            Self::This(wanted) => adapter == wanted,
        }
    }

    /// Why none of the adapters that were `found` qualifies, where these `names` are asked for.
    pub(super) fn refusal(&self, found: &[AdapterSummary], names: &[String]) -> GpuError {
        let found: Vec<String> = found.iter().map(ToString::to_string).collect();
        let mut found = if found.is_empty() { "none".to_owned() } else { found.join("; ") };
        if !names.is_empty() {
            let names: Vec<String> = names.iter().map(|name| format!("{name:?}")).collect();
            let names = names.join(" and ");
            found += &format!(" (but {ADAPTER_VARIABLE} asks for {names}: set it to a part of a name, or unset it)");
        }
        match self {
            Self::Hardware => GpuError::NoAdapter { wanted: "hardware", found },
            Self::Any => GpuError::NoAdapter { wanted: "usable", found },
            Self::This(wanted) => GpuError::NotThere { wanted: wanted.to_string(), found },
        }
    }
}

/// One adapter, in words for `doctor` and for a dataset's provenance.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize)]
pub struct AdapterSummary {
    /// Such as `llvmpipe (LLVM 15.0.6, 256 bits)`.
    pub name: String,
    /// Where it is: on the PCI bus, such as `0000:01:00.0`, if the driver says it. Adapters that would not differ
    /// otherwise are counted: `#1`, `#2`.
    pub address: String,
    /// Driver and its version.
    pub driver: String,
    /// `Vulkan`, `Metal` or `Dx12`.
    pub interface: String,
    /// `discrete GPU`, `integrated GPU`, `virtual GPU`, `software` or `unknown`.
    pub kind: &'static str,
    /// True for a GPU made of silicon.
    pub hardware: bool,
    /// Largest buffer that one binding reaches (B).
    #[serde(rename = "binding_limit_bytes")]
    pub binding_limit: u64,
}

impl AdapterSummary {
    fn of(adapter: &wgpu::Adapter) -> Self {
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
            address: info.device_pci_bus_id,
            driver: format!("{} {}", info.driver, info.driver_info).trim().to_owned(),
            interface: format!("{:?}", info.backend),
            kind,
            hardware: preference(info.device_type) < preference(wgpu::DeviceType::Other),
            binding_limit: adapter.limits().max_storage_buffer_binding_size,
        }
    }

    /// Whether `name` is a part of its name, or the end of its address.
    fn is_called(&self, name: &str) -> bool {
        let name = name.to_lowercase();
        self.name.to_lowercase().contains(&name) || (name.contains([':', '#']) && self.address.ends_with(&name))
    }

    /// Whether it is called by one of `names`, or there are none.
    fn is_among(&self, names: &[String]) -> bool {
        names.is_empty() || names.iter().any(|name| self.is_called(name))
    }

    /// Whether it solves together with those that are `taken` already: it is of their kind or, as they are, `named`,
    /// and not one of them by another interface or driver.
    #[must_use]
    pub fn joins<'a>(&self, taken: impl IntoIterator<Item = &'a Self>, named: bool) -> bool {
        taken.into_iter().all(|other| {
            self.interface == other.interface
                && (named || self.kind == other.kind)
                && (self.address.is_empty() || self.address != other.address)
        })
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
    let names = asked_for();
    candidates(&instance()).into_iter().map(|(_, adapter)| adapter).filter(|it| it.is_among(&names)).collect()
}

/// Returns what [`ADAPTER_VARIABLE`] asks for, and whether this machine has an adapter that is called so.
#[must_use]
pub fn named_adapters() -> Vec<(String, bool)> {
    let names = asked_for();
    let found = if names.is_empty() { Vec::new() } else { candidates(&instance()) };
    let is_there = |name: &String| found.iter().any(|(_, adapter)| adapter.is_called(name));
    names.iter().map(|name| (name.clone(), is_there(name))).collect()
}

/// The adapters that `choice` takes, best first.
///
/// # Errors
/// [`GpuError::NoAdapter`] or [`GpuError::NotThere`] where there is none, or one that is named is not there.
pub(super) fn qualified(
    instance: &wgpu::Instance,
    choice: &AdapterChoice,
) -> Result<Vec<(wgpu::Adapter, AdapterSummary)>, GpuError> {
    let mut found = candidates(instance);
    let names = if matches!(choice, AdapterChoice::This(_)) { Vec::new() } else { asked_for() };
    let missing: Vec<String> =
        names.iter().filter(|name| !found.iter().any(|(_, adapter)| adapter.is_called(name))).cloned().collect();
    let seen: Vec<AdapterSummary> = found.iter().map(|(_, adapter)| adapter.clone()).collect();
    found.retain(|(_, adapter)| choice.takes(adapter, &names));
    if found.is_empty() || !missing.is_empty() {
        return Err(choice.refusal(&seen, if missing.is_empty() { &names } else { &missing }));
    }
    Ok(found)
}

/// All adapters of this machine, best first.
fn candidates(instance: &wgpu::Instance) -> Vec<(wgpu::Adapter, AdapterSummary)> {
    let mut found = pollster::block_on(instance.enumerate_adapters(wgpu::Backends::PRIMARY));
    found.sort_by_key(|adapter| preference(adapter.get_info().device_type));
    let mut summaries: Vec<AdapterSummary> = found.iter().map(AdapterSummary::of).collect();
    tell_apart(&mut summaries);
    found.into_iter().zip(summaries).collect()
}

/// Counts adapters that would not differ otherwise.
fn tell_apart(adapters: &mut [AdapterSummary]) {
    let alike = adapters.to_vec();
    for (k, adapter) in adapters.iter_mut().enumerate() {
        if alike.iter().filter(|other| **other == alike[k]).count() > 1 {
            let number = alike[..=k].iter().filter(|other| **other == alike[k]).count();
            adapter.address += &format!("#{number}");
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn adapter(name: &str, address: &str, hardware: bool) -> AdapterSummary {
        AdapterSummary {
            name: name.into(),
            address: address.into(),
            driver: "driver 1".into(),
            interface: "Vulkan".into(),
            kind: if hardware { "discrete GPU" } else { "software" },
            hardware,
            binding_limit: 1 << 27,
        }
    }

    fn names(names: &[&str]) -> Vec<String> {
        names.iter().map(ToString::to_string).collect()
    }

    #[test]
    fn the_adapters_that_the_environment_names_are_the_only_ones_taken() {
        let all = [
            adapter("GeForce", "0000:01:00.0", true),
            adapter("GeForce", "0000:11:00.0", true),
            adapter("llvmpipe (LLVM)", "", false),
        ];
        let taken = |choice: &AdapterChoice, list: &[&str]| all.each_ref().map(|it| choice.takes(it, &names(list)));
        assert_eq!(taken(&AdapterChoice::Any, &[]), [true; 3]);
        assert_eq!(taken(&AdapterChoice::Any, &["LLVMpipe"]), [false, false, true]);
        assert_eq!(taken(&AdapterChoice::Any, &["Radeon"]), [false; 3]);
        assert_eq!(taken(&AdapterChoice::Any, &["geforce"]), [true, true, false]);
        assert_eq!(taken(&AdapterChoice::Any, &["11:00.0"]), [false, true, false]);
        assert_eq!(taken(&AdapterChoice::Any, &["0000:01:00.0", "llvmpipe"]), [true, false, true]);
        // A number is no address.
        assert_eq!(taken(&AdapterChoice::Any, &["0"]), [false; 3]);
        assert_eq!(taken(&AdapterChoice::Hardware, &["llvmpipe"]), [false; 3]);
        // Who names one in the window knows best.
        assert_eq!(taken(&AdapterChoice::This(all[1].clone()), &["llvmpipe"]), [false, true, false]);
        let refusal = AdapterChoice::Any.refusal(&all, &names(&["Radeon", "Arc"])).to_string();
        for part in ["GeForce (discrete GPU", "llvmpipe (LLVM)", "WGPU_ADAPTER_NAME", "\"Radeon\" and \"Arc\""] {
            assert!(refusal.contains(part), "{refusal}");
        }
    }

    #[test]
    fn adapters_that_would_not_differ_are_counted() {
        let mut all = [adapter("A", "", true), adapter("B", "", true), adapter("A", "", true), adapter("A", "1", true)];
        tell_apart(&mut all);
        assert_eq!(all.each_ref().map(|it| it.address.as_str()), ["#1", "", "#2", "1"]);
        assert!(all[2].is_called("#2") && !all[0].is_called("#2"));
    }

    #[test]
    fn those_solve_together_that_are_of_one_kind_or_named() {
        let first = adapter("GeForce", "0000:01:00.0", true);
        let joins = |other: &AdapterSummary, named| other.joins([&first], named);
        assert!(first.joins([], false));
        assert!(joins(&adapter("Radeon", "0000:02:00.0", true), false));
        assert_eq!([false, true].map(|named| joins(&adapter("llvmpipe", "", false), named)), [false, true]);
        // The same card through another driver, and through another interface.
        assert!(!joins(&AdapterSummary { driver: "driver 2".into(), ..first.clone() }, true));
        let elsewhere = AdapterSummary { interface: "Dx12".into(), address: String::new(), ..first.clone() };
        assert!(!joins(&elsewhere, true));
    }
}
