//! Force at the tool mount: an instrument weighed in 54 noisy poses, many times over; and a small contact force after the tare.

use super::normal::normals;
use crate::names::degrees;
use crate::study::{Job, Kind, Study};
use crate::{Error, Result};
use clap::Args;
use glam::{DQuat, DVec3};
use serde::Serialize;
use trocar_core::{Progress, Wrench};
use trocar_report::colors;
use trocar_report::document::{Document, Section, Table};
use trocar_report::page::{self, Card};
use trocar_report::plots::{Line, Plot};
use trocar_report::table::{count, fixed, percent};
use trocar_robot::instrument::{GRAVITY, Instrument};
use trocar_robot::wrench::{
    Compensator, ForceKind, Identification, LoadModel, SensorNoise, StaticReading, identify, static_orientations,
};

/// The paper's weight of an instrument [N].
const PAPER_WEIGHT: f64 = 4.7;

/// 95% of chi-squared with ten degrees of freedom are below.
const CHI_SQUARED_95: f64 = 18.307;

/// Largest tilts that are compared for what they tell [degrees].
const TILTS: [f64; 6] = [5.0, 10.0, 20.0, 33.6, 60.0, 180.0];

/// Readings a second at 30 frames a second that a frame averages.
const READINGS: usize = 33;
/// Frames a second.
const RATE: f64 = 30.0;
/// Frames that the tare takes.
const TARE: usize = 30;
/// How long nothing is touched, how long the contact force grows, and how long it then stays [s].
const RAMP: [f64; 3] = [3.0, 12.0, 5.0];
/// Its greatest value [N].
const PEAK: f64 = 0.05;
/// How far the sensor's bias has drifted between weighing and reset [N].
const DRIFT: DVec3 = DVec3::new(0.04, -0.03, 0.06);
/// Tilt of the shaft at reset and at the end [degrees].
const TILT: [f64; 2] = [13.3, 18.3];

/// The instrument weighed in 54 noisy poses, many times over; and a touch of tens of millinewtons after the tare.
#[derive(Clone, Copy, Debug, Args)]
pub struct Weighing {
    /// Static poses of an identification.
    #[arg(long, default_value_t = trocar_robot::wrench::STATIC_POSES)]
    pub poses: usize,
    /// Largest tilt of the instrument in them (degrees).
    #[arg(long, default_value = "60", value_parser = degrees, allow_negative_numbers = true)]
    pub tilt: f64,
    /// Identifications, each with other noise.
    #[arg(long, default_value_t = 400)]
    pub runs: usize,
    /// Noise of a force reading [N].
    #[arg(long, default_value_t = 0.02, allow_negative_numbers = true)]
    pub force_noise: f64,
    /// Noise of a torque reading [N m].
    #[arg(long, default_value_t = 0.001, allow_negative_numbers = true)]
    pub torque_noise: f64,
    /// Seed of the noise.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
}

/// One parameter of the load.
#[derive(Clone, Debug, Serialize)]
pub struct WrenchParameter {
    /// Its name.
    pub name: &'static str,
    /// Its unit.
    pub unit: &'static str,
    /// What it is.
    pub truth: f64,
    /// Mean of the estimates less the truth.
    pub bias: f64,
    /// Standard deviation of the estimates.
    pub spread: f64,
    /// The predicted one.
    pub predicted: f64,
    /// Share of the estimates within 1.96 predicted deviations of the truth; 0.95 is right.
    pub within: f64,
}

/// What poses of one largest tilt tell.
#[derive(Clone, Debug, Serialize)]
pub struct WrenchTilt {
    /// Largest tilt [degrees].
    pub tilt_deg: f64,
    /// Condition number.
    pub condition: f64,
    /// Predicted standard deviation of the weight [mN].
    pub weight_deviation_mn: f64,
}

/// One frame of the ramp. Forces along the contact force.
#[derive(Clone, Debug, Serialize)]
pub struct WrenchFrame {
    /// Time [s].
    pub time_s: f64,
    /// The contact force there is [mN].
    pub truth_mn: f64,
    /// What the sensor reads, weight and bias included [N].
    pub raw_n: f64,
    /// With the identified load taken off, not tared [mN].
    pub untared_mn: f64,
    /// Tared [mN].
    pub tared_mn: f64,
    /// Its predicted standard deviation [mN].
    pub deviation_mn: f64,
    /// What kind of force it is.
    pub kind: ForceKind,
}

