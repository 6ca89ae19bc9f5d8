//! The film of a lift that was not fitted, beside the same lift simulated with the identified
//! support.

use super::identified::organ_of;
use super::result::{FoldRow, JudgedRow};
use crate::Result;
use trocar_core::Progress;
use trocar_identify::{Grip, LoneOrgan, SeenLift};
use trocar_measure::RecordingFilm;
use trocar_recording::Recording;
use trocar_report::table::or_dash;
use trocar_specimen::Specimen;
use trocar_workflow::lift_film::{LiftFilm, ShownLift, Simulated};

/// The film, and the lift that it shows.
pub(super) struct HeldOutFilm {
    film: LiftFilm,
    judged: JudgedRow,
}

/// The lift whose landmark error is in the middle of all that were not fitted: neither the best nor
/// the worst. `None` if there is none.
fn middle(folds: &[FoldRow]) -> Option<(&FoldRow, &JudgedRow)> {
    let all = folds.iter().flat_map(|fold| fold.judged.iter().map(move |judged| (fold, judged)));
    let mut known: Vec<(f64, _)> = all.filter_map(|pair| Some((pair.1.landmark_rmse_mm?, pair))).collect();
    known.sort_by(|a, b| a.0.total_cmp(&b.0));
    known.get(known.len().saturating_sub(1) / 2).map(|(_, pair)| *pair)
}

/// Films it.
pub(super) fn held_out(
    recording: &Recording,
    specimen: &Specimen,
    appendix: &LoneOrgan,
    lifts: &[(usize, SeenLift)],
    folds: &[FoldRow],
    progress: &dyn Progress,
) -> Result<Option<HeldOutFilm>> {
    let Some((fold, judged)) = middle(folds) else { return Ok(None) };
    let Some((number, seen)) = lifts.iter().find(|(number, _)| *number == judged.lift) else { return Ok(None) };
    let organ = organ_of(fold, appendix);
    let made = Simulated { specimen, organ: &organ, seen, grip: Grip::Place };
    let lift = ShownLift { number: *number, rate_hz: recording.info.rate_hz, lift: &seen.lift };
    let film = lift.film(&mut RecordingFilm::new(recording), Some(&made), progress)?;
    Ok(Some(HeldOutFilm { film, judged: judged.clone() }))
}

impl HeldOutFilm {
    /// The film above its caption (HTML).
    pub fn figure(&self) -> String {
        let caption = format!(
            "<b>Lift {}.</b> Support and tissue of the simulated appendix are identified from the other half of the \
             lifts. Of all lifts that were not fitted, this one has the middle landmark error: {} mm at the peak. At \
             each moment the simulated tissue has gone the same share of its way as the filmed one.",
            self.judged.lift,
            or_dash(self.judged.landmark_rmse_mm, 2)
        );
        self.film.figure("a filmed lift, and at its right the same lift simulated", &caption)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use trocar_specimen::Posterior;

    #[test]
    fn the_filmed_lift_is_neither_the_best_nor_the_worst() {
        let judged = |lift: usize, error: Option<f64>| JudgedRow {
            lift,
            displacement_mm: 20.0,
            landmark_rmse_mm: error,
            chamfer_mm: None,
            without_threads_mm: None,
        };
        let fold = |judged: Vec<JudgedRow>| FoldRow {
            values: Vec::new(),
            posterior: Posterior {
                recording: String::new(),
                lifts: Vec::new(),
                landmark_rmse_mm: 1.0,
                mean: Vec::new(),
                covariance: Vec::new(),
                parameters: Vec::new(),
            },
            fitted_rmse_mm: 1.0,
            model_error: 0.1,
            judged,
        };
        let folds =
            [fold(vec![judged(1, Some(0.9)), judged(3, None)]), fold(vec![judged(0, Some(1.4)), judged(2, Some(0.6))])];
        assert_eq!(middle(&folds).map(|(_, j)| j.lift), Some(1));
        assert!(middle(&[fold(vec![judged(3, None)])]).is_none());
    }
}
