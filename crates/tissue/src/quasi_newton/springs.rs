//! Springs between nodes: what a body's matrix has now beyond its factor, or no longer has.
//!
//! A spring is a matrix k u u' of rank one. Its u has a vector at each of a few nodes, in the
//! tissue's rest frame: a contact along one direction, or one change of an element's shape.

use std::ops::Range;

/// A spring's vector at a node.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Term {
    pub node: u32,
    pub along: [f32; 3],
}

/// A stiffness that changes by less than this share is taken as the same.
const SAME_STIFFNESS: f32 = 0.25;

/// A number of a spring's vectors that changes by less than this share of the largest is the same.
const SAME_DIRECTION: f32 = 0.1;

/// A list of springs.
pub(super) struct Springs {
    /// Stiffness of each, and the end of its terms; negative where the factor has too much.
    springs: Vec<(f32, usize)>,
    terms: Vec<Term>,
}

impl Springs {
    /// Room for `count` springs of some nodes each.
    pub fn with_capacity(count: usize) -> Self {
        Self { springs: Vec::with_capacity(count), terms: Vec::with_capacity(3 * count) }
    }

    pub fn clear(&mut self) {
        self.springs.clear();
        self.terms.clear();
    }

    pub fn len(&self) -> usize {
        self.springs.len()
    }

    /// Adds a spring. One without terms is none.
    pub fn push(&mut self, stiffness: f32, terms: impl IntoIterator<Item = Term>) {
        self.terms.extend(terms);
        let first = self.springs.last().map_or(0, |(_, end)| *end);
        if self.terms.len() > first {
            self.springs.push((stiffness, self.terms.len()));
        }
    }

    /// Adds springs of one stiffness in all directions at a node.
    pub fn push_alike(&mut self, stiffness: f32, node: u32) {
        for c in 0..3 {
            self.push(stiffness, [Term { node, along: std::array::from_fn(|k| if k == c { 1.0 } else { 0.0 }) }]);
        }
    }

    /// Takes over another list without allocating.
    pub fn copy_from(&mut self, other: &Self) {
        self.springs.clone_from(&other.springs);
        self.terms.clone_from(&other.terms);
    }

    /// Removes all but the first `count`.
    pub fn truncate(&mut self, count: usize) {
        self.springs.truncate(count);
        self.terms.truncate(self.springs.last().map_or(0, |(_, end)| *end));
    }

    /// Their stiffness (N/m, if the terms have no unit), and the range of their terms.
    pub fn ranges(&self) -> impl Iterator<Item = (f32, Range<usize>)> {
        let first = std::iter::once(0).chain(self.springs.iter().map(|(_, end)| *end));
        self.springs.iter().zip(first).map(|((stiffness, end), first)| (*stiffness, first..*end))
    }

    /// Stiffness and terms of spring number `k`.
    pub fn range(&self, k: usize) -> (f32, Range<usize>) {
        let first = if k == 0 { 0 } else { self.springs[k - 1].1 };
        (self.springs[k].0, first..self.springs[k].1)
    }

    /// The terms of all.
    pub fn terms(&self) -> &[Term] {
        &self.terms
    }

    /// Whether others are nearly the same, so that a matrix with these serves for them.
    pub fn are_like(&self, others: &Self) -> bool {
        let same = |a: &[Term], b: &[Term]| {
            let largest = b.iter().flat_map(|term| term.along).fold(0.0f32, |most, u| most.max(u.abs()));
            a.iter().zip(b).all(|(a, b)| {
                let near = |(a, b): (f32, f32)| (a - b).abs() <= SAME_DIRECTION * largest;
                a.node == b.node && a.along.into_iter().zip(b.along).all(near)
            })
        };
        self.len() == others.len()
            && self.ranges().zip(others.ranges()).all(|((k, own), (other, others_own))| {
                own == others_own
                    && (k - other).abs() <= SAME_STIFFNESS * k.abs().max(other.abs())
                    && same(&self.terms[own], &others.terms[others_own])
            })
    }
}
