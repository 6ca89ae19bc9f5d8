//! Two laparoscopic instruments that move in front of the organs: shafts of 5 mm or more with a
//! jaw.

use glam::{DMat3, DVec3};
use std::f64::consts::{PI, TAU};
use trocar_geometry::TriMesh;

/// Size and motion of both instruments.
#[derive(Clone, Copy)]
pub(crate) struct InstrumentMotion {
    /// Size relative to instruments with 5 mm shafts.
    pub scale: f64,
    /// Motion of the left and the right instrument.
    pub sweeps: [Sweep; 2],
}

/// Motion of an instrument in the camera frame (m).
#[derive(Clone, Copy)]
pub(crate) struct Sweep {
    /// Where the shaft passes the abdominal wall, outside the picture.
    pub port: DVec3,
    /// Centre and amplitudes of the tip's motion.
    pub centre: DVec3,
    pub amplitude: DVec3,
}

const SIDES: usize = 28;
const SHAFT_RADIUS: f64 = 2.5e-3;
const JAW_LENGTH: f64 = 15e-3;

/// An instrument with its motion.
pub(crate) struct Instrument {
    scale: f64,
    sweep: Sweep,
    /// Periods (s) and phases (rad) of the tip's motion.
    period: DVec3,
    phase: DVec3,
}

/// The left and the right instrument; `phase` shifts their motion (rad).
pub(crate) fn pair(reach: &InstrumentMotion, phase: f64) -> [Instrument; 2] {
    let InstrumentMotion { scale, sweeps: [left, right] } = *reach;
    [
        Instrument {
            scale,
            sweep: left,
            period: DVec3::new(5.3, 3.1, 2.3),
            phase: DVec3::new(phase, 0.4 + 2.0 * phase, 0.0),
        },
        Instrument {
            scale,
            sweep: right,
            period: DVec3::new(4.7, 3.7, 2.9),
            phase: DVec3::new(1.3 + phase, 2.0 - phase, 1.0),
        },
    ]
}

impl Instrument {
    /// Surface of the instrument at `time` (s), in the camera frame.
    pub fn mesh(&self, time: f64) -> TriMesh {
        let swing = |p: f64, phase: f64| libm::sin(TAU * time / p + phase);
        let offset = DVec3::new(
            swing(self.period.x, self.phase.x),
            swing(self.period.y, self.phase.y),
            swing(self.period.z, self.phase.z),
        );
        let Sweep { port, centre, amplitude } = self.sweep;
        let roll = 0.5 * swing(self.period.x * 1.7, 0.0);
        let opening = 0.28 + 0.22 * swing(self.period.y * 0.8, 1.0);
        Posture { scale: self.scale, port, tip: centre + amplitude * offset, roll, opening }.mesh()
    }
}

/// Where an instrument is.
pub(crate) struct Posture {
    /// Size relative to an instrument with a 5 mm shaft.
    pub scale: f64,
    /// Where the shaft passes the abdominal wall, and the tip (m).
    pub port: DVec3,
    pub tip: DVec3,
    /// Turn about the shaft, and angle between the blades (rad).
    pub roll: f64,
    pub opening: f64,
}

