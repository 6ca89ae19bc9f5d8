//! An organ of one specimen in the place of the same organ of another.

use crate::{Error, Organ, Result, Specimen};
use glam::{DQuat, DVec3};
use trocar_core::Pose;
use trocar_geometry::{MeshDistance, OrganAxis, SignedDistance};

/// Turns about the vertical that are tried to either side: so many, of so much (degrees).
const TURNS: i32 = 12;
const TURN_DEG: f64 = 5.0;

/// How much deeper than the organ in whose place it is an organ may lie in another one (m).
/// Reconstructed organs that touch lie in each other by fractions of it.
const MAX_OVERLAP: f64 = 1e-3;

impl Specimen {
    /// This specimen with the organ `name` of `other` in the place of its own: the ends at the base
    /// are at the same place seen from above, the middles in the same direction from it, and the
    /// lowest points at the same height. Where the organ would then lie in another one, it is
    /// turned about the vertical through its base, by as little as is enough, and at most 60
    /// degrees.
    ///
    /// # Errors
    /// A specimen without that organ; an organ that lies in another one, however it is turned.
    pub fn with_organ_of(&self, other: &Self, name: &str) -> Result<Self> {
        let (at, own) = (self.place_of(name)?, &self.organs[self.place_of(name)?]);
        let given = &other.organs[other.place_of(name)?];
        let surfaces: Vec<(&Organ, MeshDistance)> = self
            .organs
            .iter()
            .filter(|organ| organ.name != name)
            .map(|organ| Ok((organ, MeshDistance::new(&organ.surface)?)))
            .collect::<Result<_>>()?;
        let allowed = overlaps(own, &surfaces)?.into_iter().map(|depth| depth + MAX_OVERLAP).collect::<Vec<_>>();
        let place = Place::new(self.up, own, given, other.up)?;
        let mut least: Option<(f64, &str)> = None;
        for k in 0..=2 * TURNS {
            // 0, 1, -1, 2, -2, ... turns.
            let turn = f64::from(if k % 2 == 0 { -k / 2 } else { (k + 1) / 2 }) * TURN_DEG.to_radians();
            let moved = moved(given, &place.pose(turn));
            let depths = overlaps(&moved, &surfaces)?;
            let excess = depths.iter().zip(&allowed).map(|(depth, allowed)| depth - allowed);
            let worst = excess.zip(&surfaces).max_by(|(a, _), (b, _)| a.total_cmp(b));
            match worst {
                Some((excess, (organ, _))) if excess > 0.0 => {
                    let depth = excess + MAX_OVERLAP;
                    if least.is_none_or(|(lowest, _)| depth < lowest) {
                        least = Some((depth, organ.name.as_str()));
                    }
                }
                _ => {
                    let mut made = self.clone();
                    made.organs[at] = moved;
                    return Ok(made);
                }
            }
        }
        let (depth, organ) = least.unwrap_or_default();
        Err(Error::Swap {
            organ: name.to_owned(),
            reason: format!(
                "would lie {:.1} mm deeper in '{organ}' than the one in whose place it is, however it is turned; at \
                 most {:.1} mm; choose another specimen",
                1e3 * depth,
                1e3 * MAX_OVERLAP
            ),
        })
    }

    fn place_of(&self, name: &str) -> Result<usize> {
        self.organs.iter().position(|organ| organ.name == name).ok_or_else(|| {
            let known: Vec<&str> = self.organs.iter().map(|organ| organ.name.as_str()).collect();
            let reason = format!("is no organ of {}; it has {}", self.name, known.join(", "));
            Error::Swap { organ: name.to_owned(), reason }
        })
    }
}

/// Where an organ comes to lie.
struct Place {
    up: DVec3,
    /// Turns the given organ upright, and its middle to the direction of the own one's.
    upright: DQuat,
    /// The base of the given organ, and where it comes to lie, without heights.
    from: DVec3,
    to: DVec3,
    /// The given organ's lowest height, upright, and where it comes to lie.
    heights: [f64; 2],
}

impl Place {
    fn new(up: DVec3, own: &Organ, given: &Organ, given_up: DVec3) -> Result<Self> {
        let tilt = DQuat::from_rotation_arc(given_up, up);
        let level = |v: DVec3| v - v.dot(up) * up;
        let base = |organ: &Organ| -> Result<DVec3> { Ok(OrganAxis::of(&organ.body, organ.base)?.point_at(0.0)) };
        let middle =
            |organ: &Organ| organ.body.vertices.iter().sum::<DVec3>() / organ.body.vertices.len().max(1) as f64;
        let (from, to) = (base(given)?, base(own)?);
        let (ahead, wanted) = (level(tilt * (middle(given) - from)), level(middle(own) - to));
        let turn = libm::atan2(ahead.cross(wanted).dot(up), ahead.dot(wanted));
        let upright = (DQuat::from_axis_angle(up, turn) * tilt).normalize();
        let lowest = |organ: &Organ, rotation: DQuat| {
            organ.body.vertices.iter().map(|p| (rotation * *p).dot(up)).fold(f64::INFINITY, f64::min)
        };
        let heights = [lowest(given, upright), lowest(own, DQuat::IDENTITY)];
        Ok(Self { up, upright, from, to: level(to), heights })
    }

    /// The pose of the given organ with a further turn about the vertical (rad).
    fn pose(&self, turn: f64) -> Pose {
        let rotation = (DQuat::from_axis_angle(self.up, turn) * self.upright).normalize();
        let from = rotation * self.from;
        let aside = self.to - (from - from.dot(self.up) * self.up);
        Pose { rotation, translation: aside + (self.heights[1] - self.heights[0]) * self.up }
    }
}

fn moved(organ: &Organ, pose: &Pose) -> Organ {
    let mut moved = organ.clone();
    for p in moved.body.vertices.iter_mut().chain(&mut moved.surface.vertices).chain([&mut moved.base]) {
        *p = pose.transform(*p);
    }
    moved
}

/// How deep nodes of `organ` lie in each of the others, or theirs in it (m); 0 where they are
/// apart.
fn overlaps(organ: &Organ, others: &[(&Organ, MeshDistance)]) -> Result<Vec<f64>> {
    let own = MeshDistance::new(&organ.surface)?;
    let one = |(other, surface): &(&Organ, MeshDistance)| {
        depth(&organ.body.vertices, surface, &other.body.vertices).max(depth(
            &other.body.vertices,
            &own,
            &organ.body.vertices,
        ))
    };
    Ok(others.iter().map(one).collect())
}

/// How deep `points` lie in the surface around `body` (m).
fn depth(points: &[DVec3], surface: &MeshDistance, body: &[DVec3]) -> f64 {
    let bounds = |(low, high): (DVec3, DVec3), p: &DVec3| (low.min(*p), high.max(*p));
    let (low, high) = body.iter().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), bounds);
    let near = points.iter().filter(|p| p.cmpge(low).all() && p.cmple(high).all());
    near.map(|p| -surface.distance(*p)).fold(0.0, f64::max)
}
