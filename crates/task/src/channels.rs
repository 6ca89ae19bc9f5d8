//! Channels: one flat row of figures a control period. All gates, sweeps and summaries are
//! functions of these rows alone.

use serde::Serialize;
use trocar_scene::MAX_MEASURES;

/// Declares a struct of numbers with their names in order.
macro_rules! row {
    ($(#[$meta:meta])* $name:ident { $($(#[$doc:meta])* $field:ident,)* }) => {
        $(#[$meta])*
        #[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
        pub struct $name { $($(#[$doc])* pub $field: f64,)* }

        impl $name {
            /// Names of the numbers, in order.
            pub const NAMES: [&'static str; [$(stringify!($field)),*].len()] = [$(stringify!($field)),*];

            /// The number at `place` of [`NAMES`](Self::NAMES); 0 beyond.
            fn at(&self, place: usize) -> f64 {
                [$(self.$field),*].get(place).copied().unwrap_or(0.0)
            }

            fn push(&self, all: &mut Vec<f64>) {
                all.extend([$(self.$field),*]);
            }

            fn take(from: &mut impl Iterator<Item = f64>) -> Option<Self> {
                Some(Self { $($field: from.next()?,)* })
            }
        }
    };
}

/// A flag as a row holds it.
pub(crate) fn flag(is: bool) -> f64 {
    f64::from(u8::from(is))
}

row! {
    /// One arm in a period; all zero where the scene has no such arm. Flags are 0 or 1.
    ArmChannels {
        /// First pivot, measured (rad); 0 without a port, as the next two.
        pivot_1_rad,
        /// Second pivot (rad).
        pivot_2_rad,
        /// Port's centre to the jaw's pivot (m).
        insertion_m,
        /// Turn about the shaft (rad).
        roll_rad,
        /// Jaw opening, 0 closed to 1.
        jaw,
        /// Rate of the first pivot (rad/s).
        pivot_1_rad_s,
        /// Rate of the second pivot (rad/s).
        pivot_2_rad_s,
        /// Rate of the insertion (m/s).
        insertion_m_s,
        /// Rate of the roll (rad/s).
        roll_rad_s,
        /// Rate of the jaw's opening (1/s).
        jaw_1_s,
        /// Measured tip frame (at the jaw's pivot) in the cell (m).
        tip_x_m,
        /// See [`tip_x_m`](Self::tip_x_m).
        tip_y_m,
        /// See [`tip_x_m`](Self::tip_x_m).
        tip_z_m,
        /// Its rotation, a unit quaternion, scalar first.
        tip_qw,
        /// See [`tip_qw`](Self::tip_qw).
        tip_qx,
        /// See [`tip_qw`](Self::tip_qw).
        tip_qy,
        /// See [`tip_qw`](Self::tip_qw).
        tip_qz,
        /// Commanded place of the tip frame (m).
        commanded_x_m,
        /// See [`commanded_x_m`](Self::commanded_x_m).
        commanded_y_m,
        /// See [`commanded_x_m`](Self::commanded_x_m).
        commanded_z_m,
        /// Distance between the two at the same time: error and lag together (mm).
        tracking_mm,
        /// RCM deviation at the period's end (mm).
        rcm_mm,
        /// The largest in the period (mm).
        rcm_peak_mm,
        /// Angle between shaft and port normal (degrees).
        tilt_deg,
        /// Contact force on the instrument along the cell's axes (N).
        contact_x_n,
        /// See [`contact_x_n`](Self::contact_x_n).
        contact_y_n,
        /// See [`contact_x_n`](Self::contact_x_n).
        contact_z_n,
        /// Constraint force of a latched grasp (N).
        constraint_x_n,
        /// See [`constraint_x_n`](Self::constraint_x_n).
        constraint_y_n,
        /// See [`constraint_x_n`](Self::constraint_x_n).
        constraint_z_n,
        /// Force with which tissue pushes the blades apart (N).
        jaw_force_n,
        /// The jaws hold tissue of any organ.
        attached,
        /// The task's organ is in the mouth.
        in_mouth,
        /// Share of the wedge between the blades that it fills.
        mouth_share,
        /// Rotation that was asked for and that four degrees of freedom cannot do (degrees).
        rejected_deg,
        /// The command stops short of the requested one.
        held_back,
        /// Tissue pushed with more than an arm withstands.
        load_limited,
        /// The axis of the instrument is inside an organ that its jaws do not hold.
        pierces,
        /// The force guard shortened the command.
        guarded,
        /// Largest force of solids on the instrument in a physics step of the period (N): the other
        /// instrument, the bed, tissue that cannot move.
        solid_n,
    }
}

row! {
    /// The task in a period. Values about tissue in jaws are zero while the grasper holds none of
    /// the task's organ. Flags are 0 or 1.
    TaskChannels {
        /// Distance from the middle of the grasper's mouth to the organ's axis where the grasp gate
        /// wants it (mm).
        grasp_distance_mm,
        /// The grasper holds the task's organ.
        grasped,
        /// Organ coordinate of the tissue that it holds.
        grasp_s,
        /// Rise of the held tissue's centroid since (mm).
        lift_mm,
        /// Rise of the jaws since (mm).
        jaw_lift_mm,
        /// Follow ratio: tissue lift over jaw lift; 0 below 0.1 mm of jaw lift.
        follow,
        /// Slip (mm).
        slip_mm,
        /// Distance from the cutter's tip to the nearest tissue between grasp (the gate's upper end
        /// while nothing is held) and base (mm).
        position_mm,
        /// Jaw opening of the cutter.
        cut_jaw,
        /// The cutter's mouth has tissue of the organ in it.
        cut_mouth,
        /// Share of the cutter's wedge that it fills.
        cut_share,
        /// Cuts in the period.
        cuts,
        /// Largest distance of any arm's blade tip from its first target (mm); port-reach only, as
        /// the next two.
        reach_1_mm,
        /// From its second.
        reach_2_mm,
        /// From its third.
        reach_3_mm,
        /// Times that tissue tore out of jaws in the period.
        torn,
        /// Times that it began to slide.
        slipped,
        /// Largest node speed (m/s).
        max_speed_m_s,
        /// Most inverted elements in any frame of the period.
        inverted,
        /// Smallest element volume over its rest volume.
        min_volume,
        /// Substeps in which held nodes could not follow the jaws.
        yielded,
        /// Substeps given up to sweeps.
        fallbacks,
        /// The tissue diverged.
        diverged,
        /// Times that an instrument punctured an organ in the period.
        punctures,
        /// Times that the axis of an instrument came into an organ with less force than a puncture
        /// needs.
        pierced,
        /// Times that an instrument began to strain tissue beyond its limits.
        overstretched,
        /// Times that an organ stayed strained with no instrument at it.
        folded,
        /// Largest motion of any node in the first frame after jaws took hold (mm); 0 where none
        /// did.
        activation_step_mm,
    }
}

/// A row.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Channels {
    /// Time at the period's end since the episode's start (s).
    pub time_s: f64,
    /// The left arm.
    pub left: ArmChannels,
    /// The right arm.
    pub right: ArmChannels,
    /// The task.
    pub task: TaskChannels,
    /// The task's own measures, in the order of its [`Program`](trocar_scene::Program); the rest is
    /// zero.
    pub measures: [f64; MAX_MEASURES],
}

impl Channels {
    /// Numbers a row.
    pub const COUNT: usize = 1 + 2 * ArmChannels::NAMES.len() + TaskChannels::NAMES.len();

    /// Whether the episode is lost here: tissue or an arm diverged, or an arm's RCM deviation went
    /// beyond `abort_mm`.
    pub fn is_lost(&self, abort_mm: Option<f64>) -> bool {
        let out = |mm: f64| abort_mm.is_some_and(|most| mm > most);
        self.task.diverged > 0.0 || out(self.left.rcm_peak_mm) || out(self.right.rcm_peak_mm)
    }

    /// The number at `place` of [`names`](Self::names).
    pub fn at(&self, place: usize) -> f64 {
        let arm = ArmChannels::NAMES.len();
        match place {
            0 => self.time_s,
            k if k <= arm => self.left.at(k - 1),
            k if k <= 2 * arm => self.right.at(k - 1 - arm),
            k => self.task.at(k - 1 - 2 * arm),
        }
    }

    /// Names of the numbers of a row, without the task's own measures, in order: `time_s`,
    /// `left_*`, `right_*`, then the task's.
    pub fn names() -> Vec<String> {
        let arm = |side: &'static str| ArmChannels::NAMES.into_iter().map(move |n| format!("{side}_{n}"));
        let task = TaskChannels::NAMES.into_iter().map(str::to_owned);
        ["time_s".to_owned()].into_iter().chain(arm("left")).chain(arm("right")).chain(task).collect()
    }

    /// The numbers, in the order of [`names`](Self::names).
    pub fn to_row(&self) -> Vec<f64> {
        let mut row = Vec::with_capacity(Self::COUNT);
        row.push(self.time_s);
        self.left.push(&mut row);
        self.right.push(&mut row);
        self.task.push(&mut row);
        row
    }

    /// From the numbers of a row; None of too few or too many.
    pub fn from_row(row: &[f64]) -> Option<Self> {
        let mut from = row.iter().copied();
        let time_s = from.next()?;
        let (left, right) = (ArmChannels::take(&mut from)?, ArmChannels::take(&mut from)?);
        let task = TaskChannels::take(&mut from)?;
        let made = Self { time_s, left, right, task, measures: [0.0; MAX_MEASURES] };
        from.next().is_none().then_some(made)
    }

    /// Both arms, the left one first.
    pub fn arms(&self) -> [&ArmChannels; 2] {
        [&self.left, &self.right]
    }
}

impl ArmChannels {
    /// Magnitude of the contact force (N).
    pub fn contact_n(&self) -> f64 {
        glam::DVec3::new(self.contact_x_n, self.contact_y_n, self.contact_z_n).length()
    }

    /// Magnitude of the constraint force (N).
    pub fn constraint_n(&self) -> f64 {
        glam::DVec3::new(self.constraint_x_n, self.constraint_y_n, self.constraint_z_n).length()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_and_names_go_together() {
        let names = Channels::names();
        assert_eq!(names.len(), Channels::COUNT);
        let row: Vec<f64> = (0..Channels::COUNT).map(|k| k as f64).collect();
        let made = Channels::from_row(&row).unwrap();
        assert_eq!(made.to_row(), row);
        let place = |name: &str| names.iter().position(|n| n == name).unwrap() as f64;
        assert_eq!(names, trocar_scene::channel_names(), "what expressions may name");
        assert!((0..Channels::COUNT).all(|k| made.at(k) == row[k]));
        assert_eq!(made.left.jaw, place("left_jaw"));
        assert_eq!(made.right.rcm_peak_mm, place("right_rcm_peak_mm"));
        assert_eq!(made.task.cut_jaw, place("cut_jaw"));
        let mut sorted = names.clone();
        sorted.sort();
        sorted.dedup();
        assert_eq!(sorted.len(), names.len(), "names are unique");
        assert!(Channels::from_row(&row[1..]).is_none());
    }
}
