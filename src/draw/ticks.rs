//! Round numbers along an axis, and how they are written.
//!
//! Steps are 1, 2, 2.5 or 5 times a power of ten, the finest that gives no more than the wanted number of intervals.
//! Numbers below a hundredth or from ten thousand on are written with a common factor 10^(3k), which goes into the
//! axis title; the rest as they are, all with the same number of decimals.

/// A number this fraction of a tick step beyond the end of an axis, or off a whole number of decimals, still counts as
/// on it: a thousandth of what a pixel shows, and a million times the rounding of the step.
const TICK_STEP: f64 = 1e-6;

/// A recording that ends this fraction of its duration before a round number is drawn up to it: half of one percent is
/// three points of a sheet, and a tick of a 1 kHz loop of one second is a fifth of it.
const AXIS_END: f64 = 0.005;

/// Ticks of one axis.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Ticks {
    /// Where, in data units, and what is written there.
    pub marks: Vec<(f64, String)>,
    /// Common factor as text, `×10⁻³`; empty when it is one.
    pub factor: String,
}

/// Ends of an axis that holds all finite `values` and `margin` of their extent on both sides; never empty.
pub(crate) fn range(values: impl Iterator<Item = f64>, margin: f64) -> [f64; 2] {
    let (low, high) = values
        .filter(|value| value.is_finite())
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(value), high.max(value)));
    if low > high {
        return [0.0, 1.0];
    }
    // A constant has no extent of its own: show it in the middle of a range of its own size.
    let spare = if high > low { margin * (high - low) } else { 0.5 * low.abs().max(1.0) };
    // Ranges near the largest number must stay finite; an axis that wide is of no use, but it must not fail.
    [(low - spare).max(f64::MIN / 4.0), (high + spare).min(f64::MAX / 4.0)]
}

/// The same range, its ends moved to the next hundredth of a power of ten if that is nearer than half a percent of the
/// extent: a recording that ends one sample before 3 s shows its tick at 3 s.
pub(crate) fn snapped([low, high]: [f64; 2]) -> [f64; 2] {
    let grain = 10_f64.powf((high - low).log10().floor() - 1.0);
    let snap = |end: f64| {
        let round = (end / grain).round() * grain;
        if (round - end).abs() < AXIS_END * (high - low) { round } else { end }
    };
    [snap(low), snap(high)]
}

/// Ticks inside `range`, at most `intervals` of them and one.
pub(crate) fn ticks(range: [f64; 2], intervals: usize) -> Ticks {
    let [low, high] = range;
    let none = Ticks { marks: Vec::new(), factor: String::new() };
    let extent = high - low;
    if !(extent > 0.0 && extent.is_finite()) {
        return none;
    }
    let coarsest = extent / intervals.max(1) as f64;
    let power = 10_f64.powf(coarsest.log10().floor());
    // The slack keeps a step that fits exactly, whatever the rounding of the division.
    let fits = |multiple: &f64| multiple * power * (1.0 + TICK_STEP) >= coarsest;
    let step = power * [1.0, 2.0, 2.5, 5.0].into_iter().find(fits).unwrap_or(10.0);
    let largest = low.abs().max(high.abs());
    let exponent = if (1e-2..1e4).contains(&largest) { 0 } else { 3 * (largest.log10() / 3.0).floor() as i32 };
    let unit = 10_f64.powi(exponent);
    if !(step.is_normal() && unit.is_normal()) {
        return none;
    }
    let decimals = decimals(step / unit);
    let first = (low / step - TICK_STEP).ceil();
    let marks = (0..=intervals)
        .map(|index| (first + index as f64) * step)
        .take_while(|&value| value <= high + TICK_STEP * step)
        .map(|value| (value, number(value / unit, decimals)))
        .collect();
    Ticks { marks, factor: if exponent == 0 { String::new() } else { format!("×10{}", superscript(exponent)) } }
}

/// Powers of ten below which numbers between them are marked, too.
const FEW_DECADES: usize = 4;

