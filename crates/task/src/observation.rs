//! What a policy sees: named fields, and the same as a flat vector.

use crate::Progress;
use crate::measure::upright;
use serde::Serialize;
use trocar_cell::ArmObservation;
use trocar_robot::wrench::ForceKind;
use trocar_scene::Side;

/// The observation of one arm; all zero where the scene has no such arm.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct ArmState {
    /// Two pivots (rad), insertion (m), roll (rad), jaw opening 0 to 1, as in an action. Of an arm
    /// without a port the first three are the place of the jaw's pivot in the cell (m).
    pub coordinates: [f64; 5],
    /// Their rates a second.
    pub rates: [f64; 5],
    /// Tip frame (at the jaw's pivot) in the cell (m).
    pub tip_m: [f64; 3],
    /// Its rotation, a unit quaternion, scalar first and not negative.
    pub tip_wxyz: [f64; 4],
    /// RCM deviation (m).
    pub rcm_m: f64,
    /// Force of the tissue on the instrument along the cell's axes (N).
    pub force_n: [f64; 3],
    /// Kind of that force: 0 contact, 1 the constraint of a latched grasp.
    pub force_kind: f64,
    /// The jaws hold tissue: 0 or 1.
    pub attached: f64,
}

/// The observation of a policy at the end of a period. No tissue value is in it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Observation {
    /// Time since the episode's start (s).
    pub time_s: f64,
    /// The left arm.
    pub left: ArmState,
    /// The right arm.
    pub right: ArmState,
    /// Stages passed.
    pub stage: f64,
}

/// Numbers of [`Observation::to_vec`].
pub const STATE_SIZE: usize = 47;

/// Names of the numbers of [`Observation::to_vec`], in order. The time is not among them: a policy
/// that counts seconds learns the script, not the task.
pub const STATE_NAMES: [&str; STATE_SIZE] = [
    "left_pivot_1_rad",
    "left_pivot_2_rad",
    "left_insertion_m",
    "left_roll_rad",
    "left_jaw",
    "left_pivot_1_rad_s",
    "left_pivot_2_rad_s",
    "left_insertion_m_s",
    "left_roll_rad_s",
    "left_jaw_1_s",
    "left_tip_x_m",
    "left_tip_y_m",
    "left_tip_z_m",
    "left_tip_qw",
    "left_tip_qx",
    "left_tip_qy",
    "left_tip_qz",
    "left_rcm_m",
    "left_force_x_n",
    "left_force_y_n",
    "left_force_z_n",
    "left_force_kind",
    "left_attached",
    "right_pivot_1_rad",
    "right_pivot_2_rad",
    "right_insertion_m",
    "right_roll_rad",
    "right_jaw",
    "right_pivot_1_rad_s",
    "right_pivot_2_rad_s",
    "right_insertion_m_s",
    "right_roll_rad_s",
    "right_jaw_1_s",
    "right_tip_x_m",
    "right_tip_y_m",
    "right_tip_z_m",
    "right_tip_qw",
    "right_tip_qx",
    "right_tip_qy",
    "right_tip_qz",
    "right_rcm_m",
    "right_force_x_n",
    "right_force_y_n",
    "right_force_z_n",
    "right_force_kind",
    "right_attached",
    "stage",
];

impl ArmState {
    fn of(arm: &ArmObservation) -> Self {
        let q = upright(arm.tip.rotation);
        Self {
            coordinates: arm.measured.0,
            rates: arm.rates,
            tip_m: arm.tip.translation.to_array(),
            tip_wxyz: [q.w, q.x, q.y, q.z],
            rcm_m: arm.rcm_deviation,
            force_n: arm.force.wrench.force.to_array(),
            force_kind: if arm.force.kind == ForceKind::Constraint { 1.0 } else { 0.0 },
            attached: f64::from(u8::from(arm.attached)),
        }
    }

    fn push(&self, all: &mut Vec<f64>) {
        all.extend(self.coordinates.iter().chain(&self.rates).chain(&self.tip_m).chain(&self.tip_wxyz));
        all.push(self.rcm_m);
        all.extend(self.force_n);
        all.extend([self.force_kind, self.attached]);
    }
}

impl Observation {
    /// Of arms as they are observed, at `time_s`, with the task as far as `progress` says.
    pub(crate) fn of(arms: &[ArmObservation], time_s: f64, progress: &Progress) -> Self {
        let mut seen = Self { time_s, stage: progress.stage as f64, ..Self::default() };
        for arm in arms {
            match arm.side {
                Side::Left => seen.left = ArmState::of(arm),
                Side::Right => seen.right = ArmState::of(arm),
            }
        }
        seen
    }

    /// The numbers that [`STATE_NAMES`] names.
    pub fn to_vec(&self) -> Vec<f64> {
        let mut all = Vec::with_capacity(STATE_SIZE);
        self.left.push(&mut all);
        self.right.push(&mut all);
        all.push(self.stage);
        all
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_guide_names_every_number() {
        let page = include_str!("../../../docs/guides/observations.md");
        for name in STATE_NAMES {
            let bare = name.trim_start_matches("left_").trim_start_matches("right_");
            assert!(page.contains(&format!("`{bare}`")), "docs/guides/observations.md lacks `{bare}`");
        }
    }

    #[test]
    fn there_are_as_many_numbers_as_names() {
        let seen = Observation { stage: 3.0, ..Observation::default() };
        let all = seen.to_vec();
        assert_eq!(all.len(), STATE_SIZE);
        assert_eq!(all[STATE_SIZE - 1], 3.0);
        let right = ArmState { attached: 1.0, ..ArmState::default() };
        let place = STATE_NAMES.iter().position(|n| *n == "right_attached").unwrap();
        assert_eq!(Observation { right, ..seen }.to_vec()[place], 1.0);
    }
}
