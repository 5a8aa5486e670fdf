//! The real-time thread's clock: absolute deadlines, and what the system grants it.
//!
//! A deadline is slept towards with an absolute timer, which does not drift, up to [`SPIN`] before it, and then spun
//! for: waking up takes the system some ten microseconds, spinning takes none.

use std::time::Duration;

/// Spun before a deadline: an idle Linux wakes a thread within this time nearly always (half of them within 5 us).
const SPIN: Duration = Duration::from_micros(60);

/// Waits until `deadline`, in time since the clock's origin, and returns the time it is then. `spins`: whether the
/// processor is kept busy before it.
pub fn wait_until(deadline: Duration, spins: bool) -> Duration {
    sleep_until(if spins { deadline.saturating_sub(SPIN) } else { deadline });
    loop {
        let now = now();
        if now >= deadline {
            return now;
        }
        std::hint::spin_loop();
    }
}

/// Asks the system for a real-time priority for this thread and for the process's memory to stay in place. Returns what
/// was not granted, and how to have it. A thread that stays an ordinary one at least takes short turns at the
/// processor, which everybody may ask for: when it wakes up it then comes before those that have longer ones.
pub fn ask_for_real_time() -> Vec<String> {
    let mut refused = Vec::new();
    if let Err(reason) = raise_priority() {
        take_short_turns();
        refused.push(format!(
            "no real-time priority ({reason}): expect late ticks; allow it by `ulimit -r 80` or CAP_SYS_NICE"
        ));
    }
    if let Err(reason) = lock_memory() {
        refused.push(format!(
            "memory is not locked ({reason}): page faults may delay ticks; allow it by `ulimit -l unlimited`"
        ));
    }
    refused
}

/// Time that the hypervisor has taken from the processors of this virtual machine since its start (s), in steps of a
/// hundredth; `None` where the system does not count it.
pub fn stolen() -> Option<f64> {
    let text = std::fs::read_to_string("/proc/stat").ok()?;
    // Of all processors together: user, nice, system, idle, iowait, irq, softirq, steal.
    let steps: f64 = text.lines().next()?.split_ascii_whitespace().nth(8)?.parse().ok()?;
    Some(steps / counter_rate())
}

#[cfg(target_os = "linux")]
mod system {
    use rustix::{
        mm::{MlockAllFlags, mlockall, munlockall},
        param::clock_ticks_per_second,
        process::getpriority_process,
        thread::clock_nanosleep_absolute,
        time::{ClockId, Timespec, clock_gettime},
    };
    use std::{io, time::Duration};

    /// Above ordinary real-time threads (50), below the kernel's own (99).
    const PRIORITY: libc::c_int = 80;

    pub fn now() -> Duration {
        let time = clock_gettime(ClockId::Monotonic);
        Duration::new(time.tv_sec.unsigned_abs(), time.tv_nsec.unsigned_abs() as u32)
    }

    pub fn sleep_until(deadline: Duration) {
        let time = Timespec { tv_sec: deadline.as_secs().cast_signed(), tv_nsec: deadline.subsec_nanos().into() };
        // An interrupted sleep ends early; the caller spins for the rest.
        let _ = clock_nanosleep_absolute(ClockId::Monotonic, &time);
    }

    /// Gives the calling thread a real-time priority.
    pub fn raise_priority() -> io::Result<()> {
        let parameter = libc::sched_param { sched_priority: PRIORITY };
        // SAFETY: `parameter` is valid for reading; the thread is the calling one.
        match unsafe { libc::pthread_setschedparam(libc::pthread_self(), libc::SCHED_FIFO, &raw const parameter) } {
            0 => Ok(()),
            number => Err(io::Error::from_raw_os_error(number)),
        }
    }

    /// The shortest turn that Linux grants (ns); a tick is far shorter.
    const TURN: u64 = 100_000;

    /// Known to Linux 6.12 and newer; others refuse it, and nothing changes.
    pub fn take_short_turns() {
        // SAFETY: zero is valid for each of these numbers.
        let mut wanted: libc::sched_attr = unsafe { std::mem::zeroed() };
        (wanted.size, wanted.sched_runtime) = (size_of::<libc::sched_attr>() as u32, TURN);
        wanted.sched_nice = getpriority_process(None).unwrap_or(0);
        // SAFETY: `wanted` is valid for reading and holds its own size; the thread is the calling one. The policy is
        // the ordinary one, number zero.
        unsafe { libc::syscall(libc::SYS_sched_setattr, 0, &raw const wanted, 0) };
    }

    pub fn lock_memory() -> io::Result<()> {
        // Only what is mapped now: locking future mappings, too, would make allocations elsewhere in the process fail
        // once the limit is reached.
        Ok(mlockall(MlockAllFlags::CURRENT)?)
    }

    pub fn counter_rate() -> f64 {
        clock_ticks_per_second() as f64
    }

    pub fn unlock_memory() {
        // It fails for nothing that one could mend.
        let _ = munlockall();
    }
}

#[cfg(not(target_os = "linux"))]
mod system {
    use std::{
        io,
        sync::OnceLock,
        time::{Duration, Instant},
    };

    static ORIGIN: OnceLock<Instant> = OnceLock::new();

    pub fn now() -> Duration {
        ORIGIN.get_or_init(Instant::now).elapsed()
    }

    pub fn sleep_until(deadline: Duration) {
        std::thread::sleep(deadline.saturating_sub(now()));
    }

    pub fn raise_priority() -> io::Result<()> {
        Err(io::ErrorKind::Unsupported.into())
    }

    pub fn take_short_turns() {}

    pub fn counter_rate() -> f64 {
        100.0
    }

    pub fn lock_memory() -> io::Result<()> {
        Err(io::ErrorKind::Unsupported.into())
    }

    pub fn unlock_memory() {}
}

use system::{counter_rate, lock_memory, take_short_turns};
pub use system::{now, raise_priority, sleep_until, unlock_memory};
