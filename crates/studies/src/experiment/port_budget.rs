//! Fig. 5: how far a shaft may lie beside the port's centre at each tilt, by the formula and by pushing one through the contact model.

use crate::{Error, Result, pages};
use glam::{DVec2, DVec3};
use serde::Serialize;
use std::f64::consts::{FRAC_PI_2, PI};
use std::path::Path;
use std::time::Instant;
use trocar_core::Progress;
use trocar_robot::port::{Port, RimState, Shaft, Twist};
use trocar_workflow::REPORT;

/// The file that makes a folder one of this experiment's.
const MARKER: &str = "port-budget.json";

/// Tilts of the table [degrees]: from 0 ...
const LAST_TILT: f64 = 35.0;
/// ... in steps of this.
const STEP: f64 = 0.5;

/// What the paper says (section VI-A): the arm, its tilt at the start [degrees], the clearance there [mm].
const STARTS: [(&str, f64, f64); 2] = [("left", 13.3, 0.43), ("right", 18.3, 0.37)];

/// The paper's tilt without clearance [degrees].
const PAPER_LIMIT: f64 = 34.0;

/// Tilts at which the room is measured to all sides [degrees].
const AROUND: [f64; 5] = [0.0, 13.3, 18.3, 24.1, 30.0];

/// Directions of that, over half a turn; the other half is its mirror image.
const DIRECTIONS: usize = 90;

/// Sheets beside the one that was asked for [mm].
pub(crate) const SHEETS: [f64; 2] = [1.0, 2.0];

/// No shaft is pushed farther than this share of the hole.
const FARTHEST: f64 = 1.0;

/// Halvings of a search: to the last digits.
const HALVINGS: usize = 60;

/// The experiment's options.
#[derive(Clone, Debug)]
pub struct PortBudgetExperiment {
    /// Diameter of the hole [m].
    pub hole: f64,
    /// Diameter of the shaft [m].
    pub shaft: f64,
    /// Thickness of the sheet [m]; the paper's formula is that of 0.
    pub thickness: f64,
    /// Force of the push for the deviation under load [N].
    pub push: f64,
}

/// One tilt.
#[derive(Clone, Debug, Serialize)]
pub struct PortBudgetRow {
    /// Angle between the shaft and the port's normal [degrees].
    pub tilt_deg: f64,
    /// Lateral clearance by the formula [mm]; negative where the shaft does not fit.
    pub clearance_mm: f64,
    /// Farthest that a shaft is pushed in the direction of its tilt before the contact model touches [mm]; none where it does not fit.
    pub measured_mm: Option<f64>,
    /// The same against the direction of the tilt [mm].
    pub measured_against_mm: Option<f64>,
    /// The same across it [mm].
    pub measured_across_mm: Option<f64>,
    /// The least to any side [mm].
    pub measured_least_mm: Option<f64>,
    /// How far the push takes it in the direction of its tilt, the rim yielding [mm].
    pub pushed_mm: f64,
    /// Clearance by the formula in thicker sheets, 1 and 2 mm [mm].
    pub thicker_mm: [f64; 2],
}

/// A start pose of the paper.
#[derive(Clone, Debug, Serialize)]
pub struct PortStart {
    /// The arm.
    pub arm: &'static str,
    /// Its tilt [degrees].
    pub tilt_deg: f64,
    /// The paper's clearance [mm].
    pub paper_mm: f64,
    /// The formula's [mm].
    pub clearance_mm: f64,
    /// That of the contact model [mm].
    pub measured_mm: Option<f64>,
}

/// The room to all sides at one tilt.
#[derive(Clone, Debug, Serialize)]
pub struct PortRoom {
    /// The tilt [degrees].
    pub tilt_deg: f64,
    /// Direction of the push from that of the tilt [degrees], and the farthest before something touches [mm].
    pub room: Vec<(f64, f64)>,
}

/// The experiment's outcome.
#[derive(Clone, Debug, Serialize)]
pub struct PortBudgetResult {
    /// Diameter of the hole [mm].
    pub hole_mm: f64,
    /// Diameter of the shaft [mm].
    pub shaft_mm: f64,
    /// Thickness of the sheet [mm].
    pub thickness_mm: f64,
    /// Stiffness of the rim [N/mm].
    pub stiffness_n_mm: f64,
    /// The push [N].
    pub push_n: f64,
    /// Every tilt.
    pub rows: Vec<PortBudgetRow>,
    /// The paper's start poses.
    pub starts: Vec<PortStart>,
    /// The room to all sides.
    pub rooms: Vec<PortRoom>,
    /// Tilt without clearance by the formula [degrees]; none where even an upright shaft has none.
    pub limit_deg: Option<f64>,
    /// The tilt at which a centred shaft touches in the contact model [degrees].
    pub measured_limit_deg: Option<f64>,
    /// The paper's [degrees].
    pub paper_limit_deg: f64,
    /// Largest difference between formula and contact model in the direction of the tilt [mm].
    pub largest_difference_mm: f64,
    /// Wall time [s].
    pub seconds: f64,
    /// The report's path.
    pub report: String,
}

