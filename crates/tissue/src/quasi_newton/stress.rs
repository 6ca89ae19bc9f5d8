//! Stresses of sixteen elements at once.

use crate::lanes::{LANES, Mat3L, add, apply, cofactor, dot, load, rotation, scale, splat, sub};
use crate::material::{MAX_FREE_STRETCH_SQUARED, StretchEnergy, VolumeEnergy};
use crate::{ConstitutiveModel, Corotated, Material, StableNeoHookean};
use fearless_simd::{Simd, SimdBase, f32x16};
use glam::DMat3;

/// Volume ratio above which the volume energy is its plain quadratic.
const MIN_PLAIN_RATIO: f32 = 0.25;

/// Smallest volume ratio whose logarithm is taken. The guard keeps ratios above; this keeps numbers
/// finite if it does not.
const MIN_LOGARITHM_RATIO: f64 = 1e-4;

/// Determinant of F below which no rotation is computed.
const MIN_ROTATION_RATIO: f32 = 1e-4;

/// A body's stress law.
pub(super) enum Stress {
    StableNeoHookean { mu: f32, volume: Volume },
    StVenantKirchhoff { mu: f32, lambda: f32 },
    Corotated { mu: f32, volume: Volume },
}

/// The energy of the volume ratio.
pub(super) struct Volume {
    energy: VolumeEnergy,
    modulus: f32,
    alpha: f32,
}

impl From<VolumeEnergy> for Volume {
    fn from(energy: VolumeEnergy) -> Self {
        Self { energy, modulus: energy.modulus as f32, alpha: energy.alpha as f32 }
    }
}

impl Stress {
    pub fn of(material: &Material) -> Self {
        let (mu, lambda) = material.lame();
        match material.model {
            ConstitutiveModel::StableNeoHookean => {
                let model = StableNeoHookean::new(mu, lambda);
                Self::StableNeoHookean { mu: model.mu as f32, volume: model.volume().into() }
            }
            ConstitutiveModel::StVenantKirchhoff => Self::StVenantKirchhoff { mu: mu as f32, lambda: lambda as f32 },
            ConstitutiveModel::Corotated => {
                Self::Corotated { mu: mu as f32, volume: Corotated { mu, lambda }.volume().into() }
            }
        }
    }

    /// How much larger the second derivative of the energy by the volume ratio is at `ratio` than
    /// at rest (Pa).
    pub fn hardening(&self, ratio: f32) -> f32 {
        match self {
            Self::StableNeoHookean { volume, .. } | Self::Corotated { volume, .. } => {
                let (.., curvature) = volume.energy.at(f64::from(ratio).max(MIN_LOGARITHM_RATIO));
                (curvature - volume.energy.modulus) as f32
            }
            Self::StVenantKirchhoff { .. } => 0.0,
        }
    }

    /// First Piola-Kirchhoff stress of F, whose determinant is `ratio`, without [`add_limit`].
    #[inline(always)]
    pub fn at<S: Simd>(&self, simd: S, f: &Mat3L<S>, ratio: f32x16<S>) -> Mat3L<S> {
        match self {
            Self::StableNeoHookean { mu, volume } => {
                let (mu, slope) = (splat(simd, *mu), volume.slope(simd, ratio));
                let cofactor = cofactor(f);
                let mut p = *f;
                for c in 0..3 {
                    p[c] = add(scale(f[c], mu), scale(cofactor[c], slope));
                }
                p
            }
            Self::StVenantKirchhoff { mu, lambda } => {
                let [xx, yy, zz, xy, yz, zx] = green_strain(simd, f);
                let (two_mu, pressure) = (splat(simd, 2.0 * mu), (xx + yy + zz) * *lambda);
                let s = [
                    xx * two_mu + pressure,
                    yy * two_mu + pressure,
                    zz * two_mu + pressure,
                    xy * two_mu,
                    yz * two_mu,
                    zx * two_mu,
                ];
                times_symmetric(f, s)
            }
            Self::Corotated { mu, volume } => {
                let (two_mu, slope) = (splat(simd, 2.0 * mu), volume.slope(simd, ratio));
                let (r, cofactor) = (rotation(simd, f, MIN_ROTATION_RATIO), cofactor(f));
                let mut p = *f;
                for c in 0..3 {
                    p[c] = add(scale(sub(f[c], r[c]), two_mu), scale(cofactor[c], slope));
                }
                p
            }
        }
    }
}

impl Volume {
    /// Derivative of the energy by the volume ratio.
    #[inline(always)]
    fn slope<S: Simd>(&self, simd: S, ratio: f32x16<S>) -> f32x16<S> {
        let plain = (ratio - self.alpha) * self.modulus;
        let squeezed = simd.simd_lt_f32x16(ratio, splat(simd, MIN_PLAIN_RATIO));
        if simd.any_true_mask32x16(squeezed) { self.with_barrier(simd, plain, ratio) } else { plain }
    }

