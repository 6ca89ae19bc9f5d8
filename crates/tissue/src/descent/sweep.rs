//! One sweep over a body: every free vertex takes its step, colour by colour.
//!
//! Vertices of one colour share no element, so they do not see each other's steps: they may be
//! taken in any order and by any thread with the same bits.

use super::kernel::{Kernel, VertexElasticity};
use super::lane_sweep::LaneSweep;
use super::vertex_step::Substep;
use glam::Vec3A;
use rayon::prelude::*;

/// Vertices a task; a colour of fewer than two tasks is swept by one thread.
const VERTICES_PER_TASK: usize = 192;

/// Sweeps over all colours once; `moved` is scratch.
pub(super) fn sweep(substep: &Substep<'_>, x: &mut [Vec3A], moved: &mut [Vec3A]) {
    match Kernel::of(substep.body) {
        Kernel::StableNeoHookean(term) if !substep.body.groups.is_empty() => {
            LaneSweep { substep, groups: &substep.body.groups, term: &term }.sweep(x, moved);
        }
        Kernel::StableNeoHookean(term) => sweep_with(substep, &term, x, moved),
        Kernel::StVenantKirchhoff(term) => sweep_with(substep, &term, x, moved),
        Kernel::Corotated(term) => sweep_with(substep, &term, x, moved),
    }
}

/// Sweeps vertex by vertex with a material's elasticity.
pub(super) fn sweep_with<E: VertexElasticity>(
    substep: &Substep<'_>,
    elasticity: &E,
    x: &mut [Vec3A],
    moved: &mut [Vec3A],
) {
    for color in substep.body.color_start.windows(2) {
        let (first, end) = (color[0] as usize, color[1] as usize);
        if substep.single_thread || end - first < 2 * VERTICES_PER_TASK {
            for i in first..end {
                x[i] = substep.relax(elasticity, i, x);
            }
        } else {
            let all = &*x;
            moved[first..end].par_chunks_mut(VERTICES_PER_TASK).enumerate().for_each(|(chunk, moved)| {
                for (k, to) in moved.iter_mut().enumerate() {
                    *to = substep.relax(elasticity, first + chunk * VERTICES_PER_TASK + k, all);
                }
            });
            x[first..end].copy_from_slice(&moved[first..end]);
        }
    }
}
