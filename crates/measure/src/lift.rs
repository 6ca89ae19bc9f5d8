//! One grasp-lift in a film.

use crate::centreline::{Centreline, SPACING};
use crate::chamfer::{LOCAL, chamfer};
use crate::film::Film;
use crate::landmarks::{Landmark, displacements, rmse};
use crate::plane::Plane;
use crate::profile::LiftProfile;
use crate::smooth::smooth;
use crate::surroundings::surroundings;
use crate::track::Tracks;
use crate::{Error, Result};
use glam::{DVec2, DVec3};
use trocar_camera::Mask;
use trocar_core::Progress;
use trocar_core::median;
use trocar_recording::LiftInfo;

/// Tracked points at each place along the organ, in half widths from its middle.
const ACROSS: [f64; 5] = [-0.5, -0.25, 0.0, 0.25, 0.5];

/// Share of the places that lie below the lift of a frame, by which the frame at the top is found.
const TOP_SHARE: f64 = 0.95;

/// A tracked point of the organ's front.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfacePoint {
    /// Index of its place along the organ.
    pub station: usize,
    /// Distance from the middle, in half widths.
    pub across: f64,
}

/// How the tissue at the apex has moved.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ApexMotion {
    /// Where it was at rest (m).
    pub rest: DVec3,
    /// How far it has moved (m).
    pub displacement: DVec3,
}

/// A measured lift.
#[derive(Clone, Debug)]
pub struct MeasuredLift {
    /// Its frames and click.
    pub info: LiftInfo,
    /// The plane through the tissue around the organ, at rest.
    pub plane: Plane,
    /// The organ's centreline at rest.
    pub centreline: Centreline,
    /// The tracked points.
    pub points: Vec<SurfacePoint>,
    /// Their tracks.
    pub tracks: Tracks,
    /// The frame of the greatest lift.
    pub peak: usize,
    /// A frame beside it, for the measurement floor.
    pub beside: usize,
    /// The lift along the organ at the peak; `None` if too little is seen.
    pub profile: Option<LiftProfile>,
    /// Motion of the apex at the peak.
    pub apex: Option<ApexMotion>,
    /// Landmarks along the centreline.
    pub landmarks: Vec<Landmark>,
}

impl MeasuredLift {
    /// Measures the lift `info` in `film`. `mask` shows the organ at rest; its base is near the
    /// pixel `base`.
    ///
    /// # Errors
    /// A film that cannot be read, an organ without centreline or surroundings, an interruption.
    pub fn of(
        film: &mut dyn Film,
        info: &LiftInfo,
        mask: &Mask,
        base: Option<[f64; 2]>,
        progress: &dyn Progress,
    ) -> Result<Self> {
        let (camera, up) = (film.camera(), film.up());
        let wrong = |reason: String| Error::Organ { frame: info.rest, reason };
        let rest = film.frame(info.rest)?;
        if (mask.width, mask.height) != (camera.width, camera.height) {
            return Err(wrong("the organ's mask has another size than the frame".into()));
        }
        let mut free = mask.clone();
        free.set.iter_mut().zip(&rest.instruments.set).for_each(|(set, hidden)| *set &= !hidden);
        let centreline =
            Centreline::of(&free, &rest.depth, &camera, info.click.into(), base.map(DVec2::from)).map_err(wrong)?;
        let around = surroundings(mask, &rest.instruments, &rest.depth, &camera);
        let plane = Plane::through(&around, up)
            .ok_or_else(|| wrong("there is no tissue with depth around the organ".into()))?;
        let points: Vec<SurfacePoint> = (0..centreline.stations.len())
            .flat_map(|station| ACROSS.map(|across| SurfacePoint { station, across }))
            .collect();
        let pixel = |p: &SurfacePoint| {
            let station = &centreline.stations[p.station];
            station.pixel + station.across * (p.across * station.half_width)
        };
        let pixels: Vec<DVec2> = points.iter().map(pixel).collect();
        let tracks = Tracks::follow(film, info.rest, info.last, &pixels, progress)?;
        let mut measured = Self {
            info: info.clone(),
            plane,
            centreline,
            points,
            tracks,
            peak: info.last,
            beside: info.last,
            profile: None,
            apex: None,
            landmarks: Vec::new(),
        };
        measured.find_peak();
        measured.profile = measured.profile_in(measured.peak);
        measured.apex =
            measured.profile.as_ref().and_then(|profile| measured.motion_at(profile.apex_at, measured.peak));
        measured.landmarks = measured.find_landmarks();
        Ok(measured)
    }

    /// The motion of each point from the frame at rest to another one (m); `None` where it is not
    /// seen in both.
    pub fn motion(&self, frame: usize) -> Vec<Option<DVec3>> {
        let (rest, now) = (self.tracks.row(self.info.rest), self.tracks.row(frame));
        let at = |row: Option<&[Option<DVec3>]>, i: usize| row.and_then(|row| row[i]);
        (0..self.points.len()).map(|i| Some(at(now, i)? - at(rest, i)?)).collect()
    }

    /// Rise of each place over the plane from the frame at rest to another one (m): the median of
    /// its points.
    pub fn lifts_in(&self, frame: usize) -> Vec<Option<f64>> {
        let rise: Vec<Option<f64>> = self.motion(frame).iter().map(|d| d.map(|d| d.dot(self.plane.normal))).collect();
        self.per_station(&rise)
    }

    /// The lift along the organ in a frame; `None` if too little is seen or nothing rises.
    pub fn profile_in(&self, frame: usize) -> Option<LiftProfile> {
        LiftProfile::of(&self.lifts_in(frame), SPACING)
    }

