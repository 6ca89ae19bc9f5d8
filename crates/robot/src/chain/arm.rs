//! The description of an arm: joints, limits and links, validated on construction.

use super::joints::{Joints, MAX_JOINTS};
use super::mass::MassProperties;
use crate::{Error, Result};
use glam::DVec3;
use serde::{Deserialize, Serialize};
use trocar_core::Pose;

/// Gravity in a world with z up (m/s2), the value of most simulators.
const GRAVITY: DVec3 = DVec3::new(0.0, 0.0, -9.81);

/// The motion of a joint.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum JointKind {
    /// Rotation about the axis; the position is in radians.
    Revolute,
    /// Translation along the axis; the position is in metres.
    Prismatic,
}

/// Limits of a joint. Unknown ones are infinite.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct JointLimits {
    /// Minimum and maximum position (rad or m).
    pub position: [f64; 2],
    /// Maximum speed (rad/s or m/s).
    pub velocity: f64,
    /// Maximum torque or force of the drive (N m or N).
    pub effort: f64,
    /// Maximum planned acceleration (rad/s2 or m/s2). It is not enforced.
    pub acceleration: f64,
}

impl JointLimits {
    /// No limits.
    pub const NONE: Self = Self {
        position: [f64::NEG_INFINITY, f64::INFINITY],
        velocity: f64::INFINITY,
        effort: f64::INFINITY,
        acceleration: f64::INFINITY,
    };
}

/// A joint with one degree of freedom.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Joint {
    /// Name.
    pub name: String,
    /// The motion.
    pub kind: JointKind,
    /// Pose of the joint's link in the parent's axes at position zero.
    pub placement: Pose,
    /// Axis in the link's axes, through the link's origin. Any length but zero; stored as a unit
    /// vector.
    pub axis: DVec3,
    /// Limits.
    pub limits: JointLimits,
    /// Inertia of the rotor reflected to the joint (kg m2, or kg).
    pub armature: f64,
    /// Viscous damping (N m s/rad, or N s/m).
    pub damping: f64,
    /// Coulomb friction, at rest and in motion (N m, or N).
    pub friction: f64,
}

/// A joint and its link.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Segment {
    /// Name of the link.
    pub link: String,
    /// The joint that moves the link.
    pub joint: Joint,
    /// Mass properties of the link, in its own axes.
    pub mass: MassProperties,
}

/// A robot arm: a chain of links, each moved by one joint, with a payload at its flange. It is
/// immutable; `with_*` return a changed copy.
#[derive(Clone, Debug, PartialEq)]
pub struct SerialArm {
    name: String,
    segments: Vec<Segment>,
    /// Mass properties by link, the last with the payload.
    bodies: Vec<MassProperties>,
    payload: MassProperties,
    base: Pose,
    flange: Pose,
    gravity: DVec3,
    home: Joints,
}

impl SerialArm {
    /// An arm from its base outwards. `flange` is the pose of the flange in the last link's axes.
    /// The base is at the world's origin, gravity is 9.81 m/s2 along -z, and the home posture is
    /// zero or, outside the limits, the middle of the range.
    ///
    /// # Errors
    /// No joint or more than [`MAX_JOINTS`]; an axis of zero length; reversed limits; a number that
    /// is negative or not finite; an impossible inertia; links and armature so light that the mass
    /// matrix is singular.
    pub fn new(name: impl Into<String>, segments: Vec<Segment>, flange: Pose) -> Result<Self> {
        let name = name.into();
        let n = segments.len();
        if n == 0 || n > MAX_JOINTS {
            return Err(Error::invalid(
                format!("arm '{name}'"),
                format!("has {n} joints; it must have 1 to {MAX_JOINTS}"),
            ));
        }
        let mut segments = segments;
        for s in &mut segments {
            check_joint(&mut s.joint)?;
            s.mass.validate(&format!("link '{}'", s.link))?;
        }
        let flange = check_pose(flange, "flange pose")?;
        let home = Joints::from_fn(n, |i| {
            let [low, high] = segments[i].joint.limits.position;
            if low <= 0.0 && high >= 0.0 {
                0.0
            } else if low.is_finite() && high.is_finite() {
                0.5 * (low + high)
            } else {
                0.0f64.clamp(low, high)
            }
        });
        let bodies = segments.iter().map(|s| s.mass).collect();
        let payload = MassProperties::NONE;
        let arm = Self { name, segments, bodies, payload, base: Pose::IDENTITY, flange, gravity: GRAVITY, home };
        arm.checked()
    }