/// The experiment's outcome.
#[derive(Clone, Debug, Serialize)]
pub struct WrenchResult {
    /// Static poses of an identification.
    pub poses: usize,
    /// Largest tilt in them [degrees].
    pub tilt_deg: f64,
    /// Identifications.
    pub runs: usize,
    /// Noise of one reading [N, N m].
    pub noise: SensorNoise,
    /// Condition number of the equations.
    pub condition: f64,
    /// Weight: mean of the estimates [N].
    pub weight_n: f64,
    /// Standard deviation of the estimates [mN].
    pub weight_spread_mn: f64,
    /// The predicted one [mN].
    pub weight_predicted_mn: f64,
    /// The paper's weight [N].
    pub paper_weight_n: f64,
    /// Mean of the squared distance from the truth in predicted deviations; 10 is right.
    pub mean_distance_squared: f64,
    /// Share of the estimates within the predicted 95% ellipsoid.
    pub within_95: f64,
    /// Largest difference between the distances' distribution and chi-squared's (Kolmogorov and Smirnov) ...
    pub largest_difference: f64,
    /// ... and what it exceeds once in twenty where all is right.
    pub difference_limit: f64,
    /// Mean of the residuals' chi-squared over its degrees of freedom; 1 is right.
    pub residual: f64,
    /// Every parameter.
    pub parameters: Vec<WrenchParameter>,
    /// Squared distances, in order.
    pub distances: Vec<f64>,
    /// What poses of other tilts would tell.
    pub tilts: Vec<WrenchTilt>,
    /// The ramp, frame by frame.
    pub ramp: Vec<WrenchFrame>,
    /// RMS error of the tared force [mN].
    pub tared_error_mn: f64,
    /// RMS error of the untared force [mN].
    pub untared_error_mn: f64,
    /// The contact force from which the tared reading stays above three deviations [mN].
    pub seen_from_mn: Option<f64>,
    /// Wall time [s].
    pub seconds: f64,
    /// The report's path.
    pub report: String,
}

/// Share of chi-squared with ten degrees of freedom below `x`.
fn chi_squared_10(x: f64) -> f64 {
    let half = 0.5 * x;
    let terms = (1..5).scan(1.0, |term, k| {
        *term *= half / f64::from(k);
        Some(*term)
    });
    1.0 - (-half).exp() * (1.0 + terms.sum::<f64>())
}

impl Study for Weighing {
    const NAME: &'static str = "wrench";
    const KIND: Kind = Kind::Experiment;
    type Figures = WrenchResult;

    fn run(&self, job: &Job<'_>) -> Result<(WrenchResult, Document)> {
        if !(1..=1_000_000).contains(&self.runs) {
            let reason = format!("{} is not between 1 and 1,000,000", self.runs);
            return Err(trocar_robot::Error::Invalid { what: "number of runs".into(), reason }.into());
        }
        let first = self.weigh(0, self.tilt)?;
        job.claim()?;
        let measured = self.measure(&first, job.progress)?;
        let result = WrenchResult { report: job.report(), seconds: job.seconds(), ..measured };
        let document = document(&result)?;
        Ok((result, document))
    }
}

impl Weighing {
    /// Noise of one reading.
    fn noise(&self) -> SensorNoise {
        SensorNoise { force: self.force_noise, torque: self.torque_noise }
    }

    fn measure(&self, first: &Identification, progress: &dyn Progress) -> Result<WrenchResult> {
        let truth = numbers(&truth());
        let mut estimates = Vec::with_capacity(self.runs);
        let (mut distances, mut residual) = (Vec::with_capacity(self.runs), 0.0);
        progress.begin("identifications", self.runs as u64);
        for run in 0..self.runs {
            if progress.interrupted() {
                return Err(Error::Interrupted);
            }
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
            seconds: 0.0,
            report: String::new(),
        })
    }

    /// An identification from noisy readings.
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

    /// The instrument in its port: tared at reset, then leaned to the other start tilt while a contact force grows at the jaws.
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
        // Tissue pulls mostly down and a little aside.
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

/// Gravity in the cell.
const DOWN: DVec3 = DVec3::new(0.0, 0.0, -GRAVITY);

/// The grasper on a sensor that reads newtons when it carries nothing.
fn truth() -> LoadModel {
    let bias = Wrench { force: DVec3::new(1.2, -0.8, 2.0), torque: DVec3::new(0.05, -0.03, 0.02) };
    LoadModel::of(&Instrument::grasper(), bias)
}

