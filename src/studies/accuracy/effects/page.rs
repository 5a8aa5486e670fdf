//! Prices as text, as CSV and as a section of the page.

use super::{
    super::{Cost, escaped},
    Effects,
};
use crate::{
    csv::{Table, quoted},
    report::canvas::Canvas,
};
use std::{
    fmt::{self, Write as _},
    io,
};

/// The table, for people.
///
/// # Errors
/// None in a `String`.
pub(in super::super) fn describe(text: &mut String, effects: &Effects) -> fmt::Result {
    writeln!(
        text,
        "  effects: the plain scene with each over it without (frames and GPU memory: graphics alone), and so within \
         the whole scene; least of the rounds"
    )?;
    write!(text, "    {:<18}", "")?;
    for (title, _) in effects.heads() {
        write!(text, "{title:>14}")?;
    }
    writeln!(text)?;
    for price in &effects.prices {
        write!(text, "    {:<18}", price.name)?;
        for costs in price.columns() {
            let [alone, within] =
                costs.map(|cost| cost.map_or_else(|| "-".to_owned(), |cost| format!("{:.2}", cost.least)));
            write!(text, "{alone:>8} {within:>5}")?;
        }
        writeln!(text)?;
    }
    effects.notes.iter().try_for_each(|note| writeln!(text, "  note         {note}"))
}

/// Returns all prices, a row each.
///
/// # Errors
/// None in memory.
pub(in super::super) fn csv(effects: &Effects) -> io::Result<Vec<u8>> {
    let mut text = Vec::new();
    let mut table = Table::new(&mut text);
    table.fields(["name", "setting"])?;
    for place in ["", "within_"] {
        for what in ["bake", "tick", "frame", "gpu_frame", "device", "dataset"] {
            table.fields(["median", "least", "greatest"].map(|kind| format!("{place}{what}_{kind}")))?;
        }
    }
    table.fields(["device_bytes", "device_buffers", "dispatches", "pipelines", "dataset_bytes"])?.end()?;
    for price in &effects.prices {
        table.field(&price.name)?.field(quoted(&price.setting))?;
        let columns = price.columns();
        for cost in [0, 1].into_iter().flat_map(|place| columns.map(|costs| costs[place])) {
            let numbers = |Cost { median, least, greatest }| [median, least, greatest].map(Some);
            for number in cost.map_or([None; 3], numbers) {
                table.optional(number)?;
            }
        }
        let (bytes, counts) = match price.device {
            Some(takes) => (Some(takes.bytes), [takes.buffers, takes.dispatches, takes.pipelines].map(Some)),
            None => (None, [None; 3]),
        };
        table.optional(bytes)?;
        for count in counts {
            table.optional(count)?;
        }
        table.field(price.dataset_bytes)?.end()?;
    }
    Ok(text)
}

/// The section of the page: figure and table.
///
/// # Errors
/// None in a `String`.
pub(in super::super) fn html(html: &mut String, effects: &Effects, figure: &Canvas) -> fmt::Result {
    writeln!(html, "<h2>What each effect costs</h2>")?;
    let caption = "Dots are the least of the rounds over the least of the baseline, lines reach up to the greatest; \
                   rings are what the effect costs within the whole scene. An effect of the tick costs no frame, one \
                   of the graphics no tick; friction and contact damping have contact forces stored, which the size \
                   of the dataset shows. In the table: least (median, greatest), alone, and below it within the whole \
                   scene.";
    writeln!(html, "<figure>{}<figcaption>{caption}</figcaption></figure>", figure.svg())?;
    write!(html, "<table><tr><th>effect<th>value")?;
    for (title, takes) in effects.heads() {
        write!(html, "<th>{title}<br>{takes}")?;
    }
    writeln!(html, "<th>GPU dispatches<th>pipelines</tr>")?;
    for price in &effects.prices {
        write!(html, "<tr><td>{}<td>{}", escaped(&price.name), escaped(&price.setting))?;
        for [alone, within] in price.columns() {
            write!(html, "<td>{}", told(alone))?;
            if price.within.is_some() {
                write!(html, "<br>{}", told(within))?;
            }
        }
        match price.device {
            Some(takes) => writeln!(html, "<td>{}<td>{}</tr>", takes.dispatches, takes.pipelines)?,
            None => writeln!(html, "<td>–<td>–</tr>")?,
        }
    }
    writeln!(html, "</table>")?;
    effects.notes.iter().try_for_each(|note| writeln!(html, "<p>Note: {}</p>", escaped(note)))
}

/// Least, median and greatest.
fn told(cost: Option<Cost>) -> String {
    match cost {
        Some(Cost { median, least, greatest }) if least < greatest => {
            format!("{least:.2} ({median:.2}, {greatest:.2})")
        }
        Some(Cost { least, .. }) => format!("{least:.2}"),
        None => "–".to_owned(),
    }
}
