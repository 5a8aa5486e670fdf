//! `haptize gridize`: scattered measurements made a dataset over a uniform grid.

use super::{
    Failure,
    bar::Bar,
    guessed,
    output::{self, Content, Folder, Overwritten, Replaced},
    report::{self, Describe, Report, Text},
    shell, tell,
};
use crate::{
    Error, MAX_AXES,
    dataset::{Axis, Dataset, IdentifiedFriction, IdentifiedRelaxation, Provenance},
    gridize::{
        ForceHistory, GridizeOptions, GridizeReport, Interpolation, Past, Reversals, Samples, WITHIN, gridize,
        gridize_remembering, gridize_sliding, predict_histories,
        prediction::{Prediction, held_out, predict},
    },
    input,
    logs::{Effort, ImportProgress, ImportReport, Imported, Mapping, import, total_size},
    names::{counted, listed},
    proxy::Chain,
    report::{FIGURES as FELT, gridized::gridized, hysteresis::hysteresis, write_both, write_figures},
    ros::{JointStateTable, is_mcap},
    scan::{RowStatus, ScanLog, add_slip, identify_friction},
    scene::{Rendering, ScanScene},
    toml_text::{self, coarse, significant},
};
use serde::Serialize;
use std::{
    path::{Path, PathBuf},
    time::{Instant, SystemTime},
};

/// Arguments of `haptize gridize`.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  haptize gridize sponge.csv --step 0.03
  haptize gridize sponge.csv --step 0.03 --held-out 0.1 --figures out
  haptize gridize log.mcap --topic /joint_states --step 0.03
  haptize gridize --guess run1.csv                  writes run1.columns.toml: what each column seems to be
  haptize gridize run1.csv run2.csv --columns instrument.toml --step 0.02,0.02,0.01 --scene arm.toml")]
pub struct Arguments {
    /// A log written by `haptize scan`, an MCAP file with joint states of a robot, or with --columns any tables of
    /// joint positions and torques.
    #[arg(required = true)]
    logs: Vec<PathBuf>,
    /// Grid step (rad or m): one number, or one a joint, separated by commas.
    #[arg(
        long,
        required_unless_present = "guess",
        value_delimiter = ',',
        num_args = 1,
        value_name = "H",
        allow_negative_numbers = true
    )]
    step: Vec<f64>,
    /// The dataset to write; by default the first log's name in the current folder, ending in .haptize.
    #[arg(short, long)]
    output: Option<PathBuf>,
    /// A TOML file that maps columns to quantities (datasets/instrument.toml is an example).
    #[arg(long, value_name = "TOML")]
    columns: Option<PathBuf>,
    /// Write a column mapping for the log, guessed from the names of its columns and their numbers, instead of a
    /// dataset; -o names it.
    #[arg(long, conflicts_with_all = ["columns", "topic", "scene", "held_out", "against", "figures"])]
    guess: bool,
    /// The topic of joint states to read of an MCAP file; by default its only one.
    #[arg(long)]
    topic: Option<String>,
    /// Meaning of the efforts of an MCAP file, without --columns: the torque of the motors, or that of the contact on
    /// the arm. The arm's weight must have been subtracted.
    #[arg(long, default_value = "motor", conflicts_with = "columns")]
    effort: Effort,
    /// A scene with the arm and the gains to feel the dataset with; scan logs bring theirs.
    #[arg(long)]
    scene: Option<PathBuf>,
    /// Torque above which a configuration counts as contact (N m). By default that of the scan's scene; without one three
    /// standard deviations of the samples, where these are known; else a hundredth of the greatest torque.
    #[arg(long, allow_negative_numbers = true)]
    epsilon: Option<f64>,
    /// How torques are interpolated.
    #[arg(long, default_value = "linear")]
    interpolation: Interpolation,
    /// Smooth torques within their measured standard deviation first.
    #[arg(long)]
    smooth: bool,
    /// Distance from the samples at which the measured region ends inside their convex hull, too, in spacings of the samples,
    /// and the diagonal of a grid cell at least; `inf` for the hull alone.
    #[arg(long, default_value_t = WITHIN, value_name = "SPACINGS", allow_negative_numbers = true)]
    within: f64,
    /// Measure how well the dataset predicts measurements: a second one is made without this fraction of the samples, and
    /// its errors there are stated.
    #[arg(long, value_name = "FRACTION", allow_negative_numbers = true, value_parser = super::fraction)]
    held_out: Option<f64>,
    /// Measure how well the dataset predicts other logs of the same object.
    #[arg(long, value_name = "LOG", num_args = 1..)]
    against: Vec<PathBuf>,
    /// A folder for figures: samples beside grid, torque, and the hysteresis of imported logs.
    #[arg(long, value_name = "FOLDER")]
    figures: Option<PathBuf>,
}

