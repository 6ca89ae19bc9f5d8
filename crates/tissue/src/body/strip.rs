//! The elements around a vertex as a strip of triangles.
//!
//! Each element at a vertex has a triangle opposite it: its other three corners. In the order of a
//! strip each triangle shares two corners with the one before, so n triangles need n + 2 points to
//! be read instead of 3n. A sweep spends its time on reading points.

/// Greatest number of triangles, and of points, for which a strip is sought; larger fans are read
/// triangle by triangle.
const MAX_STRIP_TRIANGLES: usize = 128;

/// A step along a strip: the window (p, q, r) becomes (q, r, to) or (p, r, to).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Push {
    /// The point that enters.
    pub to: u32,
    /// Whether p leaves, else q.
    pub drop_first: bool,
    /// The triangle of the new window, and whether it is turned over; None on the way to the next
    /// one.
    pub triangle: Option<(u32, bool)>,
}

/// A strip through all `triangles`, each once. The first two steps are never triangles.
pub(crate) fn strip(triangles: &[[u32; 3]]) -> Vec<Push> {
    let mut points: Vec<u32> = triangles.iter().flatten().copied().collect();
    points.sort_unstable();
    points.dedup();
    if triangles.len() > MAX_STRIP_TRIANGLES || points.len() > MAX_STRIP_TRIANGLES {
        let mut walk = Walk::new(triangles, Vec::new());
        (0..triangles.len()).for_each(|t| walk.begin(t, triangles[t]));
        return walk.pushes;
    }
    let set = |triangle: &[u32; 3]| {
        let bit = |p: &u32| points.binary_search(p).map_or(0, |at| 1u128 << at);
        triangle.iter().map(bit).sum::<u128>()
    };
    let sets: Vec<u128> = triangles.iter().map(set).collect();
    let beside = |a: usize| {
        let touches = |b: &usize| a != *b && (sets[a] & sets[*b]).count_ones() == 2;
        (0..sets.len()).filter(touches).map(|b| 1u128 << b).sum()
    };
    let beside: Vec<u128> = (0..sets.len()).map(beside).collect();
    let mut best: Vec<Push> = Vec::new();
    for (first, [a, b, c]) in triangles.iter().enumerate() {
        for turned in [[*a, *b, *c], [*b, *c, *a], [*c, *a, *b]] {
            let mut walk = Walk::new(triangles, beside.clone());
            walk.begin(first, turned);
            walk.walk();
            if best.is_empty() || walk.pushes.len() < best.len() {
                best = walk.pushes;
            }
            if best.len() == triangles.len() + 2 {
                return best;
            }
        }
    }
    best
}

/// A strip under construction.
struct Walk<'a> {
    triangles: &'a [[u32; 3]],
    /// Triangles that share an edge with each, as bits.
    beside: Vec<u128>,
    /// Triangles not yet in the strip, as bits.
    left: u128,
    window: [u32; 3],
    pushes: Vec<Push>,
}

impl<'a> Walk<'a> {
    fn new(triangles: &'a [[u32; 3]], beside: Vec<u128>) -> Self {
        let left = u128::MAX >> (MAX_STRIP_TRIANGLES - triangles.len().min(MAX_STRIP_TRIANGLES));
        Self { triangles, beside, left, window: [u32::MAX; 3], pushes: Vec::with_capacity(triangles.len() + 6) }
    }

    /// Adds a point; `triangle` is the triangle of the window after it.
    fn push(&mut self, to: u32, drop_first: bool, triangle: Option<usize>) {
        let [p, q, r] = self.window;
        self.window = [if drop_first { q } else { p }, r, to];
        let triangle = triangle.map(|t| {
            self.left &= !(1u128.checked_shl(t as u32).unwrap_or(0));
            let at = |point: u32| self.triangles[t].iter().position(|v| *v == point).unwrap_or(0);
            (t as u32, at(self.window[1]) != (at(self.window[0]) + 1) % 3)
        });
        self.pushes.push(Push { to, drop_first, triangle });
    }

    /// Goes to triangle `t` without sharing a point.
    fn begin(&mut self, t: usize, [a, b, c]: [u32; 3]) {
        self.push(a, true, None);
        self.push(b, true, None);
        self.push(c, true, Some(t));
    }

    /// Follows neighbours until every triangle is in the strip. Of two neighbours, the one with
    /// fewer free neighbours comes first; otherwise it would be left alone.
    fn walk(&mut self) {
        let mut last = self.pushes.last().and_then(|push| push.triangle).map_or(0, |(t, _)| t as usize);
        while self.left != 0 {
            last = self.follow(last).unwrap_or_else(|| self.jump());
        }
    }

