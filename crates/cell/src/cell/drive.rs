//! The drive of an instrument: the dynamics of an arm, or an ideal drive.

use super::setpoint::Setpoint;
use super::workspace::Workspace;
use crate::{Error, Result};
use trocar_core::Pose;
use trocar_core::Wrench;
use trocar_robot::manipulator::{JointReadings, Manipulator, ManipulatorState, Obstacle};

/// The drive of an instrument.
#[derive(Clone, Debug)]
pub(super) enum Drive {
    /// A controlled arm: joint torques, through a port.
    Dynamic(Box<Manipulator>),
    /// The tip goes where it is commanded. No load moves it.
    Ideal(Box<IdealDrive>),
}

/// An ideal arm: it is where it is commanded.
#[derive(Clone, Debug)]
pub(super) struct IdealDrive {
    workspace: Workspace,
    state: IdealState,
    /// Physics steps of a control period.
    steps: u32,
}

/// The state of an [`IdealDrive`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct IdealState {
    at: Setpoint,
    to: Setpoint,
    /// Physics steps until the target is reached.
    left: u32,
    /// Rates of the first four numbers (1/s).
    rates: [f64; 4],
}

/// The state of a [`Drive`]: plain data.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum DriveState {
    Dynamic(Box<ManipulatorState>),
    Ideal(IdealState),
}

/// The result of a command.
pub(super) struct Sent {
    pub setpoint: Setpoint,
    /// Whether the whole way was commanded.
    pub whole: bool,
}

/// The result of a physics step.
pub(super) struct Moved {
    /// RCM deviation at its end (m).
    pub rcm_deviation: f64,
    /// Whether the reference kept up.
    pub on_time: bool,
}

impl Drive {
    /// An ideal drive at `start`, with `steps` physics steps in a control period.
    pub fn ideal(workspace: Workspace, start: Setpoint, steps: u32) -> Self {
        Self::Ideal(Box::new(IdealDrive { workspace, state: IdealState::at_rest(start), steps }))
    }

    /// Commands absolute targets.
    pub fn command(&mut self, to: &Setpoint) -> Result<Sent> {
        match self {
            Self::Dynamic(arm) => {
                let commanded = arm.servo_cp(&to.in_port())?;
                Ok(Sent { setpoint: commanded.coordinates.into(), whole: commanded.reach >= 1.0 })
            }
            Self::Ideal(drive) => {
                let setpoint = drive.workspace.clamp(to);
                (drive.state.to, drive.state.left) = (setpoint, drive.steps);
                Ok(Sent { setpoint, whole: true })
            }
        }
    }

    /// The place to which the drive moves next: its filtered command. For an ideal arm it is the
    /// present place.
    pub fn reference(&self) -> Setpoint {
        match self {
            Self::Dynamic(arm) => arm.setpoint_coordinates().into(),
            Self::Ideal(drive) => drive.state.at,
        }
    }

    /// Stops the reference at its present place.
    pub fn halt(&mut self) {
        match self {
            Self::Dynamic(arm) => arm.halt(),
            Self::Ideal(drive) => (drive.state.to, drive.state.left) = (drive.state.at, 0),
        }
    }

    /// Advances by a physics step of `dt` (s) under `load` at the tip, among `obstacles` that an
    /// arm with dynamics presses on. An ideal arm has no load and no obstacles.
    pub fn step(&mut self, load: impl Fn(&Pose) -> Wrench, obstacles: &mut [Obstacle], dt: f64) -> Result<Moved> {
        match self {
            Self::Dynamic(arm) => {
                let load = load(&arm.measured_cp());
                let report = arm.step_among(load, obstacles, dt)?;
                Ok(Moved { rcm_deviation: report.rcm_deviation, on_time: report.pace >= 1.0 })
            }
            Self::Ideal(drive) => {
                drive.state.step(1.0, dt);
                Ok(Moved { rcm_deviation: 0.0, on_time: true })
            }
        }
    }

    /// Moves an ideal arm by a `share` (below 1) of its motion in a physics step of `dt` (s).
    pub fn step_part(&mut self, share: f64, dt: f64) {
        if let Self::Ideal(drive) = self {
            drive.state.step(share, dt);
        }
    }

    /// The tip frame in the cell.
    pub fn tip(&self) -> Pose {
        match self {
            Self::Dynamic(arm) => arm.measured_cp(),
            Self::Ideal(drive) => drive.workspace.tip(&drive.state.at),
        }
    }

    /// Measured numbers, and the rates of the first four; the jaw has its own drive.
    pub fn measured(&self) -> (Setpoint, [f64; 4]) {
        match self {
            Self::Dynamic(arm) => {
                let (coordinates, rates) = arm.coordinates();
                (coordinates.into(), [rates[0], rates[1], rates[2], rates[3]])
            }
            Self::Ideal(drive) => (drive.state.at, drive.state.rates),
        }
    }

