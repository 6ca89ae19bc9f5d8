//! The test motion of the controller grid: both arms of the paper's cell at their start poses, free
//! motion, a load on the tip, rest.

use crate::Result;
use glam::{DQuat, DVec3};
use serde::{Deserialize, Serialize};
use std::f64::consts::{FRAC_PI_2, TAU};
use trocar_core::{Pose, Wrench};
use trocar_robot::chain::SerialArm;
use trocar_robot::instrument::{Coordinates, Instrument};
use trocar_robot::manipulator::{ControllerSettings, Manipulator};
use trocar_robot::port::{Deviation, Port};

/// Physics steps and commands per second.
const PHYSICS: usize = 480;
const COMMANDS: usize = 30;
const DT: f64 = 1.0 / PHYSICS as f64;

/// The paper's arms: side, tilt at the start (degrees).
const ARMS: [(f64, f64); 2] = [(-1.0, 13.3), (1.0, 18.3)];
/// Insertion at the start (m).
const INSERTION: f64 = 0.1;

/// Corners of the straight moves, relative to the start (mm), each reached in [`LEG`] seconds.
const CORNERS: [[f64; 3]; 5] = [[0.0; 3], [20.0, 12.0, 10.0], [-10.0, 18.0, -12.0], [-16.0, -12.0, 8.0], [0.0; 3]];
const LEG: f64 = 1.4;
/// Sums of sines: amplitude (mm) and frequency (Hz) along x, y and z.
const SINES: [[(f64, f64); 2]; 3] = [[(9.0, 0.35), (2.0, 1.1)], [(8.0, 0.45), (2.0, 0.9)], [(6.0, 0.3), (1.5, 1.3)]];

/// Ends of the phases (s): rest until the error of gravity has settled, corners, sines, a load of 1
/// N on the tip during a move between two corners, rest.
const SETTLED: f64 = 1.0;
const CORNERS_END: f64 = SETTLED + 4.0 * LEG;
const SINES_END: f64 = CORNERS_END + 6.0;
const LOAD_END: f64 = SINES_END + 3.0;
const END: f64 = LOAD_END + 2.5;
/// Droop is measured over the end of the rest (s).
const AT_REST: f64 = 0.5;
/// The load (N), and the duration of its ramps (s).
const LOAD: f64 = 1.0;
const LOAD_RAMP: f64 = 0.2;
/// Maximum delay of the search (s).
const MAX_LAG: f64 = 0.12;
/// Impulses on the tip: force (N), duration (s), pause after each (s).
const IMPULSE: f64 = 25.0;
const IMPULSE_TIME: f64 = 0.05;
const IMPULSE_REST: f64 = 1.5;
/// Then the command steps by these pivots (rad), insertion (m) and roll (rad) from the start,
/// faster than an arm can follow.
const COMMAND_STEPS: [[f64; 4]; 6] = [
    [0.2, -0.1, 0.05, 0.8],
    [-0.2, 0.2, 0.15, -0.6],
    [0.1, 0.15, -0.04, 0.9],
    [-0.1, -0.2, 0.1, -0.9],
    [0.2, 0.2, 0.0, 0.5],
    [0.0, 0.0, 0.0, 0.0],
];
const COMMAND_STEP_LENGTH: usize = 160;
const COMMAND_STEP_REST: f64 = 2.0;
/// The arm has recovered if the shaft is this close to the centre of the port after a rest (m).
const MAX_RESIDUAL: f64 = 1e-3;
/// A stable arm stays below the RCM deviation that hardware allows (m) and comes to rest (rad/s).
const MAX_DEVIATION: f64 = trocar_robot::port::RCM_ABORT;
const MAX_REST_SPEED: f64 = 2e-3;

/// Figures of a controller, over both arms.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ControllerFigures {
    /// 95th percentile of the RCM deviation over all steps after settling (mm).
    pub rcm_p95_mm: f64,
    /// Peak of the RCM deviation (mm).
    pub rcm_peak_mm: f64,
    /// RMS distance in free motion between the reference of the tip and the measured tip at equal
    /// times (mm).
    pub tracking_rms_mm: f64,
    /// Delay between the two that minimises the distance (s).
    pub lag_s: f64,
    /// The same distance to the raw command, which is held at 30 Hz (mm).
    pub command_rms_mm: f64,
    /// Delay behind the raw command (s).
    pub command_lag_s: f64,
    /// RMS distance between the reference and the tip at rest, of the worse arm (mm).
    pub droop_mm: f64,
    /// Largest torque of any joint (N m).
    pub torque_peak: f64,
    /// Largest torque over the limit of its joint.
    pub torque_share: f64,
    /// Peak RCM deviation under impulses of 25 N for 50 ms and steps of the command (mm); none if
    /// the arm does not recover.
    pub rough_rcm_mm: Option<f64>,
    /// RMS of the largest difference of joint speed from its reference at the end of the rest
    /// (rad/s).
    pub restless_rad_s: f64,
    /// Whether the RCM deviation stayed within the limit of the hardware, also under impulses, and
    /// the arms came to rest.
    pub stable: bool,
}

