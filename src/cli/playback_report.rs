//! The report of `haptize play` beside its traces: the force at the end of the proxy, of one dataset or of two
//! felt by the same motion, where the torque came from, and what the dataset does not hold.

use super::{Failure, played};
use crate::{
    dataset::{Dataset, Provenance},
    device::{Motion, SimulatedHand},
    render::{setup::Setup, trace::Trace},
    report::{
        self,
        force::{EndForce, SteadyForce, force},
    },
};
use serde_json::{Value, json};
use std::{
    fmt::{self, Write},
    path::{Path, PathBuf},
};

/// Variation of a force below which it is reported as steady (1).
const STEADY: f64 = 0.25;

/// The result of a playback.
pub struct PlaybackReport {
    provenance: Provenance,
    absent: Vec<&'static str>,
    forces: Vec<EndForce>,
}

/// Another dataset that is felt by the same motion.
pub struct Beside<'path> {
    path: &'path Path,
    dataset: Dataset,
    setup: Setup,
    hand: SimulatedHand,
}

impl<'path> Beside<'path> {
    /// Opens the dataset at `path`, to be felt by `motion` beside that of `first`.
    pub fn open(path: &'path Path, first: &Setup, motion: Motion) -> Result<Self, Failure> {
        let dataset = Dataset::load(path)?;
        let setup = Setup::new(&dataset).map_err(|error| format!("{}: {error}", path.display()))?;
        if ![first, &setup].into_iter().all(|setup| EndForce::is_known(&setup.chain)) {
            return Err(format!(
                "--beside compares the force at the end of arms that have three joints, and contact nodes on the last \
                 link alone; play {} by itself",
                path.display()
            )
            .into());
        }
        let hand = setup.hand(motion)?;
        Ok(Self { path, dataset, setup, hand })
    }
}

impl PlaybackReport {
    /// Returns the result of playing the dataset at `path`, recorded in `trace`.
    pub fn new(path: &Path, dataset: &Dataset, setup: &Setup, trace: &Trace) -> Self {
        Self {
            provenance: dataset.provenance.clone(),
            absent: dataset.absent(),
            forces: EndForce::new(&name(path, dataset), &setup.chain, trace).into_iter().collect(),
        }
    }

    /// Has `other` felt by the same motion.
    pub fn beside(&mut self, mut other: Beside<'_>, seconds: f64) -> Result<(), Failure> {
        let played = played::play(&other.setup, &other.dataset, &mut other.hand, seconds, &mut |_| ())?;
        self.forces.extend(EndForce::new(&name(other.path, &other.dataset), &other.setup.chain, &played.trace));
        Ok(())
    }

    /// Draws the forces of all datasets in one figure, and returns its files.
    pub fn draw(&self, folder: &Path, trace: &Trace) -> Result<[PathBuf; 2], Failure> {
        Ok(report::write_both(folder, "force", &force(&self.forces, trace))?)
    }

    /// For programs.
    pub fn tell(&self, json: &mut Value) {
        json["held_force"] =
            self.forces.iter().map(|felt| json!({ "dataset": felt.name, "held": felt.held() })).collect();
        json["absent"] = self.absent.clone().into();
    }

    /// For people.
    pub fn describe(&self, text: &mut String) -> fmt::Result {
        for felt in &self.forces {
            if let Some(SteadyForce { axis, mean, variation }) = felt.held().filter(|held| held.variation < STEADY) {
                let (percent, name) = (100.0 * variation, &felt.name);
                write!(text, "  held force   {mean:.3} N along {axis} on {name}, ")?;
                writeln!(text, "constant to {percent:.1} % over the middle half of the contact")?;
            }
        }
        let Provenance { algorithm, backend, adapter, .. } = &self.provenance;
        writeln!(text, "  torque from  {algorithm} on {backend} ({adapter})")?;
        if !self.absent.is_empty() {
            writeln!(text, "  not there    {}", self.absent.join(", "))?;
        }
        Ok(())
    }
}

/// The file's name; a simulated specimen says so.
fn name(path: &Path, dataset: &Dataset) -> String {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    if dataset.provenance.backend.starts_with("simulated") { format!("{stem} (simulated)") } else { stem.into_owned() }
}
