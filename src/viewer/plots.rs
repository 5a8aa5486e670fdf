//! Live plots of the haptic loop: torque, configuration, contacts, energy accounts, and what time it takes. They pause,
//! zoom, and can be written as CSV and as the figures that `haptize play` draws.

use super::{
    files::Files,
    history::History,
    legend,
    loaded::Loaded,
    number, palette,
    theme::{self, CURVE, DASHES, FINE_CURVE, FINE_GAP, GAP, GROUP_GAP, HAIRLINE, SAMPLE, SPAN_WIDTH},
};
use crate::{
    Error, JointVector,
    dataset::{Axis, replace_file},
    draw::canvas::Canvas,
    render::{
        timing::{Durations, Percentiles},
        trace::Tick,
    },
    report,
};
use eframe::egui::{self, Button, RichText, Ui, vec2};
use egui_plot::{Bar, BarChart, Line, Plot, PlotPoints};
use std::path::PathBuf;

/// The quantity that is plotted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Tab {
    /// Contact torque and torque on the device.
    #[default]
    Torque,
    /// Positions of device and proxy.
    Configuration,
    /// Object nodes in contact.
    Contacts,
    /// Energy accounts.
    Energy,
    /// Cost and punctuality of ticks.
    Timing,
}

/// The panel's state.
pub struct Plots {
    /// The quantity that is plotted.
    pub tab: Tab,
    /// The ticks that are shown while paused.
    frozen: Option<History>,
    /// Length of the time axis (s).
    seconds: f64,
}

/// What the panel asks of the window.
#[derive(Default)]
pub struct Asked {
    /// To hold still.
    pub hold_still: bool,
    /// To say where files were written, or why not.
    pub written: Option<Result<String, String>>,
}

/// Lengths of the time axis that can be chosen (s): a touch, a motion of the scene, all that is kept.
const SPANS: [f64; 3] = [2.0, 6.0, 18.0];

/// Actions of the pointer over frozen plots and the plane of C-space, for the window's help.
pub const HELP: [(&str, &str); 3] = [
    ("Frozen plots: drag", "move along"),
    ("Right-drag, Ctrl-wheel", "zoom into a plot"),
    ("Double-click a plot", "see all of it"),
];

/// Opacity of the lines that others are compared with (1).
const BEHIND: f32 = 0.6;

/// Jitter and cost are shown from this decade to that one (log10 us): from what clocks resolve to ten periods.
const DECADES: [f64; 2] = [-1.0, 4.0];

/// Width of a histogram's bar over that of its bin (1).
const BAR: f64 = 0.94;

/// Space above and below a line over the height of its plot (1).
const AROUND: f32 = 0.08;

/// Points of a line: about one a pixel.
const POINTS: usize = 700;

impl Default for Plots {
    fn default() -> Self {
        Self { tab: Tab::Torque, frozen: None, seconds: SPANS[1] }
    }
}

impl Plots {
    /// Forgets what is paused.
    pub fn reset(&mut self) {
        self.frozen = None;
    }

    /// The panel in all of `ui`; `files` knows where exports go.
    pub fn show(&mut self, ui: &mut Ui, loaded: &Loaded, history: &mut History, files: &Files) -> Asked {
        let mut asked = Asked::default();
        ui.horizontal_wrapped(|ui| {
            for (tab, name, what) in [
                (Tab::Torque, "Torque", "Contact torque on the proxy, and torque on the device"),
                (Tab::Configuration, "Configuration", "Joint positions of proxy and device"),
                (Tab::Contacts, "Contacts", "Object nodes in contact"),
                (Tab::Energy, "Energy", "Where the loop's energy is kept and goes"),
                (Tab::Timing, "Timing", "Cost of a tick, and how punctual ticks are"),
            ] {
                ui.selectable_value(&mut self.tab, tab, name).on_hover_text(what);
            }
            ui.separator();
            let mut paused = self.frozen.is_some();
            if ui.toggle_value(&mut paused, "Freeze").on_hover_text("Stop the plots; the loop goes on").clicked() {
                self.frozen = paused.then(|| history.clone());
            }
            // Histograms have no time axis.
            if self.tab != Tab::Timing {
                self.span(ui);
            }
            if ui.button("CSV").on_hover_text("Export all ticks kept, the last twenty seconds").clicked() {
                asked.written = Some(self.write_csv(loaded, history, files));
            }
            if ui.button("PNG").on_hover_text("Export the figures that haptize play draws").clicked() {
                asked.written = Some(self.write_png(loaded, history, files).map_err(|error| error.to_string()));
            }
            if self.tab == Tab::Timing {
                if ui.button("Reset").clicked() {
                    history.reset_timing();
                }
                let why = "The window holds still for two seconds while the loop goes on: the jitter that is left is \
                           the machine's own, what is more is the window's";
                let clocked = history.cost.percentiles().count > 0;
                asked.hold_still = ui.add_enabled(clocked, Button::new("Hold still")).on_hover_text(why).clicked();
            }
        });
        let shown = self.frozen.as_ref().unwrap_or(history);
        match self.tab {
            Tab::Torque => {
                let pair: [(_, OfTick); 2] =
                    [("contact", |tick| &tick.sample.torque), ("device", |tick| &tick.device_torque)];
                self.joints(ui, loaded, shown, true, pair);
            }
            Tab::Configuration => {
                let pair: [(_, OfTick); 2] = [("proxy", |tick| &tick.proxy), ("device", |tick| &tick.device)];
                self.joints(ui, loaded, shown, false, pair);
            }
            Tab::Contacts => self.contacts(ui, loaded, shown),
            Tab::Energy => self.energy(ui, loaded, shown),
            Tab::Timing => timing(ui, shown),
        }
        asked
    }

