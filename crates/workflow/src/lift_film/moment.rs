//! What is drawn at one moment of a lift: landmarks, grasp and profile, measured or simulated.

use glam::DVec3;
use trocar_geometry::Skin;
use trocar_identify::{Lifted, LoneOrgan, SeenLift};
use trocar_measure::{LiftProfile, MeasuredLift, rmse};

/// From this share of the way on, the simulated lift is shown at its top: the filmed one is held
/// there, and its tracks tremble.
const TOP: f64 = 0.985;

/// A lift at one moment, in the frame of the camera.
#[derive(Clone, Debug)]
pub(super) struct Moment {
    /// Where each landmark is (m); `None` where it is hidden.
    pub landmarks: Vec<Option<DVec3>>,
    /// Where the grasped place was at rest and is now (m).
    pub grasp: Option<[DVec3; 2]>,
    /// The lift along the organ.
    pub profile: Option<LiftProfile>,
    /// Root mean square error of the landmarks' motions (m), of a simulated lift.
    pub error: Option<f64>,
}

impl Moment {
    /// The measured lift in a frame.
    pub fn measured(lift: &MeasuredLift, frame: usize) -> Self {
        let moved = lift.landmarks_in(frame);
        let apex = lift.profile.as_ref().and_then(|p| lift.motion_at(p.apex_at, frame));
        Self {
            landmarks: lift.landmarks.iter().zip(moved).map(|(l, moved)| Some(l.rest + moved?)).collect(),
            grasp: apex.map(|a| [a.rest, a.rest + a.displacement]),
            profile: lift.profile_in(frame),
            error: None,
        }
    }

    /// The simulated lift beside the measured one in a frame. `marks` binds the landmarks and then
    /// the grasped place to the organ.
    pub fn simulated(
        (seen, organ, marks): (&SeenLift, &LoneOrgan, &Skin),
        rest: &Lifted,
        now: &Lifted,
        frame: usize,
    ) -> Self {
        let (mut landmarks, before) = (organ.places_of(now, marks), organ.places_of(rest, marks));
        let grasp = before.last().copied().zip(landmarks.pop()).map(|(before, now)| [before, now]);
        let motions: Vec<Option<DVec3>> = seen.motions(organ, now, &seen.landmarks).into_iter().map(Some).collect();
        Self {
            landmarks: landmarks.into_iter().map(Some).collect(),
            grasp,
            profile: organ.profile(now),
            error: rmse(&motions, &seen.lift.landmarks_in(frame)),
        }
    }
}

/// Shares of the way that the apex has gone in frames, from 0 to 1. They rise as far as the peak;
/// where the apex is not seen, it stays.
pub(super) fn shares(lift: &MeasuredLift, frames: &[usize]) -> Vec<f64> {
    let way = lift.apex.map_or(DVec3::ZERO, |a| a.displacement);
    let along = |frame: usize| -> Option<f64> {
        let moved = lift.motion_at(lift.profile.as_ref()?.apex_at, frame)?.displacement;
        Some(moved.dot(way) / way.length_squared().max(f64::MIN_POSITIVE))
    };
    let mut last = 0.0;
    let share = |frame: &usize| {
        last = match along(*frame) {
            Some(share) if share >= TOP => 1.0,
            Some(share) => share.max(0.0),
            None => last,
        };
        // Before the lift begins, the tracks tremble too.
        if *frame < lift.info.first { 0.0 } else { last }
    };
    frames.iter().map(share).collect()
}
