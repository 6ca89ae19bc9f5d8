//! The figures of the study.

use crate::trials::Resumed;
use serde::{Deserialize, Serialize};
use trocar_specimen::{NINETY, Parameter};

/// What the tracker's noise moves a landmark by (mm, RMS).
pub(super) const NOISE_MM: f64 = 1e3 * super::phantom::TRACKER * 1.732_050_807_568_877_2;

/// The parameters of the support.
const SUPPORT: [Parameter; 4] =
    [Parameter::BaseLength, Parameter::ThreadsFrom, Parameter::ThreadsSlack, Parameter::ThreadsStiffness];

/// One parameter of one fit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ParameterRow {
    /// Its name.
    pub parameter: String,
    /// Its true value.
    pub truth: f64,
    /// The 5%, 50% and 95% quantiles.
    pub interval: [f64; 3],
    /// Width of the 90% interval over that of the prior.
    pub width: f64,
    /// Whether the 90% interval holds the truth.
    pub holds: bool,
    /// Distance of the fitted lifts from those at the ends of an interval half as wide as the
    /// prior's about the true value, in deviations of their landmarks' measurement: of the nearer
    /// end.
    pub distance: Option<f64>,
}

/// One fit of one phantom.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FitRow {
    /// Seed of the phantom.
    pub phantom: u64,
    /// Cells of the fitted mesh (mm).
    pub cell_mm: f64,
    /// Whether measured forces were used.
    pub forces: bool,
    /// Nodes of the fitted mesh.
    pub nodes: usize,
    /// Its parameters.
    pub parameters: Vec<ParameterRow>,
    /// Simulated values that diverged.
    pub diverged: usize,
    /// Landmark error of the fitted lifts (mm).
    pub fitted_rmse_mm: f64,
    /// Error of the model over the lift.
    pub model_error: f64,
    /// Median landmark error of the lifts that were not fitted (mm): with the identified values,
    pub held_out_mm: Option<f64>,
    /// without their threads,
    pub without_threads_mm: Option<f64>,
    /// and with the pins of a specimen.
    pub own_pins_mm: Option<f64>,
    /// Median displacement of these lifts (mm).
    pub lift_mm: Option<f64>,
}

impl FitRow {
    /// Whether landmarks of the fitted lifts can tell a parameter to half of the prior's width:
    /// with all others known, the ends of such an interval could be told from the true value with
    /// 90% confidence.
    fn observes(&self, parameter: Parameter) -> bool {
        let own = self.parameters.iter().find(|p| p.parameter == parameter.name());
        own.and_then(|p| p.distance).is_some_and(|distance| distance > NINETY)
    }
}

/// One parameter over all phantoms.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CoverageRow {
    /// What was fitted: `default`, `coarser` or `forces`.
    pub fit: String,
    /// The parameter.
    pub parameter: String,
    /// Phantoms whose 90% interval holds the truth.
    pub holds: usize,
    /// Phantoms.
    pub phantoms: usize,
    /// The share of the two.
    pub coverage: f64,
    /// Median width of the interval over the prior's.
    pub width: f64,
    /// Phantoms of which it is at most half as wide.
    pub identified: usize,
    /// Phantoms in which it is observable: with all others known, landmarks of the fitted lifts
    /// could tell the true value from the ends of an interval half as wide as the prior's.
    pub observable: usize,
    /// Median width over the prior's in these.
    pub observable_width: Option<f64>,
}

/// Landmark errors over all phantoms: medians (mm).
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ErrorRow {
    /// What was fitted.
    pub fit: String,
    /// Of the fitted lifts.
    pub fitted_rmse_mm: Option<f64>,
    /// Of the lifts that were not fitted, with the identified values.
    pub held_out_mm: Option<f64>,
    /// The same without their threads.
    pub without_threads_mm: Option<f64>,
    /// The same with the pins of a specimen.
    pub own_pins_mm: Option<f64>,
    /// Median error of the model over the lift.
    pub model_error: Option<f64>,
}

/// The figures of the study.
#[derive(Clone, Debug, Serialize)]
pub struct IdentificationResult {
    /// Each parameter of each fit over all phantoms.
    pub coverage: Vec<CoverageRow>,
    /// Parameters of the default fit whose interval holds the truth in 80% to all of the phantoms.
    pub covered: usize,
    /// Landmark errors.
    pub errors: Vec<ErrorRow>,
    /// Median landmark error of the lifts that were not fitted (mm), default fit.
    pub landmark_rmse_mm: Option<f64>,
    /// What noise alone gives (mm).
    pub landmark_floor_mm: f64,
    /// The largest `observable_width` of the parameters of the support, default fit.
    pub support_width: Option<f64>,
    /// Median displacement of these lifts (mm).
    pub lift_mm: Option<f64>,
    /// Nodes of the fitted meshes: medians of the default and the coarser one.
    pub nodes: [Option<f64>; 2],
    /// All fits.
    pub rows: Vec<FitRow>,
    /// Trials of an earlier run.
    pub resumed: Resumed,
}

