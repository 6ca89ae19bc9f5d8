//! The small language of a task's conditions: comparisons of channels and measures, `and`, `or`,
//! `not`, `for` a time, and `then`.
//!
//! [`syntax`] reads a text into a tree, [`check`] gives it meaning and units against the scene, and
//! [`tree`] is what it then is. Nothing is executed here. Length and depth are bounded: no text can
//! exhaust the stack.

mod check;
mod measure;
mod names;
mod syntax;
mod tree;
mod units;

pub use check::MAX_MEASURES;
pub(crate) use check::{Checker, Hints};
pub use measure::{Measure, Part, Place, Target};
pub(crate) use names::Needs;
pub use names::channel_names;
pub(crate) use syntax::{Tree, parse};
pub use tree::{Comparison, Condition, Number, Operation};
pub(crate) use units::Unit;

/// A mistake in an expression.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Mistake {
    /// Byte at which it is.
    pub at: usize,
    /// What is wrong, and what would be right.
    pub reason: String,
}

impl Mistake {
    pub fn new(at: usize, reason: impl Into<String>) -> Self {
        Self { at, reason: reason.into() }
    }
}
