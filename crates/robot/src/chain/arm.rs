//! What an arm is: its joints, limits and links, checked once.

use super::joints::{Joints, MAX_JOINTS};
use super::mass::MassProperties;
use crate::{Error, Result};
use glam::DVec3;
use serde::{Deserialize, Serialize};
use trocar_core::Pose;

/// Standard gravity in a world with z up [m/s2], as most simulators have it.
const GRAVITY: DVec3 = DVec3::new(0.0, 0.0, -9.81);

/// What a joint lets its link do.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum JointKind {
    /// Turn about the axis; position in radians.
    Revolute,
    /// Slide along the axis; position in metres.
    Prismatic,
}

/// How far, how fast and how hard a joint may go. Infinite where nothing is known.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct JointLimits {
    /// Lowest and highest position [rad or m].
    pub position: [f64; 2],
    /// Highest speed [rad/s or m/s].
    pub velocity: f64,
    /// Highest torque or force of the drive [N m or N].
    pub effort: f64,
    /// Highest acceleration that may be planned [rad/s2 or m/s2]. Nothing enforces it.
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
    /// Its name.
    pub name: String,
    /// What it lets its link do.
    pub kind: JointKind,
    /// Pose of its link in the parent's axes at position zero.
    pub placement: Pose,
    /// Axis in its link's axes, through the link's origin. Any length but zero; kept as a unit vector.
    pub axis: DVec3,
    /// Its limits.
    pub limits: JointLimits,
    /// Inertia of the rotor as felt at the joint [kg m2, or kg].
    pub armature: f64,
    /// Viscous damping [N m s/rad, or N s/m].
    pub damping: f64,
    /// Coulomb friction, at rest and in motion [N m, or N].
    pub friction: f64,
}

/// A joint and the link that it moves.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Segment {
    /// The link's name.
    pub link: String,
    /// What moves it.
    pub joint: Joint,
    /// The link's mass, in its own axes.
    pub mass: MassProperties,
}

/// A chain of links, each moved by one joint, with a payload at its flange: a robot arm. Immutable; `with_*` make another one.
#[derive(Clone, Debug, PartialEq)]
pub struct SerialArm {
    name: String,
    segments: Vec<Segment>,
    /// Masses by link, the last with the payload.
    bodies: Vec<MassProperties>,
    payload: MassProperties,
    base: Pose,
    flange: Pose,
    gravity: DVec3,
    home: Joints,
}

impl SerialArm {
    /// An arm from its base outwards. `flange` is the pose of the flange in the last link's axes. The base is at the world's origin, gravity
    /// 9.81 m/s2 along -z, the home posture zero or, where limits forbid that, the middle of the range.
    ///
    /// # Errors
    /// No joint or more than [`MAX_JOINTS`]; an axis of no length; limits the wrong way round; a number that is negative or not finite where
    /// it must not be; a body that cannot exist; links and armature so light that nothing resists a joint.
    pub fn new(name: impl Into<String>, segments: Vec<Segment>, flange: Pose) -> Result<Self> {
        let name = name.into();
        let n = segments.len();
        if n == 0 || n > MAX_JOINTS {
            return Err(Error::invalid(format!("arm '{name}'"), format!("{n} joints, must be 1 to {MAX_JOINTS}")));
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
            let reason = "links and rotors are too light: the mass matrix is not positive definite at the home posture";
            return Err(Error::invalid(format!("arm '{}'", self.name), reason));
        }
        Ok(self)
    }

    /// The same arm with its base at `base` in the world.
    ///
    /// # Errors
    /// A pose that is not finite or whose rotation is none.
    pub fn with_base(mut self, base: Pose) -> Result<Self> {
        self.base = check_pose(base, "base pose")?;
        Ok(self)
    }

    /// The same arm under this gravity, in world axes [m/s2].
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

    /// The same arm with this fixed to its flange, in the flange's axes, in place of what was there.
    ///
    /// # Errors
    /// A body that cannot exist.
    pub fn with_payload(mut self, payload: MassProperties) -> Result<Self> {
        payload.validate("payload")?;
        self.payload = payload;
        self.weigh();
        self.checked()
    }

    /// The same arm with another home posture: where it starts, and where [`SerialArm::inverse`] likes to have the elbow.
    ///
    /// # Errors
    /// Not a number a joint, or one beyond its limits.
    pub fn with_home(mut self, home: &[f64]) -> Result<Self> {
        self.home = self.posture(home)?;
        Ok(self)
    }

    /// The same arm with every link's mass and inertia times `links` and the payload's times `payload`: what a controller that is mistaken
    /// believes. Rotors stay as they are.
    ///
    /// # Errors
    /// A factor that is not positive (the payload's may be zero) or so small that nothing resists a joint.
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

