//! The figures of measured lifts, in millimetres.

use crate::lift::MeasuredLift;
use crate::line::Line;
use serde::Serialize;

/// The figures of one lift.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LiftFigures {
    /// The frame before the grasp.
    pub rest: usize,
    /// The frame of the greatest lift.
    pub peak: usize,
    /// Greatest lift over the plane of the surroundings since the frame at rest (mm).
    pub lift_mm: Option<f64>,
    /// Height of the apex over that plane (mm).
    pub height_mm: Option<f64>,
    /// Distance that the apex has moved (mm).
    pub displacement_mm: Option<f64>,
    /// Place of the apex along the organ (mm).
    pub apex_at_mm: Option<f64>,
    /// Length of the visible centreline (mm).
    pub length_mm: f64,
    /// Half-drop distance (mm).
    pub d50_mm: Option<f64>,
    /// Half-drop distance towards the base (mm).
    pub half_drop_base_mm: Option<f64>,
    /// Half-drop distance towards the tip (mm).
    pub half_drop_tip_mm: Option<f64>,
    /// Number of landmarks.
    pub landmarks: usize,
    /// Number of landmarks that are seen at rest and at the peak.
    pub landmarks_seen: usize,
    /// Landmark error of no motion (mm).
    pub static_rmse_mm: Option<f64>,
    /// Landmark error if all landmarks move like the apex (mm).
    pub rigid_rmse_mm: Option<f64>,
    /// Landmark difference between two frames at the peak (mm).
    pub landmark_floor_mm: Option<f64>,
    /// Local Chamfer distance of no motion (mm).
    pub static_chamfer_mm: Option<f64>,
    /// Local Chamfer distance if all points move like the apex (mm).
    pub rigid_chamfer_mm: Option<f64>,
    /// Local Chamfer distance between two frames at the peak (mm).
    pub chamfer_floor_mm: Option<f64>,
    /// Share of the surrounding points within 3 mm of the plane.
    pub plane_inlier_share: f64,
    /// Root mean square distance of these points from the plane (mm).
    pub plane_rms_mm: f64,
    /// Share of the tracked points that are seen at the peak.
    pub seen_share: f64,
    /// Distance from the apex, negative towards the base (mm), and lift over the greatest lift.
    pub profile: Vec<[f64; 2]>,
}

impl LiftFigures {
    /// Of a lift.
    pub fn of(lift: &MeasuredLift) -> Self {
        let mm = |m: f64| 1e3 * m;
        let profile = lift.profile.as_ref();
        let references = lift.references();
        let [base, tip] = profile.map_or([None; 2], |p| p.half_drop);
        Self {
            rest: lift.info.rest,
            peak: lift.peak,
            lift_mm: profile.map(|p| mm(p.apex)),
            height_mm: lift.apex.map(|a| mm(lift.plane.height(a.rest + a.displacement))),
            displacement_mm: lift.apex.map(|a| mm(a.displacement.length())),
            apex_at_mm: profile.map(|p| mm(p.apex_at)),
            length_mm: mm(lift.centreline.length()),
            d50_mm: profile.and_then(|p| p.d50()).map(mm),
            half_drop_base_mm: base.map(mm),
            half_drop_tip_mm: tip.map(mm),
            landmarks: lift.landmarks.len(),
            landmarks_seen: lift.landmarks.iter().filter(|l| l.moved.is_some()).count(),
            static_rmse_mm: references.rmse_static.map(mm),
            rigid_rmse_mm: references.rmse_rigid.map(mm),
            landmark_floor_mm: references.rmse_floor.map(mm),
            static_chamfer_mm: references.chamfer_static.map(mm),
            rigid_chamfer_mm: references.chamfer_rigid.map(mm),
            chamfer_floor_mm: references.chamfer_floor.map(mm),
            plane_inlier_share: lift.plane.inliers as f64 / lift.plane.points.max(1) as f64,
            plane_rms_mm: mm(lift.plane.rms),
            seen_share: lift.seen_share(),
            profile: profile.map(normalised).unwrap_or_default(),
        }
    }

    /// The line of d50 over lift (mm) through lifts that have both.
    pub fn line(lifts: &[Self]) -> Option<Line> {
        let pairs: Vec<(f64, f64)> = lifts.iter().filter_map(|l| Some((l.lift_mm?, l.d50_mm?))).collect();
        Line::through(&pairs)
    }
}

/// The profile as distances from the apex (mm) and shares of the greatest lift.
pub fn normalised(profile: &crate::LiftProfile) -> Vec<[f64; 2]> {
    let place = |i: usize| 1e3 * (i as f64 * profile.spacing - profile.apex_at);
    (0..profile.lift.len()).map(|i| [place(i), profile.lift[i] / profile.apex]).collect()
}
