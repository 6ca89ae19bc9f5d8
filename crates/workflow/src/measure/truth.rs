//! Measured lifts of a phantom against their truth.

use crate::{Error, Result};
use glam::DVec3;
use serde::Serialize;
use std::path::Path;
use trocar_geometry::{MeshDistance, TriMesh};
use trocar_measure::{LiftProfile, MeasuredLift, SPACING};
use trocar_phantom::LiftTruth;
use trocar_reconstruct::truth::quantile;

/// A measured lift beside its truth.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LiftTruthFigures {
    /// Median distance of tracked points from where they are, over all points and frames of the
    /// lift (mm).
    pub tracking_error_mm_median: Option<f64>,
    /// 95th percentile of these distances (mm).
    pub tracking_error_mm_p95: Option<f64>,
    /// Greatest lift of the true front (mm).
    pub lift_mm: Option<f64>,
    /// Half-drop distance of the true front (mm).
    pub d50_mm: Option<f64>,
    /// Displacement of the held tissue (mm).
    pub displacement_mm: f64,
    /// Place of the grasp along the organ, 0 at its base and 1 at its tip.
    pub grasp_s: f64,
}

/// Compares a lift with its truth in the folder `truth`. Also returns the distances of all tracked
/// points (mm).
pub fn against_truth(
    lift: &MeasuredLift,
    known: &LiftTruth,
    number: usize,
    truth: &Path,
) -> Result<(LiftTruthFigures, Vec<f64>)> {
    let surfaces = known.surfaces(truth, number)?;
    let errors = tracking_errors(lift, known, &surfaces)?;
    let profile = true_profile(lift, known, number, truth)?;
    let displacement = DVec3::from(known.displacement_m);
    let figures = LiftTruthFigures {
        tracking_error_mm_median: quantile(&errors, 0.5),
        tracking_error_mm_p95: quantile(&errors, 0.95),
        lift_mm: profile.as_ref().map(|p| 1e3 * p.apex),
        d50_mm: profile.as_ref().and_then(LiftProfile::d50).map(|d| 1e3 * d),
        displacement_mm: 1e3 * displacement.length(),
        grasp_s: known.grasp_s,
    };
    Ok((figures, errors))
}

/// Distances between tracked points and where the points of the surface are that were nearest to
/// them at rest (mm).
fn tracking_errors(lift: &MeasuredLift, known: &LiftTruth, surfaces: &[TriMesh]) -> Result<Vec<f64>> {
    let (Some(rest), Some(start)) = (surfaces.first(), lift.tracks.row(lift.info.rest)) else {
        return Ok(Vec::new());
    };
    let shape = MeshDistance::new(rest)?;
    let nearest = |p: DVec3| {
        let distance = |i: &usize| rest.vertices[*i].distance_squared(p);
        (0..rest.vertices.len()).min_by(|a, b| distance(a).total_cmp(&distance(b))).unwrap_or(0)
    };
    let bound: Vec<Option<(DVec3, usize)>> =
        start.iter().map(|p| p.map(|p| shape.closest_point(p)).map(|p| (p, nearest(p)))).collect();
    let mut errors = Vec::new();
    for frame in lift.tracks.frames.iter().copied().filter(|f| *f >= lift.info.first) {
        let (a, b, t) = known.between(frame);
        let Some(row) = lift.tracks.row(frame) else { continue };
        for (found, bound) in row.iter().zip(&bound) {
            if let (Some(found), Some((p, vertex))) = (found, bound) {
                let now = surfaces[a].vertices[*vertex].lerp(surfaces[b].vertices[*vertex], t);
                errors.push(1e3 * found.distance(*p + now - rest.vertices[*vertex]));
            }
        }
    }
    Ok(errors)
}

/// The profile of the true front over the measured plane, at the measured peak.
fn true_profile(lift: &MeasuredLift, known: &LiftTruth, number: usize, truth: &Path) -> Result<Option<LiftProfile>> {
    let path = truth.join(format!("lift-{number}")).join("centreline.csv");
    let wrong = |e: csv::Error| Error::Mismatch(format!("{}: {e}", path.display()));
    let mut heights: [Vec<f64>; 2] = Default::default();
    let mut reader = csv::Reader::from_path(&path).map_err(wrong)?;
    for row in reader.deserialize() {
        let (frame, _, _, _, _, x, y, z): (usize, f64, f64, f64, f64, f64, f64, f64) = row.map_err(wrong)?;
        let height = lift.plane.height(DVec3::new(x, y, z));
        heights[0].extend((frame == known.rest).then_some(height));
        heights[1].extend((frame == lift.peak).then_some(height));
    }
    let rises: Vec<Option<f64>> = heights[0].iter().zip(&heights[1]).map(|(a, b)| Some(b - a)).collect();
    Ok(LiftProfile::of(&rises, SPACING))
}
