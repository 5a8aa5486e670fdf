//! Threads that are begun.

use crate::{Error, error};
use std::{
    error::Error as _,
    fmt::Display,
    fs,
    sync::OnceLock,
    thread::{Builder, JoinHandle, Scope, ScopedJoinHandle},
};

/// Begins the threads that all work shares, unless they are there: where the system gives none, this is an error here
/// and a panic later. They are begun but once.
///
/// # Errors
/// As for [`spawn`].
pub fn begin_shared() -> Result<(), Error> {
    static BEGUN: OnceLock<Result<(), Error>> = OnceLock::new();
    let begin = || match rayon::ThreadPoolBuilder::new().build_global() {
        // Without a cause, they are there.
        Err(why) if why.source().is_some() => Err(refused(why)),
        _ => Ok(()),
    };
    BEGUN.get_or_init(begin).clone()
}

/// Begins `work` in a thread called `name`.
///
/// # Errors
/// When the system gives none: its limits, and what to do.
pub fn spawn<T: Send + 'static>(name: &str, work: impl FnOnce() -> T + Send + 'static) -> Result<JoinHandle<T>, Error> {
    Builder::new().name(name.into()).spawn(work).map_err(refused)
}

/// Begins `work` in a thread called `name` that ends before `scope` does.
///
/// # Errors
/// As for [`spawn`].
pub(crate) fn spawn_scoped<'scope, T: Send + 'scope>(
    scope: &'scope Scope<'scope, '_>,
    name: &str,
    work: impl FnOnce() -> T + Send + 'scope,
) -> Result<ScopedJoinHandle<'scope, T>, Error> {
    Builder::new().name(name.into()).spawn_scoped(scope, work).map_err(refused)
}

/// Returns the error of threads that the system refuses because of `why`: the limits that there are, and what to do.
pub fn refused(why: impl Display) -> Error {
    let read = |path: &str| fs::read_to_string(path).unwrap_or_default();
    let limits = limits(&read("/proc/self/limits"), &read("/sys/fs/cgroup/pids.max"));
    error!(
        "the system gives no more threads: {why}{limits}; close other programs, or raise the limits on processes and \
         memory (ulimit -u, ulimit -v)"
    )
}

/// Returns how many threads and processes there may be: `of_process` is `/proc/self/limits`, `of_group` the `pids.max`
/// of the control group.
fn limits(of_process: &str, of_group: &str) -> String {
    let user = of_process.lines().find_map(|line| line.strip_prefix("Max processes")).unwrap_or_default();
    let limits = [(user, "this user (ulimit -u)"), (of_group, "this container (pids.max)")];
    let told = limits.into_iter().filter_map(|(text, whose)| {
        let most: u64 = text.split_whitespace().next()?.parse().ok()?;
        Some(format!("{whose} may have {most}"))
    });
    let told: Vec<String> = told.collect();
    if told.is_empty() { String::new() } else { format!(" ({} threads and processes)", told.join(", ")) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn limits_are_told_where_there_are_some() {
        let of_user =
            |most: &str| format!("Max cpu time    unlimited  unlimited  us\nMax processes   {most}  200  processes\n");
        assert_eq!(limits(&of_user("unlimited"), "max\n"), "");
        assert_eq!(limits("", ""), "");
        let user = "this user (ulimit -u) may have 100";
        assert_eq!(limits(&of_user("100"), "max\n"), format!(" ({user} threads and processes)"));
        let both = format!(" ({user}, this container (pids.max) may have 64 threads and processes)");
        assert_eq!(limits(&of_user("100"), "64\n"), both);
    }
}
