//! Small types that every crate of the workspace shares.
//!
//! - [`Pose`] and [`Wrench`]: a rigid transform, and a force with its torque.
//! - [`Random`]: a counter-based random generator, independent of the order of evaluation.
//! - [`interpolate`]: linear and smooth interpolation of numbers.
//! - [`median`]: of measured values.
//! - [`Progress`]: how long work reports its progress and learns that it should stop.
//! - [`thread_pool`]: worker threads, as many as a machine bears; [`has_threads`].

#![cfg_attr(not(test), warn(clippy::disallowed_methods, reason = "the same bits on every processor"))]

pub mod interpolate;
mod pose;
mod progress;
mod random;
mod statistics;
mod threads;
mod wrench;

pub use pose::Pose;
pub use progress::{Progress, Quiet, Silent, StopAfter};
pub use random::{Random, RandomSequence, mix, standard_normal, unit};
pub use statistics::median;
pub use threads::{MAX_THREADS, has_threads, thread_pool};
pub use wrench::Wrench;

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
