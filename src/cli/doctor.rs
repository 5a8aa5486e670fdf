//! `haptize doctor`: what this machine offers, and what to do about what it lacks.
//!
//! Nothing here is needed for correct results except a place to write to. Real-time scheduling and locked memory keep
//! the 1 kHz loop punctual (`play --realtime`).

use super::{Failure, Report};
use crate::{
    device::Kind,
    gpu::{ADAPTER_VARIABLE, AdapterSummary, adapters, named_adapters},
};
use serde::Serialize;
use std::{fmt::Write, thread};

/// No arguments of its own.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  haptize doctor
  haptize doctor --json")]
pub struct Arguments {}

/// One thing looked at.
#[derive(Serialize)]
struct Finding {
    /// Subject of the check.
    subject: &'static str,
    /// True where it is as it should be.
    good: bool,
    /// True where haptize cannot work without it.
    essential: bool,
    /// Observation.
    seen: String,
    /// Remedy; empty if nothing is wrong.
    remedy: &'static str,
}

/// Looks at the machine.
pub fn run(_: &Arguments) -> Result<Report, Failure> {
    let threads = thread::available_parallelism().map_or(1, usize::from);
    let graphics = Graphics::look();
    let findings = [writing(), scheduling(), locking()];
    let whole = findings.iter().all(|finding| finding.good || !finding.essential);

    let mut text = String::new();
    writeln!(text, "haptize {} on {} {}", env!("CARGO_PKG_VERSION"), std::env::consts::OS, std::env::consts::ARCH)?;
    writeln!(text, "CPU threads            {threads}")?;
    graphics.tell(&mut text)?;
    let automatic = graphics.automatic();
    let bakes = match automatic {
        "gpu" if graphics.are_named => "gpu",
        "gpu" => "gpu; all CPU threads for what they solve in seconds",
        "cpu" => "cpu, all threads; hardware GPUs for long bakes, where there are any",
        none => none,
    };
    writeln!(text, "{:<22} {bakes}", "haptize bake takes")?;
    for finding in &findings {
        writeln!(text, "{:<22} {}", finding.subject, finding.seen)?;
        if !finding.good {
            writeln!(text, "{:<22} -> {}", "", finding.remedy)?;
        }
    }
    let devices: Vec<(Kind, _)> =
        Kind::ALL.into_iter().filter(|kind| *kind != Kind::Simulated).map(|kind| (kind, kind.find())).collect();
    for (rank, (kind, found)) in devices.iter().enumerate() {
        let head = if rank == 0 { "haptic devices" } else { "" };
        let seen = if found.places.is_empty() { "not found".into() } else { found.places.join(", ") };
        writeln!(text, "{head:<22} {}: {seen}", kind.name())?;
        found.missing.iter().try_for_each(|missing| writeln!(text, "{:<22} -> {missing}", ""))?;
    }
    let devices: Vec<_> =
        devices.iter().map(|(kind, found)| serde_json::json!({ "kind": kind.name(), "found": found })).collect();
    let json = serde_json::json!({
        "devices": devices,
        "version": env!("CARGO_PKG_VERSION"),
        "system": std::env::consts::OS,
        "architecture": std::env::consts::ARCH,
        "threads": threads,
        "adapters": graphics.describe(),
        "automatic_backend": automatic,
        "findings": findings,
        "whole": whole,
    });
    Ok(Report { text, json, whole })
}

/// Lists what there is to draw and to compute on.
struct Graphics {
    /// Best first.
    adapters: Vec<AdapterSummary>,
    /// Whether each solves when `haptize bake` takes GPUs.
    solves: Vec<bool>,
    /// Whether the environment names adapters.
    are_named: bool,
    /// Adapters that the environment names, and this machine does not have.
    missing: Vec<String>,
}

impl Graphics {
    fn look() -> Self {
        let (adapters, names) = (adapters(), named_adapters());
        let mut taken: Vec<&AdapterSummary> = Vec::new();
        let mut solves = Vec::new();
        for adapter in &adapters {
            let joins = adapter.joins(taken.iter().copied(), !names.is_empty());
            if joins {
                taken.push(adapter);
            }
            solves.push(joins);
        }
        let are_named = !names.is_empty();
        let missing = names.into_iter().filter(|(_, is_there)| !is_there).map(|(name, _)| name).collect();
        Self { adapters, solves, are_named, missing }
    }

