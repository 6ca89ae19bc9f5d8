//! One contact: a gap that is pressed shut, and friction along it.

use super::piece::{Measured, Piece};
use super::surface::Surface;
use crate::oracle::rub::{self, Rub, outer};
use crate::oracle::state::TouchKey;
use glam::{DMat3, DVec3};
use trocar_tissue::assembly::Stiffness;

/// The part of a contact that has a potential only while it is fixed.
#[derive(Clone, Default)]
pub struct Grip {
    /// Unit normal of friction's plane.
    pub normal: DVec3,
    /// Nodes and their shares of the point that touches; negative for what is touched.
    pub shares: Vec<(usize, f64)>,
    /// Where friction holds that point without force (m).
    pub place: DVec3,
    /// Greatest friction (N).
    pub limit: f64,
}

/// A contact.
pub struct Touch<'a> {
    pub key: TouchKey,
    /// The distances of which the smallest counts.
    pub pieces: Vec<Piece<'a>>,
    /// The surface that decides whether the first node is outside or inside, where distances have
    /// no sign.
    pub surface: Option<&'a Surface>,
    /// Distance without force (m).
    pub free: f64,
    /// (N/m)
    pub stiffness: f64,
    /// Depth from which the spring is [`HARDENING`] times as stiff (m).
    pub hard_from: f64,
    /// Coefficient of friction.
    pub friction: f64,
    pub grip: Grip,
}

/// Stiffness of a contact that is deep over that of one that has just begun.
const HARDENING: f64 = 25.0;

/// The gap of a contact at one place.
pub struct Gap {
    /// (m); negative where it is pressed.
    pub depth: f64,
    /// By node, each once.
    pub gradient: Vec<(usize, DVec3)>,
    /// By node, each once.
    pub shares: Vec<(usize, f64)>,
    /// 1, or -1 inside of a surface.
    side: f64,
    /// The share of each piece, and its distance.
    parts: Vec<(f64, Measured)>,
}

impl Touch<'_> {
    /// The gap with all nodes at `x`. The smallest of several distances is rounded off over a
    /// length of `blur` (m): where two are equal a vertex lies in a valley, and a minimum may be
    /// there.
    pub fn gap(&self, x: &[DVec3], blur: f64) -> Gap {
        let measured: Vec<Measured> = self.pieces.iter().map(|piece| piece.at(x)).collect();
        let least = measured.iter().map(|m| m.distance).fold(f64::INFINITY, f64::min);
        let shares: Vec<f64> = measured.iter().map(|m| libm::exp(-(m.distance - least) / blur)).collect();
        let sum: f64 = shares.iter().sum();
        let side = match self.surface {
            Some(surface) if surface.surrounds(x, x[self.pieces[0].nodes[0]]) => -1.0,
            _ => 1.0,
        };
        let rounded = if measured.len() > 1 { blur * libm::log(sum) } else { 0.0 };
        let mut gap = Gap {
            depth: side * (least - rounded) - self.free,
            gradient: Vec::new(),
            shares: Vec::new(),
            side,
            parts: shares.iter().map(|share| share / sum).zip(measured).collect(),
        };
        for (piece, (share, m)) in self.pieces.iter().zip(&gap.parts) {
            for (k, node) in piece.nodes.iter().take(piece.count).enumerate() {
                let at = gap.gradient.iter().position(|(known, _)| known == node).unwrap_or_else(|| {
                    gap.gradient.push((*node, DVec3::ZERO));
                    gap.shares.push((*node, 0.0));
                    gap.gradient.len() - 1
                });
                gap.gradient[at].1 += side * share * m.gradient[k];
                gap.shares[at].1 += share * m.shares[k];
            }
        }
        gap
    }

    /// How far a contact of some `depth` (m, negative where it presses) is pressed, and beyond
    /// where it hardens (m).
    fn pressed(&self, depth: f64) -> [f64; 2] {
        [(-depth).max(0.0), (-depth - self.hard_from).max(0.0)]
    }

    /// Energy at a `depth` (J).
    pub fn energy(&self, depth: f64) -> f64 {
        let [soft, hard] = self.pressed(depth);
        0.5 * self.stiffness * (soft * soft + (HARDENING - 1.0) * hard * hard)
    }

    /// Force that opens the gap at a `depth` (N).
    pub fn pressure(&self, depth: f64) -> f64 {
        let [soft, hard] = self.pressed(depth);
        self.stiffness * (soft + (HARDENING - 1.0) * hard)
    }

    /// Friction with its limit held; None without one.
    pub fn rub(&self, x: &[DVec3]) -> Option<Rub> {
        let Grip { normal, limit, .. } = self.grip;
        (limit > 0.0).then(|| Rub::new(normal, self.off(x), limit, self.stiffness))
    }

    /// Friction's spring after a step that ended at `x`: what pulled harder than the limit slipped
    /// (m).
    pub fn stretch(&self, x: &[DVec3]) -> DVec3 {
        let off = self.off(x);
        off - rub::dragged(self.grip.normal, off, self.grip.limit / self.stiffness)
    }

    /// From where friction holds the point to where it is (m).
    fn off(&self, x: &[DVec3]) -> DVec3 {
        self.point(x) - self.grip.place
    }

    /// The point that touches; between bodies from the one that is touched (m).
    pub fn point(&self, x: &[DVec3]) -> DVec3 {
        self.grip.shares.iter().map(|(i, share)| *share * x[*i]).sum()
    }

    /// Adds the second derivatives; only what is positive semidefinite if `project` or `secant`.
    pub fn hessian(&self, x: &[DVec3], blur: f64, project: bool, secant: bool, into: &mut Stiffness) {
        if let Some(rub) = self.rub(x) {
            let block = if secant { rub.secant } else { rub.hessian };
            for (i, a) in &self.grip.shares {
                for (j, b) in &self.grip.shares {
                    into.add(*i, *j, block * (a * b));
                }
            }
        }
        let gap = self.gap(x, blur);
        if gap.depth >= 0.0 {
            return;
        }
        let k = self.stiffness * if -gap.depth > self.hard_from { HARDENING } else { 1.0 };
        let between = |one: &[(usize, DVec3)], factor: f64, into: &mut Stiffness| {
            for (i, a) in one {
                for (j, b) in one {
                    into.add(*i, *j, product(*a, *b) * factor);
                }
            }
        };
        between(&gap.gradient, k, into);
        if self.pieces.len() == 1 && (project || secant) {
            return;
        }
        // The rounded minimum is concave, so its force makes it stiffer, outside of the surface.
        let turn = -self.pressure(gap.depth) * gap.side;
        if self.pieces.len() > 1 && (turn <= 0.0 || !(project || secant)) {
            between(&gap.gradient, turn / blur, into);
            for (piece, (share, m)) in self.pieces.iter().zip(&gap.parts) {
                let one: Vec<(usize, DVec3)> =
                    (0..piece.count).map(|k| (piece.nodes[k], gap.side * m.gradient[k])).collect();
                between(&one, -turn * share / blur, into);
            }
        }
        if project || secant {
            return;
        }
        for (piece, (share, _)) in self.pieces.iter().zip(&gap.parts).filter(|(_, (share, _))| *share > 1e-9) {
            let blocks = piece.curvature(x);
            for a in 0..piece.count {
                for b in 0..piece.count {
                    into.add(piece.nodes[a], piece.nodes[b], blocks[a][b] * (turn * share));
                }
            }
        }
    }
}

/// a b'.
fn product(a: DVec3, b: DVec3) -> DMat3 {
    if a == b { outer(a) } else { DMat3::from_cols(a * b.x, a * b.y, a * b.z) }
}
