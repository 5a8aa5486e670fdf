//! `haptize export`: a dataset for other programs.

use super::{
    Failure, Report,
    output::{self, Kind},
};
use crate::dataset::{Dataset, Format};
use std::path::PathBuf;

/// What to export, and where to.
#[derive(clap::Args)]
pub struct Arguments {
    /// The dataset's file.
    dataset: PathBuf,
    /// What to write.
    #[arg(long)]
    format: Format,
    /// The file to write; by default beside the dataset, with the format's extension.
    #[arg(short, long)]
    output: Option<PathBuf>,
}

/// Opens and checks the dataset, and writes it anew.
pub fn run(arguments: &Arguments) -> Result<Report, Failure> {
    let dataset = Dataset::open(&arguments.dataset)?;
    let beside = || arguments.dataset.with_extension(arguments.format.extension());
    let output = arguments.output.clone().unwrap_or_else(beside);
    let kind = match arguments.format {
        Format::Npz => Kind::Archive,
        Format::Csv => Kind::Table,
    };
    output::check(&output, kind, [arguments.dataset.as_path()])?;
    let files = dataset.export(&output, arguments.format)?;
    let names: Vec<String> = files.iter().map(|file| file.display().to_string()).collect();
    let absent = dataset.absent();
    let mut text: String = names.iter().map(|name| format!("{name}\n")).collect();
    if !absent.is_empty() {
        text += &format!("  not there    {}\n", absent.join(", "));
    }
    Ok(Report { text, json: serde_json::json!({ "files": names, "absent": absent }), whole: true })
}
