//! Identification of the load model from readings at rest, by weighted least squares.

use super::load::{LoadModel, PARAMETERS, SensorNoise, check_pose, regressor};
use super::svd::Svd;
use crate::{Error, Result};
use glam::{DQuat, DVec3};
use trocar_core::Wrench;

/// Minimum number of poses. With two, a rotation about the line between their gravities does not
/// determine the centre of mass.
const MIN_POSES: usize = 3;

/// Maximum condition number. Above it the orientations are too similar to separate weight from
/// bias: all within about two degrees of each other.
const MAX_CONDITION: f64 = 100.0;

/// A reading at rest, without contact.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StaticReading {
    /// Rotation from the flange's frame to the cell's.
    pub orientation: DQuat,
    /// The reading, in the flange's frame.
    pub reading: Wrench,
}

/// An identified load.
#[derive(Clone, Debug, PartialEq)]
pub struct Identification {
    /// The estimate.
    pub model: LoadModel,
    /// Condition number of the equations, weighted by the noise, with parameters scaled to equal
    /// effect.
    pub condition: f64,
    /// Sum of the squared residuals over their variances: about `degrees` for a true model. A much
    /// larger value means more noise than assumed, or contact.
    pub chi_squared: f64,
    /// Degrees of freedom: equations minus parameters.
    pub degrees: usize,
    covariance: [[f64; PARAMETERS]; PARAMETERS],
    /// The inverse of the covariance: the normal matrix of the weighted equations.
    information: [[f64; PARAMETERS]; PARAMETERS],
}

impl Identification {
    /// Standard deviations of the parameters.
    pub fn deviations(&self) -> LoadModel {
        LoadModel::from_array(std::array::from_fn(|i| self.covariance[i][i].max(0.0).sqrt()))
    }

    /// Square of the distance from the estimate to `truth` in standard deviations. It is
    /// chi-squared with ten degrees of freedom where noise is the only error.
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

/// Identifies the load from readings at rest of a sensor with `noise`, under `gravity` in the cell
/// (m/s2).
///
/// # Errors
/// Fewer than three poses, orientations too similar to separate weight from bias, a number that is
/// not finite.
pub fn identify(poses: &[StaticReading], noise: &SensorNoise, gravity: DVec3) -> Result<Identification> {
    noise.check()?;
    if poses.len() < MIN_POSES {
        return Err(Error::invalid(
            "static poses",
            format!("{} are too few for ten parameters; use 54, at least {MIN_POSES}", poses.len()),
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
            "their orientations are too similar (condition number {condition:.1e}; the maximum is {MAX_CONDITION}); tilt the instrument by 20 degrees or more to several sides"
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
    if condition.is_nan() || condition >= MAX_CONDITION {
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