/// Figures beside [`FELT`].
const FIGURES: [&str; 4] = ["gridized.svg", "gridized.png", "hysteresis.svg", "hysteresis.png"];

/// The measurements that were read.
pub struct Source {
    /// The measurements.
    pub samples: Samples,
    scene: String,
    /// The torque threshold that the scan's scene names (N m).
    pub epsilon: Option<f64>,
    /// For the dataset's provenance: `scan`, `simulated scan` or `import`, and of what.
    kind: &'static str,
    of: String,
    import: Option<ImportReport>,
    /// Both directions of motion, and the joint whose direction it is.
    branches: Option<([Samples; 2], usize)>,
    left_out: usize,
    /// What tells how the object relaxes, where something does.
    past: Option<(Vec<ForceHistory>, Past)>,
    friction: Option<Sliding>,
}

/// What tells of the object's friction.
enum Sliding {
    /// Strokes of a scan: friction, and the arm and its node that felt it.
    Node(IdentifiedFriction, Chain, usize),
    /// A log that goes to and fro: its rows, the joint that leads, and the sides of the cells in which they are averaged.
    Joints(Vec<ForceHistory>, usize, Vec<f64>),
}

impl Source {
    /// Gridizes the samples; the dataset says where they come from, and that it was made now. Where something tells how
    /// the object relaxes, its scene names it.
    pub fn gridize(&self, options: &GridizeOptions) -> Result<(Dataset, GridizeReport), Failure> {
        let (mut dataset, report) = match (&self.past, &self.friction) {
            (Some((histories, past)), _) => gridize_remembering(&self.samples, (histories, *past), options)?,
            (None, Some(Sliding::Joints(histories, lead, cell))) => {
                gridize_sliding(&self.samples.joints, &Reversals { histories, lead: *lead, cell }, options)?
            }
            _ => gridize(&self.samples, options)?,
        };
        dataset.scene.clone_from(&self.scene);
        if let Some(Sliding::Node(friction, chain, node)) = &self.friction {
            add_slip(&mut dataset, chain, *node);
            dataset.provenance.friction = Some(friction.clone());
        }
        if !self.scene.is_empty() {
            dataset.scene += &identified(&dataset.provenance)?;
            Rendering::parse(&dataset.scene, "scene")?;
        }
        dataset.provenance.backend = self.kind.to_owned();
        dataset.provenance.adapter.clone_from(&self.of);
        dataset.provenance.date = humantime::format_rfc3339_seconds(SystemTime::now()).to_string();
        Ok((dataset, report))
    }
}

