//! Intersection over union of silhouettes.

use super::error::{Error, Result, fits};
use crate::Mask;

/// Pixels in both masks over pixels in either (Jaccard index), in [0, 1]. `None` if both are empty.
///
/// # Errors
/// Masks of different sizes.
pub fn iou(a: &Mask, b: &Mask) -> Result<Option<f64>> {
    fits("the first mask", (a.width, a.height, a.set.len()), (a.width, a.height))?;
    fits("the second mask", (b.width, b.height, b.set.len()), (a.width, a.height))?;
    let both = a.set.iter().zip(&b.set).filter(|(a, b)| **a && **b).count();
    let either = a.count() + b.count() - both;
    Ok((either > 0).then(|| both as f64 / either as f64))
}

/// The union of the masks.
///
/// # Errors
/// No masks, or masks of different sizes.
pub fn union<'a>(masks: impl IntoIterator<Item = &'a Mask>) -> Result<Mask> {
    let mut masks = masks.into_iter();
    let mut all = masks.next().ok_or(Error::Empty)?.clone();
    fits("the first mask", (all.width, all.height, all.set.len()), (all.width, all.height))?;
    for mask in masks {
        fits("a mask", (mask.width, mask.height, mask.set.len()), (all.width, all.height))?;
        all.set.iter_mut().zip(&mask.set).for_each(|(all, set)| *all |= set);
    }
    Ok(all)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rows(from: usize, to: usize) -> Mask {
        let mut mask = Mask::new(5, 10);
        mask.set[5 * from..5 * to].fill(true);
        mask
    }

    #[test]
    fn overlaps_have_their_known_iou() {
        assert_eq!(iou(&rows(0, 6), &rows(0, 6)), Ok(Some(1.0)));
        assert_eq!(iou(&rows(0, 6), &rows(3, 9)), Ok(Some(3.0 / 9.0)));
        assert_eq!(iou(&rows(0, 3), &rows(5, 9)), Ok(Some(0.0)));
        assert_eq!(iou(&rows(0, 0), &rows(0, 0)), Ok(None));
        assert_eq!(union([&rows(0, 2), &rows(1, 4)]), Ok(rows(0, 4)));
        assert_eq!(union([]), Err(Error::Empty));
    }

    #[test]
    fn different_sizes_are_rejected() {
        let said = iou(&rows(0, 6), &Mask::new(4, 10)).unwrap_err().to_string();
        assert!(said.contains("4 x 10") && said.contains("5 x 10"), "{said}");
        assert!(iou(&rows(0, 1), &Mask { width: 5, height: 10, set: vec![true; 3] }).is_err());
    }
}
