//! A robust plane through the tissue around an organ.

use glam::{DMat3, DVec3};
use trocar_core::Random;
use trocar_geometry::symmetric::eigen;

/// Seed of the drawn triples.
const SEED: u64 = 41;

/// Drawn triples of points.
const TRIPLES: u64 = 500;

/// Distance from the plane up to which a point is an inlier (m). Tissue is uneven by millimetres.
const INLIER: f64 = 3e-3;

/// Rounds of the least-squares plane of the inliers.
const ROUNDS: usize = 5;

/// A plane and how well points fit it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plane {
    /// A point of it (m).
    pub point: DVec3,
    /// Unit normal, upwards.
    pub normal: DVec3,
    /// Points within 3 mm.
    pub inliers: usize,
    /// All points.
    pub points: usize,
    /// Root mean square distance of the inliers (m).
    pub rms: f64,
}

impl Plane {
    /// The plane that most of the points (m) are near to, by RANSAC (Fischler and Bolles 1981) with
    /// a fixed seed and a least-squares fit of its inliers. `up` decides the side of the normal.
    /// `None` with fewer than three points, or if all lie on a line.
    pub fn through(points: &[DVec3], up: DVec3) -> Option<Self> {
        let random = Random::new(SEED);
        let count = points.len();
        if count < 3 {
            return None;
        }
        let mut best: Option<(usize, DVec3, DVec3)> = None;
        for triple in 0..TRIPLES {
            let pick = |k: u64| points[((random.uniform(3 * triple + k) * count as f64) as usize).min(count - 1)];
            let [a, b, c] = [pick(0), pick(1), pick(2)];
            let Some(normal) = (b - a).cross(c - a).try_normalize() else { continue };
            let inliers = points.iter().filter(|p| (**p - a).dot(normal).abs() < INLIER).count();
            if best.is_none_or(|(most, ..)| inliers > most) {
                best = Some((inliers, a, normal));
            }
        }
        let (_, mut point, mut normal) = best?;
        for _ in 0..ROUNDS {
            let near: Vec<DVec3> = points.iter().copied().filter(|p| (*p - point).dot(normal).abs() < INLIER).collect();
            point = near.iter().sum::<DVec3>() / near.len().max(1) as f64;
            let mut spread = DMat3::ZERO;
            for p in &near {
                let d = *p - point;
                spread += DMat3::from_cols(d * d.x, d * d.y, d * d.z);
            }
            let (values, axes) = eigen(spread);
            let values = values.to_array();
            let least = (0..3).min_by(|a, b| values[*a].total_cmp(&values[*b]))?;
            normal = axes.col(least);
        }
        normal *= if normal.dot(up) < 0.0 { -1.0 } else { 1.0 };
        let far: Vec<f64> = points.iter().map(|p| (*p - point).dot(normal)).filter(|d| d.abs() < INLIER).collect();
        let rms = (far.iter().map(|d| d * d).sum::<f64>() / far.len().max(1) as f64).sqrt();
        Some(Self { point, normal, inliers: far.len(), points: count, rms })
    }

    /// Height of a point over the plane (m).
    pub fn height(&self, p: DVec3) -> f64 {
        (p - self.point).dot(self.normal)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn outliers_do_not_move_the_plane() {
        let random = Random::new(7);
        let normal = DVec3::new(0.2, -0.1, -1.0).normalize();
        let (along, across) = normal.any_orthonormal_pair();
        let point = |i: u64| {
            let place = DVec3::new(0.0, 0.0, 0.2)
                + 0.05 * random.symmetric(4 * i) * along
                + 0.05 * random.symmetric(4 * i + 1) * across;
            // Four in ten are organs that stand 5 to 25 mm above the plane.
            let height = if i % 10 < 4 { 5e-3 + 0.02 * random.uniform(4 * i + 2) } else { 0.3e-3 * random.normal(i) };
            place + height * normal
        };
        let points: Vec<DVec3> = (0..2000).map(point).collect();
        let plane = Plane::through(&points, -DVec3::Z).unwrap();
        assert!(plane.normal.dot(normal) > 0.9999, "{} instead of {normal}", plane.normal);
        assert!(plane.height(DVec3::new(0.0, 0.0, 0.2)).abs() < 0.2e-3, "{plane:?}");
        assert!((1150..=1300).contains(&plane.inliers) && plane.points == 2000, "{plane:?}");
        assert_eq!(Plane::through(&points, -DVec3::Z), Some(plane), "the same points, the same plane");
    }

    #[test]
    fn too_few_points_have_no_plane() {
        assert_eq!(Plane::through(&[DVec3::ZERO, DVec3::X], DVec3::Z), None);
        assert_eq!(Plane::through(&[DVec3::ZERO, DVec3::X, 2.0 * DVec3::X], DVec3::Z), None);
    }
}
