//! Force at the tool mount: an instrument weighed in 54 poses with noise, repeatedly; and a small
//! contact force after taring.

mod normal;
mod page;
mod result;

use crate::Result;
use crate::names::degrees;
use crate::study::{Job, Kind, Study};
use clap::Args;
use glam::{DQuat, DVec3};
use normal::normals;
use result::{CHI_SQUARED_95, WrenchFrame, WrenchParameter, WrenchResult, WrenchTilt, chi_squared_10};
use trocar_core::{Progress, Wrench};
use trocar_report::document::Document;
use trocar_robot::instrument::{GRAVITY, Instrument};
use trocar_robot::wrench::{
    Compensator, ForceKind, Identification, LoadModel, SensorNoise, StaticReading, identify, static_orientations,
};
use trocar_workflow::check_interrupted;

/// The paper's weight of an instrument (N).
const PAPER_WEIGHT: f64 = 4.7;

/// Largest tilts that are compared (degrees).
const TILTS: [f64; 6] = [5.0, 10.0, 20.0, 33.6, 60.0, 180.0];

/// Readings averaged per frame.
const READINGS: usize = 33;
/// Frame rate (Hz).
const RATE: f64 = 30.0;
/// Frames averaged for taring.
const TARE: usize = 30;
/// Duration without contact, of the growing contact force, and of the constant force (s).
const RAMP: [f64; 3] = [3.0, 12.0, 5.0];
/// Largest contact force (N).
const PEAK: f64 = 0.05;
/// Drift of the sensor's bias between weighing and reset (N).
const DRIFT: DVec3 = DVec3::new(0.04, -0.03, 0.06);
/// Tilt of the shaft at reset and at the end (degrees).
const TILT: [f64; 2] = [13.3, 18.3];

/// An instrument weighed in 54 poses with noise, repeatedly; and a contact force of tens of
/// millinewtons after taring.
#[derive(Clone, Copy, Debug, Args)]
pub struct WrenchExperiment {
    /// Static poses per identification.
    #[arg(long, default_value_t = trocar_robot::wrench::STATIC_POSES)]
    pub poses: usize,
    /// Largest tilt of the instrument in these poses (degrees).
    #[arg(long, default_value = "60", value_parser = degrees, allow_negative_numbers = true)]
    pub tilt: f64,
    /// Number of identifications, each with different noise.
    #[arg(long, default_value_t = 400)]
    pub runs: usize,
    /// Standard deviation of a force reading (N).
    #[arg(long, default_value_t = 0.02, allow_negative_numbers = true)]
    pub force_noise: f64,
    /// Standard deviation of a torque reading (N m).
    #[arg(long, default_value_t = 0.001, allow_negative_numbers = true)]
    pub torque_noise: f64,
    /// Seed of the noise.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
}

impl Study for WrenchExperiment {
    const NAME: &'static str = "wrench";
    const KIND: Kind = Kind::Experiment;
    type Figures = WrenchResult;

    fn run(&self, job: &Job<'_>) -> Result<(WrenchResult, Document)> {
        if !(1..=1_000_000).contains(&self.runs) {
            let reason = format!("{} must be in [1, 1000000]", self.runs);
            return Err(trocar_robot::Error::Invalid { what: "number of runs".into(), reason }.into());
        }
        let first = self.weigh(0, self.tilt)?;
        job.claim()?;
        let result = self.measure(&first, job.progress)?;
        let document = page::document(&result)?;
        Ok((result, document))
    }
}

impl WrenchExperiment {
    fn noise(&self) -> SensorNoise {
        SensorNoise { force: self.force_noise, torque: self.torque_noise }
    }

