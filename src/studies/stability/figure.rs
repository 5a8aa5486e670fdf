//! The outcomes as a picture, how much of its bound each figure takes, and as tables in Markdown.

use super::{Bound, CaseResult, figure as number};
use crate::report::{
    ReportError,
    canvas::{Anchor, Area, Canvas},
    chart::{MARGIN, headline},
    colour,
    plot::{NOTE, TICK, TITLE},
    ticks, write, write_both,
};
use std::{
    fmt::Write as _,
    path::{Path, PathBuf},
};

/// Width of the sheet, in points.
const WIDTH: f64 = 980.0;
/// Where the measures begin, and the axis.
const MEASURES: f64 = 246.0;
const AXIS: f64 = 640.0;
/// Height of a row.
const ROW: f64 = 18.0;
/// Top of the first room.
const TOP: f64 = 84.0;
/// Ends of the axis: shares of the bound. Less is drawn at the left end, more at the right.
const SHARES: [f64; 2] = [1e-6, 10.0];

/// Files that [`write_all`] writes.
pub const FILES: [&str; 3] = ["stability.svg", "stability.png", "stability.md"];

/// Writes `stability.md` and `stability.{svg,png}` into `folder`: the outcomes, each with its room, as found on
/// `adapter`.
///
/// # Errors
/// [`ReportError::Write`] when a file cannot be written.
pub fn write_all(folder: &Path, outcomes: &[(&str, CaseResult)], adapter: &str) -> Result<Vec<PathBuf>, ReportError> {
    let mut files = write_both(folder, "stability", &figure(outcomes, adapter))?.to_vec();
    files.push(write(folder.join("stability.md"), markdown(outcomes).as_bytes())?);
    Ok(files)
}

/// Returns the ratio of a figure to its bound: above one, or NaN, the bound is broken. For a share that must reach
/// some part of one, it is the ratio of what is lacking to what may be lacking.
fn share(outcome: &CaseResult) -> f64 {
    let share = match outcome.bound {
        Bound::AtMost(bound) => outcome.worst / bound,
        Bound::AtLeast(bound) if 0.0 < bound && bound < 1.0 && outcome.worst <= 1.0 => {
            (1.0 - outcome.worst) / (1.0 - bound)
        }
        Bound::AtLeast(bound) => bound / outcome.worst,
    };
    match (outcome.passed(), share.is_nan()) {
        // Nothing, where nothing is allowed; or less than nothing.
        (true, true) => 0.0,
        (true, false) => share.min(1.0),
        (false, true) => f64::INFINITY,
        (false, false) => {
            if share > 1.0 {
                share
            } else {
                f64::INFINITY
            }
        }
    }
}

/// One row of the picture: the figures of one measure of one case.
struct Row<'a> {
    case: &'a str,
    measure: &'a str,
    figures: usize,
    /// The greatest of them.
    share: f64,
}

/// The rows of one room, in the order of their first figures.
fn rows<'a>(room: &'a [(&str, CaseResult)]) -> Vec<Row<'a>> {
    let mut rows: Vec<Row<'a>> = Vec::new();
    for (_, outcome) in room {
        let share = share(outcome);
        match rows.iter_mut().find(|row| row.case == outcome.case && row.measure == outcome.measure) {
            Some(row) => (row.figures, row.share) = (row.figures + 1, row.share.max(share)),
            None => rows.push(Row { case: &outcome.case, measure: &outcome.measure, figures: 1, share }),
        }
    }
    rows
}

