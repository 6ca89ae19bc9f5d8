//! Prepares a mask for closing: one piece without pinholes.

use trocar_camera::{Mask, pixel_neighbours};

/// What [`tidy`] changed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Tidied {
    /// Pixels of smaller pieces, dropped.
    pub dropped: usize,
    /// Pixels of small holes, filled.
    pub filled: usize,
    /// Pixels on the image's border, beyond which the organ continues.
    pub on_border: usize,
}

/// Keeps the largest 4-connected piece of `mask` and fills enclosed holes of less than 2% of its
/// area, because a pinhole in a mask would become a tunnel through the organ.
pub fn tidy(mask: &mut Mask) -> Tidied {
    let pieces = pieces(mask, true);
    let mut tidied = Tidied::default();
    // The first of equal pieces.
    let largest = (0..pieces.len()).rev().max_by_key(|&p| pieces[p].len());
    for (p, piece) in pieces.iter().enumerate() {
        if Some(p) != largest {
            piece.iter().for_each(|&i| mask.set[i] = false);
            tidied.dropped += piece.len();
        }
    }
    let area = mask.count();
    let (w, h) = (mask.width, mask.height);
    let border = |i: &usize| i.is_multiple_of(w) || i % w == w - 1 || i / w == 0 || i / w == h - 1;
    for hole in self::pieces(mask, false) {
        if !hole.iter().any(border) && 50 * hole.len() < area {
            hole.iter().for_each(|&i| mask.set[i] = true);
            tidied.filled += hole.len();
        }
    }
    tidied.on_border = (0..mask.set.len()).filter(|i| mask.set[*i] && border(i)).count();
    tidied
}

/// The 4-connected pieces of the pixels that are `value`, in the order of their first pixels.
fn pieces(mask: &Mask, value: bool) -> Vec<Vec<usize>> {
    let (w, h) = (mask.width, mask.height);
    let mut seen = vec![false; mask.set.len()];
    let mut pieces = Vec::new();
    for first in 0..mask.set.len() {
        if seen[first] || mask.set[first] != value {
            continue;
        }
        seen[first] = true;
        let (mut piece, mut next) = (vec![first], 0);
        while next < piece.len() {
            let i = piece[next];
            next += 1;
            for j in pixel_neighbours(i, w, h) {
                if !seen[j] && mask.set[j] == value {
                    seen[j] = true;
                    piece.push(j);
                }
            }
        }
        pieces.push(piece);
    }
    pieces
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_piece_without_pinholes() {
        let mut mask = Mask::new(30, 20);
        for v in 0..20 {
            for u in 0..30 {
                mask.set[v * 30 + u] = (2..28).contains(&u) && (0..18).contains(&v) && (u, v) != (9, 9);
            }
        }
        mask.set[19 * 30] = true;
        for (u, v) in [(15, 5), (16, 5), (15, 6), (16, 6), (17, 5), (17, 6), (15, 7), (16, 7), (17, 7), (18, 7)] {
            mask.set[v * 30 + u] = false;
        }
        let tidied = tidy(&mut mask);
        assert_eq!(tidied, Tidied { dropped: 1, filled: 1, on_border: 26 });
        assert_eq!(mask.count(), 26 * 18 - 10, "the large hole stays");
    }
}