    /// The same arm with this Coulomb friction [N m or N] and viscous damping [N m s/rad or N s/m] in its joints.
    ///
    /// # Errors
    /// Not a number a joint, or one that is negative or not finite.
    pub fn with_friction(mut self, friction: &[f64], damping: &[f64]) -> Result<Self> {
        self.check_count(friction.len(), "friction")?;
        self.check_count(damping.len(), "damping")?;
        for (i, s) in self.segments.iter_mut().enumerate() {
            (s.joint.friction, s.joint.damping) = (friction[i], damping[i]);
            check_joint(&mut s.joint)?;
        }
        Ok(self)
    }

    /// The same arm with other limits.
    ///
    /// # Errors
    /// Not one a joint, or limits that [`SerialArm::new`] would refuse.
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

    /// Its name.
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

    /// Gravity in world axes [m/s2].
    pub fn gravity(&self) -> DVec3 {
        self.gravity
    }

    /// What is fixed to the flange, in its axes.
    pub fn payload(&self) -> MassProperties {
        self.payload
    }

    /// The home posture.
    pub fn home(&self) -> Joints {
        self.home
    }

    /// Zeros, one a joint.
    pub fn zeros(&self) -> Joints {
        Joints::zeros(self.dof())
    }

    /// A posture of this arm.
    ///
    /// # Errors
    /// Not a number a joint, one that is not finite or beyond its joint's limits.
    pub fn posture(&self, q: &[f64]) -> Result<Joints> {
        self.check_count(q.len(), "posture")?;
        for (x, s) in q.iter().zip(&self.segments) {
            let [low, high] = s.joint.limits.position;
            if !(x.is_finite() && (low..=high).contains(x)) {
                let reason = format!("a position of {x}, must be within {low} to {high}");
                return Err(Error::invalid(format!("joint '{}'", s.joint.name), reason));
            }
        }
        Joints::new(q)
    }

    /// A number for each joint of this arm.
    ///
    /// # Errors
    /// Not a number a joint, or one that is not finite.
    pub fn joints(&self, values: &[f64]) -> Result<Joints> {
        self.check_count(values.len(), "joint vector")?;
        let joints = Joints::new(values)?;
        if joints.is_finite() { Ok(joints) } else { Err(Error::NotFinite { what: "a joint's number" }) }
    }

    /// Masses by link, the last with the payload.
    pub(super) fn bodies(&self) -> &[MassProperties] {
        &self.bodies
    }

    fn check_count(&self, count: usize, what: &str) -> Result<()> {
        if count == self.dof() {
            return Ok(());
        }
        Err(Error::invalid(what, format!("{count} numbers, arm '{}' has {} joints", self.name, self.dof())))
    }

    fn weigh(&mut self) {
        self.bodies = self.segments.iter().map(|s| s.mass).collect();
        if let Some(last) = self.bodies.last_mut() {
            *last = last.joined(&self.payload.placed(&self.flange));
        }
    }
}

/// The pose with a rotation of unit length.
fn check_pose(pose: Pose, what: &str) -> Result<Pose> {
    let length = pose.rotation.length();
    // Not normalised at any length: a quaternion far from unit length is a mistake, not a rounding.
    if !(pose.translation.is_finite() && (length - 1.0).abs() < 1e-3) {
        return Err(Error::invalid(what, "must be finite, its rotation a unit quaternion"));
    }
    Ok(Pose { rotation: pose.rotation.normalize(), ..pose })
}

fn check_joint(joint: &mut Joint) -> Result<()> {
    let what = format!("joint '{}'", joint.name);
    joint.placement = check_pose(joint.placement, &format!("{what}: placement"))?;
    let Some(axis) = joint.axis.try_normalize().filter(|a| a.is_finite()) else {
        return Err(Error::invalid(what, "the axis has no direction, must be a vector other than zero"));
    };
    joint.axis = axis;
    let JointLimits { position: [low, high], velocity, effort, acceleration } = joint.limits;
    if low.is_nan() || high.is_nan() || low >= high {
        return Err(Error::invalid(what, format!("position limits {low} to {high}, the first must be the lower")));
    }
    for (value, name) in [(velocity, "velocity"), (effort, "effort"), (acceleration, "acceleration")] {
        if value.is_nan() || value <= 0.0 {
            return Err(Error::invalid(what, format!("a {name} limit of {value}, must be positive")));
        }
    }
    for (value, name) in [(joint.armature, "armature"), (joint.damping, "damping"), (joint.friction, "friction")] {
        if !(value >= 0.0 && value.is_finite()) {
            return Err(Error::invalid(what, format!("{name} {value}, must be finite and not negative")));
        }
    }
    Ok(())
}