    fn ways_on(&self, t: usize) -> u32 {
        (self.beside[t] & self.left).count_ones()
    }

    /// The next triangle over an edge that contains the newest point.
    fn follow(&mut self, last: usize) -> Option<usize> {
        let [p, _, r] = self.window;
        let next = bits(self.beside[last] & self.left).filter(|t| self.triangles[*t].contains(&r));
        let next = next.min_by_key(|t| self.ways_on(*t))?;
        let to = self.triangles[next].iter().copied().find(|v| !self.window.contains(v))?;
        self.push(to, !self.triangles[next].contains(&p), Some(next));
        Some(next)
    }

    /// Goes to a triangle that is not beside the window: over one point if it has one in common,
    /// else over two.
    fn jump(&mut self) -> usize {
        let window = self.window;
        let apart = |t: &usize| !window.iter().any(|v| self.triangles[*t].contains(v));
        let Some(next) = bits(self.left).min_by_key(|t| (apart(t), self.ways_on(*t))) else { return 0 };
        let triangle = self.triangles[next];
        let [p, q, r] = window;
        let Some(kept) = [p, q, r].into_iter().find(|v| triangle.contains(v)) else {
            self.begin(next, triangle);
            return next;
        };
        let mut others = triangle.into_iter().filter(|v| *v != kept);
        let (Some(mut a), Some(mut b)) = (others.next(), others.next()) else { return next };
        // The strip must continue from the newest point.
        let leads = |point: u32| bits(self.beside[next] & self.left).any(|t| self.triangles[t].contains(&point));
        if !leads(b) && leads(a) {
            std::mem::swap(&mut a, &mut b);
        }
        self.push(a, kept == q, None);
        self.push(b, kept == r, Some(next));
        next
    }
}

/// The numbers of the bits that are set.
fn bits(mut set: u128) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let lowest = (set != 0).then(|| set.trailing_zeros() as usize)?;
        set &= set - 1;
        Some(lowest)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every triangle is named once, with its own corners and its own turn.
    fn check(triangles: &[[u32; 3]]) -> usize {
        let pushes = strip(triangles);
        let (mut window, mut seen) = ([u32::MAX; 3], vec![0; triangles.len()]);
        for (k, push) in pushes.iter().enumerate() {
            let [p, q, r] = window;
            window = [if push.drop_first { q } else { p }, r, push.to];
            if let Some((t, turned)) = push.triangle {
                assert!(k >= 2);
                seen[t as usize] += 1;
                let [a, b, c] = triangles[t as usize];
                let turns = if turned { [[a, c, b], [c, b, a], [b, a, c]] } else { [[a, b, c], [b, c, a], [c, a, b]] };
                assert!(turns.contains(&window), "{window:?} is not {:?}", triangles[t as usize]);
            }
        }
        assert!(seen.iter().all(|n| *n == 1), "{seen:?}");
        pushes.len()
    }

    #[test]
    fn strips_go_through_every_triangle_once() {
        // An icosahedron: 20 triangles in a perfect strip.
        let mut triangles: Vec<[u32; 3]> = Vec::new();
        for i in 0..5u32 {
            let (a, b) = (1 + i, 1 + (i + 1) % 5);
            let (c, d) = (6 + i, 6 + (i + 1) % 5);
            triangles.extend([[0, a, b], [a, c, b], [b, c, d], [c, 11, d]]);
        }
        assert_eq!(check(&triangles), 22);
        // A fan, and one far away; two that share an edge with a third; one alone; two beside each
        // other at one point.
        assert_eq!(check(&[[0, 1, 2], [0, 2, 3], [0, 3, 4], [7, 8, 9]]), 5 + 3);
        check(&[[0, 1, 2], [1, 0, 3], [0, 1, 4]]);
        assert_eq!(check(&[[5, 6, 7]]), 3);
        assert_eq!(check(&[[0, 1, 2], [2, 3, 4]]), 5);
        // Random soups of triangles.
        let mut seed = 1u32;
        let mut random = |n: u32| {
            seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (seed >> 8) % n
        };
        for n in 1..40 {
            let mut soup = Vec::new();
            for _ in 0..n {
                let (a, b, c) = (random(9), random(9), random(9));
                if a != b && b != c && c != a {
                    soup.push([a, b, c]);
                }
            }
            soup.sort_by_key(|t| {
                let mut t = *t;
                t.sort_unstable();
                t
            });
            if !soup.is_empty() {
                check(&soup);
            }
        }
        // More than the search needs.
        assert_eq!(check(&(0..200).map(|i| [0, i + 1, i + 2]).collect::<Vec<_>>()), 600);
    }
}
