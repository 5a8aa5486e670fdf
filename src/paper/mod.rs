//! The paper's own method, and its results remade: the iteration of section 2.1 with a sweep of it, the procedure as a
//! drawing (Fig. 2), the specimen (Fig. 7), and the paper's numbers beside ours. Nothing else solves by the iteration:
//! it is one more [`Backend`](crate::contact::Backend).
//!
//! The other figures are those of any dataset and session: [`space`](crate::report::space) (Fig. 3),
//! [`gridized`](crate::report::gridized) (Fig. 4), [`press`](crate::report::press) (Figs. 5 and 9),
//! [`object`](crate::report::object) (Fig. 6) and [`force`](crate::report::force) (Fig. 8).

mod backend;
mod comparison;
mod iteration;
mod procedure;
mod specimen;

pub use backend::{PaperBackend, PaperSolver, baked, haptize};
pub use comparison::{Comparison, FIGURES, FigureNote, HEADING, Row, Value};
pub use procedure::procedure;
pub use specimen::{PressedTwin, hardest, specimen};

use crate::{
    dataset::Dataset,
    gridize::Samples,
    proxy::Chain,
    render::trace::Trace,
    scene::{ScanScene, Scene},
};

/// The virtual object of section 4.1.
#[derive(Clone, Copy)]
pub struct Sphere<'a> {
    /// Its scene.
    pub scene: &'a Scene,
    /// The dataset.
    pub dataset: &'a Dataset,
    /// The press (Figs. 5 and 6).
    pub press: &'a Trace,
}

/// A scanned object of section 4.2.
#[derive(Clone, Copy)]
pub struct Scanned<'a> {
    /// Its scene.
    pub scene: &'a ScanScene,
    /// The measurements.
    pub samples: &'a Samples,
    /// The measurements on the uniform grid.
    pub dataset: &'a Dataset,
    /// The proxy that scanned, which is the proxy that feels.
    pub chain: &'a Chain,
    /// The motion of Fig. 8 or Fig. 9.
    pub trace: &'a Trace,
}

/// The three scans of section 4.2.
#[derive(Clone, Copy)]
pub struct Scans<'a> {
    /// From above, bare: scraped.
    pub bare: Scanned<'a>,
    /// From above, under a fabric: scraped.
    pub fabric: Scanned<'a>,
    /// From the side: pressed.
    pub side: Scanned<'a>,
}
