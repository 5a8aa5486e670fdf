//! `haptize export`: a dataset for other programs.

use super::{
    Failure, Report,
    output::{self, Content},
};
use crate::dataset::{Dataset, Format};
use std::path::PathBuf;

/// Arguments of `haptize export`.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  haptize export sphere.haptize --format npz
  haptize export sphere.haptize --format hdf5
  haptize export sphere.haptize --format csv -o tables/sphere.csv")]
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
    let inputs = [arguments.dataset.as_path()];
    let earlier = output::check(&output, Content::Product, inputs)?;
    let beside = arguments.format.beside(&output).filter(|file| file.symlink_metadata().is_ok());
    if let Some(beside) = &beside {
        output::check(beside, Content::Product, inputs)?;
    }
    let files = dataset.export(&output, arguments.format)?;
    let names: Vec<String> = files.iter().map(|file| file.display().to_string()).collect();
    let absent = dataset.absent();
    let mut text: String = names.iter().map(|name| format!("{name}\n")).collect();
    if !absent.is_empty() {
        text += &format!("  not there    {}\n", absent.join(", "));
    }
    let mut json = serde_json::json!({ "files": names, "absent": absent });
    earlier.tell(&mut text, &mut json);
    if let Some(stale) = beside.filter(|beside| !files.contains(beside)) {
        std::fs::remove_file(&stale).map_err(|error| format!("cannot remove {}: {error}", stale.display()))?;
        text += &format!("  removed      {}, which an earlier export had left\n", stale.display());
        json["removed"] = stale.display().to_string().into();
    }
    Ok(Report { text, json, whole: true })
}