    /// The medians of the values of the points at each place.
    fn per_station(&self, values: &[Option<f64>]) -> Vec<Option<f64>> {
        let mut gathered = vec![Vec::new(); self.centreline.stations.len()];
        for (point, value) in self.points.iter().zip(values) {
            gathered[point.station].extend(*value);
        }
        gathered.into_iter().map(median).collect()
    }

    /// Finds the frame with the greatest lift, and one beside it.
    fn find_peak(&mut self) {
        let mut best = f64::NEG_INFINITY;
        let frames = self.tracks.frames.clone();
        for frame in frames.iter().copied().filter(|f| *f >= self.info.first) {
            let mut lifts: Vec<f64> = self.lifts_in(frame).into_iter().flatten().collect();
            lifts.sort_by(f64::total_cmp);
            let at = (TOP_SHARE * lifts.len().saturating_sub(1) as f64).round() as usize;
            if let Some(lift) = lifts.get(at)
                && *lift > best
            {
                (best, self.peak) = (*lift, frame);
            }
        }
        let after = frames.iter().copied().find(|f| *f > self.peak);
        let before = frames.iter().copied().rfind(|f| *f < self.peak && *f >= self.info.first);
        self.beside = after.or(before).unwrap_or(self.peak);
    }

    /// Position at rest of the place `along` the organ, and its motion from there to a frame (m),
    /// bridged where it is hidden.
    pub fn motion_at(&self, along: f64, frame: usize) -> Option<ApexMotion> {
        let motion = self.motion(frame);
        let mut displacement = DVec3::ZERO;
        for axis in 0..3 {
            let values: Vec<Option<f64>> = motion.iter().map(|d| d.map(|d| d[axis])).collect();
            let curve = smooth(&self.per_station(&values))?;
            displacement[axis] = interpolated(&curve, along / SPACING, |a, b, t| a + (b - a) * t);
        }
        let line: Vec<DVec3> = self.centreline.stations.iter().map(|s| s.point).collect();
        Some(ApexMotion { rest: interpolated(&line, along / SPACING, |a, b, t| a.lerp(b, t)), displacement })
    }

    /// Points of the surface that are seen at rest and in `frame` (m), and lie at rest within
    /// [`LOCAL`] of the apex: at rest and in the frame. None without an apex.
    pub fn surface(&self, frame: usize) -> Vec<(DVec3, DVec3)> {
        let (rest, now) = (self.tracks.row(self.info.rest), self.tracks.row(frame));
        let (Some(rest), Some(now), Some(apex)) = (rest, now, self.apex) else { return Vec::new() };
        let pairs = rest.iter().zip(now).filter_map(|(a, b)| Some(((*a)?, (*b)?)));
        pairs.filter(|(rest, _)| rest.distance(apex.rest) <= LOCAL).collect()
    }

    /// Share of the tracked points that are seen at the peak.
    pub fn seen_share(&self) -> f64 {
        let seen = self.tracks.row(self.peak).map_or(0, |row| row.iter().flatten().count());
        seen as f64 / self.points.len().max(1) as f64
    }

    /// Root mean square error of the landmarks (m) for a prediction of their motions (m).
    pub fn landmark_rmse(&self, predicted: &[Option<DVec3>]) -> Option<f64> {
        rmse(predicted, &displacements(&self.landmarks))
    }

    /// The paper's references: no motion, all landmarks move like the apex, and two frames at the
    /// peak (m).
    pub fn references(&self) -> References {
        let moved = displacements(&self.landmarks);
        let beside: Vec<Option<DVec3>> = self.landmarks.iter().map(|l| l.beside).collect();
        let all = |by: DVec3| vec![Some(by); moved.len()];
        let surface = self.surface(self.peak);
        let (rest, now): (Vec<DVec3>, Vec<DVec3>) = surface.iter().copied().unzip();
        let next: Vec<DVec3> = self.surface(self.beside).into_iter().map(|p| p.1).collect();
        let apex = self.apex;
        let around = |points: &[DVec3]| chamfer(points, &now);
        let shifted = |by: DVec3| rest.iter().map(|p| *p + by).collect::<Vec<_>>();
        References {
            rmse_static: self.landmark_rmse(&all(DVec3::ZERO)),
            rmse_rigid: apex.and_then(|apex| self.landmark_rmse(&all(apex.displacement))),
            rmse_floor: rmse(&beside, &moved),
            chamfer_static: around(&rest),
            chamfer_rigid: apex.and_then(|apex| around(&shifted(apex.displacement))),
            chamfer_floor: around(&next),
        }
    }
}

/// What predictions are compared with (m); `None` where too little is seen.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct References {
    /// Landmark error of no motion.
    pub rmse_static: Option<f64>,
    /// Landmark error if all landmarks move like the apex.
    pub rmse_rigid: Option<f64>,
    /// Landmark difference between two frames at the peak.
    pub rmse_floor: Option<f64>,
    /// Local Chamfer distance of no motion.
    pub chamfer_static: Option<f64>,
    /// Local Chamfer distance if all points move like the apex.
    pub chamfer_rigid: Option<f64>,
    /// Local Chamfer distance between two frames at the peak.
    pub chamfer_floor: Option<f64>,
}

/// A value between neighbours; the first or last beyond the ends.
fn interpolated<T: Copy>(values: &[T], at: f64, mix: impl Fn(T, T, f64) -> T) -> T {
    let last = values.len() - 1;
    let at = at.clamp(0.0, last as f64);
    let i = (at as usize).min(last.saturating_sub(1));
    mix(values[i], values[(i + 1).min(last)], at - i as f64)
}
