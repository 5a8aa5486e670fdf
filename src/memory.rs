//! Memory that is left: work that is known to need more is refused before it begins, instead of being ended by the
//! system.

/// More memory is needed than there is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "{} MB of memory are needed, {} MB are left: close other programs, or raise the limit (ulimit -v)",
    .needed.div_ceil(1_000_000), .left / 1_000_000
)]
pub struct Shortage {
    /// Memory that is needed (bytes).
    pub needed: usize,
    /// Memory that is left (bytes).
    pub left: usize,
}

/// Memory below which it is not worth to ask beforehand (bytes): asking takes as long as to take it.
pub const SMALL: usize = 1 << 24;

/// Checks that `needed` bytes are left; passes where the system does not tell.
///
/// # Errors
/// [`Shortage`].
pub fn check(needed: usize) -> Result<(), Shortage> {
    match left() {
        Some(left) if left < needed => Err(Shortage { needed, left }),
        _ => Ok(()),
    }
}

/// Returns the memory that this process may still take: the least of what the system has available, swap included, of
/// what the limit on its address space leaves, and of what its control group leaves (bytes).
#[must_use]
pub fn left() -> Option<usize> {
    let read = |path: &str| std::fs::read_to_string(path).unwrap_or_default();
    let system = available(&read("/proc/meminfo"));
    let space = address_space(&read("/proc/self/limits"), &read("/proc/self/status"));
    let group = control_group(&read("/sys/fs/cgroup/memory.max"), &read("/sys/fs/cgroup/memory.current"));
    [system, space, group].into_iter().flatten().min()
}

/// Memory below which drivers and libraries have been seen to fail without saying why (bytes).
const SCARCE: usize = 1 << 29;

/// Returns that little memory is left, for messages of what fails without saying why: empty where there is enough.
#[must_use]
pub fn scarcity() -> String {
    match left() {
        Some(left) if left < SCARCE => format!(
            " (only {} MB of memory are left, in which a driver may find no room: close other programs, or raise the \
             limit, ulimit -v)",
            left / 1_000_000
        ),
        _ => String::new(),
    }
}

/// Returns the most memory that this process has taken so far, if the system reports it (bytes).
#[must_use]
pub fn greatest() -> Option<usize> {
    kilobytes(&std::fs::read_to_string("/proc/self/status").unwrap_or_default(), "VmHWM")
}

/// Number behind `key` in a text of lines such as `MemFree:  123 kB` (bytes).
fn kilobytes(text: &str, key: &str) -> Option<usize> {
    let line = text.lines().find_map(|line| line.strip_prefix(key))?;
    let number: usize = line.trim_start_matches(':').trim().trim_end_matches("kB").trim().parse().ok()?;
    number.checked_mul(1024)
}

fn available(meminfo: &str) -> Option<usize> {
    Some(kilobytes(meminfo, "MemAvailable")? + kilobytes(meminfo, "SwapFree").unwrap_or(0))
}

fn address_space(limits: &str, status: &str) -> Option<usize> {
    let line = limits.lines().find_map(|line| line.strip_prefix("Max address space"))?;
    let limit: usize = line.split_whitespace().next()?.parse().ok()?;
    Some(limit.saturating_sub(kilobytes(status, "VmSize")?))
}

fn control_group(most: &str, current: &str) -> Option<usize> {
    let (most, current): (usize, usize) = (most.trim().parse().ok()?, current.trim().parse().ok()?);
    Some(most.saturating_sub(current))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_left_is_read_from_what_the_system_tells() {
        let meminfo = "MemTotal:       16000000 kB\nMemAvailable:    2000 kB\nSwapFree:         48 kB\n";
        assert_eq!(available(meminfo), Some(2048 << 10));
        assert_eq!(available(""), None);
        let limits = "Max address space         1048576              unlimited            bytes\n";
        assert_eq!(address_space(limits, "VmSize:\t     512 kB\n"), Some(512 << 10));
        assert_eq!(address_space(limits, "VmSize:\t    9999 kB\n"), Some(0));
        assert_eq!(address_space("Max address space  unlimited  unlimited  bytes", "VmSize: 1 kB"), None);
        assert_eq!(control_group("3000\n", "1000\n"), Some(2000));
        assert_eq!(control_group("max\n", "1000\n"), None);
    }

    #[test]
    fn more_than_any_machine_has_is_refused_with_both_numbers() {
        assert_eq!(check(0), Ok(()));
        #[cfg(target_os = "linux")]
        {
            let refused = check(usize::MAX >> 1).unwrap_err().to_string();
            assert!(refused.starts_with("9223372036855 MB") && refused.contains("MB are left"), "{refused}");
        }
    }
}
