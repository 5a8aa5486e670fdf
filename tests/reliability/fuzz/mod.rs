//! Fuzzing without a special compiler: every reader gets mutated input, from a fixed seed.
//!
//! Each target maps an input to an outcome, which is the kind of error or the success. Inputs with a new outcome join
//! the corpus, so that mutation goes on from them; `tests/fuzz.sh` compiles the library with counters, and then so do
//! inputs that run new code. An execution fails if it panics, takes longer than [`LONGEST`], or takes more memory than
//! [`MOST_BYTES`]; its input is kept then, and belongs into `corpus/` once the cause is mended.
//!
//! `HAPTIZE_FUZZ` sets the number of executions of each target. With `HAPTIZE_FUZZ_BY_KINDS` new code is counted but
//! not followed, to see what that gains.

mod coverage;
mod mutate;
mod targets;

use coverage::Coverage;
pub use mutate::Random;
use std::{
    alloc::{GlobalAlloc, Layout, System},
    cell::Cell,
    collections::HashSet,
    panic::{AssertUnwindSafe, catch_unwind},
    path::{Path, PathBuf},
    sync::{Mutex, mpsc},
    time::{Duration, Instant},
};
use targets::Target;

/// Executions of each target unless the environment says otherwise: some seconds.
const EXECUTIONS: usize = 20_000;
/// Longest execution, in time of the processor: a busy machine takes longer for it.
const LONGEST: Duration = Duration::from_secs(1);
/// When an execution is taken for endless: its input is kept, and the process ends.
const ENDLESS: Duration = Duration::from_secs(30);
/// Most memory that an execution takes at once, on its thread (bytes).
const MOST_BYTES: usize = 64 << 20;
/// Longest input (bytes).
const LONGEST_INPUT: usize = 1 << 15;
/// Most inputs of a target's corpus.
const MOST_INPUTS: usize = 2000;

thread_local! {
    /// Memory that this thread has taken and not given back (bytes); negative where others gave it theirs.
    static TAKEN: Cell<isize> = const { Cell::new(0) };
    /// Greatest value of it.
    static PEAK: Cell<isize> = const { Cell::new(0) };
}

struct Watched;

impl Watched {
    fn count(bytes: isize) {
        let taken = TAKEN.get() + bytes;
        TAKEN.set(taken);
        PEAK.set(PEAK.get().max(taken));
    }
}

// SAFETY: hands every call on to the system's allocator.
unsafe impl GlobalAlloc for Watched {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        Self::count(layout.size() as isize);
        unsafe { System.alloc(layout) }
    }
    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        Self::count(-(layout.size() as isize));
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Watched = Watched;

/// An execution that does what none may.
#[derive(Debug, PartialEq)]
enum Offence {
    Panic,
    Slow(Duration),
    Greedy(usize),
}

/// Time for which a processor has worked on this thread.
#[cfg(unix)]
fn worked() -> Duration {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
    Duration::new(time.tv_sec as u64, time.tv_nsec as u32)
}

/// Elsewhere the time that has gone by.
#[cfg(not(unix))]
fn worked() -> Duration {
    static BEGAN: std::sync::LazyLock<Instant> = std::sync::LazyLock::new(Instant::now);
    BEGAN.elapsed()
}

/// Runs `target` on `input`, and returns its outcome.
fn execute(target: &Target, file: &Path, input: &[u8]) -> Result<String, Offence> {
    let before = TAKEN.get();
    PEAK.set(before);
    let began = worked();
    let outcome = catch_unwind(AssertUnwindSafe(|| (target.run)(file, input))).map_err(|_| Offence::Panic)?;
    let time = worked().saturating_sub(began);
    let bytes = usize::try_from(PEAK.get() - before).unwrap_or(0);
    if time > LONGEST {
        Err(Offence::Slow(time))
    } else if bytes > MOST_BYTES {
        Err(Offence::Greedy(bytes))
    } else {
        Ok(outcome)
    }
}

/// What an outcome says without what it quotes from the input: the first words of its first line, behind the file's
/// name.
fn kind(outcome: &str) -> String {
    let line = outcome.lines().next().unwrap_or_default();
    let said = line.split_once(": ").map_or(line, |(_, said)| said);
    let unquoted: String = said.split(['"', '`', '\'']).step_by(2).collect();
    let words = unquoted.split_whitespace().filter(|word| word.bytes().all(|byte| byte.is_ascii_lowercase()));
    words.take(8).collect::<Vec<_>>().join(" ")
}

/// Files of the corpus, by name so that every run takes them alike.
fn corpus(name: &str) -> Vec<Vec<u8>> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/reliability/corpus").join(name);
    let mut files: Vec<PathBuf> =
        std::fs::read_dir(folder).into_iter().flatten().map(|entry| entry.unwrap().path()).collect();
    files.sort();
    files.iter().map(|file| std::fs::read(file).unwrap()).collect()
}

/// Keeps an input that offends, and fails the test.
fn fail(target: &Target, input: &[u8], offence: &Offence) -> ! {
    let kept = std::env::temp_dir().join(format!("haptize-fuzz-{}", target.name));
    std::fs::write(&kept, input).unwrap();
    panic!("{}: {offence:?}; the input is {}", target.name, kept.display());
}

/// What executions of a target reached.
struct Reached {
    /// Kinds of outcomes.
    kinds: usize,
    /// Blocks of the code that ran, and all there are; the first of them with the seeds alone.
    blocks: [usize; 3],
    /// Inputs that were mutated in the end.
    inputs: usize,
}

