//! `haptize play`: a dataset, or a scene that is solved live, felt by a simulated hand, and the object seen to deform;
//! traces and figures of it.

use super::{
    Failure, interrupt,
    keyboard::Keyboard,
    motion,
    output::{self, Content, Folder, Overwritten, Replaced, Written},
    playback_report::{Beside, PlaybackReport},
    played::{FILES, Played, SNAPSHOTS, describe_session, play, play_timed, ticks, traced, unwritten, write},
    report::{self, Describe, Report, Text},
    tell,
    watch::warn_of_free_space,
};
use crate::{
    dataset::{Dataset, JointLabel, replace_file},
    device::{Address, Device, Guard, Key, Kind, Motion, Recorded, Tally, attach, open},
    gridize::with_energy,
    names::counted,
    render::{
        live::LiveScene,
        passivity::Bound,
        realtime::Options,
        recording::Recording,
        setup::{Setup, border_stiffness, labels},
        timing::Timing,
        trace::{Summary, Tick, Trace},
    },
    report::{self as figures, FIGURES, mcap::McapSession, page::Page, series, twinned::TwinError, write_both},
    scene::Scene,
    sweep::{Clearance, thin_parts},
};
use serde::Serialize;
use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
    sync::Arc,
};

/// Arguments of `haptize play`.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  haptize play sphere.haptize
  haptize play sphere.haptize --motion scrape
  haptize play sphere.haptize --motion hand.csv --seconds 10 --realtime
  haptize play sphere.haptize --record session.csv
  haptize play sphere.haptize --html sphere.html         one page, to be opened by any browser
  haptize play sphere.haptize --vtu sphere_vtu           a series of files for ParaView
  haptize play sphere.haptize --motion session.mcap
  haptize play organ.toml                                nothing baked: contact is solved in every tick
  haptize play sphere.haptize --replay session.csv
  haptize play sponge.haptize --motion scrape --beside sponge_fabric.haptize
  haptize play sponge.haptize --twin sponge_twin.toml    the object is seen, and felt beyond what was measured")]
pub struct Arguments {
    /// A dataset, or a scene: contact is then solved live, in every tick, by the law `rest`, and nothing is baked.
    dataset: PathBuf,
    /// The scene that `haptize twin` made of the same scan: it is seen to deform, and answers where the dataset measured
    /// nothing.
    #[arg(long, value_name = "SCENE", conflicts_with = "beside")]
    twin: Option<PathBuf>,
    /// Motion of the hand: `press` or `scrape` as in the scene, a CSV file of times (s) and joint coordinates, or joint
    /// states in MCAP, such as a session that --record wrote.
    #[arg(long, default_value = "press")]
    motion: String,
    /// Topic of the MCAP file that --motion names; by default the hand's of a session, or the only one.
    #[arg(long, value_name = "NAME", conflicts_with = "replay")]
    topic: Option<String>,
    /// Duration (s); by default that of the motion.
    #[arg(long, allow_negative_numbers = true)]
    seconds: Option<f64>,
    /// Move the device exactly as the motion says, whatever the torque, instead of letting a simulated hand hold it.
    #[arg(long)]
    exact: bool,
    /// Solve in every tick the contact of an object that remembers node by node, in place of the loop's one number a term
    /// of [object.relaxation]: what that is compared with. Slower than time. Of a dataset the contact is that of its
    /// scene.
    #[arg(long, conflicts_with_all = ["device", "realtime"])]
    reference: bool,
    /// A real device instead of a simulated hand, always against the clock: KIND or KIND:PLACE, as `haptize device
    /// list` shows it.
    #[arg(long, value_name = "NAME", conflicts_with_all = ["exact", "beside", "replay"])]
    device: Option<Address>,
    /// Torque only while the space bar is held (a dead-man key).
    #[arg(long, requires = "device")]
    hold_key: bool,
    /// Change the scene's gains that are not passive to the nearest that are, for this session.
    #[arg(long)]
    passive_gains: bool,
    /// Run against the clock, in a real-time thread where permitted, instead of as fast as possible.
    #[arg(long)]
    realtime: bool,
    /// Record the session into this file: all inputs of the loop and all its outputs. A name that ends in .mcap gives
    /// joint states in MCAP, for other programs and for --motion; any other gives a table, which alone can be replayed.
    #[arg(long, value_name = "FILE")]
    record: Option<PathBuf>,
    /// Replay the session in this file and check that it matches bit for bit.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["motion", "seconds", "exact", "realtime", "record"])]
    replay: Option<PathBuf>,
    /// Write the session into this file as a page for a browser, which needs nothing beside it: object, arm, forces and
    /// C-space, turned by the mouse, and the torque against time.
    #[arg(long, value_name = "FILE")]
    html: Option<PathBuf>,
    /// Write object and arm into this folder as a series of VTU files, with displacement and contact force at each node;
    /// session.pvd opens it.
    #[arg(long, value_name = "FOLDER")]
    vtu: Option<PathBuf>,
    /// The folder to write traces and figures to; by default one in `out/` that is named after dataset and motion.
    #[arg(short, long)]
    output: Option<PathBuf>,
    /// Another dataset, played with the same motion: the forces at the ends of both arms are drawn in one figure.
    #[arg(long, value_name = "DATASET", conflicts_with = "replay")]
    beside: Option<PathBuf>,
}