    fn measure(&self, first: &Identification, progress: &dyn Progress) -> Result<WrenchResult> {
        let truth = numbers(&truth());
        let mut estimates = Vec::with_capacity(self.runs);
        let (mut distances, mut residual) = (Vec::with_capacity(self.runs), 0.0);
        progress.begin("identifications", self.runs as u64);
        for run in 0..self.runs {
            check_interrupted(progress)?;
            let found = self.weigh(run as u64, self.tilt)?;
            distances.push(found.distance_squared(&self::truth()));
            residual += found.chi_squared / found.degrees as f64;
            estimates.push(numbers(&found.model));
            progress.advance(1);
        }
        progress.end();
        distances.sort_by(f64::total_cmp);
        let runs = self.runs as f64;
        let predicted = numbers(&first.deviations());
        let parameters: Vec<WrenchParameter> = (0..NAMES.len())
            .map(|j| {
                let mean = estimates.iter().map(|e| e[j]).sum::<f64>() / runs;
                let square = estimates.iter().map(|e| (e[j] - mean).powi(2)).sum::<f64>();
                let within = estimates.iter().filter(|e| (e[j] - truth[j]).abs() < 1.96 * predicted[j]).count();
                WrenchParameter {
                    name: NAMES[j].0,
                    unit: NAMES[j].1,
                    truth: truth[j],
                    bias: mean - truth[j],
                    spread: (square / (runs - 1.0).max(1.0)).sqrt(),
                    predicted: predicted[j],
                    within: within as f64 / runs,
                }
            })
            .collect();
        let steps = distances.iter().enumerate().map(|(k, d)| {
            let share = chi_squared_10(*d);
            ((k as f64 + 1.0) / runs - share).max(share - k as f64 / runs)
        });
        let tilts = TILTS.iter().map(|tilt| {
            let found = self.weigh(0, tilt.to_radians())?;
            let weight_deviation_mn = 1e3 * GRAVITY * found.deviations().mass;
            Ok(WrenchTilt { tilt_deg: *tilt, condition: found.condition, weight_deviation_mn })
        });
        let ramp = self.ramp(first)?;
        let error = |f: &dyn Fn(&WrenchFrame) -> f64| {
            (ramp.iter().map(|r| (f(r) - r.truth_mn).powi(2)).sum::<f64>() / ramp.len() as f64).sqrt()
        };
        let hidden = ramp.iter().rposition(|f| f.tared_mn < 3.0 * f.deviation_mn);
        Ok(WrenchResult {
            poses: self.poses,
            tilt_deg: self.tilt.to_degrees(),
            runs: self.runs,
            noise: self.noise(),
            condition: first.condition,
            weight_n: GRAVITY * (parameters[0].truth + parameters[0].bias),
            weight_spread_mn: 1e3 * GRAVITY * parameters[0].spread,
            weight_predicted_mn: 1e3 * GRAVITY * parameters[0].predicted,
            paper_weight_n: PAPER_WEIGHT,
            mean_distance_squared: distances.iter().sum::<f64>() / runs,
            within_95: distances.iter().filter(|d| **d < CHI_SQUARED_95).count() as f64 / runs,
            largest_difference: steps.fold(0.0, f64::max),
            difference_limit: 1.358 / runs.sqrt(),
            residual: residual / runs,
            parameters,
            distances,
            tilts: tilts.collect::<Result<_>>()?,
            tared_error_mn: error(&|f| f.tared_mn),
            untared_error_mn: error(&|f| f.untared_mn),
            seen_from_mn: ramp.get(hidden.map_or(0, |k| k + 1)).map(|f| f.truth_mn),
            ramp,
        })
    }

    /// An identification from readings with noise.
    fn weigh(&self, run: u64, tilt: f64) -> Result<Identification> {
        let orientations = static_orientations(self.poses, tilt)?;
        let readings = orientations.into_iter().enumerate().map(|(k, orientation)| {
            let noise = self.noise_at(&[self.seed, 1, run, k as u64], 1.0);
            StaticReading { orientation, reading: truth().reading(orientation, DOWN) + noise }
        });
        Ok(identify(&readings.collect::<Vec<_>>(), &self.noise(), DOWN)?)
    }

    fn noise_at(&self, keys: &[u64], share: f64) -> Wrench {
        let of = |which: u64| normals(&[keys, &[which]].concat());
        Wrench { force: share * self.force_noise * of(0), torque: share * self.torque_noise * of(1) }
    }

    /// The instrument in its port, tared at reset, then tilted to the other start tilt while a
    /// contact force at the jaws grows.
    fn ramp(&self, load: &Identification) -> Result<Vec<WrenchFrame>> {
        let share = 1.0 / (READINGS as f64).sqrt();
        let noise = SensorNoise { force: share * self.force_noise, torque: share * self.torque_noise };
        let untared = Compensator::new(load.clone(), noise, DOWN)?;
        let mut tared = untared.clone();
        let mut drifted = truth();
        drifted.bias.force += DRIFT;
        let at = |tilt_deg: f64| DQuat::from_rotation_x(std::f64::consts::PI - tilt_deg.to_radians());
        let start = at(TILT[0]);
        let rest = |k: usize| drifted.reading(start, DOWN) + self.noise_at(&[self.seed, 2, k as u64], share);
        tared.tare(start, &(0..TARE).map(rest).collect::<Vec<_>>())?;
        // Tissue pulls mostly down and slightly sideways.
        let along = DVec3::new(0.3, 0.4, -0.866).normalize();
        let tip = Instrument::grasper().tip_in_flange().translation;
        let total: f64 = RAMP.iter().sum();
        let frames = (total * RATE).round() as usize;
        let frame = |k: usize| {
            let time = k as f64 / RATE;
            let grown = ((time - RAMP[0]) / RAMP[1]).clamp(0.0, 1.0);
            let orientation = at(TILT[0] + (TILT[1] - TILT[0]) * time / total);
            let touch = Wrench::at(orientation.inverse() * (PEAK * grown * along), tip);
            let noise = self.noise_at(&[self.seed, 3, k as u64], share);
            let reading = drifted.reading(orientation, DOWN) + touch + noise;
            let left = tared.force(orientation, reading, ForceKind::Contact)?;
            let before = untared.force(orientation, reading, ForceKind::Contact)?;
            Ok(WrenchFrame {
                time_s: time,
                truth_mn: 1e3 * PEAK * grown,
                raw_n: (orientation * reading.force).dot(along),
                untared_mn: 1e3 * before.wrench.force.dot(along),
                tared_mn: 1e3 * left.wrench.force.dot(along),
                deviation_mn: 1e3 * along.dot(left.force_covariance * along).max(0.0).sqrt(),
                kind: left.kind,
            })
        };
        (0..frames).map(frame).collect()
    }
}