/// Reads the logs and writes the dataset.
pub fn run(arguments: &Arguments) -> Result<Report, Failure> {
    if arguments.guess {
        return guessed::run(&arguments.logs, arguments.output.as_deref());
    }
    let started = Instant::now();
    let output = output(arguments)?;
    let inputs = arguments.logs.iter().chain(&arguments.against).chain(&arguments.columns).chain(&arguments.scene);
    let inputs = inputs.map(PathBuf::as_path);
    let replaced = output::check(&output, Content::Dataset, inputs.clone())?;
    let names = FELT.into_iter().chain(FIGURES);
    let mut folder = arguments.figures.as_ref().map(|folder| Folder::check(folder, names, inputs)).transpose()?;
    if let Some(folder) = &mut folder {
        folder.keep_apart(&output)?;
    }
    let mapping = mapping(arguments)?;
    let mut source = read(&arguments.logs, mapping.as_ref())?;
    if let Some(path) = &arguments.scene {
        source.scene = scene(path, source.samples.joints.len())?;
    }
    let reading = started.elapsed().as_secs_f64();
    let options = GridizeOptions {
        steps: arguments.step.clone(),
        epsilon: arguments.epsilon.or(source.epsilon),
        interpolation: arguments.interpolation,
        smooth: arguments.smooth,
        within: arguments.within,
    };
    let (dataset, report) = source.gridize(&options)?;
    if report.inside == 0 {
        let left_out =
            source.import.as_ref().map_or(String::new(), |import| format!(" (of the rows {})", import.left_out()));
        return Err(format!(
            "no grid point lies between the samples{left_out}, {}: give a smaller --step, or a log that \
             goes through more of the joints' ranges",
            counted(report.samples, ["one", "in all"])
        )
        .into());
    }
    let is_log = source.past.as_ref().is_some_and(|(_, past)| *past == Past::Log);
    if arguments.held_out.is_some() && is_log {
        return Err("the rows of a log in which the object relaxes depend on one another: hold out a whole log, by \
                    --against, and not --held-out"
            .into());
    }
    let held_out = arguments.held_out.map(|share| held_out(&source.samples, &options, share)).transpose()?;
    let other = match arguments.against.as_slice() {
        [] => None,
        logs => Some(read(logs, mapping.as_ref())?),
    };
    let against = other.as_ref().filter(|_| !is_log).map(|other| predict(&at_rest(&dataset), &other.samples));
    let history_misfit = other.iter().filter(|_| is_log).flat_map(|other| &other.past);
    let history_misfit = history_misfit.map(|(other, _)| predict_histories(&dataset, other)).next().transpose()?;
    dataset.save(&output)?;
    let figures = figures(arguments, &source, &dataset)?;
    let gridized = Gridized {
        report,
        file: output.display().to_string(),
        source: source.kind,
        seconds: started.elapsed().as_secs_f64(),
        import: source.import,
        left_out: source.left_out,
        held_out,
        against: against.transpose()?,
        relaxation: dataset.provenance.relaxation.clone(),
        friction: dataset.provenance.friction.clone(),
        history_misfit,
        folder: folder.map(|folder| folder.close(&figures)).transpose()?,
        figures: report::names(&figures),
        replaced,
        reading,
        of: source.of,
        playable: !dataset.scene.is_empty(),
        axes: dataset.grid.axes,
    };
    if gridized.report.contact_points == 0 {
        tell(format_args!(
            "haptize: nothing touches: no torque is above the threshold at any grid point; check the units of the log, or \
             lower --epsilon"
        ));
    }
    Report::of(&gridized, gridized.report.contact_points > 0)
}

/// Measurements made a dataset.
#[derive(Serialize)]
struct Gridized {
    #[serde(flatten)]
    report: GridizeReport,
    file: String,
    /// `scan`, `simulated scan` or `import`.
    source: &'static str,
    /// Wall time, and the part of it for reading (s).
    seconds: f64,
    #[serde(skip)]
    reading: f64,
    import: Option<ImportReport>,
    /// Rows of the log that were not used.
    left_out: usize,
    held_out: Option<Prediction>,
    against: Option<Prediction>,
    /// How the object relaxes.
    #[serde(skip_serializing_if = "Option::is_none")]
    relaxation: Option<IdentifiedRelaxation>,
    /// Its friction.
    #[serde(skip_serializing_if = "Option::is_none")]
    friction: Option<IdentifiedFriction>,
    /// Predicted less measured over measured torque of other logs in which it relaxes, rms (1).
    #[serde(skip_serializing_if = "Option::is_none")]
    history_misfit: Option<f64>,
    figures: Vec<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    folder: Option<Overwritten>,
    #[serde(flatten)]
    replaced: Option<Replaced>,
    /// What was measured.
    #[serde(skip)]
    of: String,
    #[serde(skip)]
    axes: Vec<Axis>,
    /// Whether it has a scene.
    #[serde(skip)]
    playable: bool,
}