/// Longest session (s): all its ticks are kept in memory, half a gigabyte for each ten minutes at 1 kHz.
const LONGEST: f64 = 3600.0;

/// Plays the dataset or the scene.
pub fn run(arguments: &Arguments) -> Result<Report, Failure> {
    let folder = folder(arguments);
    let Outputs { filled, replaced, earlier_page, filled_series } = Outputs::check(arguments, &folder)?;
    let live = live(arguments)?;
    let twin = arguments.twin.as_deref().map(|path| twin(path, live.is_some())).transpose()?;
    let dataset = Arc::new(match (&live, &twin) {
        (Some(scene), _) => scene.dataset(),
        (None, Some(twin)) => twin.beside(with_energy(Dataset::load(&arguments.dataset)?)),
        (None, None) => Dataset::load(&arguments.dataset)?,
    });
    let setup = match (&live, &twin) {
        (Some(scene), _) => Setup::live(Arc::clone(scene), &dataset),
        (None, Some(twin)) => Setup::twinned(Arc::clone(twin), &dataset),
        (None, None) => Setup::new(&dataset),
    };
    let mut setup = setup.map_err(|error| format!("{}: {error}", arguments.dataset.display()))?;
    if arguments.passive_gains {
        let changes = setup.make_passive(&dataset)?;
        if !changes.is_empty() {
            tell(format_args!("haptize: note: the gains are made passive: {}", changes.join(", ")));
        }
    }
    let notes =
        live.iter().filter_map(|scene| scene.notice()).chain(setup.advice.as_ref().map(|advice| advice.text.as_str()));
    notes.for_each(|note| tell(format_args!("haptize: note: {note}")));
    let clearance = if setup.haptics.source().live().is_some() { None } else { warn_of_free_space(&dataset)? };
    let open_beside = |path| -> Result<Beside<'_>, Failure> {
        let motion = motion::named(&setup, &dataset, &arguments.motion, arguments.topic.as_deref())?;
        Beside::open(path, &setup, motion)
    };
    let beside = arguments.beside.as_deref().map(open_beside).transpose()?;
    let mut told = None;
    let (played, ticks) = traced(&dataset, &folder, |on_tick| match &arguments.replay {
        Some(file) => {
            let (played, line) = replay(&setup, &dataset, file)?;
            played.trace.ticks.iter().for_each(on_tick);
            told = Some(line);
            Ok(played)
        }
        None => perform(&setup, &dataset, arguments, on_tick),
    })?;
    if let Some(timing) = &played.timing {
        timing.refused.iter().for_each(|refused| tell(format_args!("haptize: note: {refused}")));
    }
    let mut files: Vec<PathBuf> = Vec::new();
    let recorded = arguments.record.as_ref().map(|file| output::untaken(file, replaced.as_ref()));
    if let Some(file) = &recorded {
        record(&setup, &dataset, &played, arguments, file)?;
        files.push(file.clone());
    }
    files.push(ticks?);
    let trace = &played.trace;
    let path = || trace.ticks.iter().map(|tick| (tick.proxy, tick.sample.contact)).collect::<Vec<_>>();
    // Before the figures: the threads that draw those left out are held for good.
    let thin_part = match &live {
        Some(scene) => thin_parts::on_path(scene.direct().model(), &path()),
        None => thin_parts::told(&dataset.provenance.notices),
    };
    let page = match &arguments.html {
        Some(file) => {
            let page = Page::session(
                names(arguments).join(": "),
                &dataset,
                &setup.chain,
                trace,
                setup.haptics.source().live(),
            )?;
            files.push(figures::write(file.clone(), page.html()?.as_bytes())?);
            Some(Written { file: file.display().to_string(), replaced: earlier_page })
        }
        None => None,
    };
    let series = match arguments.vtu.as_ref().zip(filled_series) {
        Some((place, filled)) => {
            let written = series::write(place, &dataset, &setup.chain, trace, setup.haptics.source().live())?;
            let file = place.join(series::LIST).display().to_string();
            Some(Series { file, overwritten: filled.close(&written)? })
        }
        None => None,
    };
    let begins_in_contact = trace.ticks.first().is_some_and(|tick| tick.sample.contact);
    files.extend(write(&setup, &dataset, &played, &folder)?);
    let twin = setup.haptics.source().twinned().map(|field| TwinError::along(field, trace));
    if let Some(twin) = &twin {
        files.extend(write_both(&folder, "twin", &twin.draw(trace))?);
    }
    let mut felt = PlaybackReport::new(&arguments.dataset, &dataset, &setup, &played.trace);
    if let Some(beside) = beside {
        felt.beside(beside, played.trace.summary().seconds)?;
        let drawn = felt.draw(&folder, &played.trace)?;
        files.extend(drawn.into_iter().filter(|file| !files.contains(file)).collect::<Vec<_>>());
    }
    if live.is_some() && !trace.ticks.iter().any(|tick| tick.sample.contact) {
        let what = match (arguments.seconds, arguments.motion.as_str()) {
            (Some(_), "press" | "scrape") => "the motion may touch later: leave out --seconds to play it whole",
            _ => "`haptize place SCENE` says how far the object is, and makes a motion that presses",
        };
        tell(format_args!("haptize: nothing touches: the arm has not met the object; {what}"));
    }
    let tally = tally(trace);
    let summary = trace.summary();
    let fault = trace.ticks.iter().find_map(|tick| Some(Fault { time: tick.time, reason: tick.fault?.to_string() }));
    let is_whole = fault.is_none() && tally.stopped.is_none();
    let session = PlayedSession {
        border: (summary.held > 0).then(|| border_stiffness(&setup.scene.haptics, &dataset.grid).to_string()),
        summary,
        notes: setup.exceeded.iter().map(ToString::to_string).collect(),
        bounds: setup.bounds,
        fault,
        replayed: told.is_some(),
        device: arguments.device.as_ref().map(|device| Driven { name: device.to_string(), tally }),
        clearance,
        begins_in_contact,
        thin_part,
        twin,
        felt,
        page,
        series,
        recording: recorded.map(|file| Written {
            file: file.display().to_string(),
            replaced: replaced.filter(|_| Some(&file) == arguments.record.as_ref()),
        }),
        overwritten: filled.close(&files)?,
        files: report::names(&files),
        told,
        joints: trace.joints.clone(),
        timing: played.timing,
        folder: folder.display().to_string(),
    };
    Report::of(&session, is_whole)
}

