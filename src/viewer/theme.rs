//! Sizes and type of the window: one scale of distances, few widths. Everything is in points unless it says otherwise.
//! Colours are in `palette.rs`.

use crate::draw::ticks;
use eframe::egui::{self, FontFamily, FontId, Margin, Rangef, RichText, TextStyle, vec2};
use egui_plot::{AxisHints, GridInput, GridMark};

// --- Distances ---

/// Distance between things that belong together.
pub const GAP: f32 = 6.0;
/// Between groups, and from the edge of a panel.
pub const GROUP_GAP: f32 = 12.0;
/// Within a thing, such as a slider and its name.
pub const FINE_GAP: f32 = 2.0;
/// Around a panel.
pub const PANEL_MARGIN: Margin = Margin::symmetric(12, 8);
/// Around the bars above and below the panels.
pub const BAR_MARGIN: Margin = Margin::symmetric(12, 5);
/// Around a menu.
const MENU_MARGIN: Margin = Margin::same(8);
/// Around a window in the window.
const WINDOW_MARGIN: Margin = Margin::same(14);
/// Inside a button.
const BUTTON_PADDING: egui::Vec2 = vec2(8.0, 3.0);
/// Indentation of what lies below a heading and belongs to it.
const INDENT: f32 = 12.0;
/// Radius of corners.
pub const ROUNDING: u8 = 4;
/// Shadow of a window in the window: how far it falls, and how soft it is.
pub const SHADOW_DROP: i8 = 6;
/// See [`SHADOW_DROP`].
pub const SHADOW_BLUR: u8 = 24;

// --- Type ---

/// Letters of headings, of text, and of notes; of messages that point at a line.
const HEADING: f32 = 15.0;
const BODY: f32 = 12.5;
const SMALL: f32 = 10.5;
const MONOSPACE: f32 = 11.5;
/// Letters of an axis' name.
const AXIS_NAME: f32 = 11.0;

// --- Lines ---

/// Width of lines: frames; axes and bars; curves, those that are compared with them, and their samples in a legend.
pub const HAIRLINE: f32 = 1.0;
/// See [`HAIRLINE`].
pub const AXIS_LINE: f32 = 1.5;
/// See [`HAIRLINE`].
pub const CURVE: f32 = 1.8;
/// See [`HAIRLINE`].
pub const FINE_CURVE: f32 = 1.2;
/// Dash and gap of a dashed sample.
pub const DASHES: [f32; 2] = [3.0, 2.5];
/// A sample in a legend.
pub const SAMPLE: egui::Vec2 = vec2(16.0, 10.0);
/// A square in a key of colours.
pub const SWATCH: f32 = 9.0;
/// Height of a bar of colours.
pub const COLOUR_BAR: f32 = 7.0;
/// Half the length of a tick at the ends of the scale bar.
pub const TICK: f32 = 3.0;
/// Radius of a cross on a point that is not to be trusted.
pub const CROSS: f32 = 3.5;

// --- Widgets ---

/// Least height of what can be clicked.
const CLICKABLE: f32 = 20.0;
/// Width of a slider and of a choice where nothing else is said.
const SLIDER_WIDTH: f32 = 110.0;
/// Width left for the number beside a slider, its gap included.
pub const NUMBER_WIDTH: f32 = 66.0;
/// The mark of a bound on a slider.
pub const MARK_HEIGHT: f32 = 16.0;
/// See [`MARK_HEIGHT`].
pub const MARK_WIDTH: f32 = 2.0;
/// Width of a choice: among joints, among words, among columns of the dataset, among times.
pub const JOINT_WIDTH: f32 = 78.0;
/// See [`JOINT_WIDTH`].
pub const CHOICE_WIDTH: f32 = 92.0;
/// See [`JOINT_WIDTH`].
pub const COLUMN_WIDTH: f32 = 150.0;
/// See [`JOINT_WIDTH`].
pub const SPAN_WIDTH: f32 = 56.0;
/// Width of the slider of a motion, where there is room and at least, and of the button that pauses it, whatever it
/// says.
pub const MOTION_WIDTH: f32 = 120.0;
/// See [`MOTION_WIDTH`].
pub const LEAST_MOTION: f32 = 40.0;
/// See [`MOTION_WIDTH`].
pub const PAUSE_WIDTH: f32 = 52.0;
/// Width of the time in a motion, as words.
pub const TIME_WIDTH: f32 = 66.0;
/// Most of the bar's width that the name of what is open takes (1).
pub const NAME_SHARE: f32 = 0.11;
/// A button that is alone.
pub const LONE_BUTTON: egui::Vec2 = vec2(90.0, 24.0);
/// A progress bar in the middle of the window, and in its status bar.
pub const WIDE_PROGRESS: f32 = 330.0;
/// See [`WIDE_PROGRESS`].
pub const PROGRESS: f32 = 190.0;
/// See [`WIDE_PROGRESS`].
pub const PROGRESS_HEIGHT: f32 = 18.0;

