//! Many small models in parallel, beside one model of the same total size.

use crate::scenes::{BenchScene, Organs, Run, material};
use crate::statistics::median;
use crate::{Error, Result};
use serde::Serialize;
use std::time::Instant;
use trocar_core::Progress;
use trocar_workflow::{SOLVERS, check_interrupted, solver_named};

/// Warm-up frames, and maximum number of timed frames.
const WARM_UP: usize = 3;
const FRAMES: usize = 60;

/// One schedule and number of threads. The variants take turns: disturbances of the machine affect
/// all of them.
#[derive(Clone, Debug, Serialize)]
pub struct ManyRow {
    /// Name of the schedule.
    pub schedule: String,
    /// Worker threads.
    pub threads: usize,
    /// Number of models.
    pub models: usize,
    /// Elements of all models.
    pub tets: usize,
    /// A frame of the many models, each with its own stepper (ms).
    pub many_ms: f64,
    /// A frame of one model with the same bodies (ms).
    pub one_model_ms: f64,
    /// A frame of one model of six organs (ms).
    pub organs_ms: f64,
    /// Elements of the six organs.
    pub organs_tets: usize,
    /// Time of the many over that of one model with the same bodies, minus 1.
    pub loss: f64,
    /// Their time per element over that of the six organs, minus 1.
    pub loss_against_organs: f64,
}

/// Measures all schedules and numbers of threads.
pub(super) fn measure(
    count: usize,
    tets: usize,
    threads: &[usize],
    budget: f64,
    progress: &dyn Progress,
) -> Result<Vec<ManyRow>> {
    let material = material(12e3, 0.45);
    let small = Organs::analytic_appendix(tets)?;
    let single = BenchScene::many(&small, 1, material)?;
    let together = BenchScene::many(&small, count, material)?;
    let organs = Organs::analytic(count * small.tets())?;
    let six = BenchScene::moving(&organs, material)?;
    progress.begin("many models", (SOLVERS.len() * threads.len() * (WARM_UP + FRAMES)) as u64);
    let mut rows = Vec::new();
    for name in SOLVERS {
        let schedule = solver_named(name)?;
        for &threads in threads {
            let mut many = (0..count).map(|_| Run::new(&single, schedule, 1)).collect::<Result<Vec<_>>>()?;
            let (mut one, mut large) = (Run::new(&together, schedule, threads)?, Run::new(&six, schedule, threads)?);
            let mut times: [Vec<f64>; 3] = Default::default();
            let whole = Instant::now();
            for frame in 0..WARM_UP + FRAMES {
                check_interrupted(progress)?;
                let took = [
                    timed(|| step_all(&mut many, threads))?,
                    timed(|| one.frame().map(|_| ()))?,
                    timed(|| large.frame().map(|_| ()))?,
                ];
                progress.advance(1);
                if frame >= WARM_UP {
                    times.iter_mut().zip(took).for_each(|(all, ms)| all.push(ms));
                }
                if times[0].len() >= 3 && whole.elapsed().as_secs_f64() > budget {
                    break;
                }
            }
            let [many_ms, one_model_ms, organs_ms] = times.each_mut().map(|t| median(t));
            let (all, organs_tets) = (count * small.tets(), organs.tets());
            rows.push(ManyRow {
                schedule: name.to_owned(),
                threads,
                models: count,
                tets: all,
                many_ms,
                one_model_ms,
                organs_ms,
                organs_tets,
                loss: many_ms / one_model_ms - 1.0,
                loss_against_organs: (many_ms / all as f64) / (organs_ms / organs_tets as f64) - 1.0,
            });
        }
    }
    progress.end();
    Ok(rows)
}

/// Steps all models by a frame on `threads` plain threads. A thread pool would start another model
/// while one waits for its own pool.
fn step_all(runs: &mut [Run<'_>], threads: usize) -> Result<()> {
    let share = runs.len().div_ceil(threads.max(1)).max(1);
    std::thread::scope(|scope| {
        let step = |part: &mut [Run<'_>]| -> Result<()> { part.iter_mut().try_for_each(|run| run.frame().map(|_| ())) };
        let others: Vec<_> = runs.chunks_mut(share).map(|part| scope.spawn(move || step(part))).collect();
        let lost = || Err(Error::Mismatch("a worker thread panicked".to_owned()));
        others.into_iter().try_for_each(|thread| thread.join().unwrap_or_else(|_| lost()))
    })
}

/// Wall time of `work` (ms).
fn timed(work: impl FnOnce() -> Result<()>) -> Result<f64> {
    let clock = Instant::now();
    work()?;
    Ok(1e3 * clock.elapsed().as_secs_f64())
}