/// A session that was played.
#[derive(Serialize)]
struct PlayedSession {
    #[serde(flatten)]
    summary: Summary,
    /// Passivity bounds that are exceeded, in words.
    notes: Vec<String>,
    bounds: Vec<Bound>,
    timing: Option<Timing>,
    fault: Option<Fault>,
    /// Whether a recording was replayed.
    replayed: bool,
    device: Option<Driven>,
    /// How near arm and object come where nothing touches.
    clearance: Option<Clearance>,
    /// Whether arm and object touch in the first tick, so that nothing says from which side the arm came.
    begins_in_contact: bool,
    /// What to tell of a part of the object that the arm got through, or gets through somewhere in the dataset.
    #[serde(skip_serializing_if = "Option::is_none")]
    thin_part: Option<String>,
    /// What the twin of a real object errs by.
    #[serde(skip_serializing_if = "Option::is_none")]
    twin: Option<TwinError>,
    #[serde(flatten)]
    felt: PlaybackReport,
    files: Vec<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    recording: Option<Written>,
    #[serde(skip_serializing_if = "Option::is_none")]
    page: Option<Written>,
    #[serde(skip_serializing_if = "Option::is_none")]
    series: Option<Series>,
    #[serde(flatten)]
    overwritten: Overwritten,
    /// What the replay has shown.
    #[serde(skip)]
    told: Option<String>,
    #[serde(skip)]
    joints: Vec<JointLabel>,
    /// Stiffness with which the border of the range holds the device, where it does.
    #[serde(skip)]
    border: Option<String>,
    /// Where traces and figures are.
    #[serde(skip)]
    folder: String,
}

