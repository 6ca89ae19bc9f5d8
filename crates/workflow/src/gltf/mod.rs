//! An episode as a glTF file, which other programs show without a reader of ours.
//!
//! The cell's bodies are nodes with animated poses. Organs deform by morph targets, one per
//! keyframe, each at weight 1 at its time and 0 at the others: a viewer blends two neighbours. A
//! cut gives an organ another surface: that is a mesh of its own, which is shown (scale 1) from the
//! keyframe after the cut on, and hidden (scale 0) before.

mod document;

use crate::surfaces::RecordedEpisode;
use crate::{Error, Result, check_interrupted};
use document::{Document, Material, Track};
use glam::DVec3;
use std::path::Path;
use std::sync::Arc;
use trocar_core::{Pose, Progress};
use trocar_geometry::TriMesh;
use trocar_render::{Appearance, SurfaceKind, srgb};
use trocar_sensors::DrawnCell;

/// Most keyframes of a file: each is a copy of every surface that moves.
pub const MAX_KEYFRAMES: usize = 64;

/// Vertices that move less than this (m) do not move: the grid of recorded surfaces is as fine.
const STILL: f64 = 1e-5;

/// Summary of the written file.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct GltfSummary {
    /// Number of keyframes.
    pub keyframes: usize,
    /// Length of the animation (s).
    pub length_s: f64,
    /// Size of the file (bytes).
    pub bytes: usize,
}

/// A surface of an organ between two cuts.
struct Surface {
    name: String,
    mesh: Arc<TriMesh>,
    /// The first keyframe that shows it.
    first: usize,
    /// Positions of its vertices at each of its keyframes (m).
    positions: Vec<Vec<DVec3>>,
}

/// Writes `episode` from its start as a binary glTF file (`.glb`) of at most `keyframes` moments,
/// evenly spaced.
///
/// # Errors
/// Fewer than two or more than [`MAX_KEYFRAMES`] keyframes, a damaged recording, an interruption, a
/// file that cannot be written.
pub fn write_gltf(
    episode: &mut RecordedEpisode,
    path: &Path,
    keyframes: usize,
    progress: &dyn Progress,
) -> Result<GltfSummary> {
    if !(2..=MAX_KEYFRAMES).contains(&keyframes) {
        return Err(Error::Mismatch(format!("{keyframes} keyframes; a glTF file has from 2 to {MAX_KEYFRAMES}")));
    }
    let mut drawn = episode.drawn_cell()?;
    let last = episode.header().frames.saturating_sub(1);
    let count = keyframes.min(last + 1);
    let chosen: Vec<usize> = (0..count).map(|k| k * last / (count - 1).max(1)).collect();
    let (mut times, mut poses, mut surfaces) = (Vec::new(), Vec::new(), Vec::<Surface>::new());
    for frame in 0..=last {
        check_interrupted(progress)?;
        if frame > 0 && !episode.advance()? {
            break;
        }
        if !chosen.contains(&frame) {
            continue;
        }
        let now = episode.now();
        poses.push(drawn.poses_of(&now.arms));
        for (name, (mesh, positions)) in episode.header().organs.iter().zip(&now.organs) {
            let known = surfaces.iter_mut().rev().find(|surface| surface.name == *name);
            match known.filter(|known| Arc::ptr_eq(&known.mesh, mesh) || known.mesh.triangles == mesh.triangles) {
                Some(known) => known.positions.push(positions.clone()),
                None => surfaces.push(Surface {
                    name: name.clone(),
                    mesh: Arc::clone(mesh),
                    first: times.len(),
                    positions: vec![positions.clone()],
                }),
            }
        }
        times.push(now.time_s);
    }
    let mut document = Document::new(episode.header().prompt.clone());
    add_bodies(&mut document, &mut drawn, &times, &poses);
    for surface in &surfaces {
        add_surface(&mut document, surface, &times);
    }
    let bytes = document.into_bytes()?;
    std::fs::write(path, &bytes).map_err(|source| Error::Io { path: path.to_owned(), source })?;
    Ok(GltfSummary { keyframes: times.len(), length_s: times.last().copied().unwrap_or(0.0), bytes: bytes.len() })
}

/// Adds what is rigid, with its poses at each keyframe.
fn add_bodies(document: &mut Document, drawn: &mut DrawnCell, times: &[f64], poses: &[Vec<Pose>]) {
    let meshes: Vec<usize> = drawn
        .meshes
        .iter()
        .map(|own| document.mesh(&own.name, &own.mesh, &own.mesh.vertices, &[], &material(&own.appearance)))
        .collect();
    let mut moving = 0;
    for body in &drawn.bodies {
        let name = &drawn.meshes[body.mesh].name;
        let still = body.part == trocar_sensors::DrawnPart::Fixed;
        let own: Vec<Pose> = if still { vec![Pose::IDENTITY] } else { poses.iter().map(|all| all[moving]).collect() };
        moving += usize::from(!still);
        let node = document.node(name, meshes[body.mesh], &own[0]);
        if own.iter().any(|pose| *pose != own[0]) {
            document.animate(node, times, &Track::Poses(&own));
        }
    }
}

/// Adds a surface of an organ with its shapes.
fn add_surface(document: &mut Document, surface: &Surface, times: &[f64]) {
    let Surface { name, mesh, first, positions } = surface;
    let start = &positions[0];
    let moves = |shape: &Vec<DVec3>| shape.iter().zip(start).any(|(a, b)| a.distance(*b) > STILL);
    let deforms = positions.iter().any(moves);
    let targets = if deforms { &positions[1..] } else { &[] };
    let wet = Material { color: [1.0; 3], roughness: 0.35, metallic: 0.0 };
    let index = document.mesh(name, mesh, start, targets, &wet);
    let node = document.node(name, index, &Pose::IDENTITY);
    let own = &times[*first..*first + positions.len()];
    if deforms {
        document.animate(node, own, &Track::Weights(targets.len()));
    }
    if own.len() < times.len() {
        let shown: Vec<bool> = (0..times.len()).map(|k| (*first..*first + own.len()).contains(&k)).collect();
        document.animate(node, times, &Track::Shown(&shown));
    }
}

fn material(appearance: &Appearance) -> Material {
    let color = srgb::to_linear(appearance.color);
    match appearance.surface {
        SurfaceKind::Matte => Material { color, roughness: 1.0, metallic: 0.0 },
        SurfaceKind::Coated { roughness, .. } => Material { color, roughness, metallic: 0.0 },
        SurfaceKind::Metal { roughness } => Material { color, roughness, metallic: 1.0 },
    }
}