/// Marks of a logarithmic axis, both ends positive, at most `intervals` of them and one: powers of ten, every so many;
/// of few decades also the numbers between, 2 and 5 or 3, or round ones where the ends are close to each other.
pub(crate) fn decades(range: [f64; 2], intervals: usize) -> Ticks {
    let powers = multiples(range, &[1]);
    let few = || [&[1, 2, 5][..], &[1, 3]].map(|digits| multiples(range, digits)).into_iter();
    let marks = match powers.len() {
        0..FEW_DECADES => few().find(|marks| (2..=intervals + 1).contains(&marks.len())),
        _ => None,
    };
    match marks {
        None if powers.len() < 2 => ticks(range, intervals),
        None => {
            let stride = (powers.len() - 1) / intervals.max(1) + 1;
            Ticks { marks: powers.into_iter().step_by(stride).collect(), factor: String::new() }
        }
        Some(marks) => Ticks { marks, factor: String::new() },
    }
}

/// `digits` times all powers of ten, as far as they lie inside the range.
fn multiples([low, high]: [f64; 2], digits: &[u8]) -> Vec<(f64, String)> {
    // The slack keeps ends that are marks themselves.
    let inside = |value: &f64| *value >= low * (1.0 - TICK_STEP) && *value <= high * (1.0 + TICK_STEP);
    let [first, last] = [low, high].map(|end| end.log10().floor() as i32);
    let mark = |exponent: i32, digit: u8| {
        let value = f64::from(digit) * 10_f64.powi(exponent);
        let label = match exponent {
            -3..0 => format!("{value:.*}", -exponent as usize),
            0..4 => format!("{value:.0}"),
            _ if digit == 1 => format!("10{}", superscript(exponent)),
            _ => format!("{digit}·10{}", superscript(exponent)),
        };
        (value, label)
    };
    (first..=last + 1)
        .flat_map(|exponent| digits.iter().map(move |digit| mark(exponent, *digit)))
        .filter(|(value, _)| inside(value))
        .collect()
}

/// Digits after the point that tell numbers a `step` apart.
fn decimals(step: f64) -> usize {
    let shifted = |decimals: usize| step * 10_f64.powi(decimals as i32);
    (0..=6).find(|&decimals| shifted(decimals) > 0.5 && is_whole(shifted(decimals))).unwrap_or(6)
}

/// Numbers below are written with a power of ten.
#[cfg(feature = "viewer")]
const LEAST_DECIMAL: f64 = 1e-4;

/// Writes `value` with the digits that tell it from one a `step` away, by itself: without a factor in the axis title.
#[cfg(feature = "viewer")]
pub(crate) fn apart(value: f64, step: f64) -> String {
    // Rounded: a step of 0.001 has a logarithm beside -3.
    let decade = |x: f64| (x.abs().log10() + 1e-9).floor();
    if value.abs() < LEAST_DECIMAL && value.abs() > 0.5 * step {
        let unit = 10_f64.powf(decade(value));
        return format!("{}e{}", number(value / unit, decimals(step / unit)), decade(value));
    }
    number(value, if value.abs() < 0.5 * step { 0 } else { decimals(step) })
}

/// `value` with `decimals` digits after the point and a typographic minus.
pub(crate) fn number(value: f64, decimals: usize) -> String {
    let text = format!("{value:.decimals$}");
    match text.strip_prefix('-') {
        Some(magnitude) if magnitude.bytes().all(|byte| matches!(byte, b'0' | b'.')) => magnitude.to_owned(),
        Some(magnitude) => format!("−{magnitude}"),
        None => text,
    }
}

/// Returns `number` with a comma before every third digit: `8,064`.
pub(crate) fn thousands(number: usize) -> String {
    let digits = number.to_string();
    let mut text = String::new();
    for (index, digit) in digits.chars().enumerate() {
        if index > 0 && (digits.len() - index).is_multiple_of(3) {
            text.push(',');
        }
        text.push(digit);
    }
    text
}

fn is_whole(value: f64) -> bool {
    (value - value.round()).abs() < TICK_STEP
}