/// When the torque went to zero (s), and why.
#[derive(Serialize)]
struct Fault {
    time: f64,
    reason: String,
}

/// A real device, and how often it was clamped and stopped.
#[derive(Serialize)]
struct Driven {
    name: String,
    tally: Tally,
}

/// A series of VTU files.
#[derive(Serialize)]
struct Series {
    /// The one that names all others.
    file: String,
    #[serde(flatten)]
    overwritten: Overwritten,
}

impl Describe for PlayedSession {
    fn describe(&self, text: &mut Text) {
        self.told.iter().for_each(|line| text.line(line));
        describe_session(text, "", &self.summary, &self.joints);
        if let Some(stiffness) = &self.border {
            text.row("border", format_args!("holds the device with the coupling's stiffness Kvc: {stiffness}"));
        }
        if self.begins_in_contact {
            let what = "the session begins in contact, which is with the closest surface, from whichever side the arm came: \
                        begin in free space";
            text.row("note", what);
        }
        self.thin_part.iter().for_each(|told| text.row("note", told));
        if let Some(TwinError { factor, rms, .. }) = &self.twin {
            let Summary { twin_ticks, twin_alone, .. } = &self.summary;
            text.row("twin", format_args!("answers in {}, {twin_alone} of these alone", ticks(*twin_ticks)));
            let error =
                rms.map_or(String::new(), |rms| format!("; along this way it errs by {:.1} % rms", 100.0 * rms));
            text.row("", format_args!("times {factor:.3} it meets what was measured at the border{error}"));
        }
        self.felt.describe(text);
        if let Some(Fault { time, reason }) = &self.fault {
            let remedy = "play again to clear it";
            text.row("fault", format_args!("at {time:.4} s the torque went to zero: {reason}; {remedy}"));
        }
        if let Some(Driven { tally, .. }) = &self.device {
            for (clamp, count) in &tally.clamped {
                text.row(
                    "device",
                    format_args!("torque clamped by {clamp} for {}", counted(*count, ["tick", "ticks"])),
                );
            }
            for (reason, count) in &tally.halted {
                text.row("device", format_args!("without torque for {}: {reason}", counted(*count, ["tick", "ticks"])));
            }
            if let Some(reason) = &tally.stopped {
                text.row("device", format_args!("stopped for good: {reason}; run play again to open it"));
            }
        }
        self.timing.describe(text);
        for (what, written) in [("recorded in", &self.recording), ("page", &self.page)] {
            if let Some(Written { file, replaced }) = written {
                text.row(what, file);
                replaced.describe(text);
            }
        }
        if let Some(Series { file, overwritten }) = &self.series {
            text.row("series", file);
            overwritten.describe(text);
        }
        text.row("written to", &self.folder);
        self.overwritten.describe(text);
    }
}

/// Returns how often torque was clamped and missing in the session of `trace`.
fn tally(trace: &Trace) -> Tally {
    let mut tally = Tally::default();
    trace.ticks.iter().for_each(|tick| tally.add(tick.applied.clamps, tick.applied.halt));
    tally
}

/// The session that `arguments` ask for, which hands over its ticks.
fn perform(
    setup: &Setup,
    dataset: &Dataset,
    arguments: &Arguments,
    on_tick: &mut dyn FnMut(&Tick),
) -> Result<Played, Failure> {
    let motion = motion::named(setup, dataset, &arguments.motion, arguments.topic.as_deref())?;
    let (begin, end) = (motion.begin(), motion.duration());
    let seconds = arguments.seconds.unwrap_or(end);
    if end > begin && (begin >= seconds || end <= 0.0) {
        return Err(format!(
            "{}: the motion goes from {begin} s to {end} s, and a session begins at 0 s and ends at {seconds} s: nothing of \
             it would be felt; let its times begin at 0",
            arguments.motion
        )
        .into());
    }
    if arguments.seconds.is_none() && seconds == 0.0 {
        let what = "the motion is a single position: give --seconds how long it is held, or a later position";
        return Err(format!("{}: {what}", arguments.motion).into());
    }
    if !(seconds > 0.0 && seconds <= LONGEST) {
        return Err(format!("cannot play {seconds} s: give --seconds between 0 and {LONGEST}").into());
    }
    if let Some(address) = &arguments.device {
        let how = How { seconds, hold_key: arguments.hold_key };
        return drive(setup, dataset, address, motion, how, on_tick);
    }
    let mut device: Box<dyn Device> =
        if arguments.exact { Box::new(Recorded::new(motion)) } else { Box::new(setup.hand(motion)?) };
    if !arguments.realtime {
        return play(setup, dataset, device.as_mut(), seconds, on_tick);
    }
    let mut graphics = setup.graphics(dataset)?;
    let plan = setup.plan(dataset, seconds, SNAPSHOTS);
    let options = Options { on_tick: Some(on_tick), ..Options::default() };
    play_timed(&setup.haptics, device.as_mut(), graphics.as_mut(), &plan, options)
}

