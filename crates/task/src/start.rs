//! Where an episode begins, by its seed: the scene's starts and placement, varied as its task says.

use crate::Result;
use crate::random::Random;
use glam::{DQuat, DVec3};
use trocar_cell::{Cell, Setpoint, Workspace};
use trocar_core::Pose;
use trocar_robot::instrument::Coordinates;
use trocar_scene::{Frame, Scene, Start, Tool};
use trocar_specimen::Specimen;

/// How far a specimen lies from where the scene has it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Arrangement {
    /// Along the cell's x and y (m).
    shift: [f64; 2],
    /// About the vertical through the middle of the specimen (rad).
    turn: f64,
}

impl Arrangement {
    /// That of `seed`.
    pub fn of(scene: &Scene, seed: u64) -> Self {
        let (v, random) = (&scene.task.variation, Random::new(seed, "specimen"));
        let shift = [0, 1].map(|k| 1e-3 * random.aside(k, v.specimen_shift_mm));
        Self { shift, turn: random.aside(2, v.specimen_turn_deg).to_radians() }
    }

    /// The scene with the specimen so arranged.
    pub fn scene(&self, scene: &Scene, specimen: &Specimen) -> Scene {
        let mut moved = scene.clone();
        if *self == Self::default() {
            return moved;
        }
        let placement = scene.placement.pose();
        let points = || specimen.organs.iter().flat_map(|o| &o.body.vertices);
        let middle = placement.transform(points().sum::<DVec3>() / points().count().max(1) as f64);
        let rotation = DQuat::from_rotation_z(self.turn);
        let shift = DVec3::new(self.shift[0], self.shift[1], 0.0);
        let at = Pose {
            rotation: (rotation * placement.rotation).normalize(),
            translation: middle + rotation * (placement.translation - middle) + shift,
        };
        let q = at.rotation;
        moved.placement = Frame { position_m: at.translation.to_array(), rotation_wxyz: [q.w, q.x, q.y, q.z] };
        moved
    }
}

/// The arms' starts of `seed`, as near as the arms' limits let them.
pub(crate) fn starts(scene: &Scene, cell: &Cell, seed: u64) -> Vec<Setpoint> {
    let (v, random) = (&scene.task.variation, Random::new(seed, "start"));
    let one = |(k, tool): (usize, &Tool<'_>)| {
        let at = &tool.arm.start;
        // An arm's numbers do not depend on how many arms there are.
        let first = 8 * tool.arm.name as u64;
        let aside = |n: u64| 1e-3 * random.aside(first + n, v.insertion_mm);
        let start = Start {
            tilt_deg: (at.tilt_deg + random.aside(first, v.tilt_deg)).max(0.0),
            azimuth_deg: at.azimuth_deg + random.aside(first + 1, v.azimuth_deg),
            insertion_mm: at.insertion_mm + random.aside(first + 2, v.insertion_mm),
            roll_deg: at.roll_deg + random.aside(first + 3, v.roll_deg),
            jaw: at.jaw,
            position_m: at.position_m.map(|[x, y, z]| [x + aside(4), y + aside(5), z + aside(6)]),
        };
        cell.start_setpoint(k, &start, tool.port)
    };
    scene.tools().iter().enumerate().map(one).collect()
}

/// Greatest tilt of port-reach's targets (rad).
const TARGET_TILT: f64 = 0.35;
/// They are this much above the deepest insertion with which the blades stay above the floor (m),
/// over this length.
const TARGET_ABOVE: f64 = 0.015;
const TARGET_RANGE: f64 = 0.03;

/// Three targets an arm for port-reach, where its blade tips can be, above the tissue (m).
pub(crate) fn targets(cell: &Cell, seed: u64) -> Result<Vec<[DVec3; 3]>> {
    let random = Random::new(seed, "targets");
    let mut all = Vec::new();
    for (side, _) in cell.arms() {
        let (name, space) = (side.name(), cell.workspace(side.name())?);
        let length = cell.blade_tip(name)?.distance(cell.measured_cp(name)?.translation);
        let target = |n: u64| -> Result<DVec3> {
            let first = 16 * side as u64 + 4 * n;
            let Workspace::Port(in_port) = space else {
                // Evenly over the middle half of the box.
                let bounds = space.bounds();
                let along = |k: usize| {
                    let [low, high] = bounds[k];
                    random.within(first + k as u64, 0.75 * low + 0.25 * high, 0.25 * low + 0.75 * high)
                };
                return Ok(DVec3::new(along(0), along(1), along(2)) + length * space.direction_to(DVec3::ZERO));
            };
            let (limits, port) = (&in_port.limits, &in_port.port);
            let tilt = TARGET_TILT.min(0.9 * limits.tilt);
            // Evenly over the cone's disc.
            let lean = tilt * random.unit(first).sqrt();
            let azimuth = std::f64::consts::TAU * random.unit(first + 1);
            let pivots = [lean * azimuth.cos(), lean * azimuth.sin()];
            let low = limits.clamp(&Coordinates { pivots, insertion: limits.insertion[1], ..Coordinates::default() }).0;
            let deepest = cell.solve(name, &port.tip(&low), &low.into())?.setpoint.0[2] - TARGET_ABOVE;
            let insertion = random.within(first + 2, deepest - TARGET_RANGE, deepest).max(limits.insertion[0]);
            Ok(port.tip(&Coordinates { insertion, ..low }).transform(length * DVec3::X))
        };
        all.push([target(0)?, target(1)?, target(2)?]);
    }
    Ok(all)
}
