//! How late the ticks of the real-time loop came.

use crate::{
    draw::{canvas::Canvas, chart::Histogram, ticks},
    render::timing::Timing,
};

/// Histogram of the lateness of ticks, quantiles as dashed lines.
#[must_use]
pub fn jitter(timing: &Timing) -> Canvas {
    let lateness = &timing.lateness;
    let quantiles =
        [("median", lateness.p50), ("99 %", lateness.p99), ("99.9 %", lateness.p999), ("latest", lateness.max)];
    let mark = |(name, microseconds): (&str, f64)| match timing.lateness_bins.first() {
        // The first bin holds all that is shorter, too: its times are not distinguished.
        Some(first) if microseconds < first.to => {
            (first.from, format!("{name} under {} µs", ticks::number(first.to, 1)))
        }
        _ => {
            let decimals = if microseconds < 10.0 { 1 } else { 0 };
            (microseconds, format!("{name} {} µs", ticks::number(microseconds, decimals)))
        }
    };
    Histogram {
        headline: "How late the ticks of the real-time loop came".to_owned(),
        across: "Lateness [µs]".to_owned(),
        up: "Ticks [1]".to_owned(),
        bins: timing.lateness_bins.iter().map(|bin| ([bin.from, bin.to], bin.count)).collect(),
        marks: quantiles.into_iter().map(mark).collect(),
    }
    .draw()
}