/// How a device is driven.
struct How {
    /// Duration (s).
    seconds: f64,
    hold_key: bool,
}

/// Feels the dataset with the device at `address`, until Ctrl-C at the latest. The simulated one is led along `motion`.
fn drive(
    setup: &Setup,
    dataset: &Dataset,
    address: &Address,
    motion: Motion,
    how: How,
    on_tick: &mut dyn FnMut(&Tick),
) -> Result<Played, Failure> {
    let How { seconds, hold_key } = how;
    let hand = if address.kind == Kind::Simulated { Some(setup.hand(motion)?) } else { None };
    let (key, input) = Key::new();
    let _keyboard = if hold_key { Some(Keyboard::start(input)?) } else { None };
    let guard = Guard::new(open(address, hand.map(|hand| (hand, &setup.scene.device)))?, hold_key.then_some(key))
        .map_err(|halt| format!("{address}: {halt}"))?;
    tell(format_args!("haptize: {}", guard.description()));
    if let Some(caution) = address.caution(guard.limits()) {
        tell(format_args!("haptize: note: {caution}"));
    }
    if hold_key {
        tell(format_args!("haptize: torque only while the space bar is held"));
    }
    let stop = interrupt::stop_flag_of_device();
    let mut graphics = setup.graphics(dataset)?;
    let plan = setup.plan(dataset, seconds, SNAPSHOTS);
    // Last of all: the motors go on. They go off before anything is drawn.
    let mut device = attach(guard, address, setup.chain.clone(), &setup.scene)?;
    let options = Options { stop, on_tick: Some(on_tick) };
    let played = play_timed(&setup.haptics, device.as_mut(), graphics.as_mut(), &plan, options);
    interrupt::over();
    played
}

/// Replays the session in `file`. Returns its trace, and a line that says that it matched.
fn replay(setup: &Setup, dataset: &Dataset, file: &Path) -> Result<(Played, String), Failure> {
    if output::is_mcap(file) {
        let why = "MCAP holds positions and torques, of which --motion takes the hand's; only a session that was recorded as a \
                   table can be replayed";
        return Err(format!("{}: {why}", file.display()).into());
    }
    let recording = Recording::read(file, setup.chain.joints.len())?;
    let mut graphics = setup.graphics(dataset)?;
    let trace = recording.replay(&setup.haptics, graphics.as_mut(), labels(&dataset.grid))?;
    if let Some(tick) = recording.first_difference(&trace) {
        let time = trace.ticks.get(tick).map_or(0.0, |tick| tick.time);
        let why = "the dataset, its scene or the version of haptize is another one than when it was recorded";
        return Err(
            format!("{}: the session differs from tick {tick}, at {time:.4} s, on: {why}", file.display()).into()
        );
    }
    let told = format!("{} replayed, torque and proxy equal to the last bit", ticks(recording.ticks()));
    Ok((Played { trace: trace.into(), timing: None }, told))
}

/// The names of what is felt, and of the motion by which it is.
fn names(arguments: &Arguments) -> [String; 2] {
    let felt = arguments.replay.as_deref().unwrap_or(Path::new(&arguments.motion));
    [&arguments.dataset, felt].map(|path| path.file_stem().unwrap_or_default().to_string_lossy().into_owned())
}

/// Returns where traces and figures go.
fn folder(arguments: &Arguments) -> PathBuf {
    // Beside what a dataset of the same name gave, not in its place.
    let live = if Scene::is_at(&arguments.dataset) { "-live" } else { "" };
    let [dataset, motion] = names(arguments);
    let named = || Path::new("out").join(format!("{dataset}{live}-{motion}"));
    arguments.output.clone().unwrap_or_else(named)
}

