//! Stage 5: tissue on which an instrument presses hard enough is punctured.
//!
//! An instrument whose axis comes inside an organ has punctured it if it pressed on it with at
//! least the scene's `safety.puncture_force_n`. The organ then has a hole around the part of the
//! axis inside it. The hole grows as the instrument advances, and it lets this instrument through.
//! Everywhere else they touch as before. When the instrument is out, the hole closes.

use crate::World;
use crate::cell::Cell;
use crate::cell::arm::ArmUnit;
use crate::cell::inside::crossings;
use crate::cell::report::{CellEvent, PeriodLog};
use crate::cell::solid::Rod;
use glam::DVec3;
use trocar_tissue::Hole;

/// A hole reaches this far beyond the surface of the instrument (m): farther than an instrument
/// moves in a frame, and farther than triangles are wide.
const MARGIN: f64 = 4e-3;

impl Cell {
    /// Lets holes follow the instruments in them, and punctures organs.
    pub(super) fn puncture(&mut self, log: &mut PeriodLog) {
        for arm in &self.arms {
            follow(&mut self.world, arm);
            for (organ, place, force_n) in arm.punctures(&self.world) {
                log.rules.punctures += 1;
                log.events.push(CellEvent::Punctured {
                    arm: arm.model.side,
                    organ: self.world.model.bodies()[organ].name().to_owned(),
                    s: coordinate(&self.world, organ, place),
                    at_mm: (1e3 * place).to_array(),
                    force_n,
                });
                let nodes = nodes_at(&self.world, organ, &arm.rods());
                self.world.state.holes.push(Hole { body: organ, tools: arm.model.tools.all().to_vec(), nodes });
            }
        }
    }
}

impl ArmUnit {
    /// The organs that the instrument punctures now: each with a place of its axis inside (m) and
    /// the force with which it pressed (N).
    fn punctures(&self, world: &World) -> Vec<(usize, DVec3, f64)> {
        let hard = |organ: usize| self.state.pressed.peak(organ) >= self.model.puncture_force;
        if !(0..world.model.bodies().len()).any(hard) {
            return Vec::new();
        }
        let organs = self.pierces(world).into_iter().filter(|(organ, _)| hard(*organ));
        organs.map(|(organ, place)| (organ, place, self.state.pressed.peak(organ))).collect()
    }
}

/// Widens the holes around the instrument of `arm`. Closes a hole that the instrument has left: no
/// axis is inside the organ, and no node of the hole would touch the instrument. So contact begins
/// without a jump.
fn follow(world: &mut World, arm: &ArmUnit) {
    let mut holes = std::mem::take(&mut world.state.holes);
    holes.retain_mut(|hole| {
        if !hole.tools.contains(&arm.model.tools.gripper) {
            return true;
        }
        let rods = arm.rods();
        let inside = nodes_at(world, hole.body, &rods);
        if inside.is_empty() {
            let place = |node: &u32| world.state.position(&world.model, hole.body, *node as usize);
            return hole.nodes.iter().map(place).any(|p| rods.iter().any(|rod| distance(rod.ends, p) < rod.radius));
        }
        hole.nodes.extend(inside);
        hole.nodes.sort_unstable();
        hole.nodes.dedup();
        true
    });
    world.state.holes = holes;
}

/// The nodes of an organ around the parts of the axes of `rods` inside it, ascending.
fn nodes_at(world: &World, organ: usize, rods: &[Rod]) -> Vec<u32> {
    let axes: Vec<[DVec3; 2]> = rods.iter().map(|rod| rod.ends).collect();
    let found = crossings(world, organ, &axes);
    if found.is_empty() {
        return Vec::new();
    }
    let mut nodes: Vec<u32> = found.iter().flat_map(|crossing| crossing.nodes).collect();
    for (node, p) in (0..).zip(world.state.positions(&world.model, organ)) {
        let near = found.iter().any(|crossing| {
            let [from, to] = axes[crossing.segment];
            let part = crossing.part.map(|share| from.lerp(to, share));
            distance(part, p) < rods[crossing.segment].radius + MARGIN
        });
        if near {
            nodes.push(node);
        }
    }
    nodes.sort_unstable();
    nodes.dedup();
    nodes
}

/// Distance of a point from a segment (m).
fn distance([from, to]: [DVec3; 2], p: DVec3) -> f64 {
    let way = to - from;
    let share = ((p - from).dot(way) / way.length_squared().max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
    p.distance(from + share * way)
}

/// The organ coordinate of the node of an organ that is nearest to a place.
fn coordinate(world: &World, organ: usize, place: DVec3) -> f64 {
    let places = world.state.positions(&world.model, organ);
    let by_distance = |(_, a): &(usize, f64), (_, b): &(usize, f64)| a.total_cmp(b);
    let nearest = places.iter().map(|p| p.distance_squared(place)).enumerate().min_by(by_distance);
    nearest.map_or(0.0, |(node, _)| world.axes[organ].s[node])
}
