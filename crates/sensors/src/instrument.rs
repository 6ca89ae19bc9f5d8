//! Shapes of an instrument: motor, shaft and two blades.

use crate::solid::{Part, Solid, append, revolve};
use glam::DVec3;
use trocar_geometry::TriMesh;
use trocar_scene::{Instrument, InstrumentKind};

/// Cell size of the blades' surfaces (m).
const SPACING: f64 = 0.0003;

/// Thickness of a blade at its root, and widths of a grasper's and a cutter's blade (m). Contact
/// with tissue uses the same values.
const BLADE_THICKNESS: f64 = 0.0032;
const BLADE_WIDTHS: [f64; 2] = [0.005, 0.0016];

/// Pitch and depth of a grasper's teeth (m).
const TEETH: [f64; 2] = [0.0014, 0.0005];

/// Radius and length of the motor housing (m).
const MOTOR: [f64; 2] = [0.026, 0.1];

/// The parts of an instrument. Shaft and motor are in the tip frame (x along the closed blades,
/// origin at the pivot of the jaws); blades are in the frames of [`trocar_cell::Gripper::blade`].
pub(crate) struct Shapes {
    pub shaft: TriMesh,
    pub motor: TriMesh,
    /// The blade that opens towards +y and the blade that opens towards -y.
    pub blades: [TriMesh; 2],
}

impl Shapes {
    pub fn of(instrument: &Instrument) -> Self {
        let radius = 0.5e-3 * instrument.shaft_diameter_mm;
        let length = 1e-3 * instrument.shaft_length_mm;
        let blade = 1e-3 * instrument.blade_length_mm;
        let upper = blade_of(instrument.kind, blade);
        let mut lower = upper.clone();
        for p in &mut lower.vertices {
            (p.y, p.z) = (-p.y, -p.z);
        }
        let mut shaft = revolve(&[
            [-length, radius],
            [-0.009, radius],
            [-0.0082, 0.92 * radius],
            [-0.0074, 0.92 * radius],
            [-0.0066, radius],
            [-0.0045, 0.9 * radius],
            [-0.0045, 0.0],
        ]);
        shaft.colors = vec![[196, 193, 188]; shaft.vertices.len()];
        append(&mut shaft, &yoke(radius));
        Self { shaft, motor: motor(length, radius), blades: [upper, lower] }
    }
}

/// The yoke that carries the blades: two cheeks and the pin.
fn yoke(radius: f64) -> TriMesh {
    let steel = [186, 184, 180];
    let mut solid = Solid::new(0.0004);
    for side in [1.0, -1.0] {
        let centre = DVec3::new(-0.0025, 0.0, 0.82 * side * radius);
        let half = DVec3::new(0.0042, 0.55 * radius, 0.16 * radius);
        solid = solid.with(steel, Part::Block { centre, half, edge: 0.0002 });
    }
    let pin = 0.98 * radius * DVec3::Z;
    solid.with(steel, Part::Cylinder { from: -pin, to: pin, radius: 0.0008, edge: 0.0002 }).surface(0.0003)
}

/// The motor housing at the base of the shaft and the bearing in front of it.
fn motor(length: f64, radius: f64) -> TriMesh {
    let [wide, long] = MOTOR;
    let at = |x: f64, r: f64| [x - length, r];
    revolve(&[
        at(0.0, 0.0),
        at(0.0, wide - 0.003),
        at(0.0015, wide - 0.0008),
        at(0.004, wide),
        at(long - 0.02, wide),
        at(long - 0.016, wide - 0.001),
        at(long - 0.013, wide - 0.004),
        at(long, 0.011),
        at(long + 0.012, 0.0085),
        at(long + 0.012, radius),
    ])
}

/// The blade that opens towards +y.
fn blade_of(kind: InstrumentKind, length: f64) -> TriMesh {
    let steel = [206, 204, 199];
    let grasper = kind == InstrumentKind::Grasper;
    let wide = BLADE_WIDTHS[usize::from(!grasper)];
    // The blades of a cutter slide past each other.
    let aside = if grasper { 0.0 } else { 0.5 * wide };
    let solid = Solid::new(0.0).with(
        steel,
        Part::Block {
            centre: DVec3::new(0.5 * (length - 0.003), 0.5 * BLADE_THICKNESS, aside),
            half: DVec3::new(0.5 * (length + 0.003), 0.5 * BLADE_THICKNESS, 0.5 * wide),
            edge: 0.0004,
        },
    );
    solid.carved(SPACING, |d, p| {
        let share = (p.x / length).clamp(0.0, 1.0);
        // The back tapers towards the rounded tip.
        let back = p.y - BLADE_THICKNESS * (1.0 - 0.55 * share * share);
        let nose = DVec3::new(p.x - (length - 0.5 * wide), 0.0, p.z - aside).length() - 0.5 * wide;
        let mut d = d.max(0.95 * back);
        if p.x > length - 0.5 * wide {
            d = d.max(nose);
        }
        if grasper {
            if p.x > 0.003 {
                let saw = (p.x / TEETH[0]).fract();
                d = d.max(TEETH[1] * (1.0 - (2.0 * saw - 1.0).abs()) - p.y);
            }
            // The window in the blade.
            let along = p.x.clamp(0.35 * length, 0.72 * length);
            d.max(0.0009 - libm::hypot(p.x - along, p.z))
        } else {
            // The edge is ground on one side.
            d.max(0.7 * (0.0012 - p.y - 2.0 * (p.z - aside + 0.5 * wide)))
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blades_have_their_contact_dimensions() {
        for kind in [InstrumentKind::Grasper, InstrumentKind::Cutter] {
            let shapes = Shapes::of(&Instrument::of(kind));
            for (blade, side) in shapes.blades.iter().zip([1.0, -1.0]) {
                let (low, high) = blade.bounds().unwrap_or_default();
                assert!((high.x - 0.021).abs() < 4e-4, "{kind:?}: {high}");
                let (inner, outer) = if side > 0.0 { (low.y, high.y) } else { (-high.y, -low.y) };
                assert!(inner.abs() < 4e-4 && (outer - BLADE_THICKNESS).abs() < 4e-4, "{kind:?}: {inner} {outer}");
                assert!(blade.volume() > 0.0 && blade.triangles.len() < 60_000, "{}", blade.triangles.len());
            }
        }
    }
}