/// Runs a target on its seeds, and then on what is made of them.
fn fuzz(target: &Target, executions: usize) -> Reached {
    let memory = Path::new("/dev/shm");
    let folder = if memory.is_dir() { tempfile::tempdir_in(memory) } else { tempfile::tempdir() }.unwrap();
    let file = folder.path().join("input").with_extension(target.extension);
    let mut random = Random::new(22);
    let mut inputs = corpus(target.name);
    inputs.extend((target.seeds)());
    assert!(!inputs.is_empty(), "{} has nothing to mutate", target.name);
    let seeds = inputs.len();
    let mut of_seeds = 0;
    let mut kinds = HashSet::new();
    let mut coverage = Coverage::begin();
    let by_coverage = std::env::var_os("HAPTIZE_FUZZ_BY_KINDS").is_none();
    // An endless execution cannot be stopped: another thread watches that inputs follow one another.
    let at_hand = Mutex::new(Vec::new());
    let (sender, beats) = mpsc::channel();
    std::thread::scope(|scope| {
        let watched = &at_hand;
        scope.spawn(move || {
            loop {
                match beats.recv_timeout(ENDLESS) {
                    Ok(()) => (),
                    Err(mpsc::RecvTimeoutError::Disconnected) => break,
                    Err(mpsc::RecvTimeoutError::Timeout) => {
                        let kept = std::env::temp_dir().join(format!("haptize-fuzz-{}", target.name));
                        std::fs::write(&kept, &*watched.lock().unwrap()).unwrap();
                        eprintln!("{}: endless; the input is {}", target.name, kept.display());
                        std::process::abort();
                    }
                }
            }
        });
        // Dropped when the executions end, however they do.
        let sender = sender;
        for execution in 0..executions {
            let input = match inputs.get(execution).filter(|_| execution < seeds) {
                Some(input) => input.clone(),
                None => {
                    let (chosen, other) = (random.below(inputs.len()), random.below(inputs.len()));
                    let mut input = (target.mutate)(&mut random, &inputs[chosen], &inputs[other]);
                    input.truncate(LONGEST_INPUT);
                    input
                }
            };
            at_hand.lock().unwrap().clone_from(&input);
            sender.send(()).unwrap();
            let outcome = execute(target, &file, &input).unwrap_or_else(|offence| fail(target, &input, &offence));
            let is_new = (coverage.take() && by_coverage) | kinds.insert(kind(&outcome));
            if execution < seeds {
                of_seeds = coverage.blocks().0;
            } else if is_new && inputs.len() < MOST_INPUTS {
                inputs.push(input);
            }
        }
    });
    let (run, all) = coverage.blocks();
    Reached { kinds: kinds.len(), blocks: [of_seeds, run, all], inputs: inputs.len() }
}

/// Executions that are asked for.
fn executions() -> usize {
    std::env::var("HAPTIZE_FUZZ").map_or(EXECUTIONS, |count| count.parse().unwrap())
}

fn hold(target: &Target) {
    let began = Instant::now();
    let executions = executions();
    let Reached { kinds, blocks: [seeds, run, all], inputs } = fuzz(target, executions);
    let covered = if all > 0 { format!(", {seeds} blocks with its seeds, {run} of {all}") } else { String::new() };
    eprintln!(
        "{}: {executions} executions, {kinds} kinds of outcomes{covered}, {inputs} inputs, {:.0?}",
        target.name,
        began.elapsed()
    );
    // Who follows new code sees fewer kinds, and more code than that of the seeds.
    assert!(
        kinds >= target.kinds || run > seeds,
        "{}: only {kinds} kinds of outcomes: mutation reaches less than it did",
        target.name
    );
}

macro_rules! targets {
    ($($name:ident: $target:expr;)*) => {
        $(#[test]
        fn $name() {
            hold(&$target);
        })*
    };
}

targets! {
    datasets: targets::DATASETS;
    sparse_stores: targets::STORES;
    scenes: targets::SCENES;
    obj_meshes: targets::OBJ;
    ply_meshes: targets::PLY;
    stl_meshes: targets::STL;
    gmsh_meshes: targets::MSH;
    gltf_meshes: targets::GLTF;
    collada_meshes: targets::COLLADA;
    vtk_meshes: targets::VTK;
    vtk_meshes_in_xml: targets::VTU;
    tetgen_meshes: targets::TETGEN;
    medit_meshes: targets::MEDIT;
    robots: targets::ROBOTS;
    joint_states_in_mcap: targets::MCAP;
    device_mappings: targets::DEVICES;
    replies_of_devices: targets::REPLIES;
    frames_of_the_inverse3: targets::FRAMES;
    scan_logs: targets::LOGS;
    column_mappings_and_tables: targets::MAPPINGS;
    recordings: targets::RECORDINGS;
    motions: targets::MOTIONS;
}

#[test]
fn offences_are_seen() {
    let with = |run| execute(&Target { run, ..targets::MOTIONS }, Path::new("none"), b"");
    assert_eq!(with(|_, _| "fine".into()), Ok("fine".into()));
    assert_eq!(with(|_, _| panic!("seen")), Err(Offence::Panic));
    let slow = with(|_, _| {
        let began = worked();
        while worked() - began <= LONGEST {}
        String::new()
    });
    assert!(matches!(slow, Err(Offence::Slow(_))));
    let greedy = with(|_, _| format!("{}", vec![0_u8; MOST_BYTES + 1].len()));
    assert!(matches!(greedy, Err(Offence::Greedy(_))));
    let slices = with(|_, _| {
        let all: Vec<_> = (0..65).map(|_| vec![0_u8; 1 << 20]).collect();
        all.len().to_string()
    });
    assert!(matches!(slices, Err(Offence::Greedy(_))), "{slices:?}");
}
