//! Where an episode begins: the starts of its arms, and the targets of port-reach by its seed.

use crate::Result;
use glam::DVec3;
use trocar_cell::{Cell, Setpoint, Workspace};
use trocar_robot::instrument::Coordinates;
use trocar_scene::{EpisodeRandom, Scene, Tool};

/// The arms' starts in `scene`, as near as the arms' limits let them.
pub(crate) fn starts(scene: &Scene, cell: &Cell) -> Vec<Setpoint> {
    let one = |(k, tool): (usize, &Tool<'_>)| cell.start_setpoint(k, &tool.arm.start, tool.port);
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
    let random = EpisodeRandom::new(seed, "targets");
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
            let pivots = [lean * libm::cos(azimuth), lean * libm::sin(azimuth)];
            let low = limits.clamp(&Coordinates { pivots, insertion: limits.insertion[1], ..Coordinates::default() }).0;
            let deepest = cell.solve(name, &port.tip(&low), &low.into())?.setpoint.0[2] - TARGET_ABOVE;
            let insertion = random.within(first + 2, deepest - TARGET_RANGE, deepest).max(limits.insertion[0]);
            Ok(port.tip(&Coordinates { insertion, ..low }).transform(length * DVec3::X))
        };
        all.push([target(0)?, target(1)?, target(2)?]);
    }
    Ok(all)
}
