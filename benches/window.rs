//! What the haptic thread feels of the window: the jitter of its ticks while the window is drawn sixty times a second,
//! and while it holds still, in turns, so that whatever else the machine does counts for both.
//!
//!     cargo bench --bench window

#![allow(clippy::unwrap_used)] // A benchmark may stop.

use egui_kittest::{Harness, wgpu::WgpuTestRenderer};
use haptize::{
    gpu::{AdapterChoice, Context},
    render::timing::Percentiles,
    viewer::{self, Start, TickSource, Viewer},
};
use std::{
    sync::Arc,
    thread,
    time::{Duration, Instant},
};

/// Turns of each kind, and how long one takes; the loop's ring holds four seconds.
const TURNS: usize = 6;
const TURN: Duration = Duration::from_secs(3);

/// Time between two frames.
const FRAME: Duration = Duration::from_micros(16_667);

fn main() {
    let context = Arc::new(Context::open(AdapterChoice::Any).unwrap());
    let render = viewer::render_state(&context).unwrap();
    let viewer = Viewer::new(Arc::clone(&context), render.clone(), TickSource::Clock, ".".into()).unwrap();
    let mut harness = Harness::builder()
        .with_size([1280.0, 800.0])
        .with_context_setup(viewer::dress)
        .renderer(WgpuTestRenderer::from_render_state(render))
        .build_ui_state(|ui, viewer: &mut Viewer| viewer.ui(ui), viewer);
    let ctx = harness.ctx.clone();
    harness.state_mut().start(&Start::Sphere, &ctx);
    harness.state_mut().wait();
    assert_eq!(harness.state().error(), None);
    println!("drawn by {}; jitter [us] of ticks at 1 kHz, one row a turn of {} s", context.adapter(), TURN.as_secs());
    println!("{:>22} {:>10} {:>10} {:>10} {:>10}", "", "median", "99 %", "99.9 %", "most");
    let mut most = [Vec::new(), Vec::new()];
    for turn in 0..2 * TURNS {
        let drawn = turn % 2 == 1;
        harness.state_mut().advance(0.0, &ctx);
        harness.state_mut().forget_timing();
        harness.state_mut().play("press");
        let (begin, mut frames) = (Instant::now(), 0);
        while begin.elapsed() < TURN {
            if drawn {
                harness.state_mut().advance(FRAME.as_secs_f64(), &ctx);
                harness.step();
                harness.render().unwrap();
                frames += 1;
                thread::sleep((FRAME * frames).saturating_sub(begin.elapsed()));
            } else {
                thread::sleep(TURN);
            }
        }
        harness.state_mut().advance(0.0, &ctx);
        let Percentiles { p50, p99, p999, max, .. } = harness.state().timing().unwrap().lateness;
        let rate = f64::from(frames) / begin.elapsed().as_secs_f64();
        let what = if drawn { format!("drawn, {rate:.0} frames/s") } else { "still".into() };
        println!("{what:>22} {p50:>10.1} {p99:>10.1} {p999:>10.1} {max:>10.1}");
        most[usize::from(drawn)].push(max);
    }
    let [still, drawn] = most.map(|mut most| {
        most.sort_by(f64::total_cmp);
        most[most.len() / 2]
    });
    println!("the latest tick of a turn, median: drawn {drawn:.0} us, still {still:.0} us, ratio {:.1}", drawn / still);
    for refused in harness.state().timing().unwrap().refused {
        println!("{refused}");
    }
}
