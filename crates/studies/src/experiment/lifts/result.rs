//! The figures of the study.

use super::support::Support;
use crate::trials::Resumed;
use serde::{Deserialize, Serialize};
use trocar_measure::{Line, PAPER};
use trocar_specimen::Posterior;
use trocar_workflow::measure::Measured;

/// Heights at which the simulation is compared with the paper's line (mm).
pub(super) const COMPARED_MM: [f64; 2] = [15.0, 30.0];

/// The bar: the scatter of the paper's lifts about their line (mm).
pub(super) const BAR_MM: f64 = PAPER.residual_sd;

/// One simulated lift.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SimulatedRow {
    /// What holds the simulated appendix.
    pub support: String,
    /// Young's modulus (kPa).
    pub modulus_kpa: f64,
    /// Number of the recorded lift that is reproduced; `None` for a lift straight up.
    pub recorded: Option<usize>,
    /// Place of the grasp along the organ, 0 to 1.
    pub grasp_s: f64,
    /// Distance that the grasped tissue is moved (mm).
    pub displacement_mm: f64,
    /// Whether the simulation diverged.
    pub diverged: bool,
    /// Greatest lift of the centreline (mm).
    pub lift_mm: Option<f64>,
    /// Half-drop distance (mm).
    pub d50_mm: Option<f64>,
    /// Landmark error against the recorded lift (mm).
    pub landmark_rmse_mm: Option<f64>,
    /// Local Chamfer distance from the recorded lift (mm).
    pub chamfer_mm: Option<f64>,
    /// Distance from the apex (mm), and lift over the greatest lift.
    pub profile: Vec<[f64; 2]>,
}

/// A recorded lift that was not fitted, reproduced with the identified values.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct JudgedRow {
    /// Number of the lift.
    pub lift: usize,
    /// Displacement of the grasped tissue (mm).
    pub displacement_mm: f64,
    /// Landmark error (mm).
    pub landmark_rmse_mm: Option<f64>,
    /// Local Chamfer distance (mm).
    pub chamfer_mm: Option<f64>,
    /// Landmark error without the identified threads (mm).
    pub without_threads_mm: Option<f64>,
}

/// What is identified from half of the recorded lifts.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FoldRow {
    /// The values that explain these lifts best, by the names of the parameters.
    pub values: Vec<(String, f64)>,
    /// The posterior.
    pub posterior: Posterior,
    /// Landmark error of the fitted lifts (mm).
    pub fitted_rmse_mm: f64,
    /// Error of the model over the lift.
    pub model_error: f64,
    /// The other lifts.
    pub judged: Vec<JudgedRow>,
}

/// Both halves.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct IdentifiedSummary {
    /// Median landmark error of lifts that were not fitted (mm).
    pub landmark_rmse_mm: Option<f64>,
    /// The same without the identified threads (mm).
    pub without_threads_mm: Option<f64>,
    /// Median local Chamfer distance (mm).
    pub chamfer_mm: Option<f64>,
    /// From the even lifts, and from the odd ones.
    pub folds: Vec<FoldRow>,
}

impl IdentifiedSummary {
    /// Of the two halves.
    pub(super) fn of(folds: Vec<FoldRow>) -> Self {
        let middle = |of: &dyn Fn(&JudgedRow) -> Option<f64>| {
            trocar_core::median(folds.iter().flat_map(|f| &f.judged).filter_map(of).collect::<Vec<_>>())
        };
        Self {
            landmark_rmse_mm: middle(&|j| j.landmark_rmse_mm),
            without_threads_mm: middle(&|j| j.without_threads_mm),
            chamfer_mm: middle(&|j| j.chamfer_mm),
            folds,
        }
    }
}

/// The means over the places of lifts straight up.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TrendRow {
    /// What holds the simulated appendix.
    pub support: String,
    /// Young's modulus (kPa).
    pub modulus_kpa: f64,
    /// Displacement of the grasped tissue (mm).
    pub displacement_mm: f64,
    /// Mean greatest lift of the centreline (mm).
    pub lift_mm: f64,
    /// Mean half-drop distance (mm).
    pub d50_mm: f64,
    /// d50 less that of the paper's line at this lift (mm).
    pub residual_mm: f64,
}

