//! The bound on dihedral angles, by enumeration of all configurations of a lattice tet.
//!
//! A corner of the tet is inside, outside, or was moved onto the surface: along one of its 14
//! edges, at most by the snap fraction, towards a point on the other side. A cut point is anywhere
//! on its edge outside the snap fractions of the ends. The worst angles are at the limits of these
//! ranges, which are all tested. Random points within the ranges do not give smaller angles.

use super::cuts::{SNAP_LONG, SNAP_SHORT};
use super::points::{LONG_STEPS, Point, STEPS};
use super::stencil::{Corner, Side, fill};
use crate::{TetMesh, TetQuality};
use glam::{DVec3, IVec3};
use rand_pcg::Pcg64Mcg;
use rand_pcg::rand_core::Rng;

/// A positive lattice tet with the long edges (0, 1) and (2, 3). The others are its mirror images.
const TET: [Point; 4] = [[1, 1, 1], [3, 1, 1], [2, 0, 0], [2, 2, 0]];

fn at(i: usize) -> DVec3 {
    IVec3::from(TET[i]).as_dvec3()
}

/// Move of each corner: the step and the distance as a fraction of its limit. `None` for no move.
type Moves = [Option<(usize, f64)>; 4];

/// Whether signs before the moves exist that are consistent with them: each move is towards the
/// other side, and no two corners move towards each other.
fn possible(sides: &[Side; 4], moves: &Moves) -> bool {
    let to = [0, 1, 2, 3].map(|i| {
        let (step, _) = moves[i]?;
        let q = [0, 1, 2].map(|axis| TET[i][axis] + STEPS[step][axis]);
        TET.iter().position(|p| *p == q)
    });
    (0..16usize).any(|signs| {
        let inside = |i: usize| match sides[i] {
            Side::Inside => true,
            Side::Outside => false,
            Side::Surface => signs >> i & 1 == 1,
        };
        (0..4).all(|i| to[i].is_none_or(|j| inside(i) != inside(j) && to[j] != Some(i)))
    })
}

/// Smallest and largest angle of the resulting tets. `share` gives the position of an edge's cut in
/// its range, in [0, 1].
fn angles(sides: &[Side; 4], moves: &Moves, share: &dyn Fn(usize, usize) -> f64) -> (f64, f64) {
    let place = |i: usize| match moves[i] {
        Some((step, far)) => {
            let snap = if step < LONG_STEPS { SNAP_LONG } else { SNAP_SHORT };
            at(i) + IVec3::from(STEPS[step]).as_dvec3() * (snap * far)
        }
        None => at(i),
    };
    let cut = |i: usize, j: usize| {
        let snap = if i / 2 == j / 2 { SNAP_LONG } else { SNAP_SHORT };
        at(i).lerp(at(j), snap + (1.0 - 2.0 * snap) * share(i, j))
    };
    let mut extremes = (180.0f64, 0.0f64);
    fill(&TET, sides, |tet| {
        let vertices = tet.map(|corner| match corner {
            Corner::Point(i) => place(i),
            Corner::Cut(i, j) => cut(i, j),
        });
        let quality = TetQuality::of(&TetMesh { vertices: vertices.to_vec(), tets: vec![[0, 1, 2, 3]] });
        assert_eq!(quality.inverted, 0, "{sides:?} {moves:?}");
        extremes = (extremes.0.min(quality.min_dihedral_deg), extremes.1.max(quality.max_dihedral_deg));
    });
    extremes
}

#[test]
fn every_lattice_tet_keeps_the_angle_bound() {
    let kinds = [Side::Inside, Side::Surface, Side::Outside];
    let mut rng = Pcg64Mcg::new(1);
    let mut unit = || (rng.next_u64() >> 11) as f64 / (1u64 << 53) as f64;
    let (mut least, mut most) = (180.0f64, 0.0f64);
    let mut random_least = 180.0f64;
    for pattern in 0..81usize {
        let sides = [1, 3, 9, 27].map(|d| kinds[pattern / d % 3]);
        let moved: Vec<usize> = (0..4).filter(|i| sides[*i] == Side::Surface).collect();
        if !sides.contains(&Side::Inside) {
            continue;
        }
        for code in 0..15usize.pow(moved.len() as u32) {
            let mut moves: Moves = [None; 4];
            let mut rest = code;
            for &i in &moved {
                moves[i] = (rest % 15 < 14).then_some((rest % 15, 1.0));
                rest /= 15;
            }
            if !possible(&sides, &moves) {
                continue;
            }
            // One bit per pair of corners: the end at which its cut lies.
            let pairs: Vec<(usize, usize)> = (0..4)
                .flat_map(|i| (0..4).map(move |j| (i, j)))
                .filter(|&(i, j)| sides[i] == Side::Inside && sides[j] == Side::Outside)
                .collect();
            for ends in 0..1usize << pairs.len() {
                let share = |i: usize, j: usize| {
                    let bit = pairs.iter().position(|p| *p == (i, j)).unwrap_or(0);
                    f64::from((ends >> bit & 1) as u32)
                };
                let (low, high) = angles(&sides, &moves, &share);
                (least, most) = (least.min(low), most.max(high));
            }
            let moves = moves.map(|m| m.map(|(step, _)| (step, unit())));
            let shares: Vec<f64> = (0..16).map(|_| unit()).collect();
            random_least = random_least.min(angles(&sides, &moves, &|i, j| shares[4 * i + j]).0);
        }
    }
    assert!(least > 10.7 && most < 165.0 && random_least > least);
}
