//! The figures of the study.

use crate::trials::Resumed;
use crate::{Error, Result};
use serde::{Deserialize, Serialize};

/// What the body does in each case.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Cases {
    /// Mean displacement of the body that is held by its base, under a hundredth of its weight
    /// (mm).
    pub sag_mm: f64,
    /// Mean displacement of a patch of 5 mm in the middle, which is lifted by 2 mN (mm).
    pub lift_mm: f64,
    /// Mean displacements of patches of 5 mm, each of which is pulled up by 0.1 N while the lowest
    /// 42% of the body are held (mm).
    pub pull_mm: Vec<f64>,
    /// Force that lifts the grasped middle by 8 mm (N).
    pub grasp_n: f64,
}

/// The body by one kind and size of elements.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MeshRow {
    /// `quadratic` (the reference), `default` (what the cell steps), `corrected` (with `[tissue]
    /// mesh_correction`), `linear`, `patches`, `lattice`.
    pub method: String,
    /// Median edge of the mesh, or edge of a lattice's cell (mm).
    pub edge_mm: f64,
    /// Nodes.
    pub nodes: usize,
    /// Poisson's ratio.
    pub nu: f64,
    /// Deflections.
    pub cases: Cases,
}

/// Signed errors against the body: below 0 where the mesh is too stiff.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Errors {
    /// Of the sag.
    pub sag: f64,
    /// Of the lift.
    pub lift: f64,
    /// Of the pull: of the patch where it is largest.
    pub pull: f64,
    /// Of the compliance of the grasp-lift.
    pub grasp: f64,
}

/// The figures of the study.
#[derive(Clone, Debug, Serialize)]
pub struct MeshConvergenceResult {
    /// Greatest error of the default tissue's sag, over Poisson's ratios.
    pub default_sag_error: f64,
    /// Greatest error of its local pull.
    pub default_pull_error: f64,
    /// Greatest error of the sag, and of the local pull, with `[tissue] mesh_correction`.
    pub corrected_sag_error: f64,
    /// See `corrected_sag_error`.
    pub corrected_pull_error: f64,
    /// Greatest error of the default tissue's lift, and of its grasp-lift.
    pub default_lift_error: f64,
    /// See `default_lift_error`.
    pub default_grasp_error: f64,
    /// All rows.
    pub rows: Vec<MeshRow>,
    /// Errors of each row.
    pub errors: Vec<Errors>,
    /// Nodes and elements of the organ.
    pub nodes: usize,
    /// See `nodes`.
    pub tets: usize,
    /// Rows of an earlier run.
    pub resumed: Resumed,
}

impl MeshConvergenceResult {
    /// From the rows, and the organ's numbers of nodes and elements.
    pub(super) fn from_rows(rows: Vec<MeshRow>, (nodes, tets): (usize, usize), resumed: Resumed) -> Result<Self> {
        let errors = rows.iter().map(|row| errors(row, &rows)).collect::<Result<Vec<_>>>()?;
        let most = |method: &str, of: fn(&Errors) -> f64| {
            let own = rows.iter().zip(&errors).filter(|(row, _)| row.method == method);
            own.map(|(_, e)| of(e).abs()).fold(0.0, f64::max)
        };
        Ok(Self {
            default_sag_error: most("default", |e| e.sag),
            default_pull_error: most("default", |e| e.pull),
            default_lift_error: most("default", |e| e.lift),
            default_grasp_error: most("default", |e| e.grasp),
            corrected_sag_error: most("corrected", |e| e.sag),
            corrected_pull_error: most("corrected", |e| e.pull),
            nodes,
            tets,
            rows,
            errors,
            resumed,
        })
    }
}

/// Errors of a row against the quadratic elements with its Poisson's ratio.
fn errors(row: &MeshRow, rows: &[MeshRow]) -> Result<Errors> {
    let Some(truth) = rows.iter().find(|r| r.method == "quadratic" && r.nu == row.nu) else {
        return Err(Error::Mismatch("there is no row of the reference".to_owned()));
    };
    let (own, truth) = (&row.cases, &truth.cases);
    let pulls = own.pull_mm.iter().zip(&truth.pull_mm).map(|(own, truth)| own / truth - 1.0);
    Ok(Errors {
        sag: own.sag_mm / truth.sag_mm - 1.0,
        lift: own.lift_mm / truth.lift_mm - 1.0,
        pull: pulls.max_by(|a, b| a.abs().total_cmp(&b.abs())).unwrap_or(0.0),
        grasp: truth.grasp_n / own.grasp_n - 1.0,
    })
}
