//! Drawing, without a display, a GPU or a system font: charts and solid bodies.
//!
//! [`canvas`] is the paper sheet (SVG, and the same sheet rasterised to PNG), [`plot`] draws charts and heat maps on it,
//! [`solid`] lists solid bodies, [`raster`] draws them as a [`camera`] sees them. Figures and window share them.

pub mod camera;
pub mod canvas;
pub mod chart;
pub mod colour;
pub mod diagram;
mod font;
pub mod plot;
pub mod raster;
pub mod solid;
pub(crate) mod ticks;