/// One row a measure of a case, room by room.
fn figure(outcomes: &[(&str, CaseResult)], adapter: &str) -> Canvas {
    let rooms: Vec<(&str, Vec<Row<'_>>)> =
        outcomes.chunk_by(|a, b| a.0 == b.0).map(|room| (room[0].0, rows(room))).collect();
    let height = rooms.iter().map(|(_, rows)| (rows.len() + 2) as f64 * ROW).sum();
    let mut canvas = Canvas::new(WIDTH, TOP + height + 52.0);
    headline(&mut canvas, "How much of its bound each hard case takes");
    let failed = outcomes.iter().filter(|(_, outcome)| !outcome.passed()).count();
    let note = format!("{} of {} figures keep their bounds; {adapter}", outcomes.len() - failed, outcomes.len());
    canvas.text((MARGIN, 60.0), &note, NOTE);
    let area = Area { x: AXIS, y: TOP, width: WIDTH - MARGIN - AXIS - 8.0, height };
    let place = |share: f64| {
        let [low, high] = SHARES.map(f64::log10);
        area.x + (share.clamp(SHARES[0], SHARES[1]).log10() - low) / (high - low) * area.width
    };
    for (value, label) in &ticks::decades(SHARES, 8).marks {
        let x = place(*value);
        let (ink, width) = if *value == 1.0 { (colour::FRAME, 1.6) } else { (colour::GRID, 1.0) };
        canvas.polyline(&[(x, area.y), (x, area.bottom())], ink, width, None);
        canvas.text((x, area.bottom() + 17.0), label, TICK);
    }
    canvas.text(
        (area.x + 0.5 * area.width, area.bottom() + 37.0),
        "Share of the bound [1]",
        TITLE.anchored(Anchor::Middle),
    );
    let mut y = TOP;
    for (room, rows) in rooms {
        y += 2.0 * ROW;
        canvas.text((MARGIN, y - 6.0), room, TITLE);
        let mut before = "";
        for Row { case, measure, figures, share } in rows {
            let line = y + 0.5 * ROW + 0.36 * NOTE.size;
            if case != before {
                canvas.polyline(&[(MARGIN, y), (WIDTH - MARGIN, y)], colour::GRID, 0.8, None);
                canvas.text((MARGIN, line), case, NOTE);
                before = case;
            }
            let style = TICK.anchored(Anchor::Start);
            let count = if figures > 1 { format!(", {figures} times") } else { String::new() };
            canvas.text((MEASURES, line), &shortened(&format!("{measure}{count}"), |text| style.width(text)), style);
            let middle = y + 0.5 * ROW;
            let ink = colour::series(if share <= 1.0 { 2 } else { 1 });
            canvas.polyline(&[(area.x, middle), (place(share), middle)], ink.with_opacity(0.35), 5.0, None);
            canvas.disc((place(share), middle), 4.0, ink);
            y += ROW;
        }
    }
    canvas
}

/// As much of `text` as fits before the axis.
fn shortened(text: &str, width: impl Fn(&str) -> f64) -> String {
    const ROOM: f64 = AXIS - MEASURES - 14.0;
    if width(text) <= ROOM {
        return text.to_owned();
    }
    let ends = text.char_indices().map(|(end, _)| format!("{}…", text[..end].trim_end()));
    ends.take_while(|text| width(text) <= ROOM).last().unwrap_or_default()
}

/// A table for each room.
fn markdown(outcomes: &[(&str, CaseResult)]) -> String {
    let mut text = String::new();
    for room in outcomes.chunk_by(|a, b| a.0 == b.0) {
        // A String takes everything, here and below.
        let _ = writeln!(text, "### {}\n\n| case | varied | measure | worst | bound | | beside |", room[0].0);
        let _ = writeln!(text, "|---|---|---|---:|---:|---|---|");
        for (_, outcome) in room {
            let verdict = if outcome.passed() { "pass" } else { "**fail**" };
            let cells = [&outcome.case, &outcome.varied, &outcome.measure].map(|cell| cell.replace('|', "\\|"));
            let _ = writeln!(
                text,
                "| {} | {} | {} | {verdict} | {} |",
                cells.join(" | "),
                number(outcome.worst),
                outcome.bound,
                outcome.note.replace('|', "\\|")
            );
        }
        text.push('\n');
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    fn outcome(worst: f64, bound: Bound) -> CaseResult {
        let text = |text: &str| text.to_owned();
        CaseResult {
            case: text("case"),
            varied: text("a | b"),
            measure: text("size [m]"),
            worst,
            bound,
            note: text(""),
        }
    }

    #[test]
    fn a_share_is_above_one_exactly_where_the_bound_is_broken() {
        for (worst, bound, expected) in [
            (0.5, Bound::AtMost(1.0), 0.5),
            (-1.0, Bound::AtMost(1.0), -1.0),
            (4.0, Bound::AtLeast(1.0), 0.25),
            (2.0, Bound::AtMost(1.0), 2.0),
            (0.5, Bound::AtLeast(1.0), 2.0),
            (0.75, Bound::AtLeast(0.5), 0.5),
            (0.0, Bound::AtLeast(0.5), 2.0),
            (1.0, Bound::AtLeast(0.5), 0.0),
            (0.0, Bound::AtMost(0.0), 0.0),
            (1.0, Bound::AtMost(0.0), f64::INFINITY),
            (-1.0, Bound::AtLeast(1.0), f64::INFINITY),
            (f64::NAN, Bound::AtMost(1.0), f64::INFINITY),
        ] {
            assert_eq!(share(&outcome(worst, bound)), expected, "{worst} {bound}");
            assert_eq!(outcome(worst, bound).passed(), expected <= 1.0);
        }
    }

    #[test]
    fn the_table_has_a_row_for_each_figure_and_the_picture_for_each_measure() {
        let outcomes = [
            ("loop", outcome(0.5, Bound::AtMost(1.0))),
            ("loop", outcome(2.0, Bound::AtMost(1.0))),
            ("graphics", outcome(0.0, Bound::AtMost(1.0))),
        ];
        let folder = tempfile::tempdir().unwrap();
        let files = write_all(folder.path(), &outcomes, "an adapter").unwrap();
        assert!(files.iter().all(|file| file.exists()));
        let table = markdown(&outcomes);
        assert_eq!(table.lines().filter(|line| line.starts_with("| case | a \\| b")).count(), 3, "{table}");
        assert_eq!((table.matches("### ").count(), table.matches("**fail**").count()), (2, 1));
        let svg = std::fs::read_to_string(folder.path().join("stability.svg")).unwrap();
        assert_eq!(svg.matches("<circle").count(), 2);
        let worst = rows(&outcomes[..2]);
        assert_eq!((worst.len(), worst[0].figures, worst[0].share), (1, 2, 2.0));
        assert_eq!(shortened("four", |text| 100.0 * text.chars().count() as f64), "fo…");
    }
}
