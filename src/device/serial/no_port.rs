//! Serial lines are not supported here: every use says so.

use crate::device::Halt;

/// A line that cannot be opened.
#[derive(Debug)]
pub struct Port(std::convert::Infallible);

impl Port {
    /// Refuses.
    ///
    /// # Errors
    /// Always.
    pub fn open(_: &str) -> Result<Self, String> {
        Err("serial devices need Linux or macOS".into())
    }

    /// Is never called.
    pub fn end_with(&mut self, _: &[u8]) -> Result<(), String> {
        match self.0 {}
    }

    /// Is never called.
    pub fn receive(&mut self, _: &mut [u8]) -> Result<usize, Halt> {
        match self.0 {}
    }

    /// Is never called.
    pub fn send(&mut self, _: &[u8]) -> Result<usize, Halt> {
        match self.0 {}
    }

    /// Is never called.
    pub fn wait(&self, _: f64) {
        match self.0 {}
    }

    /// Is never called.
    pub fn clear(&mut self) {
        match self.0 {}
    }
}

/// Does nothing: no line is open.
pub fn let_go() {}

/// Returns nothing.
#[must_use]
pub fn ports() -> Vec<String> {
    Vec::new()
}
