//! The ways to step one instance alone, and their errors.

use super::scene::{Scene, moving};
use crate::Result;
use crate::scenes::{FRAME, OracleRun, Run, rest_positions, rms_error};
use serde::Serialize;
use trocar_tissue::{QuasiNewton, SolverSettings};

/// Tolerances and iterations of the run that judges the lattice backend.
const JUDGE: (f64, f64, usize) = (1e-12, 1e-6, 1000);

/// Relative tolerances of the fast schedule: its own, and looser ones, which cost less.
const RELATIVE: [f64; 3] = [1e-2, 0.1, 0.5];

/// One way to step an instance alone.
#[derive(Clone, Debug, Serialize)]
pub struct Alone {
    /// Its name.
    pub name: &'static str,
    /// Relative tolerance of its search.
    pub relative: f64,
    /// Nodes that can move: of its mesh, or of the lattice.
    pub nodes: usize,
    /// RMS distance from the converged solution of the same substeps over RMS displacement.
    pub error: f64,
}

/// The names of the two solvers.
const NAMES: [&str; 2] = ["quasi-Newton tetrahedra", "lattice backend"];

/// The fast schedule with a number of substeps and a relative tolerance.
fn fast(substeps: usize, relative: f64) -> SolverSettings {
    match SolverSettings::FAST {
        SolverSettings::QuasiNewton(m) => SolverSettings::QuasiNewton(QuasiNewton { substeps, relative, ..m }),
        other => other,
    }
}

/// Runs of all ways, on one thread each.
pub(super) fn runs(scene: &Scene, substeps: usize) -> Result<Vec<Run<'_>>> {
    let of = |scene| RELATIVE.iter().map(move |relative| Run::new(scene, fast(substeps, *relative), 1));
    of(&scene.tets).chain(of(&scene.lattice)).collect()
}

/// All ways with their errors after some frames, in the order of [`runs`]. `stop` may end it.
pub(super) fn errors(
    scene: &Scene,
    frames: usize,
    substeps: usize,
    stop: impl Fn() -> Result<()>,
) -> Result<Vec<Alone>> {
    let mut runs = runs(scene, substeps)?;
    let mut oracle = OracleRun::new(&scene.tets);
    let (tolerance, relative, iterations) = JUDGE;
    let exact = match SolverSettings::FAST {
        SolverSettings::QuasiNewton(m) => {
            SolverSettings::QuasiNewton(QuasiNewton { substeps, tolerance, relative, iterations, ..m })
        }
        other => other,
    };
    let mut judge = Run::new(&scene.lattice, exact, 1)?;
    let h = FRAME / substeps as f64;
    for frame in 0..frames {
        stop()?;
        for run in runs.iter_mut().chain([&mut judge]) {
            run.frame()?;
        }
        for substep in 1..=substeps {
            oracle.step(h, frame as f64 * FRAME + substep as f64 * h)?;
        }
    }
    let truths = [oracle.positions(), judge.positions()];
    let way = |(number, run): (usize, &Run<'_>)| {
        let on = number / RELATIVE.len();
        let mesh = [&scene.tets, &scene.lattice][on];
        let error = rms_error(&run.positions(), &truths[on], &rest_positions(&mesh.model));
        let nodes = [moving(mesh), scene.nodes()][on];
        Alone { name: NAMES[on], relative: RELATIVE[number % RELATIVE.len()], nodes, error }
    };
    Ok(runs.iter().enumerate().map(way).collect())
}
