//! How late the ticks of the real-time loop came.

use super::{canvas::Canvas, chart::Histogram, ticks};

/// Histogram of the lateness of ticks, `lateness` in nanoseconds; quantiles as dashed lines.
#[must_use]
pub fn jitter(lateness: &hdrhistogram::Histogram<u64>) -> Canvas {
    const NANOSECONDS: f64 = 1e3;
    /// Ratio of a bin's ends: ten bins a decade.
    const RATIO: f64 = 1.2589;
    // The lowest bin takes all that is not later than the clock resolves.
    const LOWEST: u64 = 100;
    let microseconds = |nanoseconds: f64| nanoseconds / NANOSECONDS;
    let mut bins = Vec::new();
    let mut from = LOWEST as f64 / RATIO;
    for step in lateness.iter_log(LOWEST, RATIO) {
        let to = (step.value_iterated_to() + 1) as f64;
        bins.push(([microseconds(from), microseconds(to)], step.count_since_last_iteration()));
        from = to;
    }
    let mark = |name: &str, nanoseconds: u64| {
        let value = microseconds(nanoseconds as f64);
        let decimals = if value < 10.0 { 1 } else { 0 };
        (value, format!("{name} {} µs", ticks::number(value, decimals)))
    };
    let marks = if lateness.is_empty() {
        Vec::new()
    } else {
        vec![
            mark("median", lateness.value_at_quantile(0.5)),
            mark("99 %", lateness.value_at_quantile(0.99)),
            mark("99.9 %", lateness.value_at_quantile(0.999)),
            mark("latest", lateness.max()),
        ]
    };
    Histogram {
        headline: "How late the ticks of the real-time loop came".to_owned(),
        across: "Lateness [µs]".to_owned(),
        up: "Ticks [1]".to_owned(),
        bins,
        marks,
    }
    .draw()
}
