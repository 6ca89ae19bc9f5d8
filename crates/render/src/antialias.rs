//! Anti-aliasing of previews: a pixel whose colour differs much from a neighbour's becomes the mean
//! of four points. So the edges of bodies, shadows and highlights are smooth, in less than half the
//! time of a picture of twice the size.

use crate::deferred::{Buffers, Shading};
use crate::film::Film;
use crate::lanes::LANES;
use crate::picture::Picture;
use crate::preview::ROWS;
use crate::raster::Visibility;
use crate::visibility::Drawing;
use rayon::prelude::*;

/// Points along each side of a pixel.
pub(crate) const FINER: usize = 2;

/// Greatest side of a picture that is refined (px): its points take 150 bytes each.
pub(crate) const MAX_SIDE: usize = 4096;

/// Difference from a neighbour, of 255 levels of a channel, above which a pixel is refined.
const CONTRAST: u8 = 20;

/// The points of pixels that are refined, in a picture of [`FINER`] times as many rows and columns.
pub(crate) struct Marks {
    /// For each row of pixels and each part of [`LANES`] points of one of its rows: a bit for each.
    bits: Vec<u8>,
    /// Parts of a row.
    parts: usize,
}

impl Marks {
    /// The pixels beside an edge: of another label or colour than the neighbour to the left or
    /// above, and that neighbour.
    fn of(picture: &Picture) -> Self {
        let (width, height) = (picture.color.width, picture.color.height);
        let parts = (FINER * width).div_ceil(LANES);
        let mut bits = vec![0; parts * height];
        let mut mark = |i: usize| {
            let (u, v) = (i % width, i / width);
            bits[v * parts + FINER * u / LANES] |= 0b11 << (FINER * u % LANES);
        };
        let (colors, labels) = (&picture.color.pixels, &picture.labels);
        let differ = |i: usize, j: usize| {
            labels[i] != labels[j] || (0..3).any(|c| colors[i][c].abs_diff(colors[j][c]) > CONTRAST)
        };
        for i in 0..width * height {
            let left = (i % width > 0).then(|| i - 1);
            let above = i.checked_sub(width);
            for j in [left, above].into_iter().flatten().filter(|j| differ(i, *j)) {
                mark(i);
                mark(j);
            }
        }
        Self { bits, parts }
    }

    /// Which points of a part are refined, from point `left` of row `row` of points.
    pub fn at(&self, row: usize, left: usize) -> u64 {
        u64::from(self.bits[row / FINER * self.parts + left / LANES])
    }

    /// Whether pixel `u` of row `v` is refined.
    fn has(&self, u: usize, v: usize) -> bool {
        self.at(FINER * v, FINER * u) >> (FINER * u % LANES) & 1 != 0
    }

    /// Whether a pixel of `count` rows of points from row `first` is refined.
    fn any(&self, first: usize, count: usize) -> bool {
        let rows = first / FINER..(first + count).div_ceil(FINER);
        self.bits[rows.start * self.parts..rows.end * self.parts].iter().any(|bits| *bits != 0)
    }
}

/// Refines a preview. `drawing` is that of its points, and `points` memory for what they show.
pub(crate) fn antialias(
    picture: &mut Picture,
    drawing: &Drawing<'_>,
    shadows: bool,
    film: &Film,
    points: &mut Visibility,
) {
    let marks = Marks::of(picture);
    let (width, rays) = (picture.color.width, drawing.view.rays);
    let shading = Shading { shadows, marks: Some(&marks), ..Shading::new(drawing.stage, drawing.view) };
    let rows = picture.color.pixels.par_chunks_mut((width * ROWS / FINER).max(1));
    let bands = rows.zip(points.bands(rays, ROWS)).enumerate();
    let memory = || (Buffers::new(), Picture::new(FINER * width, ROWS));
    bands.for_each_init(memory, |(buffers, lit), (k, (colors, seen))| {
        let (first, count) = (k * ROWS, FINER * colors.len() / width);
        if !marks.any(first, count) {
            return;
        }
        drawing.draw(first, seen.depth, seen.triangle);
        let mut rows = lit.first_rows(count);
        shading.shade(first, &seen, &mut rows, buffers);
        rows.develop_parts(film, rays, first, &buffers.shaded);
        for (v, row) in colors.chunks_mut(width).enumerate() {
            for (u, color) in row.iter_mut().enumerate().filter(|(u, _)| marks.has(*u, first / FINER + v)) {
                let at = FINER * (v * FINER * width + u);
                let four = [at, at + 1, at + FINER * width, at + FINER * width + 1].map(|i| rows.color[i]);
                *color = [0, 1, 2].map(|c| ((four.iter().map(|p| u32::from(p[c])).sum::<u32>() + 2) / 4) as u8);
            }
        }
    });
}