/// One step of a run.
#[derive(Clone, Debug, Serialize)]
pub struct ControllerInstant {
    /// Time (s).
    pub time_s: f64,
    /// Positions of raw command, reference and tip from the start along the first move (mm).
    pub along_mm: [f64; 3],
    /// Distance of the tip from the reference (mm).
    pub error_mm: f64,
    /// RCM deviation (mm).
    pub rcm_mm: f64,
}

/// An arm of the paper's cell in its start pose. The port is a sheet without thickness, as in the
/// paper's clearances.
fn arm((side, tilt): (f64, f64), settings: &ControllerSettings) -> Result<Manipulator> {
    let base = Pose { rotation: DQuat::from_rotation_z(FRAC_PI_2), translation: DVec3::new(0.45 * side, 0.0, 0.0) };
    let fr3 = SerialArm::franka_fr3()?.with_base(base)?;
    let instrument = if side < 0.0 { Instrument::grasper() } else { Instrument::cutter() };
    let port = Port::new(DVec3::new(0.045 * side, 0.46, 0.16), -DVec3::Z, DVec3::X)?;
    // Both tilt towards the middle.
    let pivots = [0.0, -side * tilt.to_radians()];
    let start = Coordinates { pivots, insertion: INSERTION, roll: 0.0, jaw: 0.5 };
    Ok(Manipulator::new(fr3, instrument, port, *settings, start)?)
}

/// Commanded position of the tip relative to the start at `time` (s), in metres.
fn path(time: f64) -> DVec3 {
    let corner = |k: usize| 1e-3 * DVec3::from_array(CORNERS[k.min(CORNERS.len() - 1)]);
    let smooth = |s: f64| s * s * s * (10.0 - 15.0 * s + 6.0 * s * s);
    if time < SETTLED {
        DVec3::ZERO
    } else if time < CORNERS_END {
        let legs = (time - SETTLED) / LEG;
        let k = legs.floor().min(3.0);
        corner(k as usize).lerp(corner(k as usize + 1), smooth(legs - k))
    } else if time < SINES_END {
        let t = time - CORNERS_END;
        // The amplitude ramps up and down, so that the path is continuous.
        let amplitude = smooth((t / 1.0).min(1.0)) * smooth(((SINES_END - time) / 1.0).clamp(0.0, 1.0));
        let axis = |a: usize| SINES[a].iter().map(|(size, hertz)| size * (TAU * hertz * t).sin()).sum::<f64>();
        1e-3 * amplitude * DVec3::new(axis(0), axis(1), axis(2))
    } else if time < LOAD_END {
        let s = ((time - SINES_END) / (LOAD_END - SINES_END)).clamp(0.0, 1.0);
        let there = if s < 0.5 { smooth(2.0 * s) } else { smooth(2.0 - 2.0 * s) };
        there * corner(1)
    } else {
        DVec3::ZERO
    }
}

/// Load on the tip at `time` (s).
fn load(time: f64) -> Wrench {
    let share = ((time - SINES_END) / LOAD_RAMP).min((LOAD_END - time) / LOAD_RAMP).clamp(0.0, 1.0);
    // A force across the shaft with a rotating direction.
    let turn = TAU * (time - SINES_END) / (LOAD_END - SINES_END);
    Wrench { force: LOAD * share * DVec3::new(0.8 * turn.cos(), 0.8 * turn.sin(), -0.6), torque: DVec3::ZERO }
}

/// Samples of one arm's run.
#[derive(Default)]
struct Samples {
    /// Tip in free motion: raw command, reference, measured.
    raw: Vec<DVec3>,
    reference: Vec<DVec3>,
    measured: Vec<DVec3>,
    deviation: Deviation,
    rest_squares: f64,
    speed_squares: f64,
    rest_steps: usize,
    torque: f64,
    share: f64,
}

