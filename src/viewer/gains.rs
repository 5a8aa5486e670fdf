//! Gains of the loop as sliders, each with its passivity bound drawn on it, and the contact threshold.

use super::{
    legend, number, palette,
    theme::{self, FINE_GAP, JOINT_WIDTH, MARK_HEIGHT, MARK_WIDTH, NUMBER_WIDTH, SAMPLE},
};
use crate::{
    JointVector,
    dataset::Axis,
    render::passivity,
    scene::{HapticsSpec, Interpolation},
};
use eframe::egui::{self, DragValue, Response, Slider, SliderClamping, Stroke, Ui, lerp, pos2, vec2};
use std::ops::RangeInclusive;

/// One gain of the loop.
struct Gain {
    name: &'static str,
    /// Whether it multiplies a speed, not a displacement.
    damps: bool,
    what: &'static str,
    of: fn(&mut HapticsSpec) -> &mut JointVector,
    /// Greatest passive value at a joint.
    bound: fn(&HapticsSpec, usize) -> Option<f64>,
    /// Whether there is no boundary layer without it.
    positive: bool,
    /// Whether it counts with an interpolation.
    counts: fn(Interpolation) -> bool,
}

const GAINS: [Gain; 4] = [
    Gain {
        name: "Coupling stiffness Kvc",
        damps: false,
        what: "Between device and proxy. Passive up to 2 (bd - Bvc) / T, without the hand's damping",
        of: |gains| &mut gains.coupling_stiffness,
        bound: |gains, joint| Some(passivity::greatest_stiffness(gains, joint)),
        positive: false,
        counts: |_| true,
    },
    Gain {
        name: "Boundary slope Ks",
        damps: false,
        what: "How steeply torque may begin at the contact boundary. Passive up to mu bv / T",
        of: |gains| &mut gains.boundary_slope,
        bound: |gains, joint| Some(passivity::greatest_slope(gains, joint)),
        positive: true,
        counts: |interpolation| !interpolation.is_potential(),
    },
    Gain {
        name: "Coupling damping Bvc",
        damps: true,
        what: "Between device and proxy. Passive up to bd - Kvc T/2",
        of: |gains| &mut gains.coupling_damping,
        bound: |gains, joint| Some(passivity::greatest_damping(gains, joint)),
        positive: false,
        counts: |_| true,
    },
    Gain {
        name: "Proxy damping bv",
        damps: true,
        what: "Of the proxy against the ground; more of it allows a steeper Ks",
        of: |gains| &mut gains.proxy_damping,
        bound: |_, _| None,
        positive: true,
        counts: |_| true,
    },
];

/// Greatest contact threshold that can be chosen (1): an index reaches one only where all corners of a cell are in
/// contact.
const GREATEST_THRESHOLD: f64 = 0.95;

/// The slider's end over the larger of the bound and the scene's gain (1): both lie well within it.
const HEADROOM: f64 = 2.0;

/// The slider's end where neither bound nor gain is above zero, in the gain's unit.
const LEAST_END: f64 = 2e-3;

/// Least value of a gain that must be positive, over the slider's end (1): what the slider cannot tell from zero.
const LEAST_SHARE: f64 = 1e-6;

/// Greatest value that can be typed, over the slider's end (1).
const TYPED: f64 = 1e3;

/// Change of a dragged number for each point of the pointer's way, over the slider's end (1/point).
const DRAG: f64 = 0.005;

/// Chooses the joint whose gains the sliders show; none for all.
pub fn joint(ui: &mut Ui, axes: &[Axis], chosen: &mut Option<usize>) {
    ui.horizontal(|ui| {
        let label = ui.label("Joint");
        let name = chosen.map_or("all", |joint| &axes[joint].name);
        legend::choice(ui, &label, "joint", Some(JOINT_WIDTH), name, |ui| {
            ui.selectable_value(chosen, None, "all");
            for (joint, axis) in axes.iter().enumerate() {
                ui.selectable_value(chosen, Some(joint), &axis.name);
            }
        });
    });
}

/// Says what the mark on the sliders means.
pub fn legend(ui: &mut Ui) {
    let sample = legend::entry(ui, SAMPLE, "passive up to this mark");
    let half = 0.5 * SAMPLE.y;
    let ends = [sample.center() - vec2(0.0, half), sample.center() + vec2(0.0, half)];
    ui.painter().line_segment(ends, Stroke::new(MARK_WIDTH, palette::of(ui.visuals()).good));
}

/// A slider for each of `gains`, of one joint or of all; `original` are the scene's.
pub fn sliders(ui: &mut Ui, axes: &[Axis], chosen: Option<usize>, gains: &mut HapticsSpec, original: &HapticsSpec) {
    let joints: Vec<usize> = chosen.map_or_else(|| (0..axes.len()).collect(), |joint| vec![joint]);
    for gain in &GAINS {
        ui.add_enabled_ui((gain.counts)(gains.interpolation), |ui| slider(ui, gain, axes, &joints, gains, original));
    }
}

