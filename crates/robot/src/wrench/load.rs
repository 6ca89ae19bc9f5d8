//! Wrenches, the load model of an instrument on a sensor, and the noise of a sensor.

use crate::error::within;
use crate::instrument::Instrument;
use crate::{Error, Result};
use glam::{DQuat, DVec3};
use serde::{Deserialize, Serialize};
use trocar_core::Wrench;

/// Number of parameters of a [`LoadModel`], in this order: mass, first moment (3), bias of force
/// (3) and torque (3).
pub const PARAMETERS: usize = 10;

/// The kind of a measured force.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ForceKind {
    /// Tissue or the port presses on the instrument.
    Contact,
    /// A latched grasp holds nodes at the jaws: the force of this constraint, not a contact force
    /// of tissue.
    Constraint,
}

/// The reading of a sensor at the mount without contact: linear in ten parameters.
///
/// The reading is the wrench of the instrument on the mount, in the sensor's frame (the flange's),
/// torque about its origin: force = m g + b_f, torque = (m c) x g + b_t, with gravity g in this
/// frame.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct LoadModel {
    /// Mass m (kg).
    pub mass: f64,
    /// Mass times centre of mass, m c (kg m), in the flange's frame.
    pub first_moment: DVec3,
    /// The reading of the unloaded sensor.
    pub bias: Wrench,
}

impl LoadModel {
    /// The model of an instrument on a sensor with `bias`.
    pub fn of(instrument: &Instrument, bias: Wrench) -> Self {
        let mass = instrument.mass_in_flange();
        Self { mass: mass.mass, first_moment: mass.mass * mass.center, bias }
    }

    /// Weight (N) under `gravity` (m/s2).
    pub fn weight(&self, gravity: DVec3) -> f64 {
        self.mass * gravity.length()
    }

    /// Centre of mass (m), in the flange's frame.
    pub fn centre(&self) -> DVec3 {
        self.first_moment / self.mass
    }

    /// The reading with the flange at `orientation` (from its frame to the cell's) under `gravity`
    /// in the cell (m/s2).
    pub fn reading(&self, orientation: DQuat, gravity: DVec3) -> Wrench {
        let g = orientation.inverse() * gravity;
        Wrench { force: self.mass * g, torque: self.first_moment.cross(g) } + self.bias
    }

    pub(super) fn from_array(p: [f64; PARAMETERS]) -> Self {
        let v = |k: usize| DVec3::new(p[k], p[k + 1], p[k + 2]);
        Self { mass: p[0], first_moment: v(1), bias: Wrench { force: v(4), torque: v(7) } }
    }

    pub(super) fn to_array(self) -> [f64; PARAMETERS] {
        let (c, f, t) = (self.first_moment, self.bias.force, self.bias.torque);
        [self.mass, c.x, c.y, c.z, f.x, f.y, f.z, t.x, t.y, t.z]
    }
}

/// Standard deviations of a sensor's noise, equal on all axes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SensorNoise {
    /// Of each force component (N).
    pub force: f64,
    /// Of each torque component (N m).
    pub torque: f64,
}

impl SensorNoise {
    /// Checks the noise.
    ///
    /// # Errors
    /// A deviation that is not positive and finite.
    pub fn check(&self) -> Result<()> {
        within("sensor noise, force", self.force, 1e-9, 1e3, "N")?;
        within("sensor noise, torque", self.torque, 1e-9, 1e3, "N m")?;
        Ok(())
    }

    pub(super) fn of_row(&self, row: usize) -> f64 {
        if row < 3 { self.force } else { self.torque }
    }
}

/// Checks `orientation` and `gravity` (m/s2).
pub(super) fn check_pose(what: &str, orientation: DQuat, gravity: DVec3) -> Result<()> {
    if !orientation.is_normalized() {
        return Err(Error::invalid(format!("{what}, orientation"), "must be a unit quaternion"));
    }
    if !gravity.is_finite() || gravity.length() < 0.1 {
        return Err(Error::invalid(
            "gravity",
            format!("is {gravity} m/s2; it must be finite and at least 0.1 m/s2 (the earth's is 9.81)"),
        ));
    }
    Ok(())
}

/// The derivative of a reading with respect to the ten parameters, by rows.
pub(super) fn regressor(orientation: DQuat, gravity: DVec3) -> [[f64; PARAMETERS]; 6] {
    let g = orientation.inverse() * gravity;
    let mut rows = [[0.0; PARAMETERS]; 6];
    for k in 0..3 {
        rows[k][0] = g[k];
        rows[k][4 + k] = 1.0;
        rows[3 + k][7 + k] = 1.0;
        // Column j of the cross product with g: e_j x g.
        let column = DVec3::AXES[k].cross(g);
        (0..3).for_each(|i| rows[3 + i][1 + k] = column[i]);
    }
    rows
}
