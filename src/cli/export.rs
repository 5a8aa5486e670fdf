//! `haptize export`: a dataset for other programs.

use super::{
    Failure,
    info::describe_absent,
    output::{self, Content, Replaced},
    report::{self, Describe, Report, Text},
};
use crate::dataset::{Dataset, Format};
use clap::ValueEnum;
use serde::Serialize;
use std::path::PathBuf;

/// Arguments of `haptize export`.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  haptize export sphere.haptize --format npz
  haptize export sphere.haptize --format hdf5
  haptize export sphere.haptize --format csv -o tables/sphere.csv
  haptize export sphere.haptize --format vti               two or three joints, for ParaView")]
pub struct Arguments {
    /// The dataset's file.
    dataset: PathBuf,
    /// Format of the file.
    #[arg(long)]
    format: Format,
    /// The file to write; by default beside the dataset, with the format's extension.
    #[arg(short, long)]
    output: Option<PathBuf>,
}

/// Opens and checks the dataset, and writes it again.
pub fn run(arguments: &Arguments) -> Result<Report, Failure> {
    let dataset = Dataset::open(&arguments.dataset)?;
    let beside = || arguments.dataset.with_extension(arguments.format.extension());
    let output = arguments.output.clone().unwrap_or_else(beside);
    // Programs tell what a file is by its name.
    let is_of = |format: &&Format| output.extension().is_some_and(|ending| ending == format.extension());
    if let Some(other) = Format::value_variants().iter().find(is_of).filter(|other| **other != arguments.format) {
        let (file, ending, wanted) = (output.display(), other.extension(), arguments.format.extension());
        return Err(format!(
            "{file} has the name of another format: give --format {ending}, or a file whose name ends in .{wanted}"
        )
        .into());
    }
    let inputs = [arguments.dataset.as_path()];
    let replaced = output::check(&output, Content::Product, inputs)?;
    let beside = arguments.format.beside(&output).filter(|file| file.symlink_metadata().is_ok());
    if let Some(beside) = &beside {
        output::check(beside, Content::Product, inputs)?;
    }
    let files = dataset.export(&output, arguments.format)?;
    let stale = beside.filter(|beside| !files.contains(beside));
    if let Some(stale) = &stale {
        std::fs::remove_file(stale).map_err(|error| format!("cannot remove {}: {error}", stale.display()))?;
    }
    let removed = stale.map(|stale| stale.display().to_string());
    Report::new(&Exported { files: report::names(&files), absent: dataset.absent(), replaced, removed })
}

/// A dataset for other programs.
#[derive(Serialize)]
struct Exported {
    files: Vec<String>,
    /// Columns that the dataset does not hold.
    absent: Vec<&'static str>,
    #[serde(flatten)]
    replaced: Option<Replaced>,
    /// File of an earlier export that was not written again.
    #[serde(skip_serializing_if = "Option::is_none")]
    removed: Option<String>,
}

impl Describe for Exported {
    fn describe(&self, text: &mut Text) {
        self.files.iter().for_each(|file| text.line(file));
        describe_absent(text, &self.absent);
        self.replaced.describe(text);
        if let Some(removed) = &self.removed {
            text.row("removed", format_args!("{removed}, which an earlier export had left"));
        }
    }
}
