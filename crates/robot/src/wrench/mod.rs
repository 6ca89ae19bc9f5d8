//! Forces at the tool mount: what an instrument weighs is identified and taken off.
//!
//! A six-axis sensor at the mount carries an instrument of 4.7 N; tissue pulls with tens of millinewtons. So the weight must be known to a percent and its
//! share at every orientation taken off. [`LoadModel`] is what the sensor reads when nothing is touched, [`identify`] finds it from readings
//! at rest, [`Compensator`] takes it off, tared at reset, and says how uncertain what is left is.
//!
//! All of it is static: where an arm accelerates, the instrument's inertia is in the reading too.

mod compensate;
mod identify;
mod poses;
mod svd;

pub use compensate::{Compensator, ForceReading};
pub use identify::{Identification, PARAMETERS, StaticReading, identify};
pub use poses::{STATIC_POSES, STATIC_TILT, static_orientations};

use crate::error::within;
use crate::instrument::Instrument;
use crate::{Error, Result};
use glam::{DQuat, DVec3};
use serde::{Deserialize, Serialize};
use trocar_core::Wrench;

/// What a force is, so that nobody mistakes one for the other (SPEC C8).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ForceKind {
    /// Tissue or the port presses on the instrument.
    Contact,
    /// A latched grasp holds nodes where the jaws are: the force that this takes, not the tissue's reaction to a touch.
    Constraint,
}

/// What a sensor at the mount reads when the instrument touches nothing: linear in these ten numbers.
///
/// The reading is what the instrument does to the mount, in the sensor's frame (the flange's), torque about its origin:
/// force = m g + b_f, torque = (m c) x g + b_t, with g the gravity there.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct LoadModel {
    /// Mass m [kg].
    pub mass: f64,
    /// Mass times its centre, m c [kg m], in the flange's frame.
    pub first_moment: DVec3,
    /// What the sensor reads unloaded.
    pub bias: Wrench,
}

impl LoadModel {
    /// That of an instrument on a sensor with `bias`.
    pub fn of(instrument: &Instrument, bias: Wrench) -> Self {
        let mass = instrument.mass_in_flange();
        Self { mass: mass.mass, first_moment: mass.mass * mass.center, bias }
    }

    /// Weight [N] under `gravity` [m/s2].
    pub fn weight(&self, gravity: DVec3) -> f64 {
        self.mass * gravity.length()
    }

    /// Centre of mass [m], in the flange's frame.
    pub fn centre(&self) -> DVec3 {
        self.first_moment / self.mass
    }

    /// The reading with the flange at `orientation` (its frame to the cell's) under `gravity` [m/s2] in the cell.
    pub fn reading(&self, orientation: DQuat, gravity: DVec3) -> Wrench {
        let g = orientation.inverse() * gravity;
        Wrench { force: self.mass * g, torque: self.first_moment.cross(g) } + self.bias
    }

    fn from_array(p: [f64; PARAMETERS]) -> Self {
        let v = |k: usize| DVec3::new(p[k], p[k + 1], p[k + 2]);
        Self { mass: p[0], first_moment: v(1), bias: Wrench { force: v(4), torque: v(7) } }
    }

    fn to_array(self) -> [f64; PARAMETERS] {
        let (c, f, t) = (self.first_moment, self.bias.force, self.bias.torque);
        [self.mass, c.x, c.y, c.z, f.x, f.y, f.z, t.x, t.y, t.z]
    }
}

/// Standard deviations of a sensor's noise, the same on all axes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SensorNoise {
    /// Of each force [N].
    pub force: f64,
    /// Of each torque [N m].
    pub torque: f64,
}

impl SensorNoise {
    /// Says whether the noise can be used.
    ///
    /// # Errors
    /// A deviation that is not positive and finite.
    pub fn check(&self) -> Result<()> {
        within("sensor noise, force", self.force, 1e-9, 1e3, "N")?;
        within("sensor noise, torque", self.torque, 1e-9, 1e3, "N m")?;
        Ok(())
    }

    fn of_row(&self, row: usize) -> f64 {
        if row < 3 { self.force } else { self.torque }
    }
}

/// `orientation` and `gravity`, if they can be used.
fn check_pose(what: &str, orientation: DQuat, gravity: DVec3) -> Result<()> {
    if !orientation.is_normalized() {
        return Err(Error::invalid(format!("{what}, orientation"), "must be a quaternion of length 1"));
    }
    if !gravity.is_finite() || gravity.length() < 0.1 {
        return Err(Error::invalid(
            "gravity",
            format!("{gravity} m/s2 is no gravity to weigh with; the earth's is 9.81"),
        ));
    }
    Ok(())
}

/// The derivative of a reading by the ten parameters, row by row.
fn regressor(orientation: DQuat, gravity: DVec3) -> [[f64; PARAMETERS]; 6] {
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