/// Writes what `played` recorded to `file`.
fn record(
    setup: &Setup,
    dataset: &Dataset,
    played: &Played,
    arguments: &Arguments,
    file: &Path,
) -> Result<(), Failure> {
    let lost = played.timing.as_ref().map_or(0, |timing| timing.unrecorded);
    if lost > 0 {
        return Err(format!(
            "{} not recorded, the machine is too busy: nothing is written; try again",
            counted(lost, ["tick was", "ticks were"])
        )
        .into());
    }
    if output::is_mcap(file) {
        let mut facts = BTreeMap::from([
            ("haptize".to_owned(), env!("CARGO_PKG_VERSION").to_owned()),
            ("dataset".to_owned(), arguments.dataset.display().to_string()),
        ]);
        facts.extend(arguments.device.as_ref().map(|device| ("device".to_owned(), device.to_string())));
        facts.insert("tally".into(), serde_json::to_string(&tally(&played.trace))?);
        let (chain, live) = (&setup.chain, setup.haptics.source().live());
        let session = McapSession { dataset, chain, trace: &played.trace, live };
        // After a signal, and without the object, the joint states are written at the least.
        let object = if interrupt::is_late() { Ok(None) } else { session.object() };
        let object = object.unwrap_or_else(|error| {
            tell(format_args!("haptize: note: {}: the object is left out: {error}", file.display()));
            None
        });
        replace_file(file, |out| session.write(object.as_ref(), facts, out)).map_err(|error| unwritten(file, error))?;
        return Ok(());
    }
    replace_file(file, |out| Recording::write(&played.trace, out)).map_err(|error| unwritten(file, error))?;
    Ok(())
}

/// The scene that `arguments` name, or that of the dataset where a reference is wanted, prepared to be solved live; none
/// of a dataset that is looked up.
fn live(arguments: &Arguments) -> Result<Option<Arc<LiveScene>>, Failure> {
    let path = &arguments.dataset;
    let scene = match (Scene::is_at(path), arguments.reference) {
        (true, _) => Scene::load(path)?,
        (false, true) => Scene::parse(&Dataset::load(path)?.scene, path)?,
        (false, false) => return Ok(None),
    };
    tell(format_args!(
        "haptize: {}: preparing the object for contact that is solved in every tick ...",
        path.display()
    ));
    let live = if arguments.reference { LiveScene::remembering(&scene) } else { LiveScene::new(scene) };
    Ok(Some(Arc::new(live?)))
}

/// The scene at `path`, the twin of a dataset unless the session `is_live`, prepared to be solved live.
fn twin(path: &Path, is_live: bool) -> Result<Arc<LiveScene>, Failure> {
    if is_live {
        return Err("--twin is of datasets of real objects: a scene is solved everywhere".into());
    }
    if !Scene::is_at(path) {
        return Err(format!("{}: a twin is a scene, whose name ends in .toml", path.display()).into());
    }
    Ok(Arc::new(LiveScene::new(Scene::load(path)?)?))
}

/// Returns which of the files that a session writes are there already.
struct Outputs {
    filled: Folder,
    replaced: Option<Replaced>,
    earlier_page: Option<Replaced>,
    filled_series: Option<Folder>,
}

impl Outputs {
    /// Checks before anything is played that no output destroys an input, or another output.
    fn check(arguments: &Arguments, folder: &Path) -> Result<Self, Failure> {
        let read =
            [&arguments.dataset].into_iter().chain(&arguments.twin).chain(&arguments.beside).chain(&arguments.replay);
        let inputs: Vec<&Path> = read.map(PathBuf::as_path).chain([Path::new(&arguments.motion)]).collect();
        let mut filled = Folder::check(folder, FILES.into_iter().chain(FIGURES), inputs.clone())?;
        let series: Vec<String> = series::files(SNAPSHOTS).collect();
        let check_series = |folder: &PathBuf| Folder::check(folder, series.iter().map(String::as_str), inputs.clone());
        let filled_series = arguments.vtu.as_ref().map(check_series).transpose()?;
        let mut check = |file: &Option<PathBuf>, content| {
            let Some(file) = file else { return Ok(None) };
            let earlier = output::check(file, content, inputs.clone())?;
            filled.keep_apart(file).map(|()| earlier)
        };
        let replaced = check(&arguments.record, Content::Session)?;
        let earlier_page = check(&arguments.html, Content::Product)?;
        Ok(Self { filled, replaced, earlier_page, filled_series })
    }
}
