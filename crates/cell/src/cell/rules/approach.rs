//! Tissue that an instrument is about to hit at speed, as the force guard sees it.
//!
//! A tip at 0.15 m/s goes 2.5 mm in a frame of tissue and 3 mm more until it stands. An organ that
//! lies on something hard is crushed by then. So the guard looks ahead.

use super::force_guard::FASTEST_TOUCH;
use crate::cell::arm::ArmUnit;
use crate::{FRAME, World};
use glam::DVec3;
use trocar_tissue::Hole;

/// Numbers of tissue frames ahead at which the instrument's place is checked.
const FRAMES_AHEAD: [f64; 2] = [1.0, 2.0];

/// The direction from which the instrument of `arm`, which moves by `way` in a frame (m), is about
/// to hit an organ that it does not hold: a unit vector against the hit. Zero if it hits none, or
/// slower than [`FASTEST_TOUCH`].
pub(in crate::cell) fn hit_ahead(world: &World, arm: &ArmUnit, way: DVec3) -> DVec3 {
    let (mut fastest, mut out) = (FASTEST_TOUCH * FRAME, DVec3::ZERO);
    if way.length() <= fastest {
        return out;
    }
    let rods = arm.rods();
    let holes: Vec<&Hole> = world.state.holes.iter().filter(|h| h.tools.contains(&arm.model.tools.gripper)).collect();
    let in_hole = |organ: usize, node: usize| {
        holes.iter().any(|hole| hole.body == organ && hole.nodes.binary_search(&(node as u32)).is_ok())
    };
    for shift in FRAMES_AHEAD.map(|frames| frames * way) {
        let ends = rods.iter().flat_map(|rod| rod.ends.map(|p| (p + shift, rod.radius)));
        let (low, high) = ends.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), (p, radius)| {
            (low.min(p - radius), high.max(p + radius))
        });
        for (organ, body) in world.model.bodies().iter().enumerate().filter(|(organ, _)| !arm.holds(*organ)) {
            for node in 0..body.len() {
                let p = world.state.position(&world.model, organ, node);
                if p.cmplt(low).any() || p.cmpgt(high).any() || in_hole(organ, node) {
                    continue;
                }
                for rod in &rods {
                    let [from, to] = rod.ends.map(|end| end + shift);
                    let share = ((p - from).dot(to - from) / (to - from).length_squared()).clamp(0.0, 1.0);
                    let off = p - from.lerp(to, share);
                    let towards = off.normalize_or_zero();
                    let closing = way.dot(towards);
                    if off.length() < rod.radius && closing > fastest {
                        (fastest, out) = (closing, -towards);
                    }
                }
            }
        }
    }
    out
}