/// Errors of reproduced lifts: medians over the lifts.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ErrorRow {
    /// What holds the simulated appendix.
    pub support: String,
    /// Young's modulus (kPa).
    pub modulus_kpa: f64,
    /// Number of lifts.
    pub lifts: usize,
    /// Number of lifts that diverged.
    pub diverged: usize,
    /// Median landmark error (mm).
    pub landmark_rmse_mm: Option<f64>,
    /// Median local Chamfer distance (mm).
    pub chamfer_mm: Option<f64>,
}

/// The figures of the study.
#[derive(Clone, Debug, Serialize)]
pub struct LiftsResult {
    /// The larger distance of the simulated d50 from the paper's line at 15 and 30 mm, with the
    /// specimen's own pins and modulus (mm).
    pub d50_residual_mm: Option<f64>,
    /// Median landmark error of the reproduced lifts, with the specimen's own pins and modulus
    /// (mm).
    pub specimen_landmark_rmse_mm: Option<f64>,
    /// Median landmark error of lifts that were not fitted, with the support and the tissue that
    /// are identified from the other half of the lifts (mm).
    pub landmark_rmse_mm: Option<f64>,
    /// What is identified.
    pub identified: IdentifiedSummary,
    /// Median landmark difference between two frames at the peak (mm).
    pub landmark_floor_mm: Option<f64>,
    /// Median greatest lift of the recorded lifts (mm).
    pub lift_mm: Option<f64>,
    /// Median landmark error of no motion (mm).
    pub static_rmse_mm: Option<f64>,
    /// Median landmark error if all landmarks move like the apex (mm).
    pub rigid_rmse_mm: Option<f64>,
    /// Median distance of tracked points from the phantom's truth (mm).
    pub tracking_error_mm_median: Option<f64>,
    /// Median local Chamfer distance of the reproduced lifts (mm).
    pub chamfer_mm: Option<f64>,
    /// Median over lifts of the median distance that the rigid alignment of the centrelines leaves
    /// (mm).
    pub alignment_mm: Option<f64>,
    /// The line of d50 over lift of the recorded lifts (mm).
    pub recorded_line: Option<Line>,
    /// The recorded lifts.
    pub recorded: Measured,
    /// Lifts straight up.
    pub trend: Vec<TrendRow>,
    /// Errors of the reproduced lifts.
    pub errors: Vec<ErrorRow>,
    /// All simulated lifts.
    pub rows: Vec<SimulatedRow>,
    /// Modulus of the specimen (kPa).
    pub modulus_kpa: f64,
    /// Modulus of the recorded tissue (kPa), and what held it.
    pub true_modulus_kpa: f64,
    /// What held the recorded tissue.
    pub true_support: String,
    /// Trials of an earlier run.
    pub resumed: Resumed,
}

/// Means of lifts straight up with the same support, modulus and displacement, in the order of the
/// rows.
pub(super) fn trend(rows: &[SimulatedRow]) -> Vec<TrendRow> {
    let mut trend: Vec<TrendRow> = Vec::new();
    let same = |t: &TrendRow, r: &SimulatedRow| {
        (&t.support, t.modulus_kpa, t.displacement_mm) == (&r.support, r.modulus_kpa, r.displacement_mm)
    };
    for row in rows.iter().filter(|r| r.recorded.is_none()) {
        if trend.iter().any(|t| same(t, row)) {
            continue;
        }
        let known = |r: &&SimulatedRow| r.recorded.is_none() && r.d50_mm.is_some();
        let alike = rows.iter().filter(known).filter(|r| {
            (&r.support, r.modulus_kpa, r.displacement_mm) == (&row.support, row.modulus_kpa, row.displacement_mm)
        });
        let pairs: Vec<(f64, f64)> = alike.filter_map(|r| Some((r.lift_mm?, r.d50_mm?))).collect();
        if pairs.is_empty() {
            continue;
        }
        let mean = |of: &dyn Fn(&(f64, f64)) -> f64| pairs.iter().map(of).sum::<f64>() / pairs.len() as f64;
        let (lift_mm, d50_mm) = (mean(&|p| p.0), mean(&|p| p.1));
        trend.push(TrendRow {
            support: row.support.clone(),
            modulus_kpa: row.modulus_kpa,
            displacement_mm: row.displacement_mm,
            lift_mm,
            d50_mm,
            residual_mm: d50_mm - PAPER.at(lift_mm),
        });
    }
    trend
}

