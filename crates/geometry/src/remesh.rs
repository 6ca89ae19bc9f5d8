//! Another mesh of the same surface: coarser or finer, or with the colours of another.

use crate::{Error, MeshDistance, Result, TriMesh, isosurface, sample_distance, taubin};
use glam::DVec3;

/// Spacing of the grid over the median edge of the triangles that it gives.
const SPACING: f64 = 1.13;

/// Rounds of smoothing after which vertices go back to the surface; and the steps and pairs of
/// steps of a round.
const ROUNDS: usize = 3;
const SMOOTHING: (f64, f64, usize) = (0.5, -0.53, 3);

/// Most points of a grid.
const MAX_POINTS: f64 = 3e7;

/// Least share of the volume that a coarser surface must enclose.
const MIN_VOLUME: f64 = 0.7;

/// A closed surface around the body that `surface` encloses, in triangles whose median edge is
/// about `edge` (m): the largest piece of the isosurface of the signed distance, smoothed along the
/// surface. Its vertices lie on `surface`. It has no colours.
///
/// # Errors
/// [`Error::Mesh`] for an edge that is not above 0, so long that less than 70% of the volume is
/// left, or so short that the grid has more than 30 million points; and for a surface without
/// triangles or with numbers that are not finite.
pub fn remeshed(surface: &TriMesh, edge: f64) -> Result<TriMesh> {
    if !(edge > 0.0 && edge.is_finite()) {
        return Err(Error::Mesh(format!("an edge of {edge} m; it must be above 0")));
    }
    let field = MeshDistance::new(surface)?;
    let bounds = surface.bounds().unwrap_or_default();
    let spacing = SPACING * edge;
    let points = ((bounds.1 - bounds.0) / spacing + 5.0).to_array().iter().product::<f64>();
    if points > MAX_POINTS {
        return Err(Error::Mesh(format!(
            "triangles of {:.2} mm need a grid of {points:.0e} points; at most {MAX_POINTS:.0e}: choose a longer edge",
            1e3 * edge
        )));
    }
    let mut mesh = isosurface(&sample_distance(&field, bounds, spacing), 0.0).largest_component();
    let (lambda, mu, pairs) = SMOOTHING;
    for _ in 0..ROUNDS {
        taubin(&mut mesh, lambda, mu, pairs);
        mesh.vertices.iter_mut().for_each(|p| *p = field.closest_point(*p));
    }
    let share = mesh.volume() / surface.volume().abs();
    if !(share >= MIN_VOLUME && mesh.is_watertight()) {
        return Err(Error::Mesh(format!(
            "triangles of {:.2} mm are too coarse for the surface: they enclose {share:.2} of its volume; choose a \
             shorter edge",
            1e3 * edge
        )));
    }
    Ok(mesh)
}

impl TriMesh {
    /// Gives each vertex the colour of the nearest vertex of `other`. Without colours there, it has
    /// none.
    pub fn color_like(&mut self, other: &Self) {
        self.colors.clear();
        if other.colors.len() != other.vertices.len() || other.vertices.is_empty() {
            return;
        }
        let mut order: Vec<u32> = (0..other.vertices.len() as u32).collect();
        let place = |i: u32| other.vertices[i as usize];
        order.sort_by(|a, b| place(*a).x.total_cmp(&place(*b).x).then(a.cmp(b)));
        self.colors.extend(self.vertices.iter().map(|p| other.colors[nearest(&order, place, *p) as usize]));
    }
}

/// The place nearest to `p` of those in `order`, which is by x.
fn nearest(order: &[u32], place: impl Fn(u32) -> DVec3, p: DVec3) -> u32 {
    let first = order.partition_point(|i| place(*i).x < p.x);
    let (mut best, mut least) = (order[first.min(order.len() - 1)], f64::INFINITY);
    let mut visit = |i: u32| {
        let q = place(i);
        let across = (q.x - p.x) * (q.x - p.x);
        let squared = q.distance_squared(p);
        if squared < least {
            (best, least) = (i, squared);
        }
        across <= least
    };
    for i in &order[first..] {
        if !visit(*i) {
            break;
        }
    }
    for i in order[..first].iter().rev() {
        if !visit(*i) {
            break;
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shapes::icosphere;

    #[test]
    fn edges_are_as_long_as_asked_for() {
        let ball = icosphere(5, 0.03);
        for edge in [1e-3, 2e-3, 4e-3, 8e-3] {
            let mesh = remeshed(&ball, edge).unwrap();
            let mut edges: Vec<f64> = (0..mesh.triangles.len())
                .flat_map(|t| {
                    let [a, b, c] = mesh.corners(t);
                    [a.distance(b), b.distance(c), c.distance(a)]
                })
                .collect();
            edges.sort_by(f64::total_cmp);
            let median = edges[edges.len() / 2];
            assert!((median / edge - 1.0).abs() < 0.2, "{median} m for {edge} m");
            assert!(edges[0] > 0.05 * edge, "{} m is a sliver's", edges[0]);
            assert!(mesh.is_watertight() && (mesh.volume() / ball.volume() - 1.0).abs() < 0.1);
        }
    }

    #[test]
    fn what_cannot_be_meshed_is_refused() {
        let ball = icosphere(3, 0.03);
        for (edge, said) in [
            (0.0, "must be above 0"),
            (f64::NAN, "must be above 0"),
            (1e-5, "choose a longer edge"),
            (0.06, "choose a shorter edge"),
        ] {
            let message = remeshed(&ball, edge).unwrap_err().to_string();
            assert!(message.contains(said), "{message}");
        }
        assert!(remeshed(&TriMesh::default(), 1e-3).is_err());
    }

    #[test]
    fn colours_are_those_of_the_nearest_vertex() {
        let mut painted = icosphere(4, 0.03);
        let color = |p: &DVec3| [(p.x > 0.0) as u8 * 200, (p.y > 0.01) as u8 * 200, 7];
        painted.colors = painted.vertices.iter().map(color).collect();
        let mut other = remeshed(&painted, 3e-3).unwrap();
        other.color_like(&painted);
        for (p, c) in other.vertices.iter().zip(&other.colors) {
            let by_distance = |a: &usize, b: &usize| {
                painted.vertices[*a].distance_squared(*p).total_cmp(&painted.vertices[*b].distance_squared(*p))
            };
            let nearest = (0..painted.vertices.len()).min_by(by_distance).unwrap();
            assert_eq!(*c, painted.colors[nearest], "{p}");
        }
        other.color_like(&icosphere(2, 0.03));
        assert!(other.colors.is_empty());
    }
}
