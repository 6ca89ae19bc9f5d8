//! Fig. 5: lateral clearance of a shaft in a port over its tilt, by the formula and by pushing a
//! shaft through the contact model.

mod page;
mod pushing;
mod result;

use crate::Result;
use crate::names::millimetres;
use crate::study::{Job, Kind, Study};
use clap::Args;
use pushing::{DIRECTIONS, Pushing};
use result::{PortBudgetResult, PortRoom, PortStart};
use trocar_core::Progress;
use trocar_report::document::Document;
use trocar_workflow::check_interrupted;

/// Largest tilt of the table (degrees).
const MAX_TILT: f64 = 35.0;
/// Step of the tilts of the table (degrees).
const STEP: f64 = 0.5;

/// The paper's figures (section VI-A): arm, tilt at the start (degrees), clearance there (mm).
const STARTS: [(&str, f64, f64); 2] = [("left", 13.3, 0.43), ("right", 18.3, 0.37)];

/// The paper's tilt without clearance (degrees).
const PAPER_LIMIT: f64 = 34.0;

/// Tilts at which the clearance is measured in all directions (degrees).
const AROUND: [f64; 5] = [0.0, 13.3, 18.3, 24.1, 30.0];

/// Fig. 5: lateral clearance of a shaft in a port over its tilt, by the formula and by the contact
/// model.
#[derive(Clone, Copy, Debug, Args)]
pub struct PortBudgetExperiment {
    /// Diameter of the hole (mm).
    #[arg(long, default_value = "6", value_parser = millimetres, allow_negative_numbers = true)]
    pub hole: f64,
    /// Diameter of the shaft (mm).
    #[arg(long, default_value = "5", value_parser = millimetres, allow_negative_numbers = true)]
    pub shaft: f64,
    /// Thickness of the sheet (mm); 0 is the paper's formula.
    #[arg(long, default_value = "0", value_parser = millimetres, allow_negative_numbers = true)]
    pub thickness: f64,
    /// Lateral force for the deviation under load (N).
    #[arg(long, default_value_t = 5.0, allow_negative_numbers = true)]
    pub push: f64,
}

impl Study for PortBudgetExperiment {
    const NAME: &'static str = "port-budget";
    const KIND: Kind = Kind::Experiment;
    type Figures = PortBudgetResult;

    fn run(&self, job: &Job<'_>) -> Result<(PortBudgetResult, Document)> {
        let pushing = self.pushing()?;
        job.claim()?;
        let result = self.measure(&pushing, job.progress)?;
        let document = page::document(&result)?;
        Ok((result, document))
    }
}

impl PortBudgetExperiment {
    fn pushing(&self) -> Result<Pushing> {
        let pushing = Pushing::new(self.hole, self.shaft, self.thickness)?;
        if !(self.push.is_finite() && self.push > 0.0) {
            let reason = format!("{} N must be above 0", self.push);
            return Err(trocar_robot::Error::Invalid { what: "push".into(), reason }.into());
        }
        Ok(pushing)
    }

    fn measure(&self, pushing: &Pushing, progress: &dyn Progress) -> Result<PortBudgetResult> {
        let (port, radius) = (&pushing.port, pushing.radius);
        let count = (MAX_TILT / STEP).round() as usize + 1;
        let mut rows = Vec::with_capacity(count);
        progress.begin("tilts", count as u64);
        for k in 0..count {
            check_interrupted(progress)?;
            rows.push(pushing.row(k as f64 * STEP, self.push));
            progress.advance(1);
        }
        progress.end();
        let start = |(arm, tilt_deg, paper_mm): (&'static str, f64, f64)| PortStart {
            arm,
            tilt_deg,
            paper_mm,
            clearance_mm: 1e3 * port.clearance(radius, tilt_deg.to_radians()),
            measured_mm: pushing.clearance(tilt_deg.to_radians(), 0.0).map(|r| 1e3 * r),
        };
        let around = |tilt_deg: f64| {
            let direction = |k: usize| 180.0 * k as f64 / DIRECTIONS as f64;
            let room = |d: f64| pushing.clearance(tilt_deg.to_radians(), d.to_radians()).map(|r| (d, 1e3 * r));
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
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use trocar_core::Silent;

    fn measured() -> PortBudgetResult {
        let experiment = PortBudgetExperiment { hole: 6e-3, shaft: 5e-3, thickness: 0.0, push: 5.0 };
        experiment.measure(&experiment.pushing().unwrap(), &Silent).unwrap()
    }

    #[test]
    fn the_contact_model_agrees_with_the_paper() {
        let r = measured();
        assert!(r.largest_difference_mm < 1e-9);
        for start in &r.starts {
            assert!((start.measured_mm.unwrap() - start.paper_mm).abs() < 0.005, "{start:?}");
        }
        assert!((r.limit_deg.unwrap() - 33.557).abs() < 1e-3);
        assert!((r.measured_limit_deg.unwrap() - r.limit_deg.unwrap()).abs() < 1e-6);
        assert_eq!(r.rows.len(), 71);
        assert!(r.rows.last().unwrap().measured_mm.is_none(), "35 degrees do not fit");
        // 5 N over 20 N/mm; the direction of the rim's force adds a little.
        let upright = &r.rows[0];
        assert!((upright.pushed_mm - 0.75).abs() < 1e-6, "{}", upright.pushed_mm);
        assert!(r.rooms.iter().all(|room| room.room.len() == DIRECTIONS + 1));
    }

    #[test]
    fn invalid_options_are_refused() {
        let good = PortBudgetExperiment { hole: 6e-3, shaft: 5e-3, thickness: 0.0, push: 5.0 };
        let refused = |e: PortBudgetExperiment| e.pushing().err().unwrap().to_string();
        assert!(refused(PortBudgetExperiment { hole: f64::NAN, ..good }).contains("hole_diameter"));
        assert!(refused(PortBudgetExperiment { shaft: -1.0, ..good }).contains("shaft_radius"));
        assert!(refused(PortBudgetExperiment { push: 0.0, ..good }).contains("push"));
        assert!(refused(PortBudgetExperiment { shaft: 7e-3, ..good }).contains("7 mm must be thinner"));
    }

    #[test]
    fn the_page_shows_the_papers_figures() {
        let html = page::document(&measured()).unwrap().page();
        assert_eq!(html.matches("<svg").count(), 4);
        assert_eq!(html.matches("card good").count(), 2, "both starts agree with the paper");
        assert!(
            html.contains("A 5 mm shaft in a 6 mm hole")
                && html.contains("0.43")
                && html.contains("33.56\u{b0}")
                && !html.contains("NaN")
        );
        assert_eq!(html.matches("<ellipse").count(), 5);
    }
}