fn superscript(exponent: i32) -> String {
    exponent
        .to_string()
        .chars()
        .map(|character| match character.to_digit(10) {
            Some(digit) => ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'][digit as usize],
            None => '⁻',
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(range: [f64; 2], intervals: usize) -> Vec<String> {
        ticks(range, intervals).marks.into_iter().map(|(_, label)| label).collect()
    }

    #[test]
    fn steps_are_round_and_labels_exact() {
        assert_eq!(labels([0.0, 1.0], 5), ["0.0", "0.2", "0.4", "0.6", "0.8", "1.0"]);
        assert_eq!(labels([-0.75, 0.9], 4), ["−0.5", "0.0", "0.5"]);
        assert_eq!(labels([0.0, 17.0], 4), ["0", "5", "10", "15"]);
    }

    #[test]
    fn small_and_large_numbers_share_a_factor() {
        let small = ticks([0.0, 2e-4], 4);
        assert_eq!((small.factor.as_str(), small.marks[1].1.as_str()), ("×10⁻⁶", "50"));
        let large = ticks([0.0, 3e7], 3);
        assert_eq!((large.factor.as_str(), large.marks[3].1.as_str()), ("×10⁶", "30"));
    }

    #[test]
    fn ticks_lie_inside_and_never_exceed_the_wanted_number() {
        let mut low = -3.7e-3;
        for round in 0..200 {
            let range = [low, low + 1.37_f64.powi(round - 100)];
            for intervals in 1..8 {
                let ticks = ticks(range, intervals);
                assert!(ticks.marks.len() <= intervals + 1, "{range:?} {intervals}: {ticks:?}");
                let slack = 1e-5 * (range[1] - range[0]);
                assert!(ticks.marks.iter().all(|(at, _)| *at >= range[0] - slack && *at <= range[1] + slack));
            }
            low *= -1.1;
        }
    }

    #[test]
    fn decades_are_the_powers_of_ten() {
        let labels: Vec<String> = decades([0.01, 20_000.0], 9).marks.into_iter().map(|(_, label)| label).collect();
        assert_eq!(labels, ["0.01", "0.1", "1", "10", "100", "1000", "10⁴"]);
        assert!(decades([1e-300, 1e300], 9).marks.len() <= 10);
    }

    #[test]
    fn a_few_decades_have_numbers_between_the_powers_of_ten() {
        let labels = |range| decades(range, 7).marks.into_iter().map(|(_, label)| label).collect::<Vec<_>>();
        assert_eq!(labels([0.08, 1.1]), ["0.1", "0.2", "0.5", "1"]);
        assert_eq!(labels([90.0, 6e4]), ["100", "300", "1000", "3000", "10⁴", "3·10⁴"]);
        // No multiple of 1, 2 or 5 twice: round numbers.
        assert_eq!(labels([2.1, 4.3]), ["2.5", "3.0", "3.5", "4.0"]);
        for low in [1e-7, 0.3, 2.0, 7e5] {
            for ratio in [1.2, 2.0, 9.0, 40.0, 900.0, 1e5] {
                let marks = decades([low, ratio * low], 7).marks;
                assert!((2..=8).contains(&marks.len()), "{low} {ratio}: {marks:?}");
                assert!(marks.iter().all(|(at, _)| (low * 0.999..=low * ratio * 1.001).contains(at)));
            }
        }
    }

    #[test]
    fn hostile_ranges_have_no_ticks_and_do_not_hang() {
        for range in [[f64::NAN, 1.0], [1.0, 1.0], [2.0, 1.0], [0.0, f64::INFINITY], [f64::MIN, f64::MAX]] {
            assert!(ticks(range, 5).marks.is_empty());
        }
        assert!(labels([0.0, f64::MIN_POSITIVE], 5).len() <= 6);
        assert!(labels([1e300, 1e300 * (1.0 + 1e-12)], 5).len() <= 6);
    }

    #[test]
    fn ranges_hold_their_values_and_have_extent() {
        assert_eq!(range([1.0, f64::NAN, 3.0].into_iter(), 0.0), [1.0, 3.0]);
        for values in [vec![], vec![f64::NAN], vec![0.0], vec![-7.0], vec![f64::MAX, f64::MIN]] {
            let [low, high] = range(values.iter().copied(), 0.05);
            assert!(low < high && (high - low).is_finite(), "{values:?}");
        }
    }
}
