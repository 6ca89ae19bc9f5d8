//! Chunks of actions and how a reply is read.

use crate::array::{Array, Dtype, shape_text};
use crate::error::{Error, Result};
use crate::value::Value;

/// The field of a reply that holds the actions.
const FIELD: &str = "actions";

/// A chunk of actions: rows of finite numbers, in the units of the policy.
#[derive(Clone, Debug, PartialEq)]
pub struct Actions {
    dim: usize,
    values: Vec<f64>,
}

impl Actions {
    /// A chunk of rows of `dim` numbers; `values` is row-major.
    ///
    /// # Errors
    /// [`Error::EmptyChunk`] without numbers, [`Error::WrongDimension`] if `dim` does not divide
    /// their count, [`Error::NotFinite`].
    pub fn new(dim: usize, values: Vec<f64>) -> Result<Self> {
        let at = String::new;
        if dim == 0 || values.is_empty() {
            return Err(Error::EmptyChunk { at: at(), shape: shape_text(&[values.len() / dim.max(1), dim]) });
        }
        if !values.len().is_multiple_of(dim) {
            return Err(Error::WrongDimension { at: at(), found: values.len() % dim, expected: dim });
        }
        if let Some(i) = values.iter().position(|v| !v.is_finite()) {
            return Err(Error::NotFinite { at: at(), step: i / dim, component: i % dim, value: values[i] });
        }
        Ok(Self { dim, values })
    }

    /// Number of actions, at least one.
    pub fn horizon(&self) -> usize {
        self.values.len() / self.dim
    }

    /// Number of components of an action, at least one.
    pub fn dim(&self) -> usize {
        self.dim
    }

    /// Action `step`, from 0; `None` beyond the chunk.
    pub fn step(&self, step: usize) -> Option<&[f64]> {
        self.values.chunks_exact(self.dim).nth(step)
    }

    /// All numbers, row-major.
    pub fn values(&self) -> &[f64] {
        &self.values
    }
}

/// Limits of accepted chunks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ReplyLimits {
    /// Number of components that an action must have; `None` accepts any.
    pub dim: Option<usize>,
    /// Maximum number of actions in a chunk. Chunks of openpi's models have 8 to 50.
    pub max_horizon: usize,
}

impl Default for ReplyLimits {
    fn default() -> Self {
        Self { dim: None, max_horizon: 1024 }
    }
}

impl ReplyLimits {
    /// Reads the actions of a reply: its field `actions`, or the reply itself if it is an array, as
    /// older RoboArena servers send.
    ///
    /// # Errors
    /// [`Error::WrongField`] if it is missing or not two-dimensional, [`Error::WrongDtype`],
    /// [`Error::WrongDimension`], [`Error::EmptyChunk`], [`Error::LongChunk`],
    /// [`Error::NotFinite`].
    pub fn take(&self, reply: &Value) -> Result<Actions> {
        let wrong = |reason: String| Err(Error::WrongField { at: String::new(), reason });
        match reply {
            Value::Array(array) => self.check(array),
            Value::Map(map) => match map.get(FIELD) {
                Some(Value::Array(array)) => self.check(array),
                Some(other) => wrong(format!("must be an array, not {}", other.kind())),
                None => {
                    let there: Vec<&str> = map.keys().take(8).map(String::as_str).collect();
                    return wrong(format!(
                        "there is no field '{FIELD}'; the fields are: {}",
                        crate::error::one_line(&there.join(", "))
                    ));
                }
            }
            .map_err(|e| e.within(FIELD)),
            other => wrong(format!("must be a map with the field '{FIELD}', not {}", other.kind())),
        }
    }

    fn check(&self, array: &Array) -> Result<Actions> {
        let at = String::new;
        if array.dtype() == Dtype::Bool {
            let wanted = "must be of numbers";
            return Err(Error::WrongDtype { at: at(), dtype: array.dtype().name().into(), wanted });
        }
        let &[horizon, dim] = array.shape() else {
            let reason = format!("must have the shape [horizon, components], not {}", shape_text(array.shape()));
            return Err(Error::WrongField { at: at(), reason });
        };
        if horizon == 0 || dim == 0 {
            return Err(Error::EmptyChunk { at: at(), shape: shape_text(array.shape()) });
        }
        if horizon > self.max_horizon {
            return Err(Error::LongChunk { at: at(), found: horizon, limit: self.max_horizon });
        }
        if let Some(expected) = self.dim.filter(|d| *d != dim) {
            return Err(Error::WrongDimension { at: at(), found: dim, expected });
        }
        Actions::new(dim, array.to_f64())
    }
}
