//! Moments of the material inside a cell: volume, mean, covariance, shares of the corners.

use crate::clip::{Tet, volume};
use glam::{DMat3, DVec3, Vec3Swizzles};
use trocar_geometry::symmetric::eigen;

/// Integrals over the material in a cell, in the cell's own coordinates from 0 to 1.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Moments {
    /// Of 1: the volume (cells).
    pub volume: f64,
    /// Of x, y, z.
    pub first: DVec3,
    /// Of x^2, y^2, z^2.
    pub squares: DVec3,
    /// Of yz, zx, xy.
    pub products: DVec3,
    /// Of xyz.
    pub triple: f64,
}

impl Moments {
    /// Of a full cell.
    pub const FULL: Self = Self {
        volume: 1.0,
        first: DVec3::splat(0.5),
        squares: DVec3::splat(1.0 / 3.0),
        products: DVec3::splat(0.25),
        triple: 0.125,
    };

    /// Adds a tetrahedron inside the cell with lowest corner `cell`. The integrals of monomials are
    /// exact: those of barycentric coordinates are a!b!c!d! 3!/(a+b+c+d+3)! V.
    pub fn add_tet(&mut self, tet: &Tet, cell: DVec3) {
        let v = volume(tet);
        let p = tet.map(|p| p - cell);
        let turned = |p: DVec3| (p.yzx(), p.zxy());
        let sum: DVec3 = p.iter().sum();
        let squares: DVec3 = p.iter().map(|p| p * p).sum();
        let products: DVec3 = p.iter().map(|p| turned(*p).0 * turned(*p).1).sum();
        let triple: f64 = p.iter().map(|p| p.x * p.y * p.z).sum();
        self.volume += v;
        self.first += v / 4.0 * sum;
        self.squares += v / 20.0 * (squares + sum * sum);
        self.products += v / 20.0 * (products + turned(sum).0 * turned(sum).1);
        self.triple += v / 120.0 * (sum.x * sum.y * sum.z + sum.dot(products) + 2.0 * triple);
    }

    pub fn add(&mut self, other: &Self) {
        self.volume += other.volume;
        self.first += other.first;
        self.squares += other.squares;
        self.products += other.products;
        self.triple += other.triple;
    }

    /// Centroid of the material.
    pub fn mean(&self) -> DVec3 {
        self.first / self.volume
    }

    /// The symmetric root of the covariance of the material's points.
    pub fn spread(&self) -> DMat3 {
        let mean = self.mean();
        let on = self.squares / self.volume - mean * mean;
        let off = self.products / self.volume - mean.yzx() * mean.zxy();
        let covariance = DMat3::from_cols(
            DVec3::new(on.x, off.z, off.y),
            DVec3::new(off.z, on.y, off.x),
            DVec3::new(off.y, off.x, on.z),
        );
        let (values, axes) = eigen(covariance);
        let roots = values.max(DVec3::ZERO).map(f64::sqrt);
        axes * DMat3::from_diagonal(roots) * axes.transpose()
    }

    /// Integrals of the trilinear shape functions of the eight corners; they sum to the volume.
    /// Corner c lies at (c & 1, c >> 1 & 1, c >> 2).
    pub fn shares(&self) -> [f64; 8] {
        // N = (l + s x)(m + t y)(n + u z) with (l, s) = (1, -1) or (0, 1).
        std::array::from_fn(|c| {
            let factor = |bit: usize| if c >> bit & 1 == 0 { [1.0, -1.0] } else { [0.0, 1.0] };
            let ([l, s], [m, t], [n, u]) = (factor(0), factor(1), factor(2));
            l * m * n * self.volume
                + s * m * n * self.first.x
                + l * t * n * self.first.y
                + l * m * u * self.first.z
                + l * t * u * self.products.x
                + s * m * u * self.products.y
                + s * t * n * self.products.z
                + s * t * u * self.triple
        })
    }
}