/// The larger distance from the paper's line at the compared heights.
pub(super) fn residual(trend: &[TrendRow], modulus_kpa: f64) -> Option<f64> {
    let at = |height: f64| {
        let row = trend.iter().find(|t| {
            t.support == Support::Specimen.name() && t.modulus_kpa == modulus_kpa && t.displacement_mm == height
        });
        row.map(|t| t.residual_mm.abs())
    };
    let [low, high] = COMPARED_MM.map(at);
    Some(low?.max(high?))
}

/// Medians of reproduced lifts with the same support and modulus, in the order of the rows.
pub(super) fn errors(rows: &[SimulatedRow]) -> Vec<ErrorRow> {
    let mut errors: Vec<ErrorRow> = Vec::new();
    for row in rows.iter().filter(|r| r.recorded.is_some()) {
        if errors.iter().any(|e| e.support == row.support && e.modulus_kpa == row.modulus_kpa) {
            continue;
        }
        let alike: Vec<&SimulatedRow> = rows
            .iter()
            .filter(|r| r.recorded.is_some() && r.support == row.support && r.modulus_kpa == row.modulus_kpa)
            .collect();
        let middle = |of: &dyn Fn(&&&SimulatedRow) -> Option<f64>| {
            trocar_core::median(alike.iter().filter_map(|r| of(&r)).collect::<Vec<_>>())
        };
        errors.push(ErrorRow {
            support: row.support.clone(),
            modulus_kpa: row.modulus_kpa,
            lifts: alike.len(),
            diverged: alike.iter().filter(|r| r.diverged).count(),
            landmark_rmse_mm: middle(&|r| r.landmark_rmse_mm),
            chamfer_mm: middle(&|r| r.chamfer_mm),
        });
    }
    errors
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(displacement_mm: f64, grasp_s: f64, lift_mm: f64, d50_mm: Option<f64>) -> SimulatedRow {
        SimulatedRow {
            support: Support::Specimen.name().to_owned(),
            modulus_kpa: 12.0,
            recorded: None,
            grasp_s,
            displacement_mm,
            diverged: d50_mm.is_none(),
            lift_mm: d50_mm.map(|_| lift_mm),
            d50_mm,
            landmark_rmse_mm: None,
            chamfer_mm: None,
            profile: Vec::new(),
        }
    }

    #[test]
    fn the_residual_is_the_larger_of_both_heights() {
        let rows =
            [row(15.0, 0.6, 15.0, Some(11.7)), row(15.0, 0.7, 15.0, Some(13.7)), row(30.0, 0.6, 30.0, Some(20.0))];
        let trend = trend(&rows);
        assert_eq!(trend.len(), 2);
        assert!((trend[0].d50_mm - 12.7).abs() < 1e-12 && trend[0].residual_mm.abs() < 1e-12);
        assert!((residual(&trend, 12.0).unwrap() - 2.5).abs() < 1e-12);
        assert_eq!(residual(&trend, 3.0), None);
        let diverged = [row(15.0, 0.6, 15.0, None)];
        assert_eq!(residual(&super::trend(&diverged), 12.0), None);
    }

    #[test]
    fn errors_are_medians_over_the_lifts() {
        let reproduced = |number: usize, rmse: Option<f64>| SimulatedRow {
            recorded: Some(number),
            landmark_rmse_mm: rmse,
            diverged: rmse.is_none(),
            ..row(20.0, 0.6, 19.0, rmse)
        };
        let errors = errors(&[reproduced(0, Some(4.0)), reproduced(1, Some(6.0)), reproduced(2, None)]);
        assert_eq!(errors.len(), 1);
        assert_eq!((errors[0].lifts, errors[0].diverged, errors[0].landmark_rmse_mm), (3, 1, Some(5.0)));
    }
}