impl Posture {
    /// Surface of the instrument, in the camera frame.
    pub fn mesh(&self) -> TriMesh {
        let Self { scale, port, tip, roll, opening } = *self;
        let x = (tip - port).normalize();
        let y = DVec3::Z.cross(x).normalize();
        let (y, z) =
            (y * libm::cos(roll) + x.cross(y) * libm::sin(roll), x.cross(y) * libm::cos(roll) - y * libm::sin(roll));
        let turn = DMat3::from_cols(x, y, z);

        let mut mesh = TriMesh::default();
        let hinge = -JAW_LENGTH;
        let reach = (tip - port).length() / scale + 0.01;
        let round = |x: f64, r: f64| (DVec3::new(x, 0.0, 0.0), r, r);
        let dark = [58, 58, 64];
        let steel = [172, 176, 184];
        // Short segments, so that those outside the picture can be discarded.
        let pieces = (reach / 6e-3).ceil() as usize;
        let end = hinge - 11e-3;
        let at = |i: usize| -reach + (end + reach) * i as f64 / pieces as f64;
        let shaft: Vec<_> = (0..=pieces).map(|i| round(at(i), SHAFT_RADIUS)).collect();
        loft(&mut mesh, &shaft, dark);
        let wrist =
            [(-11.0, 2.35), (-9.0, 2.45), (-8.6, 2.1), (-7.9, 2.1), (-7.5, 2.4), (-2.0, 2.3), (1.0, 1.9), (2.0, 1.0)]
                .map(|(x, r)| round(hinge + x * 1e-3, r * 1e-3));
        loft(&mut mesh, &wrist, steel);
        for side in [-1.0, 1.0] {
            let (sin, cos) = libm::sincos(side * opening / 2.0_f64);
            let rings: Vec<_> = (0..=12)
                .map(|i| {
                    let s = f64::from(i) / 12.0;
                    // Blunt at the tip, slightly bowed outwards.
                    let blunt = (1.0 - (s - 0.75).max(0.0).powi(2) / 0.0625).max(0.0).sqrt().max(0.15);
                    let (along, out) = (s * JAW_LENGTH, side * (0.75e-3 + 0.7e-3 * libm::sin(PI * s)));
                    let centre = DVec3::new(hinge + along * cos - out * sin, along * sin + out * cos, 0.0);
                    (centre, (1.0e-3 - 0.25e-3 * s) * blunt, (1.9e-3 - 0.6e-3 * s) * blunt)
                })
                .collect();
            loft(&mut mesh, &rings, steel);
        }
        for v in &mut mesh.vertices {
            *v = tip + turn * (*v * scale);
        }
        mesh
    }
}

/// Adds a closed tube through elliptical rings across x: (centre, radius along y, radius along z).
fn loft(mesh: &mut TriMesh, rings: &[(DVec3, f64, f64)], color: [u8; 3]) {
    let first = mesh.vertices.len() as u32;
    let sides = SIDES as u32;
    for (centre, ry, rz) in rings {
        for j in 0..SIDES {
            let (sin, cos) = libm::sincos(TAU * j as f64 / SIDES as f64);
            mesh.vertices.push(*centre + DVec3::new(0.0, ry * cos, rz * sin));
        }
    }
    for i in 0..rings.len() as u32 - 1 {
        for j in 0..sides {
            let (a, b) = (first + i * sides + j, first + i * sides + (j + 1) % sides);
            mesh.triangles.extend([[a, b, a + sides], [b, b + sides, a + sides]]);
        }
    }
    // End caps have their own vertices, so that their edge stays sharp.
    for (ring, flip) in [(0, true), (rings.len() - 1, false)] {
        let cap = mesh.vertices.len() as u32;
        let start = first as usize + ring * SIDES;
        mesh.vertices.extend_from_within(start..start + SIDES);
        mesh.vertices.push(rings[ring].0);
        for j in 0..sides {
            let (a, b) = (cap + j, cap + (j + 1) % sides);
            mesh.triangles.push(if flip { [cap + sides, b, a] } else { [cap + sides, a, b] });
        }
    }
    mesh.colors.resize(mesh.vertices.len(), color);
}

#[cfg(test)]
mod tests {
    use super::*;

    fn instrument_length(instrument: &Instrument) -> f64 {
        (instrument.sweep.centre - instrument.sweep.port).length()
    }

    #[test]
    fn surfaces_face_outward() {
        for instrument in pair(&crate::phantom_a::SPEC.reach, 0.3) {
            let mesh = instrument.mesh(1.0);
            let volume: f64 = mesh
                .triangles
                .iter()
                .map(|t| t.map(|v| mesh.vertices[v as usize]))
                .map(|[a, b, c]| a.dot(b.cross(c)) / 6.0)
                .sum();
            let shaft = PI * SHAFT_RADIUS * SHAFT_RADIUS * (instrument_length(&instrument) - JAW_LENGTH);
            assert!(volume > 0.9 * shaft && volume < 1.3 * shaft, "{volume} m3");
        }
    }
}
