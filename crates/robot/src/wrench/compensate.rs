//! Compensation of the instrument's weight in readings, with a tare.

use super::identify::Identification;
use super::load::{ForceKind, SensorNoise, check_pose, regressor};
use crate::{Error, Result};
use glam::{DMat3, DQuat, DVec3};
use trocar_core::Wrench;

/// The force on the instrument: a reading without weight and bias.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ForceReading {
    /// The kind of force.
    pub kind: ForceKind,
    /// Force (N) on the instrument and torque (N m) about the flange's origin, in the cell's axes.
    pub wrench: Wrench,
    /// Covariance of the force (N2), in the cell's axes.
    pub force_covariance: DMat3,
    /// Covariance of the torque (N2 m2), in the cell's axes.
    pub torque_covariance: DMat3,
}

impl ForceReading {
    /// Standard deviation of the force along each axis of the cell (N).
    pub fn force_deviation(&self) -> DVec3 {
        let c = self.force_covariance;
        DVec3::new(c.x_axis.x, c.y_axis.y, c.z_axis.z).max(DVec3::ZERO).map(f64::sqrt)
    }
}

/// Subtracts an identified load from readings.
///
/// With a tare y0 at orientation R0, a reading y at R becomes (y - y0) - (A(R) - A(R0)) p, with A
/// the derivative of the load model. The bias cancels, and the identified parameters p and their
/// covariance matter only as far as the instrument has rotated since the tare.
#[derive(Clone, Debug, PartialEq)]
pub struct Compensator {
    load: Identification,
    noise: SensorNoise,
    gravity: DVec3,
    tare: Option<Tare>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Tare {
    orientation: DQuat,
    reading: Wrench,
    count: usize,
}

impl Compensator {
    /// A compensator without a tare: it subtracts the identified bias.
    ///
    /// # Errors
    /// Invalid noise or gravity (m/s2).
    pub fn new(load: Identification, noise: SensorNoise, gravity: DVec3) -> Result<Self> {
        noise.check()?;
        check_pose("compensator", DQuat::IDENTITY, gravity)?;
        Ok(Self { load, noise, gravity, tare: None })
    }

    /// The identified load.
    pub fn load(&self) -> &Identification {
        &self.load
    }

    /// Sets the tare: the mean of `readings` without contact at `orientation` (from the flange's
    /// frame to the cell's).
    ///
    /// # Errors
    /// No reading, or one that is not finite. The tare is then unchanged.
    pub fn tare(&mut self, orientation: DQuat, readings: &[Wrench]) -> Result<()> {
        check_pose("tare", orientation, self.gravity)?;
        if readings.is_empty() {
            return Err(Error::invalid("tare", "needs at least one reading"));
        }
        if let Some(k) = readings.iter().position(|r| !r.is_finite()) {
            return Err(Error::invalid(format!("tare, reading {k}"), "must be finite"));
        }
        let sum = readings.iter().fold(Wrench::default(), |a, r| a + *r);
        let share = 1.0 / readings.len() as f64;
        let reading = Wrench { force: share * sum.force, torque: share * sum.torque };
        self.tare = Some(Tare { orientation, reading, count: readings.len() });
        Ok(())
    }

    /// The force on the instrument in a reading with the flange at `orientation`. `kind` is the
    /// current kind of force.
    ///
    /// # Errors
    /// A reading or orientation that is not finite.
    pub fn force(&self, orientation: DQuat, reading: Wrench, kind: ForceKind) -> Result<ForceReading> {
        check_pose("reading", orientation, self.gravity)?;
        if !reading.is_finite() {
            return Err(Error::invalid("reading", "must be finite"));
        }
        let model = self.load.model;
        let mut left = reading - model.reading(orientation, self.gravity);
        let mut rows = regressor(orientation, self.gravity);
        let mut readings = 1.0;
        if let Some(tare) = self.tare {
            left = left - (tare.reading - model.reading(tare.orientation, self.gravity));
            let then = regressor(tare.orientation, self.gravity);
            rows.iter_mut().flatten().zip(then.iter().flatten()).for_each(|(a, b)| *a -= b);
            readings += 1.0 / tare.count as f64;
        }
        let mut covariance = self.load.spread(&rows);
        for (i, row) in covariance.iter_mut().enumerate() {
            row[i] += readings * self.noise.of_row(i) * self.noise.of_row(i);
        }
        let turn = DMat3::from_quat(orientation);
        let block = |k: usize| {
            let column = |j: usize| DVec3::from_array([0, 1, 2].map(|i| covariance[k + i][k + j]));
            turn * DMat3::from_cols(column(0), column(1), column(2)) * turn.transpose()
        };
        Ok(ForceReading {
            kind,
            wrench: Wrench { force: orientation * left.force, torque: orientation * left.torque },
            force_covariance: block(0),
            torque_covariance: block(3),
        })
    }
}
