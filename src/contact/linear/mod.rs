//! Dense linear algebra on the nodes that carry contact.

pub mod cholesky;
pub mod condensed;
pub mod nonnegative;
pub mod rows;
pub mod support;
pub mod wide;
