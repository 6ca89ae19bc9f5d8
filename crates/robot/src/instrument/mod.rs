//! Laparoscopic instruments: shaft, jaw and mass.
//!
//! ```text
//!   flange       shaft base                        shaft end   jaw pivot
//!     | motor head |============= shaft ===============|---o<  blades
//!     +---> z      +---> z (along the shaft)               +---> x (along the closed blades)
//! ```
//!
//! There are three frames: the *flange* (the arm's tool mount); the *shaft frame*, with its origin
//! at the shaft's base and z along the shaft; and the *tip frame*, with its origin at the jaw's
//! pivot, x along the shaft, y across the closing plane and z along the hinge.

pub(crate) mod coordinates;

pub use coordinates::{Coordinates, Excess, Limits};

use crate::chain::MassProperties;
use crate::error::within;
use crate::{Error, Result};
use glam::{DQuat, DVec3};
use serde::{Deserialize, Serialize};
use std::f64::consts::{FRAC_PI_2, FRAC_PI_3, PI};
use trocar_core::Pose;

/// Standard gravity in all of Trocar (m/s2).
pub const GRAVITY: f64 = 9.81;

/// Weight of the paper's instruments (N).
pub const WEIGHT: f64 = 4.7;

/// An instrument on a tool mount.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Instrument {
    /// Name.
    pub name: String,
    /// Radius of the shaft (m).
    pub shaft_radius: f64,
    /// Length of the shaft (m), from its base to its end.
    pub shaft_length: f64,
    /// Pose of the shaft frame in the flange's.
    pub mount: Pose,
    /// Distance from the shaft's end to the jaw's pivot, along the shaft (m).
    pub pivot_offset: f64,
    /// The jaw.
    pub jaw: Jaw,
    /// Mass properties in the shaft frame.
    pub mass: MassProperties,
}

/// A jaw with two blades.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Jaw {
    /// Angle between the open blades (rad).
    pub max_angle: f64,
    /// Length of the blades beyond the pivot (m).
    pub blade_length: f64,
    /// Maximum rate of the angle between the blades (rad/s).
    pub speed: f64,
}

impl Jaw {
    /// The angle between the blades (rad) at an opening, which is clamped to [0, 1]; NaN is closed.
    pub fn angle(&self, opening: f64) -> f64 {
        self.max_angle * clamp_unit(opening)
    }

    /// The opening in [0, 1] after `seconds` of motion from `opening` to `target` at the jaw's
    /// maximum rate.
    pub fn toward(&self, opening: f64, target: f64, seconds: f64) -> f64 {
        let most = (self.speed * seconds / self.max_angle).max(0.0);
        clamp_unit(opening + (clamp_unit(target) - opening).max(-most).min(most))
    }
}