/// The median width.
fn width(rows: &[ParameterRow]) -> Option<f64> {
    trocar_core::median(rows.iter().map(|p| p.width).collect::<Vec<_>>())
}

/// The largest width of the parameters of the support, over phantoms in which they are observable.
pub(super) fn support_width(coverage: &[CoverageRow]) -> Option<f64> {
    let is_support = |c: &&CoverageRow| SUPPORT.iter().any(|p| p.name() == c.parameter);
    coverage.iter().filter(is_support).filter_map(|c| c.observable_width).max_by(f64::total_cmp)
}

/// Each parameter over the rows of a fit.
pub(super) fn coverage(fit: &str, rows: &[&FitRow]) -> Vec<CoverageRow> {
    let row = |parameter: Parameter| {
        let of = |r: &&&FitRow| r.parameters.iter().find(|p| p.parameter == parameter.name()).cloned();
        let all: Vec<ParameterRow> = rows.iter().filter_map(|r| of(&r)).collect();
        let observed: Vec<ParameterRow> =
            rows.iter().filter(|r| r.observes(parameter)).filter_map(|r| of(&r)).collect();
        let holds = all.iter().filter(|p| p.holds).count();
        CoverageRow {
            fit: fit.to_owned(),
            parameter: parameter.name().to_owned(),
            holds,
            phantoms: all.len(),
            coverage: holds as f64 / all.len().max(1) as f64,
            width: width(&all).unwrap_or(f64::NAN),
            identified: all.iter().filter(|p| p.width <= 0.5).count(),
            observable: observed.len(),
            observable_width: width(&observed),
        }
    };
    Parameter::ALL.into_iter().map(row).collect()
}

/// Errors over the rows of a fit.
pub(super) fn errors(fit: &str, rows: &[&FitRow]) -> ErrorRow {
    let middle = |of: &dyn Fn(&FitRow) -> Option<f64>| {
        trocar_core::median(rows.iter().filter_map(|r| of(r)).collect::<Vec<_>>())
    };
    ErrorRow {
        fit: fit.to_owned(),
        fitted_rmse_mm: middle(&|r| Some(r.fitted_rmse_mm)),
        held_out_mm: middle(&|r| r.held_out_mm),
        without_threads_mm: middle(&|r| r.without_threads_mm),
        own_pins_mm: middle(&|r| r.own_pins_mm),
        model_error: middle(&|r| Some(r.model_error)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coverage_counts_the_intervals_that_hold_the_truth() {
        let row = |phantom: u64, holds: bool, width: f64| FitRow {
            phantom,
            cell_mm: 4.0,
            forces: false,
            nodes: 400,
            parameters: [Parameter::BaseLength, Parameter::ThreadsSlack]
                .map(|parameter| ParameterRow {
                    parameter: parameter.name().to_owned(),
                    truth: 0.1,
                    interval: [0.05, 0.1, 0.2],
                    width,
                    holds,
                    distance: Some(if parameter == Parameter::BaseLength { 9.0 } else { phantom as f64 }),
                })
                .to_vec(),
            diverged: 0,
            fitted_rmse_mm: 1.0,
            model_error: 0.02,
            held_out_mm: Some(1.5),
            without_threads_mm: None,
            own_pins_mm: Some(5.0),
            lift_mm: Some(20.0),
        };
        let rows = [row(1, true, 0.2), row(2, false, 0.7), row(3, true, 0.3)];
        let all: Vec<&FitRow> = rows.iter().collect();
        let base = &coverage("default", &all)[0];
        assert_eq!((base.holds, base.phantoms, base.identified, base.width), (2, 3, 2, 0.3));
        assert_eq!((base.observable, base.observable_width), (3, Some(0.3)));
        // Lifts of the first phantom do not tell the slack.
        let slack = &coverage("default", &all)[2];
        assert_eq!((slack.phantoms, slack.observable, slack.observable_width), (3, 2, Some(0.5)));
        assert_eq!(support_width(&coverage("default", &all)), Some(0.5));
        assert_eq!(errors("default", &all).held_out_mm, Some(1.5));
    }
}