    /// Lets the user choose how long the time axis is.
    fn span(&mut self, ui: &mut Ui) {
        let label = ui.label("Last");
        legend::choice(ui, &label, "span", Some(SPAN_WIDTH), format!("{} s", self.seconds), |ui| {
            for seconds in SPANS {
                ui.selectable_value(&mut self.seconds, seconds, format!("{seconds} s"));
            }
        });
    }

    /// Draws a plot for each unit of efforts or of coordinates, one below the other, with two lines for each joint: their
    /// names and the vectors whose entry they show. The second is compared with the first.
    fn joints(&self, ui: &mut Ui, loaded: &Loaded, history: &History, is_effort: bool, pair: [(&str, OfTick); 2]) {
        let axes = &loaded.dataset.grid.axes;
        let unit = |axis: &Axis| if is_effort { axis.effort_unit().to_owned() } else { axis.unit.clone() };
        let groups = theme::by_unit(axes.iter().map(unit));
        let between = ui.spacing().item_spacing.y;
        for (number, (unit, joints)) in groups.iter().enumerate() {
            let left = (groups.len() - number) as f32;
            let height = (ui.available_height() - (left - 1.0) * between) / left;
            let lines = joints.iter().flat_map(|&joint| {
                [0, 1].map(|k| {
                    let (name, of) = pair[k];
                    series(&format!("{} {name}", axes[joint].name), joint, k == 1, move |tick| of(tick)[joint])
                })
            });
            let what = match (is_effort, unit.as_str()) {
                (false, _) => "q",
                (true, "N") => "force",
                (true, _) => "torque",
            };
            ui.allocate_ui(vec2(ui.available_width(), height), |ui| {
                ui.vertical(|ui| self.lines(ui, history, &format!("{what} [{unit}]"), lines.collect(), &[]));
            });
        }
    }

    fn contacts(&self, ui: &mut Ui, loaded: &Loaded, history: &History) {
        let nodes = series("object nodes in contact", 0, false, |tick| tick.sample.contact_nodes.into());
        let mut lines = vec![series("contact index × 10", 1, true, |tick| 10.0 * tick.sample.index)];
        if loaded.knows_nodes() {
            lines.insert(0, nodes);
        } else {
            absent(ui, "Nodes in contact are not stored: this dataset holds torques, no contact forces.");
        }
        self.lines(ui, history, "contacts [1]", lines, &[0.0, 1.0]);
    }

    fn energy(&self, ui: &mut Ui, loaded: &Loaded, history: &History) {
        let account =
            |name: &str, number, get: fn(&Tick) -> f64| series(name, number, false, move |tick| 1e3 * get(tick));
        let mut accounts = vec![
            account("absorbed by proxy and coupling", 1, |tick| tick.accounts.absorbed()),
            account("proxy's damping", 2, |tick| tick.accounts.proxy_dissipation),
            account("made by holding torque", 3, |tick| tick.accounts.hold_gain()),
        ];
        if loaded.dataset.energy.is_some() {
            accounts.insert(0, account("stored in the object", 0, |tick| tick.accounts.stored));
            accounts.push(account("made by time step and interpolation", 5, |tick| tick.accounts.leak));
        } else {
            let what = "The object's energy is not stored: what it holds and what time step and interpolation make is not known.";
            absent(ui, what);
        }
        self.lines(ui, history, "energy [mJ]", accounts, &[]);
    }

