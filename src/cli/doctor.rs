//! `haptize doctor`: what this machine offers, and what to do about what it lacks.
//!
//! Nothing here is needed for correct results except a place to write to. Real-time scheduling and locked memory keep
//! the 1 kHz loop punctual (`play --realtime`).

use super::{Failure, Report};
use crate::{
    device::Kind,
    gpu::{ADAPTER_VARIABLE, AdapterSummary, adapters},
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
    let adapters = adapters();
    let named = std::env::var(ADAPTER_VARIABLE).ok().filter(|name| !name.is_empty() && adapters.is_empty());
    let automatic = match &named {
        Some(_) => "none",
        None if adapters.iter().any(|adapter| adapter.hardware) => "gpu",
        None => "cpu",
    };
    let findings = [writing(), scheduling(), locking()];
    let whole = findings.iter().all(|finding| finding.good || !finding.essential);

    let mut text = String::new();
    writeln!(text, "haptize {} on {} {}", env!("CARGO_PKG_VERSION"), std::env::consts::OS, std::env::consts::ARCH)?;
    writeln!(text, "CPU threads            {threads}")?;
    match adapters.as_slice() {
        [] if named.is_some() => writeln!(
            text,
            "graphics adapters      none whose name contains {:?}, which {ADAPTER_VARIABLE} asks for: set it to a \
             part of a name, or unset it to see all",
            named.as_deref().unwrap_or_default()
        )?,
        [] => writeln!(
            text,
            "graphics adapters      none found: `haptize bake --backend gpu` and `haptize view` need a Vulkan driver, \
             nothing else does"
        )?,
        found => {
            for (rank, adapter) in found.iter().enumerate() {
                writeln!(text, "{:<22} {adapter}", if rank == 0 { "graphics adapters" } else { "" })?;
                writeln!(text, "{:<22} -> {}", "", tier(adapter))?;
            }
            writeln!(
                text,
                "{:<22} (the first is taken; {ADAPTER_VARIABLE}, set to a part of a name, allows only that)",
                ""
            )?;
        }
    }
    writeln!(text, "{:<22} {automatic} (a hardware GPU, else all CPU threads)", "haptize bake takes")?;
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
        "adapters": adapters.iter().map(describe).collect::<Vec<_>>(),
        "automatic_backend": automatic,
        "findings": findings,
        "whole": whole,
    });
    Ok(Report { text, json, whole })
}

/// Part of a bake that an adapter does.
fn tier(adapter: &AdapterSummary) -> &'static str {
    if adapter.double {
        "decides contact or not in f64, and searches forces in f32, which the CPU settles"
    } else {
        "has no f64 in shaders: the CPU decides contact near none, and settles all forces"
    }
}

fn describe(adapter: &AdapterSummary) -> serde_json::Value {
    serde_json::json!({
        "name": adapter.name,
        "kind": adapter.kind,
        "interface": adapter.interface,
        "driver": adapter.driver,
        "hardware": adapter.hardware,
        "binding_limit_bytes": adapter.binding_limit,
        "decides_in_f64": adapter.double,
    })
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

/// May a thread of this process run under a real-time policy? Tried on a thread that ends at once.
#[cfg(target_os = "linux")]
fn scheduling() -> Finding {
    let ask = || {
        let parameters = libc::sched_param { sched_priority: 1 };
        // SAFETY: pid 0 is the calling thread, `parameters` outlives the call, and the thread ends right after it.
        unsafe { libc::sched_setscheduler(0, libc::SCHED_FIFO, &raw const parameters) == 0 }
    };
    let permitted = thread::Builder::new().spawn(ask).is_ok_and(|thread| thread.join().unwrap_or(false));
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