    fn checked(self) -> Result<Self> {
        if self.mass_matrix(&self.home).factor().is_none() {
            let reason = "the mass matrix is not positive definite in the home posture: links and rotors are too light";
            return Err(Error::invalid(format!("arm '{}'", self.name), reason));
        }
        Ok(self)
    }

    /// This arm with its base at `base` in the world.
    ///
    /// # Errors
    /// A pose that is not finite or whose rotation is not a unit quaternion.
    pub fn with_base(mut self, base: Pose) -> Result<Self> {
        self.base = check_pose(base, "base pose")?;
        Ok(self)
    }

    /// This arm under `gravity`, in world axes (m/s2).
    ///
    /// # Errors
    /// A vector that is not finite.
    pub fn with_gravity(mut self, gravity: DVec3) -> Result<Self> {
        if !gravity.is_finite() {
            return Err(Error::invalid("gravity", "must be finite"));
        }
        self.gravity = gravity;
        Ok(self)
    }

    /// This arm with another payload, in the flange's axes.
    ///
    /// # Errors
    /// An impossible inertia.
    pub fn with_payload(mut self, payload: MassProperties) -> Result<Self> {
        payload.validate("payload")?;
        self.payload = payload;
        self.weigh();
        self.checked()
    }

    /// This arm with another home posture: the start, and the preferred posture of
    /// [`SerialArm::inverse`].
    ///
    /// # Errors
    /// Another number of joints, or a position outside the limits.
    pub fn with_home(mut self, home: &[f64]) -> Result<Self> {
        self.home = self.posture(home)?;
        Ok(self)
    }

    /// This arm with the masses and inertias of its links scaled by `links` and those of the
    /// payload by `payload`: the wrong model of a controller. Rotors are not scaled.
    ///
    /// # Errors
    /// A factor that is not positive (the payload's may be zero), or so small that the mass matrix
    /// is singular.
    pub fn with_mass_scaled(mut self, links: f64, payload: f64) -> Result<Self> {
        if !(links > 0.0 && links.is_finite() && payload >= 0.0 && payload.is_finite()) {
            return Err(Error::invalid("mass factor", "must be positive and finite"));
        }
        for s in &mut self.segments {
            s.mass = s.mass.scaled(links);
        }
        self.payload = self.payload.scaled(payload);
        self.weigh();
        self.checked()
    }

    /// This arm with other Coulomb friction (N m or N) and viscous damping (N m s/rad or N s/m) of
    /// its joints.
    ///
    /// # Errors
    /// Another number of joints, or a number that is negative or not finite.
    pub fn with_friction(mut self, friction: &[f64], damping: &[f64]) -> Result<Self> {
        self.check_count(friction.len(), "friction")?;
        self.check_count(damping.len(), "damping")?;
        for (i, s) in self.segments.iter_mut().enumerate() {
            (s.joint.friction, s.joint.damping) = (friction[i], damping[i]);
            check_joint(&mut s.joint)?;
        }
        Ok(self)
    }

    /// This arm with other limits.
    ///
    /// # Errors
    /// Another number of joints, or limits that [`SerialArm::new`] refuses.
    pub fn with_limits(mut self, limits: &[JointLimits]) -> Result<Self> {
        self.check_count(limits.len(), "limits")?;
        for (s, &l) in self.segments.iter_mut().zip(limits) {
            s.joint.limits = l;
            check_joint(&mut s.joint)?;
        }
        for (h, l) in self.home.iter_mut().zip(limits) {
            *h = h.clamp(l.position[0], l.position[1]);
        }
        Ok(self)
    }

    /// Name of the arm.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Joints and links from the base outwards.
    pub fn segments(&self) -> &[Segment] {
        &self.segments
    }

