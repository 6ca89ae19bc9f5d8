//! Forward kinematics: poses of links, and Jacobians.

use super::arm::{JointKind, SerialArm};
use super::joints::{Joints, MAX_JOINTS};
use glam::{DQuat, DVec3};
use trocar_core::Pose;

/// The poses of all links and of the flange in the world, in one posture.
#[derive(Clone, Copy, Debug)]
pub struct Frames {
    n: usize,
    links: [Pose; MAX_JOINTS],
    /// Unit axes in the world; that of joint i goes through the origin of link i.
    axes: [DVec3; MAX_JOINTS],
    turns: [bool; MAX_JOINTS],
    flange: Pose,
}

impl SerialArm {
    /// Forward kinematics in posture `q` (rad or m), inside or outside the limits (Lynch and Park
    /// 2017, section 4.1).
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
            // The rotation about the axis does not change it.
            let axis = link.rotation * joint.axis;
            match joint.kind {
                JointKind::Revolute => {
                    let (sin, cos) = libm::sincos(0.5 * q.at(i));
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

/// The composition of two poses: `inner` is given in the axes of `outer`.
pub(super) fn compose(outer: &Pose, inner: &Pose) -> Pose {
    Pose { rotation: outer.rotation * inner.rotation, translation: outer.transform(inner.translation) }
}

impl Frames {
    /// Pose of link `i` in the world, 0 for the first moving link; an index beyond the last is the
    /// last.
    pub fn link(&self, i: usize) -> Pose {
        self.links[i.min(self.n.max(1) - 1)]
    }

    /// Pose of the flange in the world.
    pub fn flange(&self) -> Pose {
        self.flange
    }

    /// Unit axis of joint `i` in world axes; zero beyond the last.
    pub fn axis(&self, i: usize) -> DVec3 {
        self.axes.get(i).copied().unwrap_or(DVec3::ZERO)
    }

    /// Whether joint `i` is revolute.
    pub(super) fn turns(&self, i: usize) -> bool {
        self.turns[i]
    }

    /// The geometric Jacobian of the point of link `i` at `point` in the world (m) (Lynch and Park
    /// 2017, section 5.1). An index beyond the last link is the last.
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

    /// The geometric Jacobian of the flange's origin.
    pub fn flange_jacobian(&self) -> Jacobian {
        self.jacobian(MAX_JOINTS, self.flange.translation)
    }
}

/// The geometric Jacobian of a point of a link: a column a joint, in world axes.
#[derive(Clone, Copy, Debug)]
pub struct Jacobian {
    n: usize,
    pub(super) linear: [DVec3; MAX_JOINTS],
    pub(super) angular: [DVec3; MAX_JOINTS],
}

impl Jacobian {
    /// Velocity of the point at unit speed of each joint (m/rad or 1).
    pub fn linear(&self) -> &[DVec3] {
        &self.linear[..self.n]
    }

    /// Angular velocity of the link at unit speed of each joint (1 or 0).
    pub fn angular(&self) -> &[DVec3] {
        &self.angular[..self.n]
    }

    /// Velocity of the point (m/s) and angular velocity of its link (rad/s) at the joint rates
    /// `qd`.
    pub fn velocity(&self, qd: &Joints) -> (DVec3, DVec3) {
        let mut v = (DVec3::ZERO, DVec3::ZERO);
        for k in 0..self.n {
            v.0 += self.linear[k] * qd.at(k);
            v.1 += self.angular[k] * qd.at(k);
        }
        v
    }

    /// The joint torques of a force (N) at the point and a torque (N m) on the link: J^T (force,
    /// torque).
    pub fn torque(&self, force: DVec3, torque: DVec3) -> Joints {
        Joints::from_fn(self.n, |k| self.linear[k].dot(force) + self.angular[k].dot(torque))
    }

    /// The row of the Jacobian along `direction`: its product with the joint rates is the speed of
    /// the point in this direction.
    pub fn row(&self, direction: DVec3) -> Joints {
        self.torque(direction, DVec3::ZERO)
    }
}