/// Everything to the right of the mark may create energy. Joints whose gains in the scene differ, in unit or in size,
/// share a slider of what all are multiplied by; those that have none there keep none.
fn slider(ui: &mut Ui, gain: &Gain, axes: &[Axis], joints: &[usize], gains: &mut HapticsSpec, original: &HapticsSpec) {
    let unit = |joint: usize| {
        let axis = &axes[joint];
        format!("{}{}/{}", axis.effort_unit(), if gain.damps { " s" } else { "" }, axis.unit)
    };
    let from = *(gain.of)(&mut original.clone());
    let differ = joints.windows(2).any(|pair| from[pair[0]] != from[pair[1]] || unit(pair[0]) != unit(pair[1]));
    let some = joints.iter().copied().find(|&joint| from[joint] > 0.0);
    let multiplied = differ && some.is_some();
    let one = |joint: usize| if multiplied { from[joint] } else { 1.0 };
    let unit = if multiplied { "times the scene's".into() } else { theme::units(joints.iter().copied().map(unit)) };

    let values = *(gain.of)(gains);
    let (mut bound, mut beyond) = (None, false);
    for &joint in joints {
        if let Some(here) = (gain.bound)(gains, joint) {
            beyond |= values[joint] > here;
            if one(joint) > 0.0 {
                bound = Some(bound.map_or(f64::MAX, |least: f64| least).min(here / one(joint)));
            }
        }
    }
    let first = some.unwrap_or(joints[0]);
    let mut value = values[first] / one(first);
    let end = (HEADROOM * (from[first] / one(first)).max(bound.unwrap_or(0.0))).max(LEAST_END);
    ui.add_space(FINE_GAP);
    let name = format!("{} [{unit}]", gain.name);
    let typed = Typed { greatest: TYPED * end, speed: DRAG * end, decimals: 0..=4 };
    let (response, changed) = row(ui, [gain.name, &name], &mut value, end, typed);
    match bound {
        Some(bound) => {
            mark(ui, &response, bound / end, beyond);
            response.on_hover_text(format!("{}. Bound here: {} {unit}", gain.what, number(bound)));
        }
        None => drop(response.on_hover_text(gain.what)),
    }
    if changed {
        let least = if gain.positive { LEAST_SHARE * end } else { 0.0 };
        joints.iter().for_each(|&joint| (gain.of)(gains)[joint] = value.max(least) * one(joint));
    }
}

/// The contact threshold; it counts for linear interpolation alone.
pub fn threshold(ui: &mut Ui, gains: &mut HapticsSpec) {
    ui.add_enabled_ui(gains.interpolation == Interpolation::Linear, |ui| {
        let names = ["Contact threshold Ith", "Contact threshold Ith [1]"];
        let typed = Typed { greatest: GREATEST_THRESHOLD, speed: DRAG, decimals: 2..=2 };
        let (response, _) = row(ui, names, &mut gains.threshold, GREATEST_THRESHOLD, typed);
        response.on_hover_text("Contact where the interpolated contact index exceeds it");
    });
}

/// How a number beside a slider is typed or dragged.
struct Typed {
    greatest: f64,
    /// Change for each point of the pointer's way.
    speed: f64,
    decimals: RangeInclusive<usize>,
}

/// A name, shown above; a slider up to `end`, called by its spoken name; and its number. Answers with the slider, and
/// whether the value has changed.
fn row(ui: &mut Ui, [spoken, shown]: [&str; 2], value: &mut f64, end: f64, typed: Typed) -> (Response, bool) {
    ui.spacing_mut().item_spacing.y = FINE_GAP;
    let label = ui.label(shown);
    let row = ui.horizontal(|ui| {
        ui.spacing_mut().slider_width = ui.available_width() - NUMBER_WIDTH;
        let slider = Slider::new(value, 0.0..=end).show_value(false).smart_aim(false).clamping(SliderClamping::Edits);
        let slider = ui.add(slider);
        slider.widget_info(|| egui::WidgetInfo::slider(true, *value, spoken));
        let number = DragValue::new(value).range(0.0..=typed.greatest).speed(typed.speed);
        let number = ui
            .add(number.min_decimals(*typed.decimals.start()).max_decimals(*typed.decimals.end()))
            .labelled_by(label.id);
        let changed = slider.changed() || number.changed();
        (slider, changed)
    });
    row.inner
}

/// A mark on the rail of `slider` at `share` of its length.
fn mark(ui: &Ui, slider: &Response, share: f64, beyond: bool) {
    let palette = palette::of(ui.visuals());
    let rect = slider.rect;
    // As egui draws it: a handle of this radius keeps within the rail.
    let radius = rect.height() / 2.5;
    let x = lerp(rect.x_range().shrink(radius), share.clamp(0.0, 1.0) as f32);
    let colour = if beyond { palette.bad } else { palette.good };
    let half = 0.5 * MARK_HEIGHT;
    let ends = [pos2(x, rect.center().y - half), pos2(x, rect.center().y + half)];
    ui.painter().line_segment(ends, Stroke::new(MARK_WIDTH, colour));
}
