//! Where an arm's links are at a posture, and how they move with it.

use super::arm::{JointKind, SerialArm};
use super::joints::{Joints, MAX_JOINTS};
use glam::{DQuat, DVec3};
use trocar_core::Pose;

/// The poses of all links and of the flange in the world, at one posture.
#[derive(Clone, Copy, Debug)]
pub struct Frames {
    n: usize,
    links: [Pose; MAX_JOINTS],
    /// Unit axes in the world; joint i's goes through the origin of link i.
    axes: [DVec3; MAX_JOINTS],
    turns: [bool; MAX_JOINTS],
    flange: Pose,
}

impl SerialArm {
    /// Forward kinematics: where everything is at posture `q` [rad or m], limits or not (Lynch and Park 2017, section 4.1).
    pub fn frames(&self, q: &Joints) -> Frames {
        let n = self.dof();
        let mut frames = Frames {
            n,
            links: [Pose::IDENTITY; MAX_JOINTS],
            axes: [DVec3::ZERO; MAX_JOINTS],
            turns: [false; MAX_JOINTS],
            flange: self.base(),
        };
        let mut parent = self.base();
        for (i, s) in self.segments().iter().enumerate() {
            let joint = &s.joint;
            let mut link = compose(&parent, &joint.placement);
            // The axis is the same before and after the turn about it.
            let axis = link.rotation * joint.axis;
            match joint.kind {
                JointKind::Revolute => {
                    let (sin, cos) = (0.5 * q.at(i)).sin_cos();
                    let a = joint.axis * sin;
                    link.rotation *= DQuat::from_xyzw(a.x, a.y, a.z, cos);
                }
                JointKind::Prismatic => link.translation += axis * q.at(i),
            }
            frames.links[i] = link;
            frames.axes[i] = axis;
            frames.turns[i] = joint.kind == JointKind::Revolute;
            parent = link;
        }
        frames.flange = compose(&parent, &self.flange());
        frames
    }
}

/// `inner` seen from where `outer` is seen from.
pub(super) fn compose(outer: &Pose, inner: &Pose) -> Pose {
    Pose { rotation: outer.rotation * inner.rotation, translation: outer.transform(inner.translation) }
}

impl Frames {
    /// Pose of link `i` in the world, 0 the first that moves; beyond the last, the last.
    pub fn link(&self, i: usize) -> Pose {
        self.links[i.min(self.n.max(1) - 1)]
    }

    /// Pose of the flange in the world.
    pub fn flange(&self) -> Pose {
        self.flange
    }

    /// Unit axis of joint `i` in world axes; beyond the last, zero.
    pub fn axis(&self, i: usize) -> DVec3 {
        self.axes.get(i).copied().unwrap_or(DVec3::ZERO)
    }

    /// Whether joint `i` is revolute.
    pub(super) fn turns(&self, i: usize) -> bool {
        self.turns[i]
    }

    /// The geometric Jacobian of the point of link `i` that is at `point` in the world [m] (Lynch and Park 2017, section 5.1). Beyond the
    /// last link, of the last.
    pub fn jacobian(&self, i: usize, point: DVec3) -> Jacobian {
        let mut j = Jacobian { n: self.n, linear: [DVec3::ZERO; MAX_JOINTS], angular: [DVec3::ZERO; MAX_JOINTS] };
        for k in 0..self.n.min(i.saturating_add(1)) {
            if self.turns[k] {
                j.linear[k] = self.axes[k].cross(point - self.links[k].translation);
                j.angular[k] = self.axes[k];
            } else {
                j.linear[k] = self.axes[k];
            }
        }
        j
    }

    /// The Jacobian of the flange's origin.
    pub fn flange_jacobian(&self) -> Jacobian {
        self.jacobian(MAX_JOINTS, self.flange.translation)
    }
}

/// How a point of a link moves with the joints: a column a joint, in world axes.
#[derive(Clone, Copy, Debug)]
pub struct Jacobian {
    n: usize,
    pub(super) linear: [DVec3; MAX_JOINTS],
    pub(super) angular: [DVec3; MAX_JOINTS],
}

impl Jacobian {
    /// Velocity of the point a unit of joint speed, one a joint [m/rad or 1].
    pub fn linear(&self) -> &[DVec3] {
        &self.linear[..self.n]
    }

    /// Angular velocity of the link a unit of joint speed, one a joint [1 or 0].
    pub fn angular(&self) -> &[DVec3] {
        &self.angular[..self.n]
    }

    /// Velocity of the point [m/s] and angular velocity of its link [rad/s] at the joint rates `qd`.
    pub fn velocity(&self, qd: &Joints) -> (DVec3, DVec3) {
        let mut v = (DVec3::ZERO, DVec3::ZERO);
        for k in 0..self.n {
            v.0 += self.linear[k] * qd.at(k);
            v.1 += self.angular[k] * qd.at(k);
        }
        v
    }

    /// The joint torques that hold a force [N] at the point and a torque [N m] on the link: J^T (force, torque).
    pub fn torque(&self, force: DVec3, torque: DVec3) -> Joints {
        Joints::from_fn(self.n, |k| self.linear[k].dot(force) + self.angular[k].dot(torque))
    }

    /// The row of the point's motion along `direction`: its product with the joint rates is the speed that way.
    pub fn row(&self, direction: DVec3) -> Joints {
        self.torque(direction, DVec3::ZERO)
    }
}
