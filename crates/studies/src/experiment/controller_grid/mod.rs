//! The arms' controller, chosen from 182 configurations as in the paper: seven kinds, thirteen
//! bandwidths, two damping ratios.

mod motion;
mod page;
mod result;

use crate::Result;
use crate::study::{Job, Kind, Study};
use crate::trials::Outcomes;
use clap::Args;
use motion::{evaluate, trace};
use result::{ControllerGridResult, ControllerRow, MARGIN, TARGETS};
use trocar_report::document::Document;
use trocar_robot::manipulator::{ControllerSettings, Law};

/// Kinds: law, and bandwidth of its integral action or observer (rad/s).
const KINDS: [(Law, f64); 7] = [
    (Law::JointImpedance, 0.0),
    (Law::ComputedTorque, 0.0),
    (Law::Integral, 5.0),
    (Law::Integral, 15.0),
    (Law::Observer, 15.0),
    (Law::Observer, 45.0),
    (Law::RcmImpedance, 45.0),
];
/// Bandwidths of the error (rad/s).
const BANDWIDTHS: [f64; 13] = [15.0, 20.0, 25.0, 30.0, 40.0, 50.0, 60.0, 80.0, 100.0, 120.0, 150.0, 190.0, 240.0];
/// Damping ratios.
const DAMPINGS: [f64; 2] = [0.7, 1.0];
/// Every fourth step of the chosen controller's run is recorded.
const EVERY: usize = 4;

/// The arms' controller chosen from 182 configurations: RCM deviation, tracking and droop with a
/// wrong model and friction.
#[derive(Clone, Copy, Debug, Args)]
pub struct ControllerGridExperiment {
    /// Configurations in parallel; all threads by default. The figures do not depend on it.
    #[arg(long, default_value_t = 0)]
    pub threads: usize,
}

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
        figures: evaluate(s)?,
    })
}

/// Index of the chosen configuration: the lowest bandwidth, then the best, of those with the
/// margin.
fn choose(rows: &[ControllerRow]) -> Option<usize> {
    let good = |k: &usize| rows[*k].share_of_targets() <= 1.0 - MARGIN;
    (0..rows.len()).filter(good).min_by(|&a, &b| {
        let (a, b) = (&rows[a], &rows[b]);
        a.bandwidth.total_cmp(&b.bandwidth).then(a.share_of_targets().total_cmp(&b.share_of_targets()))
    })
}

impl Study for ControllerGridExperiment {
    const NAME: &'static str = "controller-grid";
    const KIND: Kind = Kind::Experiment;
    const FOLDER: Option<&'static str> =
        Some("Output folder of the report. Finished configurations in it are used again.");
    type Figures = ControllerGridResult;

    fn run(&self, job: &Job<'_>) -> Result<(ControllerGridResult, Document)> {
        job.claim()?;
        let grid = grid();
        let settings = format!("{:?}", ControllerSettings::default().error);
        let Outcomes { rows, resumed } =
            job.trials("configurations", &settings, &grid, key, self.threads, |s, _| row(s))?;
        let chosen = choose(&rows);
        let (mut shown, mut plain) = (Vec::new(), Vec::new());
        if let Some(k) = chosen {
            shown = trace(&grid[k], EVERY)?;
            plain = trace(&ControllerSettings { law: Law::ComputedTorque, ..grid[k] }, EVERY)?;
        }
        let own = |k: usize| {
            let mut settings = grid[k];
            settings.error.friction = None;
            evaluate(&settings)
        };
        let result = ControllerGridResult {
            chosen_with_own_friction: chosen.map(own).transpose()?,
            chosen_is_default: chosen.is_some_and(|k| key(&grid[k]) == key(&ControllerSettings::default())),
            chosen: chosen.map(|k| rows[k].clone()),
            bars: TARGETS,
            stable: rows.iter().filter(|r| r.figures.stable).count(),
            within_bars: rows.iter().filter(|r| r.share_of_targets() <= 1.0).count(),
            rows,
            trace: shown,
            plain_trace: plain,
            resumed,
        };
        let document = page::document(&result)?;
        Ok((result, document))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trials::Resumed;
    use motion::{ControllerFigures, ControllerInstant};

    fn made_up_result() -> ControllerGridResult {
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
            chosen_with_own_friction: None,
            bars: TARGETS,
            stable: 181,
            within_bars: 150,
            trace: (0..400).map(instant).collect(),
            plain_trace: (0..400).map(instant).collect(),
            rows,
            resumed: Resumed::default(),
        }
    }

    #[test]
    fn there_are_182_different_configurations() {
        let mut keys: Vec<String> = grid().iter().map(key).collect();
        keys.sort();
        keys.dedup();
        assert_eq!(keys.len(), 182);
        grid().iter().for_each(|s| s.check().unwrap());
        assert!(grid().iter().any(|s| key(s) == key(&ControllerSettings::default())), "the default is one of them");
    }

    #[test]
    fn the_lowest_bandwidth_with_the_margin_is_chosen() {
        let r = made_up_result();
        let chosen = r.chosen.unwrap();
        assert!(chosen.share_of_targets() <= 1.0 - MARGIN);
        for row in r.rows.iter().filter(|row| row.share_of_targets() <= 1.0 - MARGIN) {
            assert!(row.bandwidth >= chosen.bandwidth);
        }
        assert!(r.rows[5].share_of_targets().is_infinite(), "unstable");
        assert_eq!(choose(&r.rows[..4]), None);
    }

    #[test]
    fn the_page_shows_the_papers_figures() {
        let html = page::document(&made_up_result()).unwrap().page();
        assert_eq!(html.matches("<svg").count(), 4);
        assert!(html.contains("182 configurations") && html.contains("paper 0.34 mm") && !html.contains("NaN"));
        assert_eq!(html.matches("card good").count(), 3);
        assert!(html.contains("Tracking against the command") && html.contains("1.137 N m"));
    }
}
