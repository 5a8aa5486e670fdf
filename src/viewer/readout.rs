//! What the arm is and feels, in numbers over the 3-D picture: each joint in its own unit, the tip, the contact force, and
//! the vertex that was clicked.

use super::{probe::Probe, theme};
use crate::{dataset::Axis, draw::ticks::number as plain, render::trace::Tick};
use eframe::egui::{RichText, Ui};
use glam::DVec3;

/// What is shown.
pub struct Readout<'a> {
    /// The joints.
    pub axes: &'a [Axis],
    /// The tick that is shown.
    pub tick: &'a Tick,
    /// Where the tip is (m).
    pub tip: Option<DVec3>,
    /// Distance of the tip from the surface at rest, negative inside (m); none where it is not known.
    pub gap: Option<f64>,
    /// Sum of the forces of the object on the arm (N); none where they are not known.
    pub force: Option<DVec3>,
    /// The vertex that was clicked.
    pub probe: Option<Probe>,
}

/// Widths of name, numbers and unit (letters); of a value, and of three of a vector.
const NAME: usize = 11;
const UNIT: usize = 4;
const VALUE: usize = 8;
const THREE: usize = 21;

impl Readout<'_> {
    /// Shows it, line by line, so that numbers stand below each other.
    pub fn show(&self, ui: &mut Ui) {
        let line = |ui: &mut Ui, text: String| ui.label(RichText::new(text).monospace().size(theme::small().size));
        for ((axis, q), torque) in self.axes.iter().zip(self.tick.proxy.iter()).zip(self.tick.sample.torque.iter()) {
            // A tenth of a millimetre is about a thousandth of a radian at the tip.
            let q = plain(*q, if axis.unit == "m" { 4 } else { 3 });
            let torque = plain(*torque, 3);
            let name: String = axis.name.chars().take(NAME - 1).collect();
            let (unit, effort) = (&axis.unit, axis.effort_unit());
            line(ui, format!("{name:<NAME$}{q:>VALUE$} {unit:<UNIT$}{torque:>VALUE$} {effort}"));
        }
        if let Some(tip) = self.tip {
            line(ui, format!("{:<NAME$}{:>THREE$} mm", "tip", three(1e3 * tip, 1)));
        }
        if let Some(gap) = self.gap {
            line(ui, format!("{:<NAME$}{:>THREE$} mm", "to surface", plain(1e3 * gap, 1)));
        }
        let force = |ui: &mut Ui, name: &str, force: DVec3| {
            let size = plain(force.length(), 2);
            line(ui, format!("{name:<NAME$}{:>THREE$} N, {size} N", three(force, 2)));
        };
        if let Some(sum) = self.force {
            force(ui, "force", sum);
        }
        if let Some(Probe { vertex, displacement, force: acting }) = self.probe {
            let size = plain(1e3 * displacement.length(), 2);
            line(ui, format!("vertex {vertex}"));
            line(ui, format!("{:<NAME$}{:>THREE$} mm, {size} mm", "  moved", three(1e3 * displacement, 2)));
            force(ui, "  force", acting);
        }
    }
}

fn three(vector: DVec3, decimals: usize) -> String {
    vector.to_array().map(|value| format!("{:>7}", plain(value, decimals))).concat()
}
