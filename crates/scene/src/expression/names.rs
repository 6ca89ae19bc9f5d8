//! The channels that expressions may name, with their units and what of a scene they need.

use super::Unit;
use crate::Side;

/// The kind of a channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    /// 0 or 1.
    Flag,
    In(Unit),
}

use Kind::{Flag, In};

/// The parts of a scene that a task needs, by the channels that it names.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Needs {
    pub organ: bool,
    pub grasper: bool,
    pub cutter: bool,
    pub targets: bool,
}

impl Needs {
    const NOTHING: Self = Self { organ: false, grasper: false, cutter: false, targets: false };
    const ORGAN: Self = Self { organ: true, ..Self::NOTHING };
    const GRASPER: Self = Self { grasper: true, ..Self::ORGAN };
    const CUTTER: Self = Self { cutter: true, ..Self::ORGAN };
    const TARGETS: Self = Self { targets: true, ..Self::NOTHING };

    pub fn and(self, other: Self) -> Self {
        Self {
            organ: self.organ || other.organ,
            grasper: self.grasper || other.grasper,
            cutter: self.cutter || other.cutter,
            targets: self.targets || other.targets,
        }
    }
}

const ARM: [(&str, Kind); 40] = [
    ("pivot_1_rad", In(Unit::Radian)),
    ("pivot_2_rad", In(Unit::Radian)),
    ("insertion_m", In(Unit::Metre)),
    ("roll_rad", In(Unit::Radian)),
    ("jaw", In(Unit::None)),
    ("pivot_1_rad_s", In(Unit::RadianPerSecond)),
    ("pivot_2_rad_s", In(Unit::RadianPerSecond)),
    ("insertion_m_s", In(Unit::MetrePerSecond)),
    ("roll_rad_s", In(Unit::RadianPerSecond)),
    ("jaw_1_s", In(Unit::PerSecond)),
    ("tip_x_m", In(Unit::Metre)),
    ("tip_y_m", In(Unit::Metre)),
    ("tip_z_m", In(Unit::Metre)),
    ("tip_qw", In(Unit::None)),
    ("tip_qx", In(Unit::None)),
    ("tip_qy", In(Unit::None)),
    ("tip_qz", In(Unit::None)),
    ("commanded_x_m", In(Unit::Metre)),
    ("commanded_y_m", In(Unit::Metre)),
    ("commanded_z_m", In(Unit::Metre)),
    ("tracking_mm", In(Unit::Millimetre)),
    ("rcm_mm", In(Unit::Millimetre)),
    ("rcm_peak_mm", In(Unit::Millimetre)),
    ("tilt_deg", In(Unit::Degree)),
    ("contact_x_n", In(Unit::Newton)),
    ("contact_y_n", In(Unit::Newton)),
    ("contact_z_n", In(Unit::Newton)),
    ("constraint_x_n", In(Unit::Newton)),
    ("constraint_y_n", In(Unit::Newton)),
    ("constraint_z_n", In(Unit::Newton)),
    ("jaw_force_n", In(Unit::Newton)),
    ("attached", Flag),
    ("in_mouth", Flag),
    ("mouth_share", In(Unit::None)),
    ("rejected_deg", In(Unit::Degree)),
    ("held_back", Flag),
    ("load_limited", Flag),
    ("pierces", Flag),
    ("guarded", Flag),
    ("solid_n", In(Unit::Newton)),
];