    /// Draws `lines` over time; the axis up has the values `always`, and spans [`LEAST_SPAN`] at least.
    fn lines(&self, ui: &mut Ui, history: &History, label: &str, lines: Vec<Series<'_>>, always: &[f64]) {
        let dark = ui.visuals().dark_mode;
        names(ui, label, &lines);
        let end = history.last().map_or(0.0, |tick| tick.time);
        let ticks: Vec<&Tick> = history.recent(self.seconds, POINTS).collect();
        let paused = self.frozen.is_some();
        let mut plot = plot(ui, ("lines", label, paused), "time [s]", "");
        if !paused {
            plot = plot.default_x_bounds(end - self.seconds, end).auto_bounds([false, true]).allow_drag(false);
        }
        let bounds = (end - self.seconds).max(0.0)..=end.max(self.seconds);
        let values = || lines.iter().flat_map(|(.., get)| ticks.iter().map(|tick| get(tick)));
        let (least, greatest) = (values().fold(f64::INFINITY, f64::min), values().fold(f64::NEG_INFINITY, f64::max));
        for value in always {
            plot = plot.include_y(*value);
        }
        if greatest - least < LEAST_SPAN {
            plot = plot.include_y(least - 0.5 * LEAST_SPAN).include_y(greatest + 0.5 * LEAST_SPAN);
        }
        plot.show(ui, |plot| {
            if !paused {
                plot.set_plot_bounds_x(bounds);
            }
            for (name, number, thin, get) in lines {
                let points: PlotPoints<'_> = ticks.iter().map(|tick| [tick.time, get(tick)]).collect();
                let colour = palette::series(number, dark);
                let line = Line::new(name, points);
                plot.line(if thin {
                    line.color(colour.gamma_multiply(BEHIND))
                        .width(HAIRLINE)
                        .style(egui_plot::LineStyle::dashed_dense())
                } else {
                    line.color(colour).width(CURVE)
                });
            }
        });
    }

    fn write_csv(&self, loaded: &Loaded, history: &History, files: &Files) -> Result<String, String> {
        let file = files.fresh("viewer-trace", "csv");
        let trace = self.frozen.as_ref().unwrap_or(history).trace(loaded);
        replace_file(&file, |out| trace.write_ticks(out)).map_err(|error| {
            format!("cannot write {}: {error}; free some space or start haptize elsewhere", file.display())
        })?;
        Ok(format!("wrote {}", file.display()))
    }

    fn write_png(&self, loaded: &Loaded, history: &History, files: &Files) -> Result<String, Error> {
        let history = self.frozen.as_ref().unwrap_or(history);
        let trace = history.trace(loaded);
        let write = |name: &str, canvas: &Canvas| {
            let file = files.fresh(name, "png");
            report::write_png(files.folder(), &file.file_stem().unwrap_or_default().to_string_lossy(), canvas)
        };
        let mut files: Vec<PathBuf> = vec![
            write("viewer-press", &report::press::press(&trace))?,
            write("viewer-energy", &report::press::energy(&trace))?,
        ];
        if history.jitter.percentiles().count > 0 {
            files.push(write("viewer-jitter", &report::jitter::jitter(&history.timing()))?);
        }
        let names: Vec<String> = files.iter().map(|file| file.display().to_string()).collect();
        Ok(format!("wrote {}", names.join(", ")))
    }
}

/// Least span of an axis up, in its unit: a micronewton metre, a micrometre, a nanojoule, and less, is noise that
/// nobody feels, and is not magnified.
const LEAST_SPAN: f64 = 1e-6;

/// Says what the dataset does not hold.
fn absent(ui: &mut Ui, what: &str) {
    ui.label(RichText::new(what).weak().small());
}

/// A vector of a tick.
type OfTick = fn(&Tick) -> &JointVector;

/// A line: its name, the number of its colour, whether others are compared with it, and a number of a tick.
type Series<'a> = (String, usize, bool, Box<dyn Fn(&Tick) -> f64 + 'a>);

fn series<'a>(name: &str, number: usize, is_behind: bool, get: impl Fn(&Tick) -> f64 + 'a) -> Series<'a> {
    (name.to_owned(), number, is_behind, Box::new(get))
}