impl PortBudgetExperiment {
    /// Measures all tilts and writes the report into the folder `output`.
    ///
    /// # Errors
    /// A hole, sheet or shaft that no port has, a folder that cannot be written, an interruption.
    pub fn run(&self, output: &Path, progress: &dyn Progress) -> Result<PortBudgetResult> {
        let clock = Instant::now();
        let pushing = Pushing::new(self)?;
        super::claim(output, MARKER)?;
        let mut result = self.measure(&pushing, progress)?;
        result.report = output.join(REPORT).display().to_string();
        result.seconds = clock.elapsed().as_secs_f64();
        super::write(&output.join(REPORT), pages::port_budget(&result)?.as_bytes())?;
        let json = serde_json::to_vec_pretty(&result).map_err(|e| Error::Format(e.to_string()))?;
        super::write(&output.join(MARKER), &json)?;
        Ok(result)
    }

    fn measure(&self, pushing: &Pushing, progress: &dyn Progress) -> Result<PortBudgetResult> {
        let (port, radius) = (&pushing.port, pushing.radius);
        let count = (LAST_TILT / STEP).round() as usize + 1;
        let mut rows = Vec::with_capacity(count);
        progress.begin("tilts", count as u64);
        for k in 0..count {
            if progress.interrupted() {
                return Err(Error::Interrupted);
            }
            rows.push(pushing.row(k as f64 * STEP, self.push));
            progress.advance(1);
        }
        progress.end();
        let start = |(arm, tilt_deg, paper_mm): (&'static str, f64, f64)| PortStart {
            arm,
            tilt_deg,
            paper_mm,
            clearance_mm: 1e3 * port.clearance(radius, tilt_deg.to_radians()),
            measured_mm: pushing.room(tilt_deg.to_radians(), 0.0).map(|r| 1e3 * r),
        };
        let around = |tilt_deg: f64| {
            let direction = |k: usize| 180.0 * k as f64 / DIRECTIONS as f64;
            let room = |d: f64| pushing.room(tilt_deg.to_radians(), d.to_radians()).map(|r| (d, 1e3 * r));
            PortRoom { tilt_deg, room: (0..=DIRECTIONS).filter_map(|k| room(direction(k))).collect() }
        };
        let differences = rows.iter().filter_map(|r| r.measured_mm.map(|m| (m - r.clearance_mm).abs()));
        Ok(PortBudgetResult {
            hole_mm: 1e3 * self.hole,
            shaft_mm: 1e3 * self.shaft,
            thickness_mm: 1e3 * self.thickness,
            stiffness_n_mm: 1e-3 * port.stiffness,
            push_n: self.push,
            largest_difference_mm: differences.fold(0.0, f64::max),
            rows,
            starts: STARTS.map(start).into(),
            rooms: AROUND.map(around).into(),
            limit_deg: port.tilt_with_clearance(radius, 0.0).map(f64::to_degrees),
            measured_limit_deg: pushing.limit().map(f64::to_degrees),
            paper_limit_deg: PAPER_LIMIT,
            seconds: 0.0,
            report: String::new(),
        })
    }
}

/// A port and the shaft that is pushed in it.
struct Pushing {
    port: Port,
    radius: f64,
}

impl Pushing {
    fn new(experiment: &PortBudgetExperiment) -> Result<Self> {
        let port = Port {
            hole_diameter: experiment.hole,
            thickness: experiment.thickness,
            ..Port::new(DVec3::ZERO, DVec3::Z, DVec3::X)?
        };
        port.check()?;
        let radius = 0.5 * experiment.shaft;
        let instrument = trocar_robot::instrument::Instrument::grasper();
        trocar_robot::instrument::Instrument { shaft_radius: radius, ..instrument }.check()?;
        if experiment.shaft >= experiment.hole {
            let (shaft, hole) = (1e3 * experiment.shaft, 1e3 * experiment.hole);
            let reason = format!("{shaft} mm do not go through a hole of {hole} mm; it must be thinner");
            return Err(trocar_robot::Error::Invalid { what: "shaft".into(), reason }.into());
        }
        if !(experiment.push.is_finite() && experiment.push > 0.0) {
            let reason = format!("{} N must be above 0", experiment.push);
            return Err(trocar_robot::Error::Invalid { what: "push".into(), reason }.into());
        }
        Ok(Self { port, radius })
    }

    /// A shaft tilted towards x whose axis goes through the port's plane at `at`.
    fn shaft(&self, tilt: f64, at: DVec2) -> Shaft {
        let direction = DVec3::new(tilt.sin(), 0.0, tilt.cos());
        Shaft { base: at.extend(0.0) - 0.2 * direction, direction, radius: self.radius, length: 0.33 }
    }

