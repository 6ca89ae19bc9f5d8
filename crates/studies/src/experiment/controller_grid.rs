//! The controller, chosen out of 182 configurations as the paper's was (SPEC K4): seven kinds, thirteen bandwidths, two damping ratios.

use super::controller_motion::{ControllerFigures, ControllerInstant, judge, trace};
use super::trials::{Outcomes, Resumed, Trials};
use crate::{Error, Result, pages};
use serde::{Deserialize, Serialize};
use std::path::Path;
use std::time::Instant;
use trocar_core::Progress;
use trocar_robot::manipulator::{ControllerSettings, Law};
use trocar_workflow::REPORT;

/// The file that makes a folder one of this experiment's.
const MARKER: &str = "controller-grid.json";

/// The paper's figures for its chosen controller (section VI-A), which are the bars.
pub(crate) const BARS: ControllerBars = ControllerBars { rcm_p95_mm: 0.34, tracking_rms_mm: 0.048, droop_mm: 0.26 };

/// A configuration that is chosen has its figures below this share of the bars.
pub(crate) const IN_HAND: f64 = 0.8;

/// Kinds: a law, its integral action's or observer's bandwidth [rad/s].
const KINDS: [(Law, f64); 7] = [
    (Law::JointImpedance, 0.0),
    (Law::ComputedTorque, 0.0),
    (Law::Integral, 5.0),
    (Law::Integral, 15.0),
    (Law::Observer, 15.0),
    (Law::Observer, 45.0),
    (Law::RcmImpedance, 45.0),
];
/// Bandwidths of the error [rad/s].
const BANDWIDTHS: [f64; 13] = [15.0, 20.0, 25.0, 30.0, 40.0, 50.0, 60.0, 80.0, 100.0, 120.0, 150.0, 190.0, 240.0];
/// Damping ratios.
const DAMPINGS: [f64; 2] = [0.7, 1.0];
/// One step in so many is kept of the chosen one's run.
const EVERY: usize = 4;

/// Figures that a controller must not exceed.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct ControllerBars {
    /// RCM deviation that 95% of all steps stay below [mm].
    pub rcm_p95_mm: f64,
    /// Tracking in free motion, RMS [mm].
    pub tracking_rms_mm: f64,
    /// Droop at rest [mm].
    pub droop_mm: f64,
}

/// The experiment's options.
#[derive(Clone, Debug)]
pub struct ControllerGridExperiment {
    /// Configurations at once; 0: as many as the machine has threads.
    pub threads: usize,
}

/// One configuration and what it came to.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ControllerRow {
    /// The law by name.
    pub controller: String,
    /// Bandwidth of the error [rad/s].
    pub bandwidth: f64,
    /// Damping ratio.
    pub damping: f64,
    /// Bandwidth of the integral action [rad/s], where the law has it.
    pub integral: Option<f64>,
    /// Bandwidth of the disturbance observer [rad/s], where the law has it.
    pub observer: Option<f64>,
    /// Its figures.
    #[serde(flatten)]
    pub figures: ControllerFigures,
}

impl ControllerRow {
    /// The greatest of its figures as a share of its bar; infinite where it is not stable.
    pub fn share_of_bars(&self) -> f64 {
        let f = &self.figures;
        let shares =
            [f.rcm_p95_mm / BARS.rcm_p95_mm, f.tracking_rms_mm / BARS.tracking_rms_mm, f.droop_mm / BARS.droop_mm];
        if f.stable { shares.into_iter().fold(0.0, f64::max) } else { f64::INFINITY }
    }
}

/// The experiment's outcome.
#[derive(Clone, Debug, Serialize)]
pub struct ControllerGridResult {
    /// All configurations.
    pub rows: Vec<ControllerRow>,
    /// The chosen one: of those that have a fifth of every bar in hand the one of the least bandwidth, and of these the best; none where no configuration has.
    pub chosen: Option<ControllerRow>,
    /// Whether the program's default controller is the chosen one.
    pub chosen_is_default: bool,
    /// The paper's figures.
    pub bars: ControllerBars,
    /// How many configurations are stable, and how many of them meet all bars.
    pub stable: usize,
    /// Those that meet all bars.
    pub within_bars: usize,
    /// The left arm under the chosen controller.
    pub trace: Vec<ControllerInstant>,
    /// The same with the same gains without observer or integral action.
    pub plain_trace: Vec<ControllerInstant>,
    /// Configurations that an earlier run had finished.
    pub resumed: Resumed,
    /// Wall time [s].
    pub seconds: f64,
    /// The report's path.
    pub report: String,
}

/// All configurations.
fn grid() -> Vec<ControllerSettings> {
    let mut all = Vec::with_capacity(KINDS.len() * BANDWIDTHS.len() * DAMPINGS.len());
    for (law, correction) in KINDS {
        for bandwidth in BANDWIDTHS {
            for damping in DAMPINGS {
                let mut settings = ControllerSettings { law, ..ControllerSettings::default() };
                (settings.gains.bandwidth, settings.gains.damping) = (bandwidth, damping);
                match law {
                    Law::Integral => settings.gains.integral = correction,
                    Law::Observer | Law::RcmImpedance => settings.gains.observer = correction,
                    Law::JointImpedance | Law::ComputedTorque => {}
                }
                all.push(settings);
            }
        }
    }
    all
}

fn key(s: &ControllerSettings) -> String {
    let g = &s.gains;
    let of =
        |name: &str, value: f64| if s.law.gains().contains(&name) { format!(" {name} {value}") } else { String::new() };
    format!(
        "{}{}{}{}{}",
        s.law.name(),
        of("bandwidth", g.bandwidth),
        of("damping", g.damping),
        of("integral", g.integral),
        of("observer", g.observer)
    )
}

