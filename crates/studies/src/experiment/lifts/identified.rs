//! The support that is identified from some of the recorded lifts, judged by the others.

use super::result::{FoldRow, JudgedRow};
use crate::Result;
use trocar_core::Progress;
use trocar_identify::{FINER, Grip, Identification, Lifted, LoneOrgan, Pace, SeenLift, default_priors};
use trocar_specimen::{Parameter, Posterior};

/// Cells of the coarse mesh in which lifts are fitted (m).
const CELL: f64 = 4e-3;

/// Landmark error and local Chamfer distance of a lift (mm).
type Errors = [Option<f64>; 2];

/// Identifies from the lifts whose number leaves `fold` when halved, and reproduces the others with
/// the mesh of the specimen.
pub(crate) fn identified(
    fold: usize,
    appendix: &LoneOrgan,
    lifts: &[(usize, SeenLift)],
    progress: &dyn Progress,
) -> Result<FoldRow> {
    let (fitted, judged): (Vec<_>, Vec<_>) = lifts.iter().partition(|(number, _)| number % 2 == fold);
    let identification = Identification {
        organ: appendix.meshed(CELL)?,
        finer: appendix.meshed(FINER * CELL)?,
        lifts: fitted.iter().map(|(number, lift)| lift.observation(*number)).collect(),
        priors: default_priors(),
        seed: 1,
        recording: "recording".to_owned(),
        threads: 1,
    };
    let found = identification.run(progress)?;
    let error = |threads: bool| -> Result<Vec<Errors>> {
        let organ = appendix.with(|organ| {
            Posterior::apply(&found.best, organ);
            organ.threads = organ.threads.filter(|_| threads);
        });
        let pulls: Vec<_> = judged.iter().map(|(_, lift)| lift.pull(Grip::Place)).collect();
        let lifted = organ.lift(&pulls, Pace::SLOW, progress)?;
        let of = |(_, lift): &(usize, SeenLift), l: &Option<Lifted>| {
            l.as_ref().map(|l| lift.compared(&organ, l)).unwrap_or_default().map(|e| e.map(|m| 1e3 * m))
        };
        Ok(judged.iter().zip(&lifted).map(|(lift, l)| of(lift, l)).collect())
    };
    let (held, loose) = (error(true)?, error(false)?);
    let row = |k: usize| JudgedRow {
        lift: judged[k].0,
        displacement_mm: 1e3 * judged[k].1.displacement.length(),
        landmark_rmse_mm: held[k][0],
        chamfer_mm: held[k][1],
        without_threads_mm: loose[k][0],
    };
    Ok(FoldRow {
        values: found.best.iter().map(|(p, value)| (p.name().to_owned(), *value)).collect(),
        fitted_rmse_mm: 1e3 * found.rmse,
        model_error: found.model_error,
        judged: (0..judged.len()).map(row).collect(),
        posterior: found.posterior,
    })
}

/// The organ with the identified support and tissue.
pub(crate) fn organ_of(fold: &FoldRow, appendix: &LoneOrgan) -> LoneOrgan {
    let known = fold.values.iter().filter_map(|(name, value)| Some((Parameter::named(name)?, *value)));
    let values: Vec<(Parameter, f64)> = known.collect();
    appendix.with(|organ| Posterior::apply(&values, organ))
}