// --- Panels ---

/// The window as it is opened: width and height (points).
pub const WINDOW: [f32; 2] = [1280.0, 800.0];
/// How small the window can be made: width and height (points).
pub const LEAST_WINDOW: [f32; 2] = [900.0, 560.0];
/// Width of the window below which plots lie under all other panels.
pub const NARROW: f32 = 1150.0;
/// Width of the controls, and how far it can be dragged.
pub const CONTROLS_WIDTH: f32 = 232.0;
/// See [`CONTROLS_WIDTH`].
pub const CONTROLS_RANGE: std::ops::RangeInclusive<f32> = 200.0..=360.0;
/// Height of the plots and width of C-space: this share of the window (1), within these limits.
pub const SIDE_SHARE: f32 = 0.27;
/// See [`SIDE_SHARE`].
pub const PLOTS_RANGE: [f32; 2] = [165.0, 320.0];
/// See [`SIDE_SHARE`].
pub const SPACE_RANGE: [f32; 2] = [240.0, 420.0];
/// Height from which on plane and cloud of C-space find room, one below the other.
pub const ROOM_FOR_BOTH: f32 = 470.0;
/// Share of it that the plane has then (1).
pub const PLANE_SHARE: f32 = 0.58;
/// Height of what explains the heat map below it, two lines; least height of the map itself, with its axes.
pub const KEY_HEIGHT: f32 = 52.0;
/// See [`KEY_HEIGHT`].
pub const LEAST_MAP: f32 = 80.0;
/// Width of the first screen's steps.
pub const STEPS_WIDTH: f32 = 300.0;
/// Width of a message, and of the chooser of files; its height, that of its list, and the width of its field.
pub const MESSAGE_WIDTH: f32 = 560.0;
/// See [`MESSAGE_WIDTH`].
pub const CHOOSER: egui::Vec2 = vec2(420.0, 380.0);
/// See [`MESSAGE_WIDTH`].
pub const LIST_HEIGHT: f32 = 220.0;
/// See [`MESSAGE_WIDTH`].
pub const FIELD_WIDTH: f32 = 290.0;

/// Letters of notes, where a painter writes.
#[must_use]
pub fn small() -> FontId {
    FontId::proportional(SMALL)
}

/// The unit of several quantities: `N m`, or each once where they differ.
#[must_use]
pub fn units(all: impl Iterator<Item = String>) -> String {
    by_unit(all).into_iter().map(|(unit, _)| unit).collect::<Vec<_>>().join(" or ")
}

/// Returns the joints of each unit, in the order in which units first occur: quantities of different units share no
/// axis.
#[must_use]
pub fn by_unit(units: impl Iterator<Item = String>) -> Vec<(String, Vec<usize>)> {
    let mut groups: Vec<(String, Vec<usize>)> = Vec::new();
    for (joint, unit) in units.enumerate() {
        match groups.iter_mut().find(|(known, _)| *known == unit) {
            Some((_, joints)) => joints.push(joint),
            None => groups.push((unit, vec![joint])),
        }
    }
    groups
}

fn axis<'a>(hints: AxisHints<'a>, label: &str) -> AxisHints<'a> {
    hints.label(RichText::new(label).size(AXIS_NAME)).tick_label_font(small())
}