/// The lines of a scene that name what was identified of its object.
fn identified(provenance: &Provenance) -> Result<String, std::fmt::Error> {
    let mut text = String::new();
    if let Some(found) = &provenance.relaxation {
        toml_text::heading(&mut text, "Identified by haptize gridize")?;
        text += "[object.relaxation]\n";
        let term = |[share, time]: &[f64; 2]| format!("[{}, {}]", significant(*share), significant(*time));
        toml_text::entry(&mut text, "terms", &toml_text::list(&found.terms, term), "share of the force, and time [s]")?;
    }
    if let Some(found) = &provenance.friction {
        text += "\n[haptics.friction]\n";
        toml_text::entry(&mut text, "coefficient", &significant(found.coefficient), "identified by haptize gridize")?;
        if let Some(stiffness) = found.stiffness {
            toml_text::entry(&mut text, "stiffness", &significant(stiffness), "likewise")?;
        }
    }
    Ok(text)
}

/// The torque of `dataset` where all that fades has faded.
fn at_rest(dataset: &Dataset) -> Dataset {
    let fading = |relaxation: &IdentifiedRelaxation| relaxation.terms.iter().map(|[share, _]| share).sum::<f64>();
    let lasting = 1.0 - dataset.provenance.relaxation.as_ref().map_or(0.0, fading);
    let torque: Vec<f64> = dataset.torque.iter().map(|torque| lasting * torque).collect();
    Dataset::bare(dataset.grid.clone(), torque, dataset.status.to_vec())
}

fn figures(arguments: &Arguments, source: &Source, dataset: &Dataset) -> Result<Vec<PathBuf>, Failure> {
    let Some(folder) = &arguments.figures else { return Ok(Vec::new()) };
    let mut files = write_figures(folder, dataset, None)?;
    files.extend(write_both(folder, "gridized", &gridized(&source.samples, dataset))?);
    if let Some(([forward, backward], lead)) = &source.branches {
        files.extend(write_both(folder, "hysteresis", &hysteresis(forward, backward, *lead))?);
    }
    Ok(files)
}

fn output(arguments: &Arguments) -> Result<PathBuf, Failure> {
    if let Some(output) = &arguments.output {
        return Ok(output.clone());
    }
    let name = arguments.logs.first().and_then(|log| log.file_name()).ok_or("the log's path names no file; give -o")?;
    Ok(PathBuf::from(name).with_extension("haptize"))
}

/// The mapping of --columns, or the one that the joint states of an MCAP file need.
fn mapping(arguments: &Arguments) -> Result<Option<Mapping>, Failure> {
    let topic = arguments.topic.as_deref();
    if let Some(columns) = &arguments.columns {
        let mut mapping = Mapping::load(columns)?;
        mapping.table.topic = topic.map(str::to_owned).or(mapping.table.topic);
        return Ok(Some(mapping));
    }
    let Some(log) = arguments.logs.first().filter(|log| is_mcap(log)) else {
        // A recording of another kind says what to do.
        for log in &arguments.logs {
            input::open(log).map_err(|source| Error::unreadable(log, &source))?;
        }
        return if topic.is_some() {
            Err("--topic is of MCAP files, and the first log is none".into())
        } else {
            Ok(None)
        };
    };
    let table = JointStateTable::open(log, topic)?;
    if table.joints().len() > MAX_AXES {
        let names = listed(table.joints());
        let (file, many) = (log.display(), table.joints().len());
        return Err(format!(
            "{file}: {} has {many} joints ({names}), more than {MAX_AXES}: choose some by a column mapping \
             (--columns)",
            table.topic()
        )
        .into());
    }
    Ok(Some(Mapping::of_joint_states(table.joints(), table.topic(), arguments.effort)))
}

/// Reads `logs`, a scan's or, through `mapping`, any tables.
fn read(logs: &[PathBuf], mapping: Option<&Mapping>) -> Result<Source, Failure> {
    mapping.map_or_else(|| scanned(logs), |mapping| imported(logs, mapping))
}

/// Reads the log of one scan.
pub fn scanned(logs: &[PathBuf]) -> Result<Source, Failure> {
    let [path] = logs else {
        return Err("several logs can be gridized together only with --columns".into());
    };
    let log = ScanLog::read(path)?;
    let left_out = log.rows.iter().filter(|row| matches!(row.status, RowStatus::Unsteady | RowStatus::Limit));
    let left_out = left_out.count();
    let histories = log.histories();
    let kind = if log.header.simulated { "simulated scan" } else { "scan" };
    let scene = ScanScene::parse(&log.header.scene, path)?;
    let epsilon = Some(scene.scan.control.epsilon);
    let chain = Chain::new(&scene.proxy);
    let friction = identify_friction(&log, &scene.scan, &chain);
    let node = scene.scan.plan.node(chain.nodes.len());
    let friction = friction.map(|friction| Sliding::Node(friction, chain, node));
    Ok(Source {
        samples: log.samples(),
        scene: log.header.scene,
        epsilon,
        kind,
        of: log.header.rig,
        import: None,
        branches: None,
        left_out,
        past: (!histories.is_empty()).then_some((histories, Past::Presses)),
        friction,
    })
}