    /// What the rim does to a shaft at rest there, in the port's plane [N], and whether it touches.
    fn rim(&self, tilt: f64, at: DVec2) -> (DVec2, bool) {
        let shaft = self.shaft(tilt, at);
        let contacts = self.port.contacts(&shaft, &Twist::default(), &RimState::default());
        (contacts.on_shaft(shaft.base).0.truncate(), contacts.touching().next().is_some())
    }

    /// The farthest push from the centre in a direction (from the tilt's) before something touches [m]; none where the centred shaft touches. What fits is convex, so
    /// halving finds it.
    fn room(&self, tilt: f64, direction: f64) -> Option<f64> {
        let along = DVec2::from_angle(direction);
        let touches = |d: f64| self.rim(tilt, d * along).1;
        (!touches(0.0)).then(|| halve(0.0, FARTHEST * self.port.hole_diameter, touches))
    }

    /// How far a push of `force` [N] takes the shaft in the direction of its tilt [m].
    fn pushed(&self, tilt: f64, force: f64) -> f64 {
        halve(0.0, FARTHEST * self.port.hole_diameter, |d| -self.rim(tilt, d * DVec2::X).0.x >= force)
    }

    /// The tilt at which a centred shaft touches [rad].
    fn limit(&self) -> Option<f64> {
        let touches = |tilt: f64| self.rim(tilt, DVec2::ZERO).1;
        (!touches(0.0)).then(|| halve(0.0, 85_f64.to_radians(), touches))
    }

    fn row(&self, tilt_deg: f64, push: f64) -> PortBudgetRow {
        let tilt = tilt_deg.to_radians();
        let room = |direction: f64| self.room(tilt, direction).map(|r| 1e3 * r);
        let all = (0..=DIRECTIONS).filter_map(|k| room(PI * k as f64 / DIRECTIONS as f64));
        let thicker = |mm: f64| 1e3 * Port { thickness: 1e-3 * mm, ..self.port }.clearance(self.radius, tilt);
        PortBudgetRow {
            tilt_deg,
            clearance_mm: 1e3 * self.port.clearance(self.radius, tilt),
            measured_mm: room(0.0),
            measured_against_mm: room(PI),
            measured_across_mm: room(FRAC_PI_2),
            measured_least_mm: all.reduce(f64::min),
            pushed_mm: 1e3 * self.pushed(tilt, push),
            thicker_mm: SHEETS.map(thicker),
        }
    }
}

/// Where a condition begins to hold between `low` and `high`.
fn halve(mut low: f64, mut high: f64, holds: impl Fn(f64) -> bool) -> f64 {
    for _ in 0..HALVINGS {
        let middle = 0.5 * (low + high);
        if holds(middle) { high = middle } else { low = middle }
    }
    low
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use trocar_core::Silent;

    pub(crate) fn measured() -> PortBudgetResult {
        let experiment = PortBudgetExperiment { hole: 6e-3, shaft: 5e-3, thickness: 0.0, push: 5.0 };
        experiment.measure(&Pushing::new(&experiment).unwrap(), &Silent).unwrap()
    }

    #[test]
    fn the_contact_model_has_the_papers_budget() {
        let r = measured();
        assert!(r.largest_difference_mm < 1e-9);
        for start in &r.starts {
            assert!((start.measured_mm.unwrap() - start.paper_mm).abs() < 0.005, "{start:?}");
        }
        assert!((r.limit_deg.unwrap() - 33.557).abs() < 1e-3);
        assert!((r.measured_limit_deg.unwrap() - r.limit_deg.unwrap()).abs() < 1e-6);
        assert_eq!(r.rows.len(), 71);
        assert!(r.rows.last().unwrap().measured_mm.is_none(), "35 degrees do not fit");
        // 5 N on 20 N/mm, a little more where the rim pushes aslant.
        let upright = &r.rows[0];
        assert!((upright.pushed_mm - 0.75).abs() < 1e-6, "{}", upright.pushed_mm);
        assert!(r.rooms.iter().all(|room| room.room.len() == DIRECTIONS + 1));
    }

    #[test]
    fn options_that_make_no_port_are_refused() {
        let good = PortBudgetExperiment { hole: 6e-3, shaft: 5e-3, thickness: 0.0, push: 5.0 };
        let refused = |e: PortBudgetExperiment| Pushing::new(&e).err().unwrap().to_string();
        assert!(refused(PortBudgetExperiment { hole: f64::NAN, ..good }).contains("hole_diameter"));
        assert!(refused(PortBudgetExperiment { shaft: -1.0, ..good }).contains("shaft_radius"));
        assert!(refused(PortBudgetExperiment { push: 0.0, ..good }).contains("push"));
        assert!(refused(PortBudgetExperiment { shaft: 7e-3, ..good }).contains("7 mm do not go through"));
    }
}
