//! The two branches of a mechanism with friction: torque against the position of the joint that leads, moving up and
//! moving down.

use super::press::subscript;
use crate::{
    draw::{
        canvas::{Area, Canvas},
        chart, colour,
        plot::{self, Entry, Mark, Panel, Scale},
        ticks,
    },
    gridize::Samples,
};

const WIDTH: f64 = 760.0;
const LANE: f64 = 210.0;
const ABOVE: f64 = 44.0;
const DISC: f64 = 2.0;

/// One panel a joint: its torque in every cell of C-space that was visited, by direction of joint `lead`.
#[must_use]
pub fn hysteresis(forward: &Samples, backward: &Samples, lead: usize) -> Canvas {
    let joints = forward.joints.len();
    let height = 64.0 + joints as f64 * (LANE + ABOVE) + 30.0;
    let mut canvas = Canvas::new(WIDTH, height);
    chart::headline(&mut canvas, "Hysteresis: torque by direction of motion");
    let branches = [("moving up", forward), ("moving down", backward)];
    let entries: Vec<Entry> = branches
        .iter()
        .enumerate()
        .map(|(number, (name, _))| Entry { name: (*name).to_owned(), colour: colour::series(number), mark: Mark::Dot })
        .collect();
    plot::legend(&mut canvas, (WIDTH - chart::MARGIN, chart::MARGIN + 12.0), &entries);
    let column = |values: &[f64], joint: usize| values.iter().skip(joint).step_by(joints).copied().collect::<Vec<_>>();
    let range = |of: fn(&Samples) -> &[f64], joint: usize| {
        let both = branches.iter().flat_map(|(_, samples)| column(of(samples), joint));
        ticks::range(both, 0.05)
    };
    for (joint, label) in forward.joints.iter().enumerate() {
        let area = Area {
            x: chart::MARGIN + 46.0,
            y: 64.0 + ABOVE + joint as f64 * (LANE + ABOVE) - 20.0,
            width: WIDTH - 2.0 * chart::MARGIN - 46.0,
            height: LANE,
        };
        let lead_label = &forward.joints[lead];
        let across = format!("q{} {} [{}]", subscript(lead + 1), lead_label.name, lead_label.unit);
        let up = format!("τ{} {} [{}]", subscript(joint + 1), label.name, label.effort_unit());
        let panel = Panel {
            area,
            across: Scale::linear(ticks::snapped(range(|samples| &samples.configurations, lead)), across),
            up: Scale::linear(range(|samples| &samples.torques, joint), up),
        };
        panel.grid(&mut canvas, joint + 1 == joints);
        panel.zero_line(&mut canvas);
        for (number, (_, samples)) in branches.iter().enumerate() {
            let points = column(&samples.configurations, lead).into_iter().zip(column(&samples.torques, joint));
            for point in points {
                canvas.disc(panel.place(point), DISC, colour::series(number).with_opacity(0.6));
            }
        }
    }
    canvas
}