impl Instrument {
    /// Names of the built-in instruments.
    pub const NAMES: [&'static str; 2] = ["grasper", "cutter"];

    /// A built-in instrument: 5 mm shaft of 330 mm, jaw of 60 degrees with blades of 21 mm, 4.7 N.
    ///
    /// # Errors
    /// Another name.
    pub fn named(name: &str) -> Result<Self> {
        match name {
            "grasper" => Ok(Self::grasper()),
            "cutter" => Ok(Self::cutter()),
            _ => Err(Error::invalid(format!("instrument '{name}'"), "is unknown; it must be grasper or cutter")),
        }
    }

    /// The motorised grasper of the left arm. The jaw opens fully in 0.3 s.
    pub fn grasper() -> Self {
        let head = Head { radius: 0.028, length: 0.09, aside: 0.006 };
        Self::motorised("grasper", &head, FRAC_PI_3 / 0.3)
    }

    /// The motorised cutter of the right arm: like the grasper, with the motor farther to the side
    /// and a faster jaw.
    pub fn cutter() -> Self {
        let head = Head { radius: 0.026, length: 0.09, aside: 0.009 };
        Self::motorised("cutter", &head, FRAC_PI_3 / 0.2)
    }

    fn motorised(name: &str, head: &Head, jaw_speed: f64) -> Self {
        const STEEL: f64 = 7850.0;
        let (shaft_radius, bore, shaft_length) = (2.5e-3, 1.8e-3, 0.33);
        let tube = PI * (shaft_radius * shaft_radius - bore * bore) * shaft_length * STEEL;
        let shaft = MassProperties::tube(tube, shaft_radius, bore, shaft_length, DVec3::Z * (0.5 * shaft_length));
        let centre = DVec3::new(head.aside, 0.0, -0.5 * head.length);
        let motor = MassProperties::tube(WEIGHT / GRAVITY - tube, head.radius, 0.0, head.length, centre);
        Self {
            name: name.to_owned(),
            shaft_radius,
            shaft_length,
            mount: Pose { rotation: DQuat::IDENTITY, translation: DVec3::Z * head.length },
            pivot_offset: 8e-3,
            jaw: Jaw { max_angle: FRAC_PI_3, blade_length: 0.021, speed: jaw_speed },
            mass: shaft.joined(&motor),
        }
    }

    /// Distance from the shaft's base to the jaw's pivot (m).
    pub fn reach(&self) -> f64 {
        self.shaft_length + self.pivot_offset
    }

    /// Pose of the tip frame in the flange's.
    pub fn tip_in_flange(&self) -> Pose {
        let in_shaft = Pose { rotation: shaft_to_tip(), translation: DVec3::Z * self.reach() };
        compose(&self.mount, &in_shaft)
    }

    /// Pose of the tip in the cell, from that of the flange.
    pub fn tip(&self, flange: &Pose) -> Pose {
        compose(flange, &self.tip_in_flange())
    }

    /// Pose of the flange in the cell, from that of the tip.
    pub fn flange(&self, tip: &Pose) -> Pose {
        compose(tip, &self.tip_in_flange().inverse())
    }

    /// Mass properties in the flange's frame.
    pub fn mass_in_flange(&self) -> MassProperties {
        self.mass.placed(&self.mount)
    }

    /// Weight (N).
    pub fn weight(&self) -> f64 {
        self.mass.mass * GRAVITY
    }

    /// Checks the instrument.
    ///
    /// # Errors
    /// A length, angle or mass out of range, a number that is not finite, an impossible inertia.
    pub fn check(&self) -> Result<()> {
        let what = |field: &str| format!("instrument '{}', {field}", self.name);
        within(&what("shaft_radius"), self.shaft_radius, 5e-4, 0.02, "m")?;
        within(&what("shaft_length"), self.shaft_length, 0.02, 2.0, "m")?;
        within(&what("pivot_offset"), self.pivot_offset, 0.0, 0.2, "m")?;
        within(&what("jaw.max_angle"), self.jaw.max_angle, 1e-3, PI, "rad")?;
        within(&what("jaw.blade_length"), self.jaw.blade_length, 1e-3, 0.2, "m")?;
        within(&what("jaw.speed"), self.jaw.speed, 1e-3, 1e3, "rad/s")?;
        if !self.mount.translation.is_finite() || self.mount.translation.length() > 1.0 {
            return Err(Error::invalid(what("mount"), "its translation must be finite and shorter than 1 m"));
        }
        if !self.mount.rotation.is_normalized() {
            return Err(Error::invalid(what("mount"), "its rotation must be a unit quaternion"));
        }
        within(&what("mass"), self.mass.mass, 1e-4, 100.0, "kg")?;
        if self.mass.center.length() > 2.0 {
            return Err(Error::invalid(what("mass.center"), "must be within 2 m"));
        }
        self.mass.validate(&what("mass, inertia"))
    }
}

/// `value` clamped to [0, 1]; NaN becomes 0.
pub(crate) fn clamp_unit(value: f64) -> f64 {
    if value.is_nan() { 0.0 } else { value.clamp(0.0, 1.0) }
}

/// The motor housing, a cylinder behind the shaft.
struct Head {
    radius: f64,
    length: f64,
    /// Distance of its centre of mass from the shaft's axis (m).
    aside: f64,
}

/// The rotation from the shaft frame to the tip frame: the tip's x is the shaft's z; y is the same.
pub(crate) fn shaft_to_tip() -> DQuat {
    DQuat::from_rotation_y(-FRAC_PI_2)
}

/// The composition of two poses, normalized: `inner` is given in the axes of `outer`.
pub(crate) fn compose(outer: &Pose, inner: &Pose) -> Pose {
    Pose { rotation: (outer.rotation * inner.rotation).normalize(), translation: outer.transform(inner.translation) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn built_in_instruments_have_the_papers_weight() {
        for name in Instrument::NAMES {
            let i = Instrument::named(name).unwrap();
            i.check().unwrap();
            assert!((i.weight() - 4.7).abs() < 1e-12);
            assert!((i.jaw.angle(1.0).to_degrees() - 60.0).abs() < 1e-12);
            assert!(i.mass.center.z < 0.0, "the motor outweighs the shaft");
        }
        assert!(Instrument::named("stapler").unwrap_err().to_string().contains("grasper or cutter"));
    }

    #[test]
    fn the_tip_has_the_grippers_frame() {
        let i = Instrument::grasper();
        let tip = i.tip(&Pose::IDENTITY);
        assert!((tip.rotation * DVec3::X - DVec3::Z).length() < 1e-15, "x runs along the shaft");
        assert!((tip.rotation * DVec3::Y - DVec3::Y).length() < 1e-15);
        assert!((tip.translation - DVec3::Z * (0.09 + 0.33 + 0.008)).length() < 1e-15);
        let back = i.flange(&tip);
        assert!(back.translation.length() < 1e-15 && back.rotation.angle_between(DQuat::IDENTITY) < 1e-7);
    }

    #[test]
    fn the_jaw_keeps_its_rate_and_range() {
        let jaw = Instrument::grasper().jaw;
        assert!((jaw.toward(0.0, 1.0, 0.03) - 0.1).abs() < 1e-12);
        assert_eq!(jaw.toward(0.95, 7.0, 1.0), 1.0);
        assert_eq!(jaw.toward(0.02, -1.0, 1.0), 0.0);
        assert!(!jaw.toward(0.5, f64::NAN, 0.1).is_nan());
    }

    #[test]
    fn invalid_instruments_are_refused_by_field() {
        let refused = |change: &dyn Fn(&mut Instrument), field: &str| {
            let mut i = Instrument::cutter();
            change(&mut i);
            let e = i.check().unwrap_err().to_string();
            assert!(e.contains("cutter") && e.contains(field), "{e}");
        };
        refused(&|i| i.shaft_radius = f64::NAN, "shaft_radius");
        refused(&|i| i.shaft_length = 0.0, "shaft_length");
        refused(&|i| i.jaw.max_angle = 4.0, "jaw.max_angle");
        refused(&|i| i.mass.mass = -1.0, "mass");
        refused(&|i| i.mass.inertia.x_axis.x = -1.0, "inertia");
        refused(&|i| i.mass.inertia.z_axis.z = 1.0, "inertia");
        refused(&|i| i.mount.rotation = DQuat::from_xyzw(0.0, 0.0, 0.0, 2.0), "mount");
        refused(&|i| i.mount.translation.x = f64::INFINITY, "mount");
    }
}
