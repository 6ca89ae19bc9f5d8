//! Distances between sets of points.

use glam::DVec3;

/// Points that are at rest within this distance of the apex are compared (m), as in the paper.
pub const LOCAL: f64 = 0.025;

/// The symmetric Chamfer distance (m): the mean distance to the nearest point of the other set, of
/// both directions averaged (Barrow and others 1977; Fan and others 2017). `None` if a set is
/// empty.
pub fn chamfer(a: &[DVec3], b: &[DVec3]) -> Option<f64> {
    let one_way = |from: &[DVec3], to: &[DVec3]| {
        let nearest = |p: &DVec3| to.iter().map(|q| p.distance_squared(*q)).fold(f64::INFINITY, f64::min).sqrt();
        from.iter().map(nearest).sum::<f64>() / from.len() as f64
    };
    (!a.is_empty() && !b.is_empty()).then(|| 0.5 * (one_way(a, b) + one_way(b, a)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_sets_have_their_distance() {
        let line = |height: f64| (0..50).map(|i| DVec3::new(1e-3 * f64::from(i), 0.0, height)).collect::<Vec<_>>();
        assert_eq!(chamfer(&line(0.0), &line(0.0)), Some(0.0));
        assert!((chamfer(&line(0.0), &line(4e-4)).unwrap() - 4e-4).abs() < 1e-12);
        assert_eq!(chamfer(&[], &line(0.0)), None);
        // One point more, 10 mm aside: (0 + 10 / 51) / 2.
        let mut more = line(0.0);
        more.push(DVec3::new(0.0, 0.01, 0.0));
        assert!((chamfer(&line(0.0), &more).unwrap() - 0.5 * 0.01 / 51.0).abs() < 1e-12);
    }
}