/// The parameters' names and units, in the order of [`numbers`].
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

fn document(r: &WrenchResult) -> Result<Document> {
    let lead = format!(
        "The grasper weighed in {} poses tilted by up to {}\u{b0} (condition number {}), {} times with other noise: {} mN a force and {} mN m a torque. Each time ten numbers are estimated, with their covariance.",
        r.poses,
        fixed(r.tilt_deg, 0),
        fixed(r.condition, 1),
        count(r.runs),
        fixed(1e3 * r.noise.force, 0),
        fixed(1e3 * r.noise.torque, 1),
    );
    let weighing = Section::new("Weighing", lead).cards(cards(r)).figures([distances(r)?, tilts(r)?]);
    let document = Document::new("Force at the tool mount", "An instrument weighed, tared and touched");
    Ok(document.with(weighing).with(touching(r)?).with(parameters(r)))
}

fn cards(r: &WrenchResult) -> [Card; 4] {
    let off = 1e3 * (r.weight_n - r.paper_weight_n).abs();
    let mean_deviation = r.weight_predicted_mn / (r.runs as f64).sqrt();
    let weight = format!(
        "spread {} mN, predicted {} mN; the paper: {} N",
        fixed(r.weight_spread_mn, 2),
        fixed(r.weight_predicted_mn, 2),
        r.paper_weight_n
    );
    let seen = r.seen_from_mn.map_or("not seen".to_owned(), |f| format!("{} mN", fixed(f, 0)));
    [
        Card::new("Weight", format!("{} N", fixed(r.weight_n, 4)), weight).met(off < 4.0 * mean_deviation),
        Card::new("Within the predicted 95%", percent(r.within_95, 1), "of all ten numbers together"),
        Card::new(
            "Chi-squared",
            fixed(r.mean_distance_squared, 2),
            format!(
                "mean, 10 is right; farthest from its distribution by {} (limit {})",
                fixed(r.largest_difference, 3),
                fixed(r.difference_limit, 3)
            ),
        )
        .met(r.largest_difference < r.difference_limit),
        Card::new("A touch is seen from", seen, "tared reading above three deviations for good")
            .met(r.seen_from_mn.is_some()),
    ]
}

fn distances(r: &WrenchResult) -> Result<String> {
    let (found, right) = (colors::organ(1), colors::organ(0));
    let n = r.distances.len() as f64;
    let steps = r.distances.iter().enumerate().flat_map(|(k, d)| [(*d, k as f64 / n), (*d, (k as f64 + 1.0) / n)]);
    let last = r.distances.last().copied().unwrap_or(1.0).max(CHI_SQUARED_95);
    let curve = (0..=120).map(|k| last * f64::from(k) / 120.0).map(|x| (x, chi_squared_10(x)));
    let plot = Plot {
        title: "Distances of the estimates from the truth",
        x: "squared distance in predicted deviations",
        y: "share below",
        lines: vec![
            Line { points: curve.collect(), color: right, filled: false },
            Line { points: steps.collect(), color: found, filled: false },
        ],
        bands: vec![],
        show: vec![0.0, 1.0],
        limits: vec![0.95],
        log_x: false,
        log_y: false,
    };
    let legend = page::legend([("estimates", found), ("chi-squared, 10 degrees", right)]);
    Ok(page::figure(&plot.svg()?, &format!("<b>Estimates lie as far from the truth as predicted.</b>{legend}")))
}

fn tilts(r: &WrenchResult) -> Result<String> {
    let (weight, condition) = (colors::organ(2), colors::organ(3));
    let line = |color, value: &dyn Fn(&WrenchTilt) -> f64| Line {
        points: r.tilts.iter().map(|t| (t.tilt_deg, value(t))).collect(),
        color,
        filled: false,
    };
    let plot = Plot {
        title: "What the poses' tilt tells",
        x: "largest tilt of the poses [\u{b0}]",
        y: "mN, or condition",
        lines: vec![line(weight, &|t| t.weight_deviation_mn), line(condition, &|t| t.condition)],
        bands: vec![],
        show: vec![],
        limits: vec![],
        log_x: true,
        log_y: true,
    };
    let legend = page::legend([("deviation of the weight [mN]", weight), ("condition number", condition)]);
    let caption = format!("<b>Poses must be tilted</b> to tell weight from bias.{legend}");
    Ok(page::figure(&plot.svg()?, &caption))
}