fn row(s: &ControllerSettings) -> Result<ControllerRow> {
    let has = |name: &str, value: f64| s.law.gains().contains(&name).then_some(value);
    Ok(ControllerRow {
        controller: s.law.name().to_owned(),
        bandwidth: s.gains.bandwidth,
        damping: s.gains.damping,
        integral: has("integral", s.gains.integral),
        observer: has("observer", s.gains.observer),
        figures: judge(s)?,
    })
}

/// The place of the configuration that is chosen.
fn choose(rows: &[ControllerRow]) -> Option<usize> {
    let good = |k: &usize| rows[*k].share_of_bars() <= IN_HAND;
    (0..rows.len()).filter(good).min_by(|&a, &b| {
        let (a, b) = (&rows[a], &rows[b]);
        a.bandwidth.total_cmp(&b.bandwidth).then(a.share_of_bars().total_cmp(&b.share_of_bars()))
    })
}

impl ControllerGridExperiment {
    /// Runs every configuration that no earlier run in the folder `output` has finished and writes the report into it.
    ///
    /// # Errors
    /// A folder that cannot be written or is another's, an interruption.
    pub fn run(&self, output: &Path, progress: &dyn Progress) -> Result<ControllerGridResult> {
        let clock = Instant::now();
        super::claim(output, MARKER)?;
        let grid = grid();
        let store = Trials::open(output, "controller-grid", &format!("{:?}", ControllerSettings::default().error))?;
        let Outcomes { rows, resumed } =
            store.run("configurations", &grid, key, self.threads, progress, |s, _| row(s))?;
        let chosen = choose(&rows);
        let (mut shown, mut plain) = (Vec::new(), Vec::new());
        if let Some(k) = chosen {
            shown = trace(&grid[k], EVERY)?;
            plain = trace(&ControllerSettings { law: Law::ComputedTorque, ..grid[k] }, EVERY)?;
        }
        let result = ControllerGridResult {
            chosen_is_default: chosen.is_some_and(|k| key(&grid[k]) == key(&ControllerSettings::default())),
            chosen: chosen.map(|k| rows[k].clone()),
            bars: BARS,
            stable: rows.iter().filter(|r| r.figures.stable).count(),
            within_bars: rows.iter().filter(|r| r.share_of_bars() <= 1.0).count(),
            rows,
            trace: shown,
            plain_trace: plain,
            resumed,
            seconds: clock.elapsed().as_secs_f64(),
            report: output.join(REPORT).display().to_string(),
        };
        super::write(&output.join(REPORT), pages::controller_grid(&result)?.as_bytes())?;
        let json = serde_json::to_vec_pretty(&result).map_err(|e| Error::Format(e.to_string()))?;
        super::write(&output.join(MARKER), &json)?;
        Ok(result)
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// A result of made-up rows.
    pub(crate) fn made_up_result() -> ControllerGridResult {
        let row = |k: usize, s: &ControllerSettings| {
            let size = 1.0 + k as f64;
            ControllerRow {
                controller: s.law.name().to_owned(),
                bandwidth: s.gains.bandwidth,
                damping: s.gains.damping,
                integral: None,
                observer: (s.law == Law::Observer).then_some(s.gains.observer),
                figures: ControllerFigures {
                    rcm_p95_mm: 2.0 / size,
                    rcm_peak_mm: 3.0 / size,
                    tracking_rms_mm: 1.0 / size,
                    lag_s: 1e-4,
                    command_rms_mm: 0.8,
                    command_lag_s: 0.034,
                    droop_mm: 0.5 / size,
                    torque_peak: 50.0,
                    torque_share: 0.6,
                    rough_rcm_mm: Some(1.0),
                    restless_rad_s: 0.0,
                    stable: k != 5,
                },
            }
        };
        let rows: Vec<ControllerRow> = grid().iter().enumerate().map(|(k, s)| row(k, s)).collect();
        let chosen = choose(&rows).map(|k| rows[k].clone());
        let instant = |k: usize| ControllerInstant {
            time_s: 0.01 * k as f64,
            along_mm: [k as f64, k as f64 - 1.0, k as f64 - 1.01],
            error_mm: 0.01,
            rcm_mm: 0.02,
        };
        ControllerGridResult {
            chosen,
            chosen_is_default: false,
            bars: BARS,
            stable: 181,
            within_bars: 150,
            trace: (0..400).map(instant).collect(),
            plain_trace: (0..400).map(instant).collect(),
            rows,
            resumed: Resumed::default(),
            seconds: 1.0,
            report: String::new(),
        }
    }

    #[test]
    fn there_are_182_and_no_two_are_one() {
        let mut keys: Vec<String> = grid().iter().map(key).collect();
        keys.sort();
        keys.dedup();
        assert_eq!(keys.len(), 182);
        grid().iter().for_each(|s| s.check().unwrap());
        assert!(grid().iter().any(|s| key(s) == key(&ControllerSettings::default())), "the default is one of them");
    }

    #[test]
    fn the_softest_with_something_in_hand_is_chosen() {
        let r = made_up_result();
        let chosen = r.chosen.unwrap();
        assert!(chosen.share_of_bars() <= IN_HAND);
        for row in r.rows.iter().filter(|row| row.share_of_bars() <= IN_HAND) {
            assert!(row.bandwidth >= chosen.bandwidth);
        }
        assert!(r.rows[5].share_of_bars().is_infinite(), "unstable");
        assert_eq!(choose(&r.rows[..4]), None);
    }
}