    /// The backend that `haptize bake` takes by itself for long bakes.
    fn automatic(&self) -> &'static str {
        match () {
            () if !self.missing.is_empty() => "none",
            () if self.adapters.iter().any(|adapter| adapter.hardware) => "gpu",
            () => "cpu",
        }
    }

    fn tell(&self, text: &mut String) -> std::fmt::Result {
        for (rank, name) in self.missing.iter().enumerate() {
            writeln!(
                text,
                "{:<22} none is called {name:?}, which {ADAPTER_VARIABLE} asks for: set it to parts of names or to \
                 addresses, with commas between, or unset it to see all",
                if rank == 0 { "graphics adapters" } else { "" }
            )?;
        }
        if self.adapters.is_empty() && self.missing.is_empty() {
            return writeln!(
                text,
                "graphics adapters      none found: `haptize bake --backend gpu` and `haptize view` need a Vulkan \
                 driver, nothing else does"
            );
        }
        for (rank, adapter) in self.adapters.iter().enumerate() {
            let head = if rank == 0 && self.missing.is_empty() { "graphics adapters" } else { "" };
            let address = if adapter.address.is_empty() { "" } else { " at " };
            writeln!(text, "{head:<22} {adapter}{address}{}", adapter.address)?;
        }
        let solving = match self.solves.iter().filter(|solves| **solves).count() {
            0 | 1 => "the first is taken".to_owned(),
            all if all == self.solves.len() => "the first draws, all solve".to_owned(),
            several => format!("the first draws, {several} solve: {}", self.solving()),
        };
        let list = "set to parts of names or to addresses, allows only those";
        writeln!(text, "{:<22} ({solving}; {ADAPTER_VARIABLE}, {list})", "")
    }

    /// Ranks of those that solve, from one.
    fn solving(&self) -> String {
        let ranks = self.solves.iter().enumerate().filter(|(_, solves)| **solves);
        ranks.map(|(rank, _)| (rank + 1).to_string()).collect::<Vec<_>>().join(", ")
    }

    fn describe(&self) -> Vec<serde_json::Value> {
        let pairs = self.adapters.iter().zip(&self.solves);
        let one = |(adapter, solves): (&AdapterSummary, &bool)| {
            serde_json::json!({
                "name": adapter.name,
                "address": adapter.address,
                "kind": adapter.kind,
                "interface": adapter.interface,
                "driver": adapter.driver,
                "hardware": adapter.hardware,
                "solves": solves,
                "binding_limit_bytes": adapter.binding_limit,
            })
        };
        pairs.map(one).collect()
    }
}

/// Can results be written to the current folder?
fn writing() -> Finding {
    let seen = tempfile::tempfile_in(".").and_then(|mut file| std::io::Write::write_all(&mut file, &[0; 4096]));
    Finding {
        subject: "current folder",
        good: seen.is_ok(),
        essential: true,
        seen: seen.map_or_else(|error| format!("cannot be written: {error}"), |()| "can be written".into()),
        remedy: "change to a folder of yours with free space: results go to ./out unless -o says otherwise",
    }
}

/// May a thread of this process run with the priority of the haptic loop? Tried on a thread that ends at once.
#[cfg(target_os = "linux")]
fn scheduling() -> Finding {
    let asking = thread::Builder::new().spawn(|| crate::control::real_time::raise_priority().is_ok());
    let permitted = asking.is_ok_and(|thread| thread.join().unwrap_or(false));
    Finding {
        subject: "real-time scheduling",
        good: permitted,
        essential: false,
        seen: if permitted { "permitted" } else { "not permitted: ticks of `play --realtime` may be late" }.into(),
        remedy: "add `@realtime - rtprio 80` to /etc/security/limits.d/realtime.conf, join the group `realtime` \
                 (groupadd -f realtime; usermod -aG realtime $USER), log in again",
    }
}

/// Elsewhere than on Linux the loop runs at the normal priority.
#[cfg(not(target_os = "linux"))]
fn scheduling() -> Finding {
    Finding {
        subject: "real-time scheduling",
        good: false,
        essential: false,
        seen: "not used on this system: ticks of `play --realtime` may be late".into(),
        remedy: "use Linux for a punctual 1 kHz loop; everything else works here",
    }
}

/// May this process lock a dataset's worth of memory?
#[cfg(unix)]
fn locking() -> Finding {
    use rustix::process::{Resource, geteuid, getrlimit};
    let limit = if geteuid().is_root() { None } else { getrlimit(Resource::Memlock).current };
    Finding {
        subject: "locked memory",
        good: limit.is_none(),
        essential: false,
        seen: limit.map_or_else(
            || "unlimited".into(),
            |bytes| format!("at most {} KiB: a page fault may delay a tick", bytes / 1024),
        ),
        remedy: "add `@realtime - memlock unlimited` to /etc/security/limits.d/realtime.conf, join the group \
                 `realtime`, log in again",
    }
}

/// Elsewhere than on Unix memory is not locked.
#[cfg(not(unix))]
fn locking() -> Finding {
    Finding {
        subject: "locked memory",
        good: false,
        essential: false,
        seen: "not used on this system: a page fault may delay a tick".into(),
        remedy: "use Linux for a punctual 1 kHz loop; everything else works here",
    }
}
