//! The extension module beneath the Python package `haptize`: classes and functions that hand NumPy arrays to the
//! library and its results back. Nothing is decided here.

mod arrays;
mod background;
mod bake;
mod dataset;
mod direct;
mod errors;
mod field;
mod gridize;
mod haptic_loop;
mod scene;
mod threads;

use pyo3::prelude::*;

/// Contact solved beforehand for every joint configuration, felt at 1 kHz.
#[pymodule]
mod _haptize {
    use super::{errors, threads};
    use pyo3::prelude::*;
    use std::ffi::OsString;

    #[pymodule_export]
    use super::{
        bake::bake,
        dataset::Dataset,
        direct::{Equilibrium, Solver, solve},
        field::Field,
        gridize::gridize,
        haptic_loop::Loop,
        scene::Scene,
    };

    /// Run the command line `arguments`, the program's name first, and return its exit code. Wrong arguments, and help,
    /// end the process.
    #[pyfunction]
    fn main(py: Python<'_>, arguments: Vec<OsString>) -> PyResult<u8> {
        threads::detach(py, || haptize::cli::run(arguments))
    }

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        module.add("__version__", env!("CARGO_PKG_VERSION"))?;
        threads::watch_forks(module)?;
        errors::add(module)
    }
}
