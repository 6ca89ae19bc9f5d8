//! Queries of channels and measures to a cell: the bodies of an organ, the node nearest to a point,
//! and the tissue between blades.

use glam::DVec3;
use trocar_cell::Cell;

/// Middle of the region between the blades from the pivot (m).
pub(crate) const MID_JAWS: f64 = 0.0115;

/// The bodies that an organ is in: its pieces after a cut are called `name.1` and so on.
pub(crate) fn bodies_of(cell: &Cell, organ: &str) -> Vec<usize> {
    let is = |name: &str| name.strip_prefix(organ).is_some_and(|rest| rest.is_empty() || rest.starts_with('.'));
    let bodies = cell.world().model.bodies().iter().enumerate();
    bodies.filter(|(_, b)| is(b.name())).map(|(k, _)| k).collect()
}

/// Distance from `p` to the nearest node of a body among those `of` (m); infinite without any.
pub(crate) fn nearest(cell: &Cell, body: usize, p: DVec3, of: impl Fn(usize) -> bool) -> f64 {
    let world = cell.world();
    let count = world.model.bodies()[body].len();
    let square = |i: usize| world.state.position(&world.model, body, i).distance_squared(p);
    (0..count).filter(|i| of(*i)).map(square).fold(f64::INFINITY, f64::min).sqrt()
}

/// Whether any of `bodies` is between the blades of arm `k`, and the share of the wedge that they
/// fill.
pub(crate) fn between_blades(cell: &Cell, k: usize, bodies: &[usize]) -> (bool, f64) {
    let all: Vec<f64> = bodies.iter().filter_map(|body| Some(cell.between_blades(k, *body)?.1)).collect();
    (!all.is_empty(), all.iter().sum::<f64>().min(1.0))
}