/// Shows quantity and names of the lines above their plot: beside it, a short plot leaves no room for its axis' name.
fn names(ui: &mut Ui, label: &str, lines: &[Series<'_>]) {
    let dark = ui.visuals().dark_mode;
    ui.horizontal_wrapped(|ui| {
        ui.spacing_mut().item_spacing.x = GAP;
        ui.label(RichText::new(label).small().weak());
        ui.add_space(GAP);
        for (name, number, thin, _) in lines {
            let sample = legend::entry(ui, SAMPLE, name);
            let colour = palette::series(*number, dark);
            let ends = [sample.left_center(), sample.right_center()];
            if *thin {
                let stroke = egui::Stroke::new(FINE_CURVE, colour.gamma_multiply(BEHIND));
                ui.painter().extend(egui::Shape::dashed_line(&ends, stroke, DASHES[0], DASHES[1]));
            } else {
                ui.painter().line_segment(ends, egui::Stroke::new(CURVE, colour));
            }
            ui.add_space(FINE_GAP);
        }
    });
}

fn plot<'a>(ui: &Ui, id: impl std::fmt::Debug, x: &str, y: &str) -> Plot<'a> {
    Plot::new(format!("{id:?}"))
        .custom_x_axes(vec![theme::across(x)])
        .custom_y_axes(vec![theme::upward(y).formatter(theme::mark_number)])
        .y_grid_spacer(theme::marks)
        .allow_scroll(false)
        .set_margin_fraction(vec2(0.0, AROUND))
        .show_background(false)
        .grid_color(palette::grid(ui.visuals()))
}

/// Histograms of jitter and cost, side by side, with their shares in words.
fn timing(ui: &mut Ui, history: &History) {
    let dark = ui.visuals().dark_mode;
    let size = vec2(0.5 * (ui.available_width() - GROUP_GAP), ui.available_height());
    ui.horizontal_top(|ui| {
        for (number, title, durations) in [(0, "jitter", &history.jitter), (1, "cost of a tick", &history.cost)] {
            ui.allocate_ui(size, |ui| {
                ui.vertical(|ui| {
                    let words = shares(durations).unwrap_or_else(|| "nothing measured, the loop runs by steps".into());
                    ui.label(RichText::new(format!("{title} [µs]: {words}")).small());
                    if number == 0 {
                        let words = shares(&history.still).unwrap_or_else(|| "not measured yet".into());
                        ui.label(RichText::new(format!("the window holding still: {words}")).weak().small());
                    }
                    let bars: Vec<Bar> = durations
                        .bins()
                        .iter()
                        .filter(|bin| bin.count > 0)
                        .map(|bin| {
                            let (from, to) = (bin.from.log10(), bin.to.log10());
                            Bar::new(0.5 * (from + to), (bin.count as f64).log10() + 1.0).width(BAR * (to - from))
                        })
                        .collect();
                    let chart = BarChart::new(title, bars).color(palette::series(number, dark)).allow_hover(false);
                    plot(ui, ("timing", number), &format!("{title} [µs]"), "ticks")
                        .y_grid_spacer(egui_plot::log_grid_spacer(10))
                        .default_x_bounds(DECADES[0], DECADES[1])
                        .include_y(0.0)
                        .include_x(DECADES[0])
                        .include_x(DECADES[1])
                        .custom_x_axes(vec![
                            theme::across(&format!("{title} [µs]")).formatter(|mark, _| power_of_ten(mark.value)),
                        ])
                        .custom_y_axes(vec![theme::upward("ticks").formatter(|mark, _| count(mark.value))])
                        .show(ui, |plot| {
                            plot.bar_chart(chart);
                        });
                });
            });
        }
    });
}

/// Shares of `durations` in words (us); none where there are none.
fn shares(durations: &Durations) -> Option<String> {
    let Percentiles { count, p50, p99, p999, max, .. } = durations.percentiles();
    let [p50, p99, p999, max] = [p50, p99, p999, max].map(number);
    (count > 0).then(|| format!("median {p50}, 99 % {p99}, 99.9 % {p999}, most {max}"))
}

/// Ten to the power of `power`, where that is whole.
fn power_of_ten(power: f64) -> String {
    match 10.0_f64.powf(power) {
        _ if (power - power.round()).abs() >= 1e-9 => String::new(),
        value if value >= 1.0 => format!("{value:.0}"),
        value => number(value),
    }
}

/// The count whose bar is `height` high.
fn count(height: f64) -> String {
    if height >= 1.0 { power_of_ten(height - 1.0) } else { String::new() }
}