const TASK: [(&str, Kind, Needs); 28] = [
    ("grasp_distance_mm", In(Unit::Millimetre), Needs::GRASPER),
    ("grasped", Flag, Needs::GRASPER),
    ("grasp_s", In(Unit::None), Needs::GRASPER),
    ("lift_mm", In(Unit::Millimetre), Needs::GRASPER),
    ("jaw_lift_mm", In(Unit::Millimetre), Needs::GRASPER),
    ("follow", In(Unit::None), Needs::GRASPER),
    ("slip_mm", In(Unit::Millimetre), Needs::GRASPER),
    ("position_mm", In(Unit::Millimetre), Needs::CUTTER),
    ("cut_jaw", In(Unit::None), Needs::CUTTER),
    ("cut_mouth", Flag, Needs::CUTTER),
    ("cut_share", In(Unit::None), Needs::CUTTER),
    ("cuts", In(Unit::None), Needs::CUTTER),
    ("reach_1_mm", In(Unit::Millimetre), Needs::TARGETS),
    ("reach_2_mm", In(Unit::Millimetre), Needs::TARGETS),
    ("reach_3_mm", In(Unit::Millimetre), Needs::TARGETS),
    ("torn", In(Unit::None), Needs::NOTHING),
    ("slipped", In(Unit::None), Needs::NOTHING),
    ("max_speed_m_s", In(Unit::MetrePerSecond), Needs::NOTHING),
    ("inverted", In(Unit::None), Needs::NOTHING),
    ("min_volume", In(Unit::None), Needs::NOTHING),
    ("yielded", In(Unit::None), Needs::NOTHING),
    ("fallbacks", In(Unit::None), Needs::NOTHING),
    ("diverged", Flag, Needs::NOTHING),
    ("punctures", In(Unit::None), Needs::NOTHING),
    ("pierced", In(Unit::None), Needs::NOTHING),
    ("overstretched", In(Unit::None), Needs::NOTHING),
    ("folded", In(Unit::None), Needs::NOTHING),
    ("activation_step_mm", In(Unit::Millimetre), Needs::NOTHING),
];

/// A channel as expressions see it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Channel {
    /// Its place in [`channel_names`].
    pub place: usize,
    pub unit: Unit,
    pub flag: bool,
    pub needs: Needs,
    /// The arm that it is of.
    pub side: Option<Side>,
}

/// Names of the channels, in their order: the time, the left arm's, the right arm's, the task's.
pub fn channel_names() -> Vec<String> {
    let arm = |side: Side| ARM.iter().map(move |(name, _)| format!("{}_{name}", side.name()));
    let task = TASK.iter().map(|(name, ..)| (*name).to_owned());
    std::iter::once("time_s".to_owned()).chain(arm(Side::Left)).chain(arm(Side::Right)).chain(task).collect()
}

/// The channel of that name.
pub(crate) fn channel(name: &str) -> Option<Channel> {
    let made = |place, kind, needs, side| Channel {
        place,
        unit: if let In(unit) = kind { unit } else { Unit::None },
        flag: kind == Flag,
        needs,
        side,
    };
    if name == "time_s" {
        return Some(made(0, In(Unit::Second), Needs::default(), None));
    }
    for side in [Side::Left, Side::Right] {
        let own = name.strip_prefix(side.name()).and_then(|rest| rest.strip_prefix('_'));
        if let Some(k) = own.and_then(|own| ARM.iter().position(|(n, _)| *n == own)) {
            let needs = if ARM[k].0.contains("mouth") { Needs::ORGAN } else { Needs::default() };
            return Some(made(1 + side as usize * ARM.len() + k, ARM[k].1, needs, Some(side)));
        }
    }
    let k = TASK.iter().position(|(n, ..)| *n == name)?;
    Some(made(1 + 2 * ARM.len() + k, TASK[k].1, TASK[k].2, None))
}

/// The unit at the end of a gate's or constant's name.
pub(crate) fn unit_at_end(name: &str) -> Unit {
    const ENDS: [(&str, Unit); 9] = [
        ("_mm_s", Unit::MillimetrePerSecond),
        ("_m_s", Unit::MetrePerSecond),
        ("_deg_s", Unit::DegreePerSecond),
        ("_mm", Unit::Millimetre),
        ("_m", Unit::Metre),
        ("_s", Unit::Second),
        ("_n", Unit::Newton),
        ("_deg", Unit::Degree),
        ("_rad", Unit::Radian),
    ];
    ENDS.iter().find(|(end, _)| name.ends_with(end)).map_or(Unit::None, |(_, unit)| *unit)
}
