//! Readings with the instrument's weight taken off, tared at reset.

use super::{ForceKind, Identification, SensorNoise, check_pose, regressor};
use crate::{Error, Result};
use glam::{DMat3, DQuat, DVec3};
use trocar_core::Wrench;

/// What is left of a reading: the force on the instrument.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ForceReading {
    /// What kind of force it is.
    pub kind: ForceKind,
    /// Force [N] on the instrument and torque [N m] about the flange's origin, along the cell's axes.
    pub wrench: Wrench,
    /// Covariance of the force [N2], along the cell's axes.
    pub force_covariance: DMat3,
    /// Covariance of the torque [N2 m2], along the cell's axes.
    pub torque_covariance: DMat3,
}

impl ForceReading {
    /// Standard deviation of the force along each axis of the cell [N].
    pub fn force_deviation(&self) -> DVec3 {
        let c = self.force_covariance;
        DVec3::new(c.x_axis.x, c.y_axis.y, c.z_axis.z).max(DVec3::ZERO).map(f64::sqrt)
    }
}

/// Takes an identified load off readings.
///
/// A tare at orientation R0 leaves of a reading y at R: (y - y0) - (A(R) - A(R0)) p with A the load model's derivative: the bias is gone, the identified parameters p
/// matter only as far as the instrument was turned since, and so does their covariance.
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
    /// Without a tare: the identified bias is taken off.
    ///
    /// # Errors
    /// Noise or a gravity [m/s2] that cannot be used.
    pub fn new(load: Identification, noise: SensorNoise, gravity: DVec3) -> Result<Self> {
        noise.check()?;
        check_pose("compensator", DQuat::IDENTITY, gravity)?;
        Ok(Self { load, noise, gravity, tare: None })
    }

    /// The identified load.
    pub fn load(&self) -> &Identification {
        &self.load
    }

    /// Takes the mean of `readings` at `orientation` (the flange's frame to the cell's) for touching nothing.
    ///
    /// # Errors
    /// No reading, or one that is not finite; the tare stays as it was.
    pub fn tare(&mut self, orientation: DQuat, readings: &[Wrench]) -> Result<()> {
        check_pose("tare", orientation, self.gravity)?;
        if readings.is_empty() {
            return Err(Error::invalid("tare", "needs one reading at least"));
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

    /// The force on the instrument in one reading with the flange at `orientation`; `kind` says what is held or touched now.
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