    #[cold]
    #[inline(never)]
    fn with_barrier<S: Simd>(&self, simd: S, plain: f32x16<S>, ratio: f32x16<S>) -> f32x16<S> {
        let (mut slopes, mut ratios) = ([0.0; LANES], [0.0; LANES]);
        plain.store_slice(&mut slopes);
        ratio.store_slice(&mut ratios);
        for (slope, ratio) in slopes.iter_mut().zip(ratios) {
            if ratio < MIN_PLAIN_RATIO {
                *slope = self.energy.at(f64::from(ratio).max(MIN_LOGARITHM_RATIO)).1 as f32;
            }
        }
        load(simd, &slopes)
    }
}

/// Adds to the stress of F what limits large stretches. Returns the lanes in which a stretch is
/// beyond the limit, a bit each.
#[inline(always)]
pub(super) fn add_limit<S: Simd>(simd: S, limit: &StretchEnergy, f: &Mat3L<S>, p: &mut Mat3L<S>) -> u16 {
    let (zero, one) = (splat(simd, 0.0), splat(simd, 1.0));
    // Principal stretches are within the limit where 16 I - F'F is positive definite: where its
    // leading minors are positive (Sylvester).
    let most = splat(simd, MAX_FREE_STRETCH_SQUARED as f32);
    let [xx, yy, zz] = [0, 1, 2].map(|c| most - dot(f[c], f[c]));
    let [xy, yz, zx] = [dot(f[0], f[1]), dot(f[1], f[2]), dot(f[2], f[0])];
    let (second, first) = (xx * yy - xy * xy, xx);
    let third = zz * second - (xx * yz * yz + yy * zx * zx + (xy + xy) * (yz * zx));
    let [first, second, third] = [first, second, third].map(|minor| simd.simd_gt_f32x16(minor, zero));
    let within = first & second & third;
    if simd.all_true_mask32x16(within) {
        return 0;
    }
    let mut acts = [0.0; LANES];
    simd.select_f32x16(within, zero, one).store_slice(&mut acts);
    let beyond = (0..LANES).fold(0, |lanes, lane| lanes | u16::from(acts[lane] != 0.0) << lane);
    let (stretch, mut sum) = (stored(f), stored(p));
    add_limit_to(limit, beyond, &stretch, &mut sum);
    *p = sum.map(|column| column.map(|numbers| load(simd, &numbers)));
    beyond
}

/// Numbers of the lanes of a matrix.
#[inline(always)]
fn stored<S: Simd>(m: &Mat3L<S>) -> [[[f32; LANES]; 3]; 3] {
    let mut numbers = [[[0.0; LANES]; 3]; 3];
    for (to, from) in numbers.as_flattened_mut().iter_mut().zip(m.as_flattened()) {
        from.store_slice(to);
    }
    numbers
}

/// Adds it in the lanes `beyond` the limit.
#[cold]
#[inline(never)]
fn add_limit_to(limit: &StretchEnergy, beyond: u16, f: &[[[f32; LANES]; 3]; 3], sum: &mut [[[f32; LANES]; 3]; 3]) {
    for lane in (0..LANES).filter(|lane| beyond >> lane & 1 != 0) {
        let f = DMat3::from_cols_array_2d(&f.map(|column| column.map(|numbers| f64::from(numbers[lane]))));
        let part = limit.stress(f).to_cols_array_2d();
        for (sum, part) in sum.as_flattened_mut().iter_mut().zip(part.as_flattened()) {
            sum[lane] += *part as f32;
        }
    }
}

/// Green's strain (F'F - I)/2: xx, yy, zz, xy, yz, zx.
#[inline(always)]
fn green_strain<S: Simd>(simd: S, f: &Mat3L<S>) -> [f32x16<S>; 6] {
    let (half, one) = (splat(simd, 0.5), splat(simd, 1.0));
    [
        (dot(f[0], f[0]) - one) * half,
        (dot(f[1], f[1]) - one) * half,
        (dot(f[2], f[2]) - one) * half,
        dot(f[0], f[1]) * half,
        dot(f[1], f[2]) * half,
        dot(f[2], f[0]) * half,
    ]
}

/// F S for a symmetric S.
#[inline(always)]
fn times_symmetric<S: Simd>(f: &Mat3L<S>, [xx, yy, zz, xy, yz, zx]: [f32x16<S>; 6]) -> Mat3L<S> {
    [apply(f, [xx, xy, zx]), apply(f, [xy, yy, yz]), apply(f, [zx, yz, zz])]
}
