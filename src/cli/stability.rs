//! `haptize stability`: the hard cases of contact, gridization, loops and graphics, on this machine and its adapter.

use super::{Failure, Report, bar::Bar, output::Folder};
use crate::{
    gpu::{AdapterChoice, Context},
    studies::stability::{Bound, Case, CaseResult, Effort, FILES, Setting, cases, table, write_all},
    sweep::{OTHER_ADAPTER, remedied},
};
use serde_json::json;
use std::{path::PathBuf, sync::Arc, time::Instant};

/// Which cases, on what.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  haptize stability
  haptize stability contact --no-gpu
  haptize stability --full -o out/stability")]
pub struct Arguments {
    /// Modules to test: contact, gridization, loop, graphics; by default all.
    rooms: Vec<String>,
    /// Run all variations of every case instead of a sample that takes a minute: hours for contact, seconds for the
    /// other modules.
    #[arg(long)]
    full: bool,
    /// Skip the cases that need a GPU.
    #[arg(long)]
    no_gpu: bool,
    /// A folder to write the table (Markdown) and a picture of it to.
    #[arg(short, long)]
    output: Option<PathBuf>,
}

/// Runs the cases one after another; whole only if every figure keeps its bound.
pub fn run(arguments: &Arguments) -> Result<Report, Failure> {
    let cases = chosen(arguments)?;
    let folder = arguments.output.as_ref().map(|folder| Folder::check(folder, FILES, [])).transpose()?;
    let (gpu, adapter) = adapter(arguments.no_gpu);
    let effort = if arguments.full { Effort::Full } else { Effort::Sample };
    let setting = Setting { effort, gpu };
    let bar = Bar::new("cases", "{wide_bar} {pos}/{len} cases, {msg}, {elapsed}");
    let started = Instant::now();
    let (mut outcomes, mut spent) = (Vec::new(), Vec::new());
    for (done, case) in cases.iter().enumerate() {
        let began = Instant::now();
        bar.set(done as u64, cases.len() as u64, format!("{}: {}", case.room, case.name));
        // A case that cannot be run has not passed.
        let found = (case.run)(&setting).unwrap_or_else(|error| vec![not_run(case, &error)]);
        outcomes.extend(found.into_iter().map(|outcome| (case.room, outcome)));
        spent.push((case, began.elapsed().as_secs_f64()));
    }
    bar.finish();
    let seconds = started.elapsed().as_secs_f64();
    let failed = outcomes.iter().filter(|(_, outcome)| !outcome.passed()).count();
    let rows: Vec<_> = outcomes
        .iter()
        .map(|(room, outcome)| {
            let mut row = serde_json::to_value(outcome)?;
            row["room"] = (*room).into();
            row["passed"] = outcome.passed().into();
            Ok::<_, serde_json::Error>(row)
        })
        .collect::<Result<_, _>>()?;
    let files = match &arguments.output {
        Some(folder) => write_all(folder, &outcomes, &adapter)?,
        None => Vec::new(),
    };
    spent.sort_by(|a, b| b.1.total_cmp(&a.1));
    let row = |(case, seconds): &(&Case, f64)| json!({ "room": case.room, "case": case.name, "seconds": seconds });
    let mut json = json!({
        "outcomes": rows, "failed": failed, "adapter": adapter, "seconds": seconds,
        "spent": spent.iter().map(row).collect::<Vec<_>>(),
        "files": files.iter().map(|file| file.display().to_string()).collect::<Vec<_>>(),
    });
    let mut text = String::new();
    for room in ["contact", "gridization", "loop", "graphics"] {
        let of_room = outcomes.iter().filter(|(of, _)| *of == room).map(|(_, outcome)| outcome.clone());
        let of_room: Vec<CaseResult> = of_room.collect();
        if !of_room.is_empty() {
            text += &format!("{room}\n{}\n", table(&of_room));
        }
    }
    let count = outcomes.len();
    text += &format!("{} of {count} figures keep their bounds; {seconds:.1} s, {adapter}\n", count - failed);
    let longest: Vec<String> =
        spent.iter().take(3).map(|(case, seconds)| format!("{} {seconds:.1} s", case.name)).collect();
    text += &format!("longest: {}\n", longest.join(", "));
    if let (Some(path), Some(folder)) = (&arguments.output, folder) {
        text += &format!("{} files in {}\n", files.len(), path.display());
        folder.close(&files, &mut text, &mut json)?;
    }
    Ok(Report { text, json, whole: failed == 0 })
}

fn chosen(arguments: &Arguments) -> Result<Vec<Case>, Failure> {
    let all = cases();
    let known = |room: &String| all.iter().any(|case| case.room == *room);
    if let Some(unknown) = arguments.rooms.iter().find(|room| !known(room)) {
        let mut rooms: Vec<&str> = all.iter().map(|case| case.room).collect();
        rooms.dedup();
        return Err(format!("no hard case belongs to `{unknown}`; there are {}", rooms.join(", ")).into());
    }
    let wanted = |case: &Case| arguments.rooms.is_empty() || arguments.rooms.iter().any(|room| case.room == *room);
    Ok(all.into_iter().filter(wanted).collect())
}

/// The adapter for the GPU's half, and what to say of it.
fn adapter(left_out: bool) -> (Option<Arc<Context>>, String) {
    if left_out {
        return (None, "the GPU's half left out".to_owned());
    }
    match Context::open(AdapterChoice::Any) {
        Ok(context) => {
            let name = context.adapter().name.clone();
            (Some(Arc::new(context)), name)
        }
        Err(error) => (None, format!("the GPU's half left out: {}", remedied(&error.to_string(), OTHER_ADAPTER))),
    }
}

fn not_run(case: &Case, error: &Failure) -> CaseResult {
    CaseResult {
        case: case.name.to_owned(),
        varied: "not run".to_owned(),
        measure: "errors".to_owned(),
        worst: 1.0,
        bound: Bound::AtMost(0.0),
        note: error.to_string(),
    }
}
