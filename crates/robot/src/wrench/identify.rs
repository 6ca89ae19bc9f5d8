//! The load model from readings at rest: weighted least squares, with what it does not know.

use super::load::{LoadModel, PARAMETERS, SensorNoise, Wrench, check_pose, regressor};
use crate::{Error, Result};
use glam::{DQuat, DVec3};
use nalgebra::{DMatrix, DVector, SMatrix, SVD};

/// Fewest poses: with two, a turn about the line between their gravities leaves the centre of mass
/// open.
const FEWEST: usize = 3;

/// Condition number from which the orientations are too alike to tell weight from bias: all within
/// about two degrees of one another.
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
    /// Condition number of the equations, each weighted by its noise and each parameter scaled to
    /// the same effect.
    pub condition: f64,
    /// Sum of the squared residuals over their variances. For a true model about `degrees`; far
    /// more says that the noise is greater than was said or that something was touched.
    pub chi_squared: f64,
    /// Equations less parameters.
    pub degrees: usize,
    covariance: SMatrix<f64, PARAMETERS, PARAMETERS>,
}

impl Identification {
    /// Covariance of the parameters in the order of [`PARAMETERS`], SI units.
    pub fn covariance(&self) -> [[f64; PARAMETERS]; PARAMETERS] {
        std::array::from_fn(|i| std::array::from_fn(|j| self.covariance[(i, j)]))
    }

    /// Standard deviation of every parameter.
    pub fn deviations(&self) -> LoadModel {
        LoadModel::from_array(std::array::from_fn(|i| self.covariance[(i, i)].max(0.0).sqrt()))
    }

    /// Square of the distance from the estimate to `truth` in standard deviations: chi-squared with
    /// ten degrees of freedom where noise is all that is wrong.
    ///
    /// # Errors
    /// A covariance that cannot be inverted.
    pub fn distance_squared(&self, truth: &LoadModel) -> Result<f64> {
        let (a, b) = (self.model.to_array(), truth.to_array());
        let off = SMatrix::<f64, PARAMETERS, 1>::from_fn(|i, _| a[i] - b[i]);
        let factor = self.covariance.cholesky();
        let factor =
            factor.ok_or_else(|| Error::invalid("identification", "its covariance is not positive definite"))?;
        Ok(off.dot(&factor.solve(&off)))
    }

    pub(super) fn spread(&self, rows: &[[f64; PARAMETERS]; 6]) -> SMatrix<f64, 6, 6> {
        let a = SMatrix::<f64, 6, PARAMETERS>::from_fn(|i, j| rows[i][j]);
        a * self.covariance * a.transpose()
    }
}

/// Identifies the load from readings at rest under `gravity` (m/s2) (in the cell) of a sensor with
/// `noise`.
///
/// # Errors
/// Fewer than three poses, orientations too alike to tell weight from bias, a number that is not
/// finite; the pose is said.
pub fn identify(poses: &[StaticReading], noise: &SensorNoise, gravity: DVec3) -> Result<Identification> {
    noise.check()?;
    if poses.len() < FEWEST {
        return Err(Error::invalid(
            "static poses",
            format!("{} are too few for ten parameters; take 54, at least {FEWEST}", poses.len()),
        ));
    }
    let count = 6 * poses.len();
    let mut equations = DMatrix::<f64>::zeros(count, PARAMETERS);
    let mut readings = DVector::<f64>::zeros(count);
    for (p, pose) in poses.iter().enumerate() {
        check_pose(&format!("static pose {p}"), pose.orientation, gravity)?;
        if !pose.reading.is_finite() {
            return Err(Error::invalid(format!("static pose {p}, reading"), "must be finite"));
        }
        let (rows, read) = (regressor(pose.orientation, gravity), pose.reading.to_array());
        for (r, row) in rows.iter().enumerate() {
            let weight = 1.0 / noise.of_row(r);
            readings[6 * p + r] = weight * read[r];
            row.iter().enumerate().for_each(|(j, v)| equations[(6 * p + r, j)] = weight * v);
        }
    }
    solve(equations, &readings)
}

/// Least squares by the singular values of the equations with columns of length 1.
fn solve(mut equations: DMatrix<f64>, readings: &DVector<f64>) -> Result<Identification> {
    let alike = |condition: f64| {
        let reason = format!(
            "their orientations are too alike (condition number {condition:.1e}, at most {WORST_CONDITION}); tilt the instrument by 20 degrees or more to several sides"
        );
        Error::invalid("static poses", reason)
    };
    let scales: Vec<f64> = equations.column_iter().map(|c| c.norm()).collect();
    if scales.iter().any(|s| *s <= 0.0 || !s.is_finite()) {
        return Err(alike(f64::INFINITY));
    }
    for (j, scale) in scales.iter().enumerate() {
        equations.column_mut(j).scale_mut(1.0 / scale);
    }
    let svd = SVD::try_new(equations.clone(), true, true, f64::EPSILON, 10_000);
    let Some((u, v, values)) = svd.and_then(|s| Some((s.u?, s.v_t?, s.singular_values))) else {
        return Err(Error::invalid(
            "static poses",
            "their equations have no singular values; look for absurd readings",
        ));
    };
    let condition = values.max() / values.min();
    if condition.is_nan() || condition >= WORST_CONDITION {
        return Err(alike(condition));
    }
    let projected = (u.transpose() * readings).component_div(&values);
    let scaled = v.transpose() * &projected;
    let residual = readings - equations * &scaled;
    let parameters = std::array::from_fn(|j| scaled[j] / scales[j]);
    let covariance = SMatrix::from_fn(|i, j| {
        let sum: f64 = (0..PARAMETERS).map(|k| v[(k, i)] * v[(k, j)] / (values[k] * values[k])).sum();
        sum / (scales[i] * scales[j])
    });
    Ok(Identification {
        model: LoadModel::from_array(parameters),
        condition,
        chi_squared: residual.norm_squared(),
        degrees: readings.len() - PARAMETERS,
        covariance,
    })
}
