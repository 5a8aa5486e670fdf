//! The report of `haptize play` beside its traces: the force at the end of the proxy, of one dataset or of two
//! felt by the same motion, where the torque came from, and what the dataset does not hold.

use super::{
    Failure,
    info::describe_absent,
    played,
    report::{Describe, Text},
};
use crate::{
    dataset::{Dataset, Provenance},
    device::{Motion, SimulatedHand},
    render::{setup::Setup, trace::Trace},
    report::{
        self as figures,
        force::{EndForce, SteadyForce, force},
    },
};
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Variation of a force below which it is reported as steady (1).
const STEADY: f64 = 0.25;

/// The result of a playback.
#[derive(Serialize)]
pub struct PlaybackReport {
    held_force: Vec<HeldForce>,
    /// Columns that the dataset does not hold.
    absent: Vec<&'static str>,
    #[serde(skip)]
    provenance: Provenance,
    #[serde(skip)]
    forces: Vec<EndForce>,
}

/// The steady force of a dataset, if there is one.
#[derive(Serialize)]
struct HeldForce {
    dataset: String,
    held: Option<SteadyForce>,
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
        let (provenance, absent) = (dataset.provenance.clone(), dataset.absent());
        let mut report = Self { held_force: Vec::new(), absent, provenance, forces: Vec::new() };
        report.add(EndForce::new(&name(path, dataset), &setup.chain, trace));
        report
    }

    /// Has `other` felt by the same motion.
    pub fn beside(&mut self, mut other: Beside<'_>, seconds: f64) -> Result<(), Failure> {
        let played = played::play(&other.setup, &other.dataset, &mut other.hand, seconds, &mut |_| ())?;
        self.add(EndForce::new(&name(other.path, &other.dataset), &other.setup.chain, &played.trace));
        Ok(())
    }

    fn add(&mut self, force: Option<EndForce>) {
        let held = force.iter().map(|force| HeldForce { dataset: force.name.clone(), held: force.held() });
        self.held_force.extend(held);
        self.forces.extend(force);
    }

    /// Draws the forces of all datasets in one figure, and returns its files.
    pub fn draw(&self, folder: &Path, trace: &Trace) -> Result<[PathBuf; 2], Failure> {
        Ok(figures::write_both(folder, "force", &force(&self.forces, trace))?)
    }
}

impl Describe for PlaybackReport {
    fn describe(&self, text: &mut Text) {
        for HeldForce { dataset, held } in &self.held_force {
            if let Some(SteadyForce { axis, mean, variation }) = held.filter(|held| held.variation < STEADY) {
                let percent = 100.0 * variation;
                text.row(
                    "held force",
                    format_args!(
                        "{mean:.3} N along {axis} on {dataset}, constant to {percent:.1} % over the middle half of the \
                         contact"
                    ),
                );
            }
        }
        let Provenance { algorithm, backend, adapter, .. } = &self.provenance;
        text.row("torque from", format_args!("{algorithm} on {backend} ({adapter})"));
        describe_absent(text, &self.absent);
    }
}

/// The file's name; a simulated specimen says so.
fn name(path: &Path, dataset: &Dataset) -> String {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    if dataset.provenance.backend.starts_with("simulated") { format!("{stem} (simulated)") } else { stem.into_owned() }
}