/// The axis across, named `label`.
#[must_use]
pub fn across<'a>(label: &str) -> AxisHints<'a> {
    axis(AxisHints::new_x().label_spacing(Rangef::new(22.0, 34.0)), label)
}

/// The axis up, named `label`.
#[must_use]
pub fn upward<'a>(label: &str) -> AxisHints<'a> {
    axis(AxisHints::new_y().label_spacing(Rangef::new(11.0, 15.0)).min_thickness(36.0), label)
}

/// Marks on an axis up, at most so many and one: what is read at a glance. A low plot has two numbers, too: a single one
/// tells no scale.
const MARKS: usize = 6;
/// Least distance of two marks over the least distance of grid lines (1): room for a line of small letters.
const LEGIBLE: f64 = 2.0;

/// Returns the marks of an axis up, with round numbers.
#[must_use]
pub fn marks(input: GridInput) -> Vec<GridMark> {
    let (low, high) = input.bounds;
    let room = (high - low) / (LEGIBLE * input.base_step_size);
    let marks = |intervals| ticks::ticks([low, high], intervals).marks;
    let found = ((room as usize).clamp(1, MARKS)..=MARKS).map(marks).find(|marks| marks.len() > 1).unwrap_or_default();
    let step_size = found.windows(2).map(|pair| pair[1].0 - pair[0].0).next().unwrap_or(0.0);
    found.into_iter().map(|(value, _)| GridMark { value, step_size }).collect()
}

/// Writes the number at a mark with the digits that tell it from the next one.
#[must_use]
pub fn mark_number(mark: GridMark, _: &std::ops::RangeInclusive<f64>) -> String {
    ticks::apart(mark.value, mark.step_size)
}

/// Gives `ctx` type and spacing.
pub fn apply(ctx: &egui::Context) {
    ctx.all_styles_mut(|style| {
        let font = |size| FontId::new(size, FontFamily::Proportional);
        style.text_styles.insert(TextStyle::Heading, font(HEADING));
        style.text_styles.insert(TextStyle::Body, font(BODY));
        style.text_styles.insert(TextStyle::Button, font(BODY));
        style.text_styles.insert(TextStyle::Small, font(SMALL));
        style.text_styles.insert(TextStyle::Monospace, FontId::new(MONOSPACE, FontFamily::Monospace));
        style.spacing.item_spacing = vec2(GAP, GAP);
        style.spacing.button_padding = BUTTON_PADDING;
        style.spacing.interact_size.y = CLICKABLE;
        style.spacing.slider_width = SLIDER_WIDTH;
        style.spacing.combo_width = JOINT_WIDTH;
        style.spacing.indent = INDENT;
        style.spacing.menu_margin = MENU_MARGIN;
        style.spacing.window_margin = WINDOW_MARGIN;
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_range_has_several_marks_with_numbers_of_their_own() {
        for (low, high) in [(0.0, 0.095), (-0.003, 0.0902), (-1.7, 0.3), (0.0, 19.0), (-2e-7, 9e-7), (4.98, 5.02)] {
            let marks = marks(GridInput { bounds: (low, high), base_step_size: 0.03 * (high - low) });
            let mut numbers: Vec<String> = marks.iter().map(|&mark| mark_number(mark, &(low..=high))).collect();
            let count = numbers.len();
            assert!((3..=7).contains(&count), "{low} to {high}: {numbers:?}");
            for (mark, number) in marks.iter().zip(&numbers) {
                let told: f64 = number.replace('−', "-").parse().unwrap();
                assert!(
                    (told - mark.value).abs() < 1e-3 * mark.step_size + 1e-12 * mark.value.abs(),
                    "{number}: {}",
                    mark.value
                );
            }
            assert!(numbers.iter().all(|number| number.len() < 9), "{numbers:?}");
            numbers.dedup();
            assert_eq!(numbers.len(), count);
        }
    }

    #[test]
    fn a_low_plot_has_two_numbers() {
        for (low, high) in [(-0.2, 3.1), (0.0, 0.95), (-1.0, 1.0), (3.0, 3.4)] {
            let marks = marks(GridInput { bounds: (low, high), base_step_size: high - low });
            assert!(marks.len() >= 2, "{low} to {high}: {} marks", marks.len());
        }
    }
}