    /// The number of joints.
    pub fn dof(&self) -> usize {
        self.segments.len()
    }

    /// Pose of the base in the world.
    pub fn base(&self) -> Pose {
        self.base
    }

    /// Pose of the flange in the last link's axes.
    pub fn flange(&self) -> Pose {
        self.flange
    }

    /// Gravity in world axes (m/s2).
    pub fn gravity(&self) -> DVec3 {
        self.gravity
    }

    /// The payload, in the flange's axes.
    pub fn payload(&self) -> MassProperties {
        self.payload
    }

    /// The home posture.
    pub fn home(&self) -> Joints {
        self.home
    }

    /// A zero for each joint.
    pub fn zeros(&self) -> Joints {
        Joints::zeros(self.dof())
    }

    /// A posture of this arm (rad or m).
    ///
    /// # Errors
    /// Another number of joints, or a position that is not finite or outside the limits.
    pub fn posture(&self, q: &[f64]) -> Result<Joints> {
        self.check_count(q.len(), "posture")?;
        for (x, s) in q.iter().zip(&self.segments) {
            let [low, high] = s.joint.limits.position;
            if !(x.is_finite() && (low..=high).contains(x)) {
                let reason = format!("its position is {x}; it must be in [{low}, {high}]");
                return Err(Error::invalid(format!("joint '{}'", s.joint.name), reason));
            }
        }
        Joints::new(q)
    }

    /// A number for each joint of this arm.
    ///
    /// # Errors
    /// Another number of joints, or a number that is not finite.
    pub fn joints(&self, values: &[f64]) -> Result<Joints> {
        self.check_count(values.len(), "joint vector")?;
        let joints = Joints::new(values)?;
        if joints.is_finite() { Ok(joints) } else { Err(Error::NotFinite { what: "a joint's number" }) }
    }

    /// Mass properties by link, the last with the payload.
    pub(super) fn bodies(&self) -> &[MassProperties] {
        &self.bodies
    }

    fn check_count(&self, count: usize, what: &str) -> Result<()> {
        if count == self.dof() {
            return Ok(());
        }
        Err(Error::invalid(what, format!("has {count} numbers; arm '{}' has {} joints", self.name, self.dof())))
    }

    fn weigh(&mut self) {
        self.bodies = self.segments.iter().map(|s| s.mass).collect();
        if let Some(last) = self.bodies.last_mut() {
            *last = last.joined(&self.payload.placed(&self.flange));
        }
    }
}

/// The pose with its rotation normalized.
fn check_pose(pose: Pose, what: &str) -> Result<Pose> {
    let length = pose.rotation.length();
    // A quaternion far from unit length is a mistake, not rounding.
    if !(pose.translation.is_finite() && (length - 1.0).abs() < 1e-3) {
        return Err(Error::invalid(what, "must be finite, with a unit quaternion as its rotation"));
    }
    Ok(Pose { rotation: pose.rotation.normalize(), ..pose })
}

fn check_joint(joint: &mut Joint) -> Result<()> {
    let what = format!("joint '{}'", joint.name);
    joint.placement = check_pose(joint.placement, &format!("{what}: placement"))?;
    let Some(axis) = joint.axis.try_normalize().filter(|a| a.is_finite()) else {
        return Err(Error::invalid(what, "the axis must not be zero"));
    };
    joint.axis = axis;
    let JointLimits { position: [low, high], velocity, effort, acceleration } = joint.limits;
    if low.is_nan() || high.is_nan() || low >= high {
        return Err(Error::invalid(what, format!("position limits are [{low}, {high}]; the first must be lower")));
    }
    for (value, name) in [(velocity, "velocity"), (effort, "effort"), (acceleration, "acceleration")] {
        if value.is_nan() || value <= 0.0 {
            return Err(Error::invalid(what, format!("the {name} limit is {value}; it must be positive")));
        }
    }
    for (value, name) in [(joint.armature, "armature"), (joint.damping, "damping"), (joint.friction, "friction")] {
        if !(value >= 0.0 && value.is_finite()) {
            return Err(Error::invalid(what, format!("{name} is {value}; it must be finite and not negative")));
        }
    }
    Ok(())
}