impl Samples {
    /// Moves the arm through the test motion and calls `each` after every step. Returns whether the
    /// run was complete.
    fn run(&mut self, m: &mut Manipulator, mut each: impl FnMut(f64, DVec3, &Manipulator, f64)) -> Result<bool> {
        let start = m.measured_cp();
        let limits: Vec<f64> = m.arm().segments().iter().map(|s| s.joint.limits.effort).collect();
        let mut raw = start.translation;
        for k in 0..(END / DT).round() as usize {
            let time = k as f64 * DT;
            if k % (PHYSICS / COMMANDS) == 0 {
                raw = start.translation + path(time);
                m.servo_tip(&Pose { translation: raw, ..start }, 0.5)?;
            }
            let Ok(report) = m.step(load(time), DT) else { return Ok(false) };
            // The time at the end of the step.
            let now = time + DT;
            let (tip, reference) = (m.measured_cp().translation, m.setpoint_cp().translation);
            for (t, limit) in report.arm.torque.iter().zip(&limits) {
                self.torque = self.torque.max(t.abs());
                self.share = self.share.max(t.abs() / limit);
            }
            each(now, raw, m, report.rcm_deviation);
            if now > SETTLED {
                self.deviation.add(report.rcm_deviation)?;
            }
            if now > SETTLED && now <= SINES_END {
                self.raw.push(raw);
                self.reference.push(reference);
                self.measured.push(tip);
            }
            if now > END - AT_REST {
                self.rest_squares += tip.distance_squared(reference);
                let (is, shall) = (m.measured_js().velocity, m.setpoint_js().velocity);
                let fastest = is.iter().zip(shall.iter()).fold(0.0_f64, |f, (a, b)| f.max((a - b).abs()));
                self.speed_squares += fastest * fastest;
                self.rest_steps += 1;
            }
            if report.rcm_deviation > 10.0 * MAX_DEVIATION {
                return Ok(false);
            }
        }
        Ok(true)
    }
}

/// Mean squared distance of `behind` from `ahead` `steps` steps before (m2).
fn mean_square(ahead: &[DVec3], behind: &[DVec3], steps: usize) -> f64 {
    let pairs = ahead.iter().zip(behind.iter().skip(steps));
    let (sum, count) = pairs.fold((0.0, 0usize), |(s, n), (a, b)| (s + a.distance_squared(*b), n + 1));
    sum / count.max(1) as f64
}

/// The delay of `behind` that minimises the distance (s): the best step, refined by a parabola.
/// Negative if `behind` leads.
fn delay(ahead: &[DVec3], behind: &[DVec3]) -> f64 {
    let most = (MAX_LAG / DT) as i64;
    let at = |k: i64| {
        if k < 0 {
            mean_square(behind, ahead, k.unsigned_abs() as usize)
        } else {
            mean_square(ahead, behind, k as usize)
        }
    };
    let mut least = 0;
    for k in -4..=most {
        if at(k) < at(least) {
            least = k;
        }
    }
    let (a, b, c) = (at(least - 1), at(least), at(least + 1));
    let bend = a - 2.0 * b + c;
    let shift = if bend > 0.0 { (0.5 * (a - c) / bend).clamp(-0.5, 0.5) } else { 0.0 };
    (least as f64 + shift) * DT
}

/// Peak RCM deviation under impulses on the tip and steps of the command (m); infinite if the arm
/// does not recover.
fn disturbed(which: (f64, f64), settings: &ControllerSettings) -> Result<f64> {
    let mut m = arm(which, settings)?;
    let start = m.commanded();
    let mut peak = 0.0_f64;
    let mut steps_under = |m: &mut Manipulator, force: DVec3, steps: usize| {
        for _ in 0..steps {
            let load = Wrench { force, torque: DVec3::ZERO };
            peak = m.step(load, DT).map_or(f64::INFINITY, |r| peak.max(r.rcm_deviation));
        }
    };
    let steps = |seconds: f64| (seconds / DT).round() as usize;
    steps_under(&mut m, DVec3::ZERO, steps(SETTLED));
    for direction in [DVec3::X, DVec3::Y, -DVec3::X] {
        steps_under(&mut m, IMPULSE * direction, steps(IMPULSE_TIME));
        steps_under(&mut m, DVec3::ZERO, steps(IMPULSE_REST));
    }
    let mut back = m.rcm_deviation() < MAX_RESIDUAL;
    for [first, second, insertion, roll] in COMMAND_STEPS {
        let pivots = [start.pivots[0] + first, start.pivots[1] + second];
        m.servo_cp(&Coordinates { pivots, insertion: start.insertion + insertion, roll: start.roll + roll, ..start })?;
        steps_under(&mut m, DVec3::ZERO, COMMAND_STEP_LENGTH);
    }
    steps_under(&mut m, DVec3::ZERO, steps(COMMAND_STEP_REST));
    back &= m.rcm_deviation() < MAX_RESIDUAL;
    Ok(if back { peak } else { f64::INFINITY })
}

