//! The load model from readings at rest: weighted least squares, with what it does not know.

use super::svd::Svd;
use super::{LoadModel, SensorNoise, check_pose, regressor};
use crate::{Error, Result};
use glam::{DQuat, DVec3};
use trocar_core::Wrench;

/// Parameters of a [`LoadModel`]: mass, first moment (3), bias of force (3) and torque (3), in this order.
pub const PARAMETERS: usize = 10;

/// Fewest poses: with two, a turn about the line between their gravities leaves the centre of mass open.
const FEWEST: usize = 3;

/// Condition number from which the orientations are too alike to tell weight from bias: all within about two degrees of one another.
const WORST_CONDITION: f64 = 100.0;

/// A reading at rest, touching nothing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StaticReading {
    /// The flange's frame to the cell's.
    pub orientation: DQuat,
    /// What the sensor read, in the flange's frame.
    pub reading: Wrench,
}

/// An identified load.
#[derive(Clone, Debug, PartialEq)]
pub struct Identification {
    /// The estimate.
    pub model: LoadModel,
    /// Condition number of the equations, each weighted by its noise and each parameter scaled to the same effect.
    pub condition: f64,
    /// Sum of the squared residuals over their variances. For a true model about `degrees`; far more says that the noise is greater than was said or that something was touched.
    pub chi_squared: f64,
    /// Equations less parameters.
    pub degrees: usize,
    covariance: [[f64; PARAMETERS]; PARAMETERS],
    /// The inverse of the covariance: the normal matrix of the weighted equations.
    information: [[f64; PARAMETERS]; PARAMETERS],
}

impl Identification {
    /// Covariance of the parameters in the order of [`PARAMETERS`], SI units.
    pub fn covariance(&self) -> [[f64; PARAMETERS]; PARAMETERS] {
        self.covariance
    }

    /// Standard deviation of every parameter.
    pub fn deviations(&self) -> LoadModel {
        LoadModel::from_array(std::array::from_fn(|i| self.covariance[i][i].max(0.0).sqrt()))
    }

    /// Square of the distance from the estimate to `truth` in standard deviations. It is chi-squared
    /// with ten degrees of freedom where noise is the only error.
    pub fn distance_squared(&self, truth: &LoadModel) -> f64 {
        let (a, b) = (self.model.to_array(), truth.to_array());
        let off: [f64; PARAMETERS] = std::array::from_fn(|i| a[i] - b[i]);
        quadratic(&self.information, &off, &off)
    }

    /// Covariance of a reading whose regressor is `rows`.
    pub(super) fn spread(&self, rows: &[[f64; PARAMETERS]; 6]) -> [[f64; 6]; 6] {
        std::array::from_fn(|i| std::array::from_fn(|j| quadratic(&self.covariance, &rows[i], &rows[j])))
    }
}

/// a' M b.
fn quadratic(m: &[[f64; PARAMETERS]; PARAMETERS], a: &[f64; PARAMETERS], b: &[f64; PARAMETERS]) -> f64 {
    let row = |i: usize| (0..PARAMETERS).map(|j| m[i][j] * b[j]).sum::<f64>();
    (0..PARAMETERS).map(|i| a[i] * row(i)).sum()
}

/// Identifies the load from readings at rest under `gravity` [m/s2] (in the cell) of a sensor with `noise`.
///
/// # Errors
/// Fewer than three poses, orientations too alike to tell weight from bias, a number that is not finite; the pose is said.
pub fn identify(poses: &[StaticReading], noise: &SensorNoise, gravity: DVec3) -> Result<Identification> {
    noise.check()?;
    if poses.len() < FEWEST {
        return Err(Error::invalid(
            "static poses",
            format!("{} are too few for ten parameters; take 54, at least {FEWEST}", poses.len()),
        ));
    }
    let count = 6 * poses.len();
    let mut equations = Vec::with_capacity(count);
    let mut readings = Vec::with_capacity(count);
    for (p, pose) in poses.iter().enumerate() {
        check_pose(&format!("static pose {p}"), pose.orientation, gravity)?;
        if !pose.reading.is_finite() {
            return Err(Error::invalid(format!("static pose {p}, reading"), "must be finite"));
        }
        let (rows, read) = (regressor(pose.orientation, gravity), pose.reading.to_array());
        for (r, row) in rows.iter().enumerate() {
            let weight = 1.0 / noise.of_row(r);
            readings.push(weight * read[r]);
            equations.push(row.map(|v| weight * v));
        }
    }
    solve(&equations, &readings)
}

/// Least squares by the singular values of the equations with columns of length 1.
fn solve(equations: &[[f64; PARAMETERS]], readings: &[f64]) -> Result<Identification> {
    let alike = |condition: f64| {
        let reason = format!(
            "their orientations are too alike (condition number {condition:.1e}, at most {WORST_CONDITION}); tilt the instrument by 20 degrees or more to several sides"
        );
        Error::invalid("static poses", reason)
    };
    let dot = |i: usize, j: usize| -> f64 { equations.iter().map(|row| row[i] * row[j]).sum() };
    let information = std::array::from_fn(|i| std::array::from_fn(|j| dot(i, j)));
    let scales: [f64; PARAMETERS] = std::array::from_fn(|j| dot(j, j).sqrt());
    if scales.iter().any(|s| *s <= 0.0 || !s.is_finite()) {
        return Err(alike(f64::INFINITY));
    }
    let scale = |row: &[f64; PARAMETERS]| -> [f64; PARAMETERS] { std::array::from_fn(|j| row[j] / scales[j]) };
    let Some(svd) = Svd::new(equations.iter().map(scale).collect()) else {
        return Err(Error::invalid(
            "static poses",
            "their equations have no singular values; look for absurd readings",
        ));
    };
    let (least, most) =
        svd.values.iter().fold((f64::INFINITY, 0.0_f64), |(least, most), v| (least.min(*v), most.max(*v)));
    let condition = most / least;
    if condition.is_nan() || condition >= WORST_CONDITION {
        return Err(alike(condition));
    }
    let scaled = svd.solve(readings);
    let parameters: [f64; PARAMETERS] = std::array::from_fn(|j| scaled[j] / scales[j]);
    let residual = |(row, reading): (&[f64; PARAMETERS], &f64)| {
        reading - row.iter().zip(&parameters).map(|(a, p)| a * p).sum::<f64>()
    };
    Ok(Identification {
        model: LoadModel::from_array(parameters),
        condition,
        chi_squared: equations.iter().zip(readings).map(residual).map(|r| r * r).sum(),
        degrees: readings.len() - PARAMETERS,
        covariance: std::array::from_fn(|i| {
            std::array::from_fn(|j| svd.inverse_normal(i, j) / (scales[i] * scales[j]))
        }),
        information,
    })
}
