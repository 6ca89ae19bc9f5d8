//! A laparoscopic view of procedural organs, for the renderer's benchmark and picture tests: tubes and a bed, two instruments.

use glam::{DQuat, DVec3};
use trocar_geometry::{Pose, TriMesh};

/// What is on the stage, in metres, the camera at [`view`].
pub(crate) struct LaparoscopicScene {
    /// Organs: coloured surfaces.
    pub organs: Vec<TriMesh>,
    /// An instrument's surface, shaft along z, its tip at the origin.
    pub instrument: TriMesh,
}

impl LaparoscopicScene {
    /// Five loops of bowel over a bed, each of about `organ_triangles`.
    pub(crate) fn new(organ_triangles: usize) -> Self {
        let sides = ((organ_triangles as f64 / 8.0).sqrt().round() as usize).max(6);
        let rings = (organ_triangles / (2 * sides)).max(6);
        let loops: Vec<TriMesh> = (0..4).map(|i| bowel(i, rings, sides)).collect();
        let mut organs = loops;
        organs.push(bed(((organ_triangles as f64 / 2.0).sqrt() as usize).max(4)));
        Self { organs, instrument: rod(0.0025, 0.3, 24) }
    }

    /// Vertices of organ `index` while it moves, at time `t` [s].
    pub(crate) fn moved(&self, index: usize, t: f64) -> Vec<DVec3> {
        let lift = |p: &DVec3| 0.008 * (std::f64::consts::TAU * t).sin() * (60.0 * p.x).cos();
        self.organs[index].vertices.iter().map(|p| *p + DVec3::new(0.0, 0.0, lift(p))).collect()
    }

    /// Pose of one of the two instruments at time `t` [s].
    pub(crate) fn instrument_pose(&self, right: bool, t: f64) -> Pose {
        let side = if right { 1.0 } else { -1.0 };
        let tip = DVec3::new(side * (0.012 + 0.004 * (2.0 * t).sin()), -0.012, 0.022);
        let port = DVec3::new(side * 0.09, -0.12, 0.14);
        Pose { rotation: DQuat::from_rotation_arc(DVec3::Z, (port - tip).normalize()), translation: tip }
    }
}

/// Pose of the endoscope's camera.
pub(crate) fn view() -> Pose {
    Pose::look_at(DVec3::new(0.0, -0.075, 0.095), DVec3::new(0.0, 0.004, 0.005), DVec3::Z)
}

/// A winding tube, radius about a centimetre.
fn bowel(index: usize, rings: usize, sides: usize) -> TriMesh {
    let place = index as f64;
    let centre = |s: f64| {
        let x = -0.15 + 0.30 * s;
        let y = -0.045 + 0.028 * place + 0.010 * (15.0 * s + 1.7 * place).sin();
        DVec3::new(x, y, 0.007 + 0.005 * (18.0 * s + 2.1 * place).sin())
    };
    let mut mesh = TriMesh::default();
    for i in 0..=rings {
        let s = i as f64 / rings as f64;
        let along = (centre(s + 1e-4) - centre(s - 1e-4)).normalize();
        let (x, y) = along.any_orthonormal_pair();
        // Haustra: the tube is gathered every few centimetres.
        let gathered = 0.0115 * (1.0 + 0.10 * (110.0 * s + place).sin() + 0.03 * (190.0 * s).sin());
        for j in 0..sides {
            let angle = std::f64::consts::TAU * j as f64 / sides as f64;
            let ripple = 1.0 + 0.03 * (3.0 * angle + 20.0 * s).sin();
            mesh.vertices.push(centre(s) + (x * angle.cos() + y * angle.sin()) * gathered * ripple);
            // Vessels: thin dark red branches on pink.
            let vessel = ((40.0 * s + 2.0 * (2.0 * angle).sin() + place).sin().abs() * 6.0).min(1.0);
            let mix = |dark: f64, light: f64| (dark + (light - dark) * vessel) as u8;
            mesh.colors.push([mix(165.0, 214.0), mix(52.0, 128.0), mix(50.0, 112.0)]);
        }
    }
    for i in 0..rings {
        for j in 0..sides {
            let at = |i: usize, j: usize| (i * sides + j % sides) as u32;
            mesh.triangles.push([at(i, j), at(i, j + 1), at(i + 1, j)]);
            mesh.triangles.push([at(i, j + 1), at(i + 1, j + 1), at(i + 1, j)]);
        }
    }
    mesh
}

/// The cavity's floor, `cells` a side.
fn bed(cells: usize) -> TriMesh {
    let mut mesh = TriMesh::default();
    let side = |i: usize| -0.16 + 0.32 * i as f64 / cells as f64;
    for j in 0..=cells {
        for i in 0..=cells {
            let (x, y) = (side(i), side(j));
            let z = -0.008 + 0.006 * (30.0 * x).sin() * (25.0 * y).cos() + 0.9 * (x * x + y * y);
            mesh.vertices.push(DVec3::new(x, y, z));
            let fat = (40.0 * x + 9.0 * (31.0 * y).sin()).sin() * 0.5 + 0.5;
            let mix = |a: f64, b: f64| (a + (b - a) * fat) as u8;
            mesh.colors.push([mix(168.0, 214.0), mix(64.0, 150.0), mix(56.0, 84.0)]);
        }
    }
    for j in 0..cells {
        for i in 0..cells {
            let a = (j * (cells + 1) + i) as u32;
            let below = a + cells as u32 + 1;
            mesh.triangles.extend([[a, a + 1, below], [a + 1, below + 1, below]]);
        }
    }
    mesh
}

/// A rod with a pointed tip.
fn rod(radius: f64, length: f64, sides: usize) -> TriMesh {
    let rings = [(0.0, 0.2 * radius), (0.004, 0.6 * radius), (0.012, radius), (length, radius)];
    let mut mesh = TriMesh::default();
    for (z, r) in rings {
        for j in 0..sides {
            let angle = std::f64::consts::TAU * j as f64 / sides as f64;
            mesh.vertices.push(DVec3::new(r * angle.cos(), r * angle.sin(), z));
        }
    }
    for i in 0..rings.len() - 1 {
        for j in 0..sides {
            let at = |i: usize, j: usize| (i * sides + j % sides) as u32;
            mesh.triangles.push([at(i, j), at(i, j + 1), at(i + 1, j)]);
            mesh.triangles.push([at(i, j + 1), at(i + 1, j + 1), at(i + 1, j)]);
        }
    }
    mesh
}
