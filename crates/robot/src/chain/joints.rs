//! Vectors and sets over an arm's joints, without allocation.

use crate::{Error, Result};
use serde::{Deserialize, Serialize};
use std::ops::{Deref, DerefMut};

/// Maximum number of joints of an arm.
pub const MAX_JOINTS: usize = 16;

/// A number for each joint of an arm: angles (rad) or displacements (m), their rates, torques (N m)
/// or forces (N). It dereferences to a slice.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Vec<f64>", into = "Vec<f64>")]
pub struct Joints {
    n: usize,
    // Zero beyond n: a vector of a smaller arm reads as zeros there.
    values: [f64; MAX_JOINTS],
}

impl Joints {
    /// Zeros for `n` joints, at most [`MAX_JOINTS`].
    pub const fn zeros(n: usize) -> Self {
        Self { n: if n < MAX_JOINTS { n } else { MAX_JOINTS }, values: [0.0; MAX_JOINTS] }
    }

    /// From a number for each joint.
    ///
    /// # Errors
    /// More than [`MAX_JOINTS`].
    pub fn new(values: &[f64]) -> Result<Self> {
        if values.len() > MAX_JOINTS {
            let reason = format!("has {} numbers; the maximum is {MAX_JOINTS}", values.len());
            return Err(Error::invalid("joint vector", reason));
        }
        Ok(Self::from_fn(values.len(), |i| values[i]))
    }

    /// `f(i)` for each of `n` joints, at most [`MAX_JOINTS`].
    pub fn from_fn(n: usize, mut f: impl FnMut(usize) -> f64) -> Self {
        let mut joints = Self::zeros(n);
        for i in 0..joints.n {
            joints.values[i] = f(i);
        }
        joints
    }

    /// The number of joint `i`, zero beyond the last.
    pub(crate) const fn at(&self, i: usize) -> f64 {
        if i < MAX_JOINTS { self.values[i] } else { 0.0 }
    }

    /// The scalar product.
    pub fn dot(&self, other: &Self) -> f64 {
        self.iter().zip(other.iter()).map(|(a, b)| a * b).sum()
    }

    /// The maximum magnitude; NaN if one is NaN.
    pub fn max_abs(&self) -> f64 {
        self.iter().fold(0.0, |m: f64, x| if x.is_nan() || m.is_nan() { f64::NAN } else { m.max(x.abs()) })
    }

    /// Whether every number is finite.
    pub fn is_finite(&self) -> bool {
        self.iter().all(|x| x.is_finite())
    }
}

impl Deref for Joints {
    type Target = [f64];

    fn deref(&self) -> &[f64] {
        &self.values[..self.n]
    }
}

impl DerefMut for Joints {
    fn deref_mut(&mut self) -> &mut [f64] {
        &mut self.values[..self.n]
    }
}

impl TryFrom<Vec<f64>> for Joints {
    type Error = Error;

    fn try_from(values: Vec<f64>) -> Result<Self> {
        Self::new(&values)
    }
}

impl From<Joints> for Vec<f64> {
    fn from(joints: Joints) -> Self {
        joints.to_vec()
    }
}

/// A set of joints of an arm.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct JointSet(u16);

impl JointSet {
    /// Whether it contains joint `i`.
    pub const fn contains(self, i: usize) -> bool {
        i < MAX_JOINTS && self.0 >> i & 1 == 1
    }

    /// Whether it is empty.
    pub const fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// Adds joint `i`.
    pub(crate) const fn insert(&mut self, i: usize) {
        if i < MAX_JOINTS {
            self.0 |= 1 << i;
        }
    }

    /// The union of both sets.
    pub const fn union(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// The indices of its joints, ascending.
    pub fn iter(self) -> impl Iterator<Item = usize> {
        (0..MAX_JOINTS).filter(move |&i| self.contains(i))
    }
}