/// Gravity in the cell (m/s2).
const DOWN: DVec3 = DVec3::new(0.0, 0.0, -GRAVITY);

/// The load of the grasper on a sensor with a bias.
fn truth() -> LoadModel {
    let bias = Wrench { force: DVec3::new(1.2, -0.8, 2.0), torque: DVec3::new(0.05, -0.03, 0.02) };
    LoadModel::of(&Instrument::grasper(), bias)
}

/// Names and units of the parameters, in the order of [`numbers`].
const NAMES: [(&str, &str); 10] = [
    ("mass", "kg"),
    ("m c, x", "kg m"),
    ("m c, y", "kg m"),
    ("m c, z", "kg m"),
    ("force bias, x", "N"),
    ("force bias, y", "N"),
    ("force bias, z", "N"),
    ("torque bias, x", "N m"),
    ("torque bias, y", "N m"),
    ("torque bias, z", "N m"),
];

fn numbers(m: &LoadModel) -> [f64; 10] {
    let (c, f, t) = (m.first_moment, m.bias.force, m.bias.torque);
    [m.mass, c.x, c.y, c.z, f.x, f.y, f.z, t.x, t.y, t.z]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study;
    use trocar_core::Silent;

    fn measured() -> WrenchResult {
        let (force_noise, torque_noise) = (0.02, 1e-3);
        let e =
            WrenchExperiment { poses: 54, tilt: 60_f64.to_radians(), runs: 200, force_noise, torque_noise, seed: 1 };
        e.measure(&e.weigh(0, e.tilt).unwrap(), &Silent).unwrap()
    }

    #[test]
    fn estimates_lie_within_the_predicted_covariance() {
        let r = measured();
        assert!(r.largest_difference < 1.2 * r.difference_limit, "{} {}", r.largest_difference, r.difference_limit);
        assert!((r.weight_n - 4.7).abs() < 4e-3 * r.weight_predicted_mn, "{}", r.weight_n);
        assert!((0.9..=1.0).contains(&r.within_95) && (r.residual - 1.0).abs() < 0.03);
        assert!(r.tared_error_mn < 5.0 && r.untared_error_mn > 30.0, "{} {}", r.tared_error_mn, r.untared_error_mn);
        assert!(r.seen_from_mn.unwrap() < 30.0);
        assert!(r.tilts.windows(2).all(|w| w[1].condition < w[0].condition + 1.0));
    }

    #[test]
    fn the_distribution_is_chi_squared() {
        // Tabulated median and 95% quantile.
        assert!((chi_squared_10(9.342) - 0.5).abs() < 1e-4 && (chi_squared_10(CHI_SQUARED_95) - 0.95).abs() < 1e-4);
        assert_eq!(chi_squared_10(0.0), 0.0);
    }

    #[test]
    fn invalid_options_are_refused() {
        let good = WrenchExperiment { poses: 54, tilt: 1.0, runs: 10, force_noise: 0.02, torque_noise: 1e-3, seed: 1 };
        let dir = tempfile::tempdir().unwrap();
        let refused = |e: WrenchExperiment| study::run(&e, dir.path(), &Silent).err().unwrap().to_string();
        assert!(refused(WrenchExperiment { poses: 2, ..good }).contains("static poses"));
        assert!(refused(WrenchExperiment { tilt: 0.02, ..good }).contains("too similar"));
        assert!(refused(WrenchExperiment { runs: 0, ..good }).contains("runs"));
        assert!(refused(WrenchExperiment { force_noise: -1.0, ..good }).contains("noise"));
    }

    #[test]
    fn the_page_shows_all_figures() {
        let html = page::document(&measured()).unwrap().page();
        assert_eq!(html.matches("<svg").count(), 4);
        assert_eq!(html.matches("<tr>").count(), 11);
        assert!(html.contains("4.7 N") && html.contains("card good") && !html.contains("NaN"));
    }
}