fn imported(logs: &[PathBuf], mapping: &Mapping) -> Result<Source, Failure> {
    let total = total_size(logs);
    let bar = Bar::new("bytes", "{wide_bar} {bytes}/{total_bytes}, {msg}");
    let mut progress =
        |progress: ImportProgress| bar.set(progress.bytes, total, counted(progress.rows, ["row", "rows"]), None);
    let imported = import(mapping, logs, &mut progress);
    bar.finish();
    let Imported { samples, branches, histories, report } = imported?;
    if samples.draw_on() {
        tell(format_args!(
            "haptize: note: the torques draw the arm on where an object pushes it back: if they are the motors', say \
             effort = \"motor\" in [torque] of the mapping, or --effort; if they hold the weight of the arm, take it off"
        ));
    }
    let left_out = report.dropped.iter().map(|dropped| dropped.rows as usize).sum();
    let names: Vec<String> = logs.iter().map(|log| log.display().to_string()).collect();
    let (mut past, mut friction) = (None, None);
    if mapping.torque.relaxes {
        past = Some((histories, Past::Log));
    } else if mapping.torque.friction {
        friction = Some(Sliding::Joints(histories, mapping.lead(), mapping.torque.cell.clone()));
    }
    Ok(Source {
        samples,
        scene: String::new(),
        epsilon: None,
        kind: "import",
        of: names.join(", "),
        import: Some(report),
        branches: branches.map(|branches| (branches, mapping.lead())),
        left_out,
        past,
        friction,
    })
}

/// The text of a valid scene with as many joints as the samples.
fn scene(path: &PathBuf, joints: usize) -> Result<String, Failure> {
    let scene = Rendering::load(path)?;
    let count = scene.proxy.joints.len();
    if count != joints {
        return Err(format!("{}: its proxy has {count} joints, the samples {joints}", path.display()).into());
    }
    Ok(scene.text)
}

impl Describe for IdentifiedRelaxation {
    fn describe(&self, text: &mut Text) {
        let Self { terms, histories, misfit, held_out } = self;
        let term = |[share, time]: &[f64; 2]| format!("{:.1} % in {} s", 100.0 * share, coarse(*time));
        let terms = terms.iter().map(term).collect::<Vec<_>>().join(", ");
        let out = held_out.map(|held_out| format!(", to {:.1} % of those held out", 100.0 * held_out));
        text.row("relaxes", terms);
        text.row(
            "",
            format_args!(
                "told by {} to {:.1} % of the torque, rms{}",
                counted(*histories, ["history", "histories"]),
                100.0 * misfit,
                out.unwrap_or_default()
            ),
        );
    }
}

impl Describe for IdentifiedFriction {
    fn describe(&self, text: &mut Text) {
        let Self { coefficient, strokes, deviation, stiffness, predicted } = self;
        let builds_up = stiffness.map_or(String::new(), |k| format!(", builds up at {} N/m (N m/rad)", coarse(k)));
        text.row(
            "friction",
            format_args!(
                "{coefficient:.3} +- {deviation:.3}, of {}{builds_up}",
                counted(*strokes, ["stroke", "strokes"])
            ),
        );
        for (joint, [with, without]) in predicted.iter().enumerate() {
            let joint = joint + 1;
            let left_out = if with < without { "" } else { ": it has none" };
            text.row(
                "",
                format_args!(
                    "joint {joint}: held-out strokes predicted to {} rms, without friction to {}{left_out}",
                    coarse(*with),
                    coarse(*without)
                ),
            );
        }
    }
}

