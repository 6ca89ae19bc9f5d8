//! Rays per second, beside Embree.

use crate::bench::embree::{Embree, EmbreeRows};
use crate::{Error, Result};
use glam::Vec3;
use rayon::ThreadPoolBuilder;
use serde::Serialize;
use std::path::Path;
use std::time::Instant;
use trocar_camera::Camera;
use trocar_core::Pose;
use trocar_geometry::TriMesh;
use trocar_render::{Appearance, Stage};

/// Repetitions. The fastest counts, because the machine may be shared.
const TRIES: usize = 5;

/// First hits of one kind of ray on one thread.
#[derive(Clone, Debug, Serialize)]
pub struct RayRow {
    /// `camera` (coherent) or `scattered` (in all directions from where camera rays hit).
    pub kind: &'static str,
    /// Rays.
    pub rays: usize,
    /// Our rays per second.
    pub rays_per_second: f64,
    /// Embree's rays per second.
    pub embree_rays_per_second: Option<f64>,
    /// Our speed over Embree's.
    pub ratio: Option<f64>,
    /// Rays that hit for only one of the two, without those at edges of the picture.
    pub differing: Option<usize>,
    /// Compared rays: all but those at edges.
    pub compared: Option<usize>,
    /// Largest distance between the two hits (m).
    pub largest_difference_m: Option<f64>,
}

/// Casts both kinds of rays of a square image of `side` pixels, with our code and with Embree.
pub(super) fn measure(
    mesh: &TriMesh,
    view: &Pose,
    side: usize,
    python: &Path,
) -> Result<(Vec<RayRow>, Option<String>)> {
    let mut stage = Stage::new();
    stage.add_mesh(mesh, 1, &Appearance::matte([128; 3]))?;
    let camera = Camera::centred(side, side, 1.2);
    let eye = view.translation.as_vec3();
    let ahead: Vec<(Vec3, Vec3)> = (0..side * side)
        .map(|i| (eye, (view.rotation * camera.ray((i % side) as f64, (i / side) as f64)).as_vec3()))
        .collect();
    let away: Vec<(Vec3, Vec3)> = ahead
        .iter()
        .enumerate()
        .map(|(i, (o, d))| {
            let t = stage.cast(*o, *d).map_or(0.1, |m| m.t);
            // From a millimetre before the hit, in a direction of a golden spiral over the sphere,
            // far from that of its neighbour.
            let turn = i as f32 * 2.399_963_2;
            let z = 1.0 - 2.0 * ((i * 7_919) % 10_007) as f32 / 10_007.0;
            let r = (1.0 - z * z).max(0.0).sqrt();
            (*o + *d * (t - 1e-3 / d.length()), Vec3::new(r * turn.cos(), r * turn.sin(), z))
        })
        .collect();
    let one = ThreadPoolBuilder::new().num_threads(1).build().map_err(|e| Error::Format(e.to_string()))?;
    let mut rows = Vec::new();
    let mut failure = None;
    for (kind, rays) in [("camera", &ahead), ("scattered", &away)] {
        let mut seconds = f64::INFINITY;
        let mut ours = Vec::new();
        for _ in 0..TRIES {
            let clock = Instant::now();
            ours = one.install(|| {
                rays.iter().map(|(o, d)| stage.cast(*o, *d).map_or(f32::INFINITY, |m| m.t)).collect::<Vec<_>>()
            });
            seconds = seconds.min(clock.elapsed().as_secs_f64());
        }
        let mut row = RayRow {
            kind,
            rays: rays.len(),
            rays_per_second: rays.len() as f64 / seconds,
            embree_rays_per_second: None,
            ratio: None,
            differing: None,
            compared: None,
            largest_difference_m: None,
        };
        match (Embree { python, tries: TRIES }).cast(mesh, rays) {
            Ok(theirs) => row.compare(rays, &ours, &theirs, side),
            Err(why) => failure = Some(why),
        }
        rows.push(row);
    }
    Ok((rows, failure))
}

impl RayRow {
    fn compare(&mut self, rays: &[(Vec3, Vec3)], ours: &[f32], theirs: &EmbreeRows, width: usize) {
        let per_second = rays.len() as f64 / theirs.seconds;
        self.embree_rays_per_second = Some(per_second);
        self.ratio = Some(self.rays_per_second / per_second);
        // An edge: a neighbour misses, or its distance differs by more than a twentieth.
        let inner = |i: usize| {
            let (u, v) = (i % width, i / width);
            if u == 0 || v == 0 || u + 1 == width || v + 1 == width {
                return false;
            }
            let here = theirs.distances[i];
            let alike = |j: usize| {
                let there = theirs.distances[j];
                here.is_finite() == there.is_finite() && (here.is_infinite() || (here - there).abs() < 0.05 * here)
            };
            [i - width - 1, i - width, i - width + 1, i - 1, i + 1, i + width - 1, i + width, i + width + 1]
                .into_iter()
                .all(alike)
        };
        let camera = self.kind == "camera";
        let (mut compared, mut differing, mut largest) = (0, 0, 0.0_f64);
        for i in 0..rays.len() {
            if camera && !inner(i) {
                continue;
            }
            compared += 1;
            let (a, b) = (ours[i], theirs.distances[i]);
            if a.is_finite() != b.is_finite() {
                differing += 1;
            } else if a.is_finite() {
                largest = largest.max(f64::from((a - b).abs() * rays[i].1.length()));
            }
        }
        (self.compared, self.differing, self.largest_difference_m) = (Some(compared), Some(differing), Some(largest));
    }
}

/// All organs as one mesh.
pub(super) fn merged(organs: &[TriMesh]) -> TriMesh {
    let mut whole = TriMesh::default();
    for organ in organs {
        let first = whole.vertices.len() as u32;
        whole.vertices.extend(&organ.vertices);
        whole.triangles.extend(organ.triangles.iter().map(|t| t.map(|v| v + first)));
    }
    whole
}