    /// RCM deviation (m); 0 for an ideal arm.
    pub fn rcm_deviation(&self) -> f64 {
        match self {
            Self::Dynamic(arm) => arm.rcm_deviation(),
            Self::Ideal(_) => 0.0,
        }
    }

    /// Angle between shaft and port normal (rad); 0 without a port.
    pub fn tilt(&self) -> f64 {
        match self {
            Self::Dynamic(arm) => arm.tilt(),
            Self::Ideal(drive) => drive.workspace.as_port().map_or(0.0, |_| drive.state.at.in_port().tilt()),
        }
    }

    /// The manipulator, where an arm is simulated.
    pub fn manipulator(&self) -> Option<&Manipulator> {
        match self {
            Self::Dynamic(arm) => Some(arm),
            Self::Ideal(_) => None,
        }
    }

    /// Measured joints; `None` for an ideal arm.
    pub fn joints(&self) -> Option<JointReadings> {
        self.manipulator().map(Manipulator::measured_js)
    }

    /// Commands the joints. Returns false for an ideal arm.
    pub fn command_joints(&mut self, joints: &[f64]) -> Result<bool> {
        match self {
            Self::Dynamic(arm) => {
                arm.servo_jp(joints)?;
                Ok(true)
            }
            Self::Ideal(_) => Ok(false),
        }
    }

    /// Restarts at rest at `start`.
    pub fn restart(&mut self, start: &Setpoint) -> Result<()> {
        match self {
            Self::Dynamic(arm) => Ok(arm.restart(&start.in_port())?),
            Self::Ideal(drive) => {
                drive.state = IdealState::at_rest(*start);
                Ok(())
            }
        }
    }

    pub fn state(&self) -> DriveState {
        match self {
            Self::Dynamic(arm) => DriveState::Dynamic(Box::new(arm.state())),
            Self::Ideal(drive) => DriveState::Ideal(drive.state),
        }
    }

    pub fn restore(&mut self, state: &DriveState) -> Result<()> {
        match (self, state) {
            (Self::Dynamic(arm), DriveState::Dynamic(state)) => Ok(arm.restore(state)?),
            (Self::Ideal(drive), DriveState::Ideal(state)) => {
                drive.state = *state;
                Ok(())
            }
            _ => Err(Error::Option("the state is of an arm with another drive".to_owned())),
        }
    }
}

impl IdealState {
    fn at_rest(at: Setpoint) -> Self {
        Self { at, to: at, left: 0, rates: [0.0; 4] }
    }

    /// Moves by `share` of an equal part of the remaining way. A part of a step does not count as a
    /// step: the rest of the way takes as many steps as before.
    fn step(&mut self, share: f64, dt: f64) {
        let before = self.at;
        if self.left > 0 {
            let whole = if self.left == 1 { self.to } else { before.towards(&self.to, 1.0 / f64::from(self.left)) };
            if share < 1.0 {
                self.at = before.towards(&whole, share);
            } else {
                self.at = whole;
                self.left -= 1;
            }
        }
        self.rates = std::array::from_fn(|k| (self.at.0[k] - before.0[k]) / dt);
    }

    fn numbers(&self) -> Vec<f64> {
        let Self { at, to, left, rates } = self;
        at.0.iter().chain(&to.0).chain(rates).copied().chain([f64::from(*left)]).collect()
    }
}

impl DriveState {
    /// Every number of the state.
    pub fn numbers(&self) -> Vec<f64> {
        match self {
            Self::Dynamic(state) => state.numbers().collect(),
            Self::Ideal(state) => state.numbers(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cell::workspace::FreeSpace;
    use glam::DVec3;

    #[test]
    fn an_ideal_arm_is_where_it_was_sent_at_the_periods_end() {
        let start = Setpoint([0.0, 0.0, 0.1, 0.0, 1.0]);
        let space = Workspace::Free(FreeSpace::around(DVec3::new(0.0, 0.0, 0.1), -DVec3::Z));
        let mut drive = Drive::ideal(space, start, 16);
        let to = Setpoint([0.003, -0.002, 0.101, 0.05, 0.0]);
        drive.command(&to).unwrap();
        let mut places = vec![drive.tip().translation];
        for _ in 0..16 {
            drive.step(|_| Wrench::default(), &mut [], 1.0 / 480.0).unwrap();
            places.push(drive.tip().translation);
        }
        assert_eq!(drive.measured().0.0[..4], to.0[..4]);
        let ways: Vec<f64> = places.windows(2).map(|p| p[0].distance(p[1])).collect();
        assert!(ways.iter().all(|w| (w - ways[0]).abs() < 1e-12), "evenly: {ways:?}");
        assert!((drive.measured().1[0] - 0.003 * 30.0).abs() < 1e-9);
        let saved = drive.state();
        drive.step(|_| Wrench::default(), &mut [], 1.0 / 480.0).unwrap();
        assert_eq!(drive.measured().1, [0.0; 4], "at rest again");
        drive.restore(&saved).unwrap();
        assert_eq!(drive.state(), saved);
    }
}