impl Describe for Gridized {
    fn describe(&self, text: &mut Text) {
        let Self { file, source, of, seconds, reading, import, left_out, .. } = self;
        let GridizeReport { samples, merged, points, inside, contact_points, epsilon, far, distance, .. } =
            &self.report;
        text.line(format_args!(
            "{file}: {inside} of {} inside the measured region",
            counted(*points, ["grid point", "grid points"])
        ));
        text.row("made from", format_args!("{} ({source}: {of})", counted(*samples, ["sample", "samples"])));
        if *merged > 0 {
            text.row(
                "merged",
                format_args!("{} at the same configuration as another", counted(*merged, ["sample", "samples"])),
            );
        }
        let unit = match &self.axes[..] {
            [first, others @ ..] if others.iter().all(|axis| axis.unit == first.unit) => first.effort_unit(),
            _ => "N m or N",
        };
        if *far > 0 {
            let mut told: Vec<String> = Vec::new();
            for (distance, axis) in distance.iter().zip(&self.axes) {
                let own = format!("{} {}", coarse(*distance), axis.unit);
                if !told.contains(&own) {
                    told.push(own);
                }
            }
            let told = told.join(", ");
            text.row(
                "far",
                format_args!(
                    "{} left out, more than {told} from any sample",
                    counted(*far, ["grid point between the samples is", "grid points between the samples are"])
                ),
            );
        }
        text.row(
            "in contact",
            format_args!("{}, torque above {} {unit}", counted(*contact_points, ["point", "points"]), coarse(*epsilon)),
        );
        if *left_out > 0 {
            text.row("left out", counted(*left_out, ["row", "rows"]));
        }
        import.iter().flat_map(|import| &import.dropped).for_each(|dropped| text.row("", dropped));
        if let Some(import) = import {
            text.row("rows", format_args!("{} read, {} in time", import.rows, counted(import.gaps, ["gap", "gaps"])));
        }
        let cells = import.as_ref().and_then(|import| import.cells.as_ref());
        if let Some(cells) = cells {
            let (visited, both) = (cells.cells, cells.both_directions);
            text.row("cells", format_args!("{visited} visited, {both} of them in both directions"));
            for (axis, (hysteresis, repeatability)) in
                self.axes.iter().zip(cells.hysteresis.iter().zip(&cells.repeatability))
            {
                let unit = axis.effort_unit();
                let [hysteresis, repeatability] = [hysteresis, repeatability].map(|x| coarse(*x));
                text.row(
                    &axis.name,
                    format_args!("hysteresis +-{hysteresis} {unit}, repeatability {repeatability} {unit}"),
                );
            }
        }
        for (what, prediction) in [("held out", &self.held_out), ("against", &self.against)] {
            let Some(Prediction { samples, predicted, rms, worst, deviation }) = prediction else { continue };
            text.row(
                what,
                format_args!(
                    "{}, {predicted} of them inside the grid and predicted",
                    counted(*samples, ["sample", "samples"])
                ),
            );
            for (joint, axis) in self.axes.iter().enumerate().filter(|_| *predicted > 0) {
                let own =
                    deviation.as_ref().map(|own| format!("; their own standard deviation {}", coarse(own[joint])));
                let repeated = cells.map(|cells| format!(", repeatability {}", coarse(cells.repeatability[joint])));
                let beside: String = own.into_iter().chain(repeated).collect();
                let (rms, worst, unit) = (coarse(rms[joint]), coarse(worst[joint]), axis.effort_unit());
                text.row(&axis.name, format_args!("to {rms} {unit} rms, {worst} at worst{beside}"));
            }
        }
        self.relaxation.describe(text);
        self.friction.describe(text);
        if let Some(misfit) = self.history_misfit {
            text.row("against", format_args!("memory included, to {:.1} % of the torque, rms", 100.0 * misfit));
        }
        if let Some(folder) = self.figures.first().and_then(|figure| Path::new(figure).parent()) {
            text.row(
                "figures",
                format_args!("{} in {}", counted(self.figures.len(), ["file", "files"]), folder.display()),
            );
        }
        text.row("time", format_args!("{seconds:.2} s, of these {reading:.2} s for reading"));
        if *contact_points > 0 {
            // Without an arm there is nothing to feel it with.
            let command = if self.playable { "play" } else { "info" };
            text.row("next", format_args!("haptize {command} {}", shell::file(Path::new(file))));
        }
        self.replaced.describe(text);
        self.folder.describe(text);
    }
}
