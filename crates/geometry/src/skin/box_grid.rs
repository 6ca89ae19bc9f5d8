//! A uniform grid over boxes, to find the boxes near a point.

use glam::DVec3;

/// A grid whose cells list the boxes that overlap them.
pub(super) struct BoxGrid {
    origin: DVec3,
    cell: f64,
    dims: [usize; 3],
    starts: Vec<u32>,
    items: Vec<u32>,
}

impl BoxGrid {
    /// Sorts `boxes`, given by their smallest and largest coordinates (m), into cells about as
    /// large as the mean box. `None` if there are no boxes or coordinates are not finite.
    pub(super) fn new(boxes: &[(DVec3, DVec3)]) -> Option<Self> {
        let &first = boxes.first()?;
        let (lo, hi) = boxes.iter().fold(first, |(lo, hi), b| (lo.min(b.0), hi.max(b.1)));
        let mean = boxes.iter().map(|b| (b.1 - b.0).max_element()).sum::<f64>() / boxes.len() as f64;
        // Limits the number of cells to a few per box for any arrangement.
        let coarsest = libm::cbrt((hi - lo).max(DVec3::splat(mean)).element_product() / (8 * boxes.len()) as f64);
        let cell = mean.max(coarsest);
        if !(cell > 0.0 && (hi - lo).is_finite()) {
            return None;
        }
        let dims = ((hi - lo) / cell).to_array().map(|n| n as usize + 1);
        let mut grid =
            Self { origin: lo, cell, dims, starts: vec![0; dims.iter().product::<usize>() + 1], items: vec![] };
        // Counting sort: the count per cell, the start of each cell, then the boxes.
        for b in boxes {
            let range = grid.range(b);
            grid.each_cell(range, |cell, starts| starts[cell + 1] += 1);
        }
        for i in 1..grid.starts.len() {
            grid.starts[i] += grid.starts[i - 1];
        }
        let mut items = vec![0; grid.starts.last().map_or(0, |&n| n as usize)];
        let mut next = grid.starts.clone();
        for (item, b) in boxes.iter().enumerate() {
            let range = grid.range(b);
            grid.each_cell(range, |cell, _| {
                items[next[cell] as usize] = item as u32;
                next[cell] += 1;
            });
        }
        grid.items = items;
        Some(grid)
    }

    /// The boxes that overlap the cell of `p` in ascending order; none if `p` is outside the grid.
    pub(super) fn at(&self, p: DVec3) -> &[u32] {
        let at = (p - self.origin) / self.cell;
        let inside = at.cmpge(DVec3::ZERO).all() && (0..3).all(|a| at[a] < self.dims[a] as f64);
        if inside { self.cell_items(self.clamped(p)) } else { &[] }
    }

    /// The item with the smallest `distance` (m) from `p`, where `distance` is that of an object
    /// within the item's box. Of equal distances the lower item wins. `None` if every distance is
    /// NaN.
    pub(super) fn nearest(&self, p: DVec3, distance: impl Fn(u32) -> f64) -> Option<u32> {
        let mut best: Option<(f64, u32)> = None;
        let centre = self.clamped(p);
        for ring in 0..=self.dims.iter().copied().max().unwrap_or(0) {
            // A cell of this ring is at least ring - 1 cells away from the cell of `p`.
            let away = (ring as f64 - 1.0).max(0.0) * self.cell;
            if best.is_some_and(|(least, _)| least < away) {
                break;
            }
            self.each_of_ring(centre, ring, |cell| {
                // The nearest object lies in a cell that lists it, so farther cells than the best
                // distance are skipped.
                if best.is_some_and(|(least, _)| least < self.distance_to_cell(p, cell)) {
                    return;
                }
                for &item in self.cell_items(cell) {
                    let d = distance(item);
                    if best.is_none_or(|(least, known)| d < least || (d == least && item < known)) && !d.is_nan() {
                        best = Some((d, item));
                    }
                }
            });
        }
        best.map(|(_, item)| item)
    }

    /// Distance from `p` to a cell (m), reduced slightly for rounding.
    fn distance_to_cell(&self, p: DVec3, cell: [usize; 3]) -> f64 {
        let lo = self.origin + self.cell * DVec3::from(cell.map(|c| c as f64));
        p.distance(p.clamp(lo, lo + self.cell)) - 1e-9 * self.cell
    }

    fn clamped(&self, p: DVec3) -> [usize; 3] {
        let at = ((p - self.origin) / self.cell).max(DVec3::ZERO).to_array();
        [0, 1, 2].map(|a| (at[a] as usize).min(self.dims[a] - 1))
    }

    fn range(&self, b: &(DVec3, DVec3)) -> ([usize; 3], [usize; 3]) {
        (self.clamped(b.0), self.clamped(b.1))
    }

    fn index(&self, [x, y, z]: [usize; 3]) -> usize {
        (z * self.dims[1] + y) * self.dims[0] + x
    }

    fn cell_items(&self, cell: [usize; 3]) -> &[u32] {
        let i = self.index(cell);
        &self.items[self.starts[i] as usize..self.starts[i + 1] as usize]
    }

    fn each_cell(&mut self, (lo, hi): ([usize; 3], [usize; 3]), mut f: impl FnMut(usize, &mut [u32])) {
        for z in lo[2]..=hi[2] {
            for y in lo[1]..=hi[1] {
                for x in lo[0]..=hi[0] {
                    f(self.index([x, y, z]), &mut self.starts);
                }
            }
        }
    }

    /// The cells at Chebyshev distance `ring` from `centre`.
    fn each_of_ring(&self, centre: [usize; 3], ring: usize, mut f: impl FnMut([usize; 3])) {
        let [xs, ys, zs] = [0, 1, 2].map(|a| centre[a].saturating_sub(ring)..=(centre[a] + ring).min(self.dims[a] - 1));
        for z in zs {
            for y in ys.clone() {
                let on_side = z.abs_diff(centre[2]) == ring || y.abs_diff(centre[1]) == ring;
                if on_side {
                    xs.clone().for_each(|x| f([x, y, z]));
                } else {
                    let ends = [centre[0].checked_sub(ring), Some(centre[0] + ring).filter(|_| ring > 0)];
                    ends.into_iter().flatten().filter(|x| xs.contains(x)).for_each(|x| f([x, y, z]));
                }
            }
        }
    }
}
