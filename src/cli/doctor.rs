//! `haptize doctor`: what this machine offers, and what to do about what it lacks.
//!
//! Nothing here is needed for correct results except a place to write to. Real-time scheduling and locked memory keep
//! the 1 kHz loop punctual (`play --realtime`).

use super::{
    Failure,
    device::Listed,
    report::{Describe, Report, Text},
};
use crate::{
    device::Kind,
    gpu::{ADAPTER_VARIABLE, AdapterSummary, adapters, named_adapters},
};
use serde::Serialize;
use std::thread;

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

/// What this machine offers.
#[derive(Serialize)]
struct Machine {
    version: &'static str,
    system: &'static str,
    architecture: &'static str,
    /// Threads of the CPU.
    threads: usize,
    #[serde(flatten)]
    graphics: Graphics,
    /// Backend of long bakes.
    automatic_backend: &'static str,
    findings: [Finding; 3],
    devices: Vec<Listed>,
    whole: bool,
}

/// Looks at the machine.
pub fn run(_: &Arguments) -> Result<Report, Failure> {
    let graphics = Graphics::look();
    let findings = [writing(), scheduling(), locking()];
    let machine = Machine {
        version: env!("CARGO_PKG_VERSION"),
        system: std::env::consts::OS,
        architecture: std::env::consts::ARCH,
        threads: thread::available_parallelism().map_or(1, usize::from),
        automatic_backend: graphics.automatic(),
        graphics,
        whole: findings.iter().all(|finding| finding.good || !finding.essential),
        findings,
        devices: Kind::ALL.into_iter().filter(|kind| *kind != Kind::Simulated).map(Listed::look).collect(),
    };
    Report::of(&machine, machine.whole)
}

impl Describe for Machine {
    fn describe(&self, text: &mut Text) {
        let Self { version, system, architecture, threads, graphics, automatic_backend, findings, devices, .. } = self;
        text.line(format_args!("haptize {version} on {system} {architecture}"));
        text.row("CPU threads", threads);
        graphics.describe(text);
        text.row(
            "haptize bake takes",
            match *automatic_backend {
                "gpu" if graphics.are_named => "gpu",
                "gpu" => "gpu; all CPU threads for what they solve in seconds",
                "cpu" => "cpu, all threads; hardware GPUs for long bakes, where there are any",
                none => none,
            },
        );
        for Finding { subject, good, seen, remedy, .. } in findings {
            text.row(*subject, seen);
            if !good {
                text.row("", format_args!("-> {remedy}"));
            }
        }
        for (rank, Listed { kind, found, .. }) in devices.iter().enumerate() {
            let seen = if found.places.is_empty() { "not found".into() } else { found.places.join(", ") };
            text.row(if rank == 0 { "haptic devices" } else { "" }, format_args!("{kind}: {seen}"));
            found.missing.iter().for_each(|missing| text.row("", format_args!("-> {missing}")));
        }
    }
}

/// What there is to draw and to compute on.
#[derive(Serialize)]
struct Graphics {
    /// Best first.
    adapters: Vec<Adapter>,
    /// Whether the environment names adapters.
    #[serde(skip)]
    are_named: bool,
    /// Adapters that the environment names, and this machine does not have.
    #[serde(skip)]
    missing: Vec<String>,
}

#[derive(Serialize)]
struct Adapter {
    #[serde(flatten)]
    summary: AdapterSummary,
    /// Whether it solves when `haptize bake` takes GPUs.
    solves: bool,
}

impl Graphics {
    fn look() -> Self {
        let names = named_adapters();
        let mut found: Vec<Adapter> = Vec::new();
        for summary in adapters() {
            let taken = found.iter().filter(|adapter| adapter.solves).map(|adapter| &adapter.summary);
            let solves = summary.joins(taken, !names.is_empty());
            found.push(Adapter { summary, solves });
        }
        let are_named = !names.is_empty();
        let missing = names.into_iter().filter(|(_, is_there)| !is_there).map(|(name, _)| name).collect();
        Self { adapters: found, are_named, missing }
    }

    /// The backend that `haptize bake` takes by itself for long bakes.
    fn automatic(&self) -> &'static str {
        match () {
            () if !self.missing.is_empty() => "none",
            () if self.adapters.iter().any(|adapter| adapter.summary.hardware) => "gpu",
            () => "cpu",
        }
    }

    /// Ranks of those that solve, from one.
    fn solving(&self) -> Vec<String> {
        let ranks = self.adapters.iter().enumerate().filter(|(_, adapter)| adapter.solves);
        ranks.map(|(rank, _)| (rank + 1).to_string()).collect()
    }
}

impl Describe for Graphics {
    fn describe(&self, text: &mut Text) {
        let Self { adapters, missing, .. } = self;
        let label = "graphics adapters";
        if adapters.is_empty() && missing.is_empty() {
            let none =
                "none found: `haptize bake --backend gpu` and `haptize view` need a Vulkan driver, nothing else does";
            return text.row(label, none);
        }
        let remedy = "set it to parts of names or to addresses, with commas between, or unset it to see all";
        let missing =
            missing.iter().map(|name| format!("none is called {name:?}, which {ADAPTER_VARIABLE} asks for: {remedy}"));
        let found = adapters.iter().map(|Adapter { summary, .. }| match summary.address.as_str() {
            "" => summary.to_string(),
            address => format!("{summary} at {address}"),
        });
        text.rows(label, missing.chain(found));
        let solving = self.solving();
        let solving = match solving.len() {
            0 | 1 => "the first is taken".to_owned(),
            all if all == adapters.len() => "the first draws, all solve".to_owned(),
            several => format!("the first draws, {several} solve: {}", solving.join(", ")),
        };
        let list = "set to parts of names or to addresses, allows only those";
        text.row("", format_args!("({solving}; {ADAPTER_VARIABLE}, {list})"));
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
