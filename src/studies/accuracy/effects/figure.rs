//! One row a variant, one column a cost: a dot at the least of the rounds, a line from there to the greatest, and a
//! ring at what the effect costs within the whole scene.

use super::{super::Cost, Effects};
use crate::report::{
    canvas::{Anchor, Area, Canvas},
    chart::{MARGIN, headline},
    colour,
    plot::{NOTE, TICK, TITLE},
    ticks,
};

/// Width of the sheet, in points.
const WIDTH: f64 = 1220.0;
/// Room for the names of the effects.
const NAMES: f64 = 132.0;
/// Height of a row.
const ROW: f64 = 24.0;
/// Top of the rows: below headline, note, titles and what the baselines take.
const TOP: f64 = 126.0;
/// Room between two columns.
const BETWEEN: f64 = 22.0;
/// Room for a number beside the dots.
const NUMBER: f64 = 34.0;

/// Draws the cost of each effect.
#[must_use]
pub(in super::super) fn figure(effects: &Effects) -> Canvas {
    let rows = effects.prices.len() as f64;
    let mut canvas = Canvas::new(WIDTH, TOP + rows * ROW + 52.0);
    headline(&mut canvas, "What each effect costs, relative to the scene without it");
    let note = format!(
        "dots, left numbers: alone, the least of {} rounds, lines up to the greatest; rings, right numbers: within \
         the whole scene; {:.0} % of the ticks are in contact; {} nodes are drawn; frames on the GPU: {}",
        effects.rounds,
        100.0 * effects.in_contact,
        effects.nodes,
        effects.adapter.as_deref().unwrap_or("no adapter")
    );
    canvas.text((MARGIN, 60.0), &note, NOTE);
    let area = Area { x: MARGIN, y: TOP, width: WIDTH - 2.0 * MARGIN, height: rows * ROW };
    for (row, price) in effects.prices.iter().enumerate() {
        let y = TOP + row as f64 * ROW;
        if row % 2 == 0 {
            canvas.rectangle(Area { y, height: ROW, ..area }, colour::SHADE);
        }
        canvas.text((MARGIN + 6.0, base_line(y)), &price.name, NOTE);
    }
    let width = (area.width - NAMES + BETWEEN) / 6.0;
    for (column, (title, takes)) in effects.heads().into_iter().enumerate() {
        let x = MARGIN + NAMES + column as f64 * width;
        let area = Area { x, width: width - BETWEEN, ..area };
        canvas.text((area.x, TOP - 28.0), title, TITLE);
        canvas.text((area.x, TOP - 11.0), &takes, TICK.anchored(Anchor::Start));
        let costs: Vec<[Option<Cost>; 2]> = effects.prices.iter().map(|price| price.columns()[column]).collect();
        draw(&mut canvas, area, &costs);
    }
    canvas
}

fn base_line(top: f64) -> f64 {
    top + 0.5 * ROW + 0.36 * NOTE.size
}

/// One column: an axis of ratios that holds one, and all of `costs`. What costs more than its baseline usually does has
/// the other colour.
fn draw(canvas: &mut Canvas, area: Area, costs: &[[Option<Cost>; 2]]) {
    // One round that was interrupted does not set the scale: its line is cut.
    let alone = costs.iter().filter_map(|[alone, _]| *alone);
    let within = costs.iter().filter_map(|[_, within]| *within);
    let ends = alone.clone().flat_map(|cost| [cost.least, cost.median]).chain(within.map(|cost| cost.least));
    let [low, high] = ticks::range(ends.chain([0.95, 1.05]), 0.0);
    // Equal lengths are equal ratios where there are large ones.
    let wide = low > 0.0 && high > 5.0 * low;
    let along = |ratio: f64| if wide { ratio.log10() } else { ratio };
    let spare = 0.05 * (along(high) - along(low));
    let [left, right] = [along(low) - spare, along(high) + spare];
    // Numbers stand at the right end, clear of all dots.
    let [first, second] = [area.right() - NUMBER, area.right()];
    let place = |ratio: f64| area.x + (along(ratio) - left) / (right - left) * (first - NUMBER - area.x);
    let marks = if wide { ticks::decades([low, high], 2) } else { ticks::ticks([left, right], 2) };
    for (value, label) in &marks.marks {
        let x = place(*value);
        canvas.polyline(&[(x, area.y), (x, area.bottom())], colour::GRID, 1.0, None);
        canvas.text((x, area.bottom() + 17.0), label, TICK);
    }
    canvas.polyline(&[(place(1.0), area.y), (place(1.0), area.bottom())], colour::FRAME, 1.2, None);
    let usual = alone.clone().find(|cost| cost.least == 1.0).map_or(1.0, |baseline| baseline.median);
    for (row, [alone, within]) in costs.iter().enumerate() {
        let top = area.y + row as f64 * ROW;
        let middle = top + 0.5 * ROW;
        let mut number = |x: f64, cost: &Option<Cost>| {
            let text = cost.map_or_else(|| "–".to_owned(), |cost| format!("{:.2}", cost.least));
            canvas.text((x, base_line(top)), &text, TICK.anchored(Anchor::End));
        };
        number(first, alone);
        if within.is_some() {
            number(second, within);
        }
        let ink = |cost: &Cost| colour::series(usize::from(cost.least > usual));
        if let Some(cost) = within {
            let centre = (place(cost.least), middle);
            canvas.disc(centre, 5.6, ink(cost));
            canvas.disc(centre, 4.2, if row % 2 == 0 { colour::SHADE } else { colour::WHITE });
        }
        if let Some(cost) = alone {
            let end = place(cost.greatest).min(first - NUMBER);
            let ends = [(place(cost.least), middle), (end, middle)];
            canvas.polyline(&ends, ink(cost).with_opacity(0.6), 2.2, None);
            canvas.disc(ends[0], 3.6, ink(cost));
        }
    }
}
