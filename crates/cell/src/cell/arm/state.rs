//! The state of an arm without its drive's, at the start and as numbers.

use super::ArmModel;
use crate::bite::Bite;
use crate::cell::exchange::Exchange;
use crate::cell::pressed::Pressed;
use crate::cell::rules::{ForceGuard, place};
use crate::cell::setpoint::Setpoint;
use crate::cell::solid::SolidLoad;
use crate::hold::Hold;
use crate::severance::Parting;
use crate::{GraspDesign, Gripper, Jaw, Scissors};
use glam::DVec3;
use trocar_core::Pose;
use trocar_core::Wrench;
use trocar_tissue::ToolForce;

/// The request to an arm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Wanted {
    /// Absolute targets, and the rejected part of the requested orientation.
    Setpoint(Setpoint, DVec3),
    /// Joints, which the drive knows, and the jaw's opening.
    Joints(f64),
}

/// Tissue that the jaws hold.
#[derive(Clone, Debug)]
pub(crate) struct Held {
    pub organ: usize,
    /// Organ coordinate of the held tissue.
    pub s: f64,
    pub hold: Hold,
    /// The opening at which the jaws closed on it.
    pub opening: f64,
}

/// The state of an arm without its drive's: plain data.
#[derive(Clone, Debug)]
pub(crate) struct ArmState {
    pub wanted: Wanted,
    /// The last command.
    pub commanded: Setpoint,
    /// Whether the last command stops short of the request.
    pub held_back: bool,
    pub guard: ForceGuard,
    /// Whether the guard shortened the last command.
    pub guarded: bool,
    /// The gripper at the end of the last tissue frame.
    pub gripper: Gripper,
    pub design: GraspDesign,
    pub jaw: Jaw,
    /// Change of the jaw's opening (1/s).
    pub jaw_rate: f64,
    pub exchange: Exchange,
    /// The force of solids.
    pub solid: SolidLoad,
    pub pressed: Pressed,
    pub forces: [ToolForce; 3],
    pub scissors: Scissors,
    /// Angle of a cutter's blades (rad) before they began to close through tissue. Such blades
    /// shear tissue and do not press it.
    pub shears: Option<f64>,
    /// A cutter's blades on their way through tissue, and the tissue that they have parted.
    pub bite: Option<Bite>,
    pub parting: Option<Parting>,
    pub held: Option<Held>,
    /// Tissue frames for which jaws that closed on tissue have stood where they are commanded.
    pub standing: u32,
    /// Whether the instrument's axis is inside an organ.
    pub pierces: bool,
    /// Largest RCM deviation of the period so far (m).
    pub rcm_peak: f64,
    /// Which of the RCM limits are exceeded, and that was reported.
    pub rcm_reported: [bool; 2],
}

impl Wanted {
    /// The requested opening.
    pub fn jaw(&self) -> f64 {
        match self {
            Self::Setpoint(to, _) => to.jaw(),
            Self::Joints(jaw) => *jaw,
        }
    }

    /// Requests another opening.
    pub fn set_jaw(&mut self, opening: f64) {
        match self {
            Self::Setpoint(to, _) => *to = to.with_jaw(opening),
            Self::Joints(jaw) => *jaw = opening,
        }
    }

    /// The rejected part of the requested orientation.
    pub fn rejected_rotation(&self) -> DVec3 {
        match self {
            Self::Setpoint(_, rejected) => *rejected,
            Self::Joints(_) => DVec3::ZERO,
        }
    }
}

impl ArmState {
    /// At rest at `start` with the tip frame at `pose`, without a grasp.
    pub fn new(
        pose: Pose,
        model: &ArmModel,
        start: Setpoint,
        design: GraspDesign,
        jaw: Jaw,
        scissors: Scissors,
    ) -> Self {
        Self {
            wanted: Wanted::Setpoint(start, DVec3::ZERO),
            commanded: start,
            held_back: false,
            guard: ForceGuard::new(place(pose.translation, start.roll())),
            guarded: false,
            gripper: Gripper { pose, jaw_angle: start.jaw() * model.blades.max_angle },
            design,
            jaw,
            jaw_rate: 0.0,
            exchange: Exchange::new(pose.translation),
            solid: SolidLoad::default(),
            pressed: Pressed::default(),
            forces: [ToolForce::default(); 3],
            scissors,
            shears: None,
            bite: None,
            parting: None,
            held: None,
            standing: 0,
            pierces: false,
            rcm_peak: 0.0,
            rcm_reported: [false; 2],
        }
    }

    /// Every number of the state, for its hash. It destructures every field: a forgotten field does
    /// not compile.
    pub fn numbers(&self) -> Vec<f64> {
        let Self {
            wanted,
            commanded,
            held_back,
            guard,
            guarded,
            gripper: Gripper { pose: Pose { rotation, translation }, jaw_angle },
            design,
            jaw,
            jaw_rate,
            exchange,
            solid,
            pressed,
            forces,
            scissors,
            shears,
            bite,
            parting,
            held,
            standing,
            pierces,
            rcm_peak,
            rcm_reported,
        } = self;
        let mut all = match wanted {
            Wanted::Setpoint(to, _) => to.0.to_vec(),
            Wanted::Joints(jaw) => vec![*jaw],
        };
        all.extend(wanted.rejected_rotation().to_array());
        all.extend(commanded.0);
        all.extend(translation.to_array());
        all.extend(rotation.to_array());
        all.extend([*jaw_angle, *jaw_rate, *rcm_peak, shears.unwrap_or(-1.0)]);
        all.extend(exchange.numbers());
        all.extend(guard.numbers());
        all.extend(jaw.numbers());
        all.extend(scissors.numbers());
        for ToolForce { contact, constraint, pressing, touching } in forces {
            for Wrench { force, torque } in [contact, constraint] {
                all.extend(force.to_array());
                all.extend(torque.to_array());
            }
            all.extend([*pressing, *touching as f64]);
        }
        let flags = [*pierces, *held_back, *guarded, rcm_reported[0], rcm_reported[1], held.is_some()];
        all.extend(flags.map(|b| f64::from(u8::from(b))));
        all.push(GraspDesign::ALL.iter().position(|d| d == design).unwrap_or(0) as f64);
        if let Some(Held { organ, s, hold, opening }) = held {
            all.extend([*organ as f64, *s, *opening]);
            all.extend(hold.numbers());
        }
        // Added only if it is not empty: hashes of episodes that were recorded before this field
        // existed stay valid.
        if *standing > 0 {
            all.push(f64::from(*standing));
        }
        all.extend(solid.numbers());
        all.extend(pressed.numbers());
        all.extend(bite.iter().flat_map(Bite::numbers));
        all.extend(parting.iter().flat_map(Parting::numbers));
        all
    }
}