fn touching(r: &WrenchResult) -> Result<Section> {
    let points = |value: &dyn Fn(&WrenchFrame) -> f64| r.ramp.iter().map(|f| (f.time_s, value(f))).collect::<Vec<_>>();
    let (truth, tared, untared, raw) = (colors::organ(0), colors::organ(1), colors::organ(7), colors::organ(4));
    let plot = |title, y, lines, show| Plot {
        title,
        x: "time [s]",
        y,
        lines,
        bands: vec![],
        show,
        limits: vec![],
        log_x: false,
        log_y: false,
    };
    let line = |color, points| Line { points, color, filled: false };
    let before = plot("Reading before the tare", "reading [N]", vec![line(raw, points(&|f| f.raw_n))], vec![0.0]);
    let after = plot(
        "Force after the tare",
        "force [mN]",
        vec![
            line(untared, points(&|f| f.untared_mn)),
            line(tared, points(&|f| f.tared_mn)),
            line(truth, points(&|f| f.truth_mn)),
        ],
        vec![0.0],
    );
    let legend = page::legend([("contact force", truth), ("tared", tared), ("identified bias, not tared", untared)]);
    let figures = [
        page::figure(
            &before.svg()?,
            "<b>What the sensor reads</b> along the contact force, weight and bias included: the touch is a hundredth of it.",
        ),
        page::figure(
            &after.svg()?,
            &format!("<b>After the weight is taken off</b>; kind of the force: contact.{legend}"),
        ),
    ];
    let first = r.ramp.first().map_or(f64::NAN, |f| f.deviation_mn);
    let lead = format!(
        "The sensor\u{2019}s bias has drifted since the weighing. At reset the instrument is tared; then it is leaned from 13.3 to 18.3\u{b0} while tissue pulls at its jaws, up to 50 mN. A frame is the mean of \
         33 readings; its predicted deviation is {} mN. RMS error {} mN tared, {} mN not tared.",
        fixed(first, 1),
        fixed(r.tared_error_mn, 1),
        fixed(r.untared_error_mn, 1)
    );
    Ok(Section::new("A touch of tens of millinewtons", lead).figures(figures))
}

fn parameters(r: &WrenchResult) -> Section {
    let head = ["Parameter", "Truth", "Mean error", "Spread", "Predicted", "Within 1.96 deviations"];
    let small = |v: f64| format!("{v:.2e}").replace('-', "\u{2212}");
    let rows: Vec<Vec<String>> = r
        .parameters
        .iter()
        .map(|p| {
            vec![
                format!("{} [{}]", p.name, p.unit),
                fixed(p.truth, 4),
                small(p.bias),
                small(p.spread),
                small(p.predicted),
                percent(p.within, 1),
            ]
        })
        .collect();
    Section::new("Every parameter", "").table(Table::new(head, rows))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study;
    use trocar_core::Silent;

    fn measured() -> WrenchResult {
        let (force_noise, torque_noise) = (0.02, 1e-3);
        let e = Weighing { poses: 54, tilt: 60_f64.to_radians(), runs: 200, force_noise, torque_noise, seed: 1 };
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
        // Tables: medians and 95% of ten degrees of freedom.
        assert!((chi_squared_10(9.342) - 0.5).abs() < 1e-4 && (chi_squared_10(CHI_SQUARED_95) - 0.95).abs() < 1e-4);
        assert_eq!(chi_squared_10(0.0), 0.0);
    }

    #[test]
    fn useless_options_are_refused() {
        let good = Weighing { poses: 54, tilt: 1.0, runs: 10, force_noise: 0.02, torque_noise: 1e-3, seed: 1 };
        let dir = tempfile::tempdir().unwrap();
        let refused = |e: Weighing| study::run(&e, dir.path(), &Silent).err().unwrap().to_string();
        assert!(refused(Weighing { poses: 2, ..good }).contains("static poses"));
        assert!(refused(Weighing { tilt: 0.02, ..good }).contains("too similar"));
        assert!(refused(Weighing { runs: 0, ..good }).contains("runs"));
        assert!(refused(Weighing { force_noise: -1.0, ..good }).contains("noise"));
    }

    #[test]
    fn everything_is_shown() {
        let html = document(&measured()).unwrap().page();
        assert_eq!(html.matches("<svg").count(), 4);
        assert_eq!(html.matches("<tr>").count(), 11);
        assert!(html.contains("4.7 N") && html.contains("card good") && !html.contains("NaN"));
    }
}
