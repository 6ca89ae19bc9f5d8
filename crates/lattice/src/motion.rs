//! Positions and velocities of a lattice's nodes, read at many points in one pass.

use crate::{BodyState, EmbeddedPoint};
use fearless_simd::{Level, Simd, SimdBase, dispatch, f64x8};
use glam::{DVec3, Vec3A};

/// Position and velocity of each node, side by side: a point reads both with its weights, in the
/// lanes of a register. Lanes never meet and nothing is fused, so a point has the bits of
/// [`EmbeddedPoint::interpolate`] on every instruction set.
#[derive(Clone, Debug, Default)]
pub struct Motion {
    rows: Vec<Row>,
}

/// Position (m) and velocity (m/s) of a node, in a cache line of its own.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
struct Row([f64; 8]);

impl Motion {
    /// Takes over the motion of a state.
    pub fn load(&mut self, state: &BodyState) {
        let row = |(x, v): (&DVec3, &DVec3)| Row([x.x, x.y, x.z, v.x, v.y, v.z, 0.0, 0.0]);
        self.rows.clear();
        self.rows.extend(state.positions.iter().zip(&state.velocities).map(row));
    }

    /// Writes the positions (m) and velocities (m/s) of points, rounded to single precision. Those
    /// that are not in the lattice stay as they are.
    pub fn write(&self, points: &[Option<EmbeddedPoint>], x: &mut [Vec3A], v: &mut [Vec3A]) {
        dispatch!(Level::new(), simd => self.write_in(simd, points, x, v));
    }

    #[inline(always)]
    fn write_in<S: Simd>(&self, simd: S, points: &[Option<EmbeddedPoint>], x: &mut [Vec3A], v: &mut [Vec3A]) {
        for ((point, x), v) in points.iter().zip(x).zip(v) {
            let Some(point) = point else { continue };
            let mut sum = f64x8::splat(simd, 0.0);
            for k in 0..8 {
                sum += f64x8::from_slice(simd, &self.rows[point.nodes[k] as usize].0) * point.weights[k];
            }
            let mut at = [0.0; 8];
            sum.store_slice(&mut at);
            *x = Vec3A::new(at[0] as f32, at[1] as f32, at[2] as f32);
            *v = Vec3A::new(at[3] as f32, at[4] as f32, at[5] as f32);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_have_the_bits_of_their_sums() {
        let at = |seed: f64, k: usize| (seed + k as f64).sin();
        let field = |seed: f64| (0..9).map(|k| DVec3::new(at(seed, k), at(seed, 2 * k), at(seed, 3 * k))).collect();
        let state = BodyState { positions: field(0.1), velocities: field(0.7) };
        let weights = std::array::from_fn(|k| at(0.3, k));
        let point = EmbeddedPoint { hexahedron: 0, nodes: [8, 1, 5, 3, 0, 2, 7, 4], weights };
        let before = Vec3A::new(1.0, 2.0, 3.0);
        let (mut x, mut v) = ([before; 2], [before; 2]);
        let mut motion = Motion::default();
        motion.load(&state);
        motion.write(&[None, Some(point)], &mut x, &mut v);
        assert_eq!([x[0], v[0]], [before; 2]);
        assert_eq!(x[1], point.interpolate(&state.positions).as_vec3a());
        assert_eq!(v[1], point.interpolate(&state.velocities).as_vec3a());
    }
}