/// Moves both arms through the test motion.
pub(super) fn evaluate(settings: &ControllerSettings) -> Result<ControllerFigures> {
    let (mut deviations, mut stable) = (Deviation::default(), true);
    let (mut squares, mut raw_squares, mut lags, mut raw_lags) = (0.0, 0.0, 0.0, 0.0);
    let mut disturbed_peak = 0.0_f64;
    let (mut droop, mut torque, mut share, mut restless) = (0.0_f64, 0.0_f64, 0.0_f64, 0.0_f64);
    for which in ARMS {
        let mut m = arm(which, settings)?;
        let mut samples = Samples::default();
        let mut all = Vec::new();
        stable &= samples.run(&mut m, |now, _, _, deviation| {
            if now > SETTLED {
                all.push(deviation);
            }
        })?;
        all.into_iter().try_for_each(|d| deviations.add(d))?;
        let part = 1.0 / ARMS.len() as f64;
        squares += part * mean_square(&samples.reference, &samples.measured, 0);
        raw_squares += part * mean_square(&samples.raw, &samples.measured, 0);
        lags += part * delay(&samples.reference, &samples.measured);
        raw_lags += part * delay(&samples.raw, &samples.measured);
        let count = samples.rest_steps.max(1) as f64;
        droop = droop.max((samples.rest_squares / count).sqrt());
        restless = restless.max((samples.speed_squares / count).sqrt());
        (torque, share) = (torque.max(samples.torque), share.max(samples.share));
        disturbed_peak = disturbed_peak.max(disturbed(which, settings)?);
        stable &= samples.deviation.peak() < MAX_DEVIATION && disturbed_peak < MAX_DEVIATION;
    }
    Ok(ControllerFigures {
        rcm_p95_mm: 1e3 * deviations.percentile(0.95),
        rcm_peak_mm: 1e3 * deviations.peak(),
        tracking_rms_mm: 1e3 * squares.sqrt(),
        lag_s: lags,
        command_rms_mm: 1e3 * raw_squares.sqrt(),
        command_lag_s: raw_lags,
        droop_mm: 1e3 * droop,
        torque_peak: torque,
        torque_share: share,
        rough_rcm_mm: disturbed_peak.is_finite().then_some(1e3 * disturbed_peak),
        restless_rad_s: restless,
        stable: stable && restless < MAX_REST_SPEED,
    })
}

/// The run of the left arm, every `every`th step.
pub(super) fn trace(settings: &ControllerSettings, every: usize) -> Result<Vec<ControllerInstant>> {
    let mut m = arm(ARMS[0], settings)?;
    let start = m.measured_cp().translation;
    let along = DVec3::from_array(CORNERS[1]).normalize();
    let (mut instants, mut k) = (Vec::new(), 0);
    Samples::default().run(&mut m, |time_s, raw, m, deviation| {
        k += 1;
        if k % every.max(1) == 0 {
            let (tip, reference) = (m.measured_cp().translation, m.setpoint_cp().translation);
            let far = |p: DVec3| 1e3 * (p - start).dot(along);
            instants.push(ControllerInstant {
                time_s,
                along_mm: [far(raw), far(reference), far(tip)],
                error_mm: 1e3 * tip.distance(reference),
                rcm_mm: 1e3 * deviation,
            });
        }
    })?;
    Ok(instants)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_motion_is_continuous_and_as_fast_as_the_task() {
        let (mut fastest, mut last) = (0.0_f64, path(0.0));
        for k in 1..(END / DT) as usize {
            let here = path(k as f64 * DT);
            fastest = fastest.max(last.distance(here) / DT);
            assert!(last.distance(here) < 2e-4, "continuous");
            last = here;
        }
        assert!((0.03..0.06).contains(&fastest), "{fastest} m/s");
        assert!(
            (load(SINES_END + 1.0).force.length() - 1.0).abs() < 1e-12 && load(0.5 * SINES_END).force == DVec3::ZERO
        );
    }

    #[test]
    fn a_known_delay_is_found() {
        let at = |t: f64| DVec3::new((3.0 * t).sin(), (2.0 * t).cos(), 0.0);
        let late: Vec<DVec3> = (0..4000).map(|k| at(k as f64 * DT - 0.0371)).collect();
        let ahead: Vec<DVec3> = (0..4000).map(|k| at(k as f64 * DT)).collect();
        assert!((delay(&ahead, &late) - 0.0371).abs() < 1e-5, "{}", delay(&ahead, &late));
        assert!((delay(&late, &late)).abs() < 1e-9);
    }

    #[test]
    fn the_default_controller_meets_the_papers_figures() {
        let figures = evaluate(&ControllerSettings::default()).unwrap();
        assert!(figures.stable && figures.rcm_p95_mm <= 0.34, "{figures:?}");
        assert!(figures.tracking_rms_mm <= 0.048 && figures.droop_mm <= 0.26, "{figures:?}");
        assert!((figures.command_lag_s - 1.0 / 30.0).abs() < 5e-3, "the reference's filter: {figures:?}");
    }
}
