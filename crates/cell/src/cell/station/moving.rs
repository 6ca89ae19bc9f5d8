//! What changes of an arm, as it begins and as numbers.

use super::{Fixed, Moving, Wanted};
use crate::cell::exchange::Exchange;
use crate::cell::guard::Guard;
use crate::{GraspDesign, Gripper, Jaw, Scissors};
use glam::DVec3;
use trocar_core::Pose;
use trocar_robot::instrument::Coordinates;
use trocar_tissue::ToolForce;

impl Moving {
    pub fn new(
        pose: Pose,
        fixed: &Fixed,
        start: Coordinates,
        design: GraspDesign,
        jaw: Jaw,
        scissors: Scissors,
    ) -> Self {
        Self {
            wanted: Wanted::Coordinates(start, DVec3::ZERO),
            commanded: start,
            held_back: false,
            guard: Guard::default(),
            guarded: false,
            gripper: Gripper { pose, jaw_angle: start.jaw * fixed.blades.max_angle },
            design,
            jaw,
            jaw_rate: 0.0,
            exchange: Exchange::new(pose.translation),
            forces: [ToolForce::default(); 3],
            scissors,
            shears: None,
            held: None,
            unhooked: false,
            bare: false,
            rcm_peak: 0.0,
            rcm_told: [false; 2],
        }
    }
}

impl Moving {
    /// What watches its blades.
    pub fn scissors(&self) -> Scissors {
        self.scissors
    }

    /// The opening that is asked for.
    pub fn wanted_jaw(&self) -> f64 {
        self.wanted.jaw()
    }

    /// Asks for an opening.
    pub fn set_wanted_jaw(&mut self, opening: f64) {
        match &mut self.wanted {
            Wanted::Coordinates(c, _) => c.jaw = opening,
            Wanted::Joints(jaw) => *jaw = opening,
        }
    }

    /// Every number of the state, for its hash; the manipulator's and the tissue's are not among them.
    pub fn numbers(&self) -> Vec<f64> {
        let (wanted, rejected) = match self.wanted {
            Wanted::Coordinates(c, rejected) => (c.to_action().to_vec(), rejected),
            Wanted::Joints(jaw) => (vec![jaw], DVec3::ZERO),
        };
        let pose = &self.gripper.pose;
        let mut all = wanted;
        all.extend(rejected.to_array());
        all.extend(self.commanded.to_action());
        all.extend(pose.translation.to_array());
        all.extend(pose.rotation.to_array());
        all.extend([self.gripper.jaw_angle, self.jaw_rate, self.rcm_peak, self.shears.unwrap_or(-1.0)]);
        all.extend(self.exchange.numbers());
        all.extend(self.guard.numbers());
        all.extend(self.jaw.numbers());
        all.extend(self.scissors.numbers());
        for f in &self.forces {
            for w in [f.contact, f.constraint] {
                all.extend(w.force.to_array());
                all.extend(w.torque.to_array());
            }
            all.extend([f.pressing, f.touching as f64]);
        }
        all.extend(
            [
                self.unhooked,
                self.bare,
                self.held_back,
                self.guarded,
                self.rcm_told[0],
                self.rcm_told[1],
                self.held.is_some(),
            ]
            .map(|b| f64::from(u8::from(b))),
        );
        all.push(GraspDesign::ALL.iter().position(|d| *d == self.design).unwrap_or(0) as f64);
        if let Some(held) = &self.held {
            all.extend([held.organ as f64, held.s, held.opening]);
            all.extend(held.hold.numbers());
        }
        all
    }
}
