//! An operator's commands as the arms' numbers for a control period.

use crate::error::Result;
use crate::hub::Arrived;
use crate::inbox::ClientId;
use crate::protocol::{ArmName, Axes, Command, Servo};
use glam::{DQuat, DVec3};
use std::time::Instant;
use trocar_cell::{Cell, Setpoint};
use trocar_core::Pose;
use trocar_scene::{Scene, Side};

/// Who moves an arm, with its number in the column of files.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Actor {
    /// The policy.
    #[default]
    Policy = 0,
    /// The operator, by a command that lives.
    Operator = 1,
    /// Nobody: the operator has the arm, but no command lives.
    Hold = 2,
}

impl Actor {
    pub fn name(self) -> &'static str {
        match self {
            Self::Policy => "policy",
            Self::Operator => "operator",
            Self::Hold => "hold",
        }
    }
}

/// A command that was applied, for the latency.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Shown {
    pub seq: u64,
    pub time_s: f64,
    /// From its arrival to the beginning of the period (ms).
    pub waited_ms: f64,
    /// The beginning of the period.
    pub tick: Instant,
}

/// One arm of an operator.
#[derive(Clone, Debug, Default)]
struct Seat {
    taken: bool,
    /// Who pressed the clutch, its number, and the commanded pose of that instant.
    anchor: Option<(ClientId, u64, Pose)>,
    jaw: Option<f64>,
    last: Option<(ClientId, u64)>,
    shown: Option<Shown>,
    actor: Actor,
}

/// The operator's part in an episode.
#[derive(Clone, Debug, Default)]
pub(crate) struct Operators {
    arms: [Seat; 2],
}

/// The arm of a side.
pub(crate) fn arm_of(side: Side) -> ArmName {
    match side {
        Side::Left => ArmName::Left,
        Side::Right => ArmName::Right,
    }
}

impl Operators {
    /// The policy has this arm again. Returns whether it had been taken.
    pub fn hand_back(&mut self, arm: ArmName) -> bool {
        let had = self.arms[arm as usize].taken;
        self.arms[arm as usize] = Seat::default();
        had
    }

    /// Who moves an arm now.
    pub fn actor(&self, arm: ArmName) -> Actor {
        self.arms[arm as usize].actor
    }

    /// The newest command of an arm that was applied.
    pub fn shown(&self, arm: ArmName) -> Option<Shown> {
        self.arms[arm as usize].shown
    }

    /// The numbers of each arm that the operator has, by the cell's order; `None` leaves an arm to
    /// the policy. `tick` is the beginning of the period.
    pub fn plan(
        &mut self,
        cell: &Cell,
        scene: &Scene,
        commands: &[Option<Arrived>; 2],
        tick: Instant,
    ) -> Result<Vec<Option<Setpoint>>> {
        let mut all = Vec::new();
        for (side, _) in cell.arms() {
            let arm = arm_of(side);
            let command = commands[arm as usize].as_ref();
            all.push(self.arms[arm as usize].plan(cell, side.name(), scene, command, tick)?);
        }
        Ok(all)
    }
}

impl Seat {
    fn plan(
        &mut self,
        cell: &Cell,
        arm: &str,
        scene: &Scene,
        arrived: Option<&Arrived>,
        tick: Instant,
    ) -> Result<Option<Setpoint>> {
        let alive = arrived.filter(|a| a.is_alive(tick));
        let known = alive.filter(|a| self.last.is_none_or(|(client, seq)| client != a.client || a.command.seq > seq));
        self.taken |= known.is_some();
        if !self.taken {
            (self.actor, self.shown) = (Actor::Policy, None);
            return Ok(None);
        }
        let commanded = cell.setpoint(arm)?;
        let jaw = self.jaw.unwrap_or(commanded.jaw());
        let Some(arrived) = alive else {
            self.actor = Actor::Hold;
            self.jaw = Some(jaw);
            return Ok(Some(commanded.with_jaw(jaw)));
        };
        self.actor = Actor::Operator;
        let command = &arrived.command;
        let jaw = command.jaw.unwrap_or(jaw);
        self.jaw = Some(jaw);
        if known.is_some() {
            let waited_ms = 1e3 * tick.saturating_duration_since(arrived.at).as_secs_f64();
            self.shown = Some(Shown { seq: command.seq, time_s: command.time_s, waited_ms, tick });
            self.last = Some((arrived.client, command.seq));
        }
        let space = cell.workspace(arm)?;
        let near = commanded.with_jaw(jaw);
        let to = match &command.servo {
            Servo::Relative { clutch, .. } => {
                let same = self.anchor.filter(|(client, own, _)| (*client, *own) == (arrived.client, *clutch));
                let anchor = same.map_or_else(|| space.tip(&commanded), |(_, _, pose)| pose);
                self.anchor = Some((arrived.client, *clutch, anchor));
                Some(relative(command, &anchor, scene))
            }
            Servo::Pose([x, y, z, w, i, j, k]) => {
                let rotation = DQuat::from_xyzw(*i, *j, *k, *w).normalize();
                Some(Pose { rotation, translation: DVec3::new(*x, *y, *z) })
            }
            Servo::Numbers([a, b, c, d]) => {
                return Ok(Some(space.clamp(&Setpoint([*a, *b, *c, *d, jaw]))));
            }
            Servo::Jaw | Servo::Release => None,
        };
        Ok(Some(match to {
            Some(pose) => space.clamp(&cell.solve(arm, &pose, &near)?.setpoint.with_jaw(jaw)),
            None => near,
        }))
    }
}

/// The pose that a relative motion asks for.
fn relative(command: &Command, anchor: &Pose, scene: &Scene) -> Pose {
    let Servo::Relative { axes, camera, scale, translation, rotation, .. } = &command.servo else { return *anchor };
    let frame = match axes {
        Axes::World => DQuat::IDENTITY,
        Axes::Tool => anchor.rotation,
        Axes::Endoscope => endoscope(scene, camera.as_deref()),
    };
    let [w, x, y, z] = *rotation;
    let turn = frame * DQuat::from_xyzw(x, y, z, w).normalize() * frame.inverse();
    Pose {
        rotation: (turn * anchor.rotation).normalize(),
        translation: anchor.translation + *scale * (frame * DVec3::from(*translation)),
    }
}

/// The axes of a camera: the one of this name, the endoscope, or the first.
fn endoscope(scene: &Scene, name: Option<&str>) -> DQuat {
    let named = scene.cameras.iter().find(|c| name == Some(c.name.as_str()));
    let scope = || scene.cameras.iter().find(|c| trocar_sensors::image_circle(c).is_some());
    let camera = named.or_else(scope).or_else(|| scene.cameras.first());
    camera.map_or(DQuat::IDENTITY, |c| c.view.pose(&scene.placement).rotation)
}
