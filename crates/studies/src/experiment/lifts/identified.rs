//! The support that is identified from some of the recorded lifts, judged by the others.

use super::result::{FoldRow, JudgedRow};
use crate::Result;
use trocar_core::Progress;
use trocar_identify::{Grip, Identification, LoneOrgan, Pace, SeenLift, default_priors};
use trocar_specimen::Posterior;

/// Cells of the mesh in which lifts are fitted (m).
const CELL: f64 = 4e-3;

/// Identifies from the lifts whose number leaves `fold` when halved, and reproduces the others with
/// the mesh of the specimen.
pub(super) fn identified(
    fold: usize,
    appendix: &LoneOrgan,
    lifts: &[(usize, SeenLift)],
    progress: &dyn Progress,
) -> Result<FoldRow> {
    let (fitted, judged): (Vec<_>, Vec<_>) = lifts.iter().partition(|(number, _)| number % 2 == fold);
    let identification = Identification {
        organ: appendix.meshed(CELL)?,
        lifts: fitted.iter().map(|(number, lift)| lift.observation(*number)).collect(),
        priors: default_priors(),
        seed: 1,
        recording: "recording".to_owned(),
        threads: 1,
    };
    let found = identification.run(progress)?;
    let error =
        |values: &[(trocar_specimen::Parameter, f64)], threads: bool| -> Result<Vec<Option<[Option<f64>; 2]>>> {
            let organ = appendix.with(|organ| {
                Posterior::apply(values, organ);
                organ.threads = organ.threads.filter(|_| threads);
            });
            let pulls: Vec<_> = judged.iter().map(|(_, lift)| lift.pull(Grip::Place)).collect();
            let lifted = organ.lift(&pulls, Pace::SLOW, progress)?;
            Ok(judged.iter().zip(&lifted).map(|((_, lift), l)| l.as_ref().map(|l| lift.compared(&organ, l))).collect())
        };
    let (held, loose) = (error(&found.best, true)?, error(&found.best, false)?);
    let mm = |e: Option<f64>| e.map(|m| 1e3 * m);
    let row = |((number, lift), (held, loose)): (
        &&(usize, SeenLift),
        (&Option<[Option<f64>; 2]>, &Option<[Option<f64>; 2]>),
    )| {
        let [rmse, chamfer] = held.unwrap_or_default();
        JudgedRow {
            lift: *number,
            displacement_mm: 1e3 * lift.displacement.length(),
            landmark_rmse_mm: mm(rmse),
            chamfer_mm: mm(chamfer),
            without_threads_mm: mm(loose.and_then(|l| l[0])),
        }
    };
    Ok(FoldRow {
        values: found.best.iter().map(|(p, value)| (p.name().to_owned(), *value)).collect(),
        fitted_rmse_mm: 1e3 * found.rmse,
        model_error: found.model_error,
        judged: judged.iter().zip(held.iter().zip(&loose)).map(row).collect(),
        posterior: found.posterior,
    })
}
