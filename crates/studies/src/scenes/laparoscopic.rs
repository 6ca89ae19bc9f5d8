//! A laparoscopic view of procedural organs, a bed and two instruments, for the renderer's
//! benchmark and picture tests.

use glam::{DQuat, DVec3};
use trocar_core::Pose;
use trocar_geometry::TriMesh;

/// The surfaces of the view (m). The camera is at [`view`].
pub struct LaparoscopicScene {
    /// Organs: coloured surfaces.
    pub organs: Vec<TriMesh>,
    /// The surface of an instrument, with its shaft along z and its tip at the origin.
    pub instrument: TriMesh,
}

impl LaparoscopicScene {
    /// Four loops of bowel over a bed, each of about `organ_triangles`.
    pub fn new(organ_triangles: usize) -> Self {
        let sides = ((organ_triangles as f64 / 8.0).sqrt().round() as usize).max(6);
        let rings = (organ_triangles / (2 * sides)).max(6);
        let loops: Vec<TriMesh> = (0..4).map(|i| bowel(i, rings, sides)).collect();
        let mut organs = loops;
        organs.push(bed(((organ_triangles as f64 / 2.0).sqrt() as usize).max(4)));
        Self { organs, instrument: rod(0.0025, 0.3, 24) }
    }

    /// Vertices of the moving organ `index` at the time `t` (s).
    pub fn moved(&self, index: usize, t: f64) -> Vec<DVec3> {
        let lift = |p: &DVec3| 0.008 * (std::f64::consts::TAU * t).sin() * (60.0 * p.x).cos();
        self.organs[index].vertices.iter().map(|p| *p + DVec3::new(0.0, 0.0, lift(p))).collect()
    }

    /// Pose of one of the two instruments at the time `t` (s).
    pub fn instrument_pose(&self, right: bool, t: f64) -> Pose {
        let side = if right { 1.0 } else { -1.0 };
        let tip = DVec3::new(side * (0.012 + 0.004 * (2.0 * t).sin()), -0.012, 0.022);
        let port = DVec3::new(side * 0.085, -0.11, 0.105);
        Pose { rotation: DQuat::from_rotation_arc(DVec3::Z, (port - tip).normalize()), translation: tip }
    }
}

/// Pose of the endoscope's camera.
pub fn view() -> Pose {
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
        // Axes that turn with the tube without flips.
        let x = along.cross(DVec3::Z).normalize();
        let y = x.cross(along);
        // Haustra: constrictions every few centimetres.
        let gathered = 0.0115 * (1.0 + 0.10 * (110.0 * s + place).sin() + 0.03 * (190.0 * s).sin());
        for j in 0..sides {
            let angle = std::f64::consts::TAU * j as f64 / sides as f64;
            let ripple = 1.0 + 0.03 * (3.0 * angle + 20.0 * s).sin();
            mesh.vertices.push(centre(s) + (x * angle.cos() + y * angle.sin()) * gathered * ripple);
            // Vessels: a net of thin dark red lines on pink.
            let warp = angle + 0.8 * (31.0 * s + place).sin() + 0.3 * (83.0 * s).sin();
            let field = (2.0 * warp + 24.0 * s).sin() + 0.8 * (61.0 * s + 2.0 * (2.0 * angle + place).sin()).sin();
            let line = (field.abs() / 0.16).min(1.0);
            let fine = 0.85 + 0.15 * ((7.0 * warp + 140.0 * s).sin().abs() / 0.3).min(1.0);
            let mix = |dark: f64, light: f64| ((dark + (light - dark) * line) * fine) as u8;
            mesh.colors.push([mix(176.0, 219.0), mix(70.0, 138.0), mix(66.0, 124.0)]);
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
            // Lobules of fat.
            let lobes = |k: f64| (k * x + 2.0 * (0.7 * k * y).sin()).sin() * (k * y + 2.0 * (0.8 * k * x).sin()).sin();
            let height = 0.004 * lobes(75.0).abs().sqrt() + 0.0012 * lobes(230.0).abs().sqrt();
            let z = -0.012 + 0.006 * (30.0 * x).sin() * (25.0 * y).cos() + 0.9 * (x * x + y * y) + height;
            mesh.vertices.push(DVec3::new(x, y, z));
            let fat = (height / 0.004).min(1.0) * (0.75 + 0.25 * (19.0 * x - 23.0 * y).sin());
            let mix = |a: f64, b: f64| (a + (b - a) * fat) as u8;
            mesh.colors.push([mix(158.0, 226.0), mix(58.0, 176.0), mix(48.0, 104.0)]);
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
