//! The mesentery below the organs: a height field.

use crate::body::Body;
use crate::noise;
use glam::DVec3;
use rayon::prelude::*;
use trocar_geometry::{SignedDistance, TriMesh};

/// Gap between an organ and the bed (m).
const GAP: f64 = 0.3e-3;
/// Height to which the bed climbs at an organ, and the distance at which it starts to climb (m).
const CLIMB: f64 = 1.8e-3;
const CLIMB_REACH: f64 = 2.5e-3;
/// Half extent of the bed along x and y (m), larger than the camera's view.
const EXTENT: (f64, f64) = (0.225, 0.130);

/// Specification of a bed.
#[derive(Clone, Copy)]
pub(crate) struct BedSpec {
    /// Depth without deformation (m).
    pub depth: f64,
    /// Size relative to [`Self::MESENTERY`], of the bed and of everything on it.
    pub scale: f64,
    /// Colours of its two layers, and the amount of fat on them, in [0, 1].
    pub meat: DVec3,
    pub film: DVec3,
    pub fat: f64,
}

impl BedSpec {
    /// The mesentery of a rabbit, seen from 15 cm.
    pub const MESENTERY: Self = Self {
        depth: 0.150,
        scale: 1.0,
        meat: DVec3::new(138.0, 50.0, 46.0),
        film: DVec3::new(180.0, 88.0, 72.0),
        fat: 1.0,
    };
}

/// A gently undulating sheet that gives way under organs.
pub(crate) struct Bed {
    pub spec: BedSpec,
    pub seed: u64,
    organs: Vec<Body>,
}

impl Bed {
    pub fn new(spec: BedSpec, seed: u64) -> Self {
        Self { spec, seed, organs: Vec::new() }
    }

    /// Imprints `organs` into the bed.
    pub fn imprint(&mut self, organs: Vec<Body>) {
        self.organs = organs;
    }

    /// Depth of the bed without lobules and imprints (m). Organs are laid along this surface.
    pub fn smooth_height(&self, x: f64, y: f64) -> f64 {
        let scale = self.spec.scale;
        let wide = 0.055 * scale;
        let waves = 3.5e-3 * scale * noise::smooth(self.seed, DVec3::new(x / wide, y / wide, 0.5));
        // The abdominal wall rises around the field.
        let out = ((x / (0.19 * scale)).powi(2) + (y / (0.125 * scale)).powi(2)).sqrt();
        let t = ((out - 0.45) / 0.75).clamp(0.0, 1.0);
        self.spec.depth + waves - 0.030 * scale * t * t * (3.0 - 2.0 * t)
    }

    /// Dimensionless distance from the seams between the lobules; 0 on a seam.
    pub fn seams(&self, x: f64, y: f64) -> f64 {
        let wide = 0.012 * self.spec.scale;
        noise::fractal(self.seed + 10, DVec3::new(x / wide, y / wide, 0.5), 2).abs()
    }

    /// Depth of the bed (m).
    pub fn height(&self, x: f64, y: f64) -> f64 {
        let smooth = self.smooth_height(x, y);
        let lobes = self.seams(x, y);
        let scale = self.spec.scale;
        let across = DVec3::new(x / (0.035 * scale), y / (0.06 * scale), 0.5);
        let folds = noise::fractal(self.seed + 20, across, 2).abs();
        let lobe = 1.4e-3 * scale * (lobes.min(0.5) - 0.2);
        let mut p = DVec3::new(x, y, smooth - lobe - 4e-3 * scale * (folds - 0.3).max(0.0));
        // The sheet climbs slightly at an organ, where it is attached.
        let beside = self.organs.iter().map(|o| o.distance(p)).fold(f64::INFINITY, f64::min);
        p.z -= CLIMB * scale * libm::exp(-beside.max(0.0) / (CLIMB_REACH * scale));
        // Descend until clear of every organ. A minimum step lets a column through an organ pass
        // below it.
        for _ in 0..400 {
            let nearest = self.organs.iter().map(|o| o.distance(p)).fold(f64::INFINITY, f64::min);
            if nearest >= GAP {
                break;
            }
            p.z += (GAP - nearest).max(0.02e-3);
        }
        p.z
    }

    /// Mesh of the bed with triangles of size `spacing` (m), facing the camera.
    pub fn mesh(&self, spacing: f64) -> TriMesh {
        let extent = (EXTENT.0 * self.spec.scale, EXTENT.1 * self.spec.scale);
        let columns = (2.0 * extent.0 / spacing).ceil() as usize + 1;
        let rows = (2.0 * extent.1 / spacing).ceil() as usize + 1;
        let vertices = (0..rows * columns)
            .into_par_iter()
            .map(|i| {
                let (x, y) = ((i % columns) as f64 * spacing - extent.0, (i / columns) as f64 * spacing - extent.1);
                DVec3::new(x, y, self.height(x, y))
            })
            .collect();
        let mut triangles = Vec::with_capacity(2 * rows * columns);
        for j in 0..rows - 1 {
            for i in 0..columns - 1 {
                let a = (j * columns + i) as u32;
                let below = a + columns as u32;
                triangles.extend([[a, below, a + 1], [a + 1, below, below + 1]]);
            }
        }
        TriMesh { vertices, triangles, colors: Vec::new() }
    }
}
