//! Anti-aliasing of previews: a pixel whose colour differs much from a neighbour's becomes the mean
//! of four points. So the edges of bodies, shadows and highlights are smooth, in less than half the
//! time of a picture of twice the size.

use crate::deferred::{Buffers, Shading};
use crate::film::Film;
use crate::lanes::LANES;
use crate::picture::Picture;
use crate::preview::ROWS;
use crate::raster::{Seen, Visibility};
use crate::rays::TILE;
use crate::stage::{BundleCandidates, Stage};
use crate::visibility::Drawing;
use glam::Vec3A;
use rayon::prelude::*;
use std::ops::Range;

/// Points along each side of a pixel.
pub(crate) const FINER: usize = 2;

/// Greatest side of a picture that is refined (px): the points of a pixel take 150 bytes, and 40
/// more for each camera for which bodies at rest are kept.
pub(crate) const MAX_SIDE: usize = 4096;

/// Difference from a neighbour, of 255 levels of a channel, above which a pixel is refined.
const CONTRAST: u8 = 20;

/// A part of a row has a bit for each of its points in a byte.
const _: () = assert!(LANES == u8::BITS as usize);

/// The points of pixels that are refined, in a picture of [`FINER`] times as many rows and columns.
#[derive(Debug)]
pub(crate) struct Marks {
    /// For each row of pixels and each part of [`LANES`] points of one of its rows: a bit for each.
    bits: Vec<u8>,
    /// Parts of a row.
    parts: usize,
    /// The first row of pixels.
    first: usize,
}

/// The refined pixels of bodies at rest.
#[derive(Debug)]
pub(crate) struct Refined {
    marks: Marks,
    colors: Vec<[u8; 3]>,
}

/// What is known of bodies at rest when others are drawn over them.
#[derive(Clone, Copy)]
pub(crate) struct KeptPoints<'a> {
    pub refined: &'a Refined,
    /// What their points show.
    pub points: &'a Visibility,
    /// For each tile of points a box around what it shows (m, in the world).
    pub boxes: &'a [Option<[Vec3A; 2]>],
    /// Whether a body is not among them, and may move.
    pub moves: &'a (dyn Fn(usize) -> bool + Sync),
}

impl Marks {
    /// The pixels beside an edge: of another label or colour than the neighbour to the left or
    /// above, and that neighbour.
    pub fn of(picture: &Picture) -> Self {
        let (width, height) = (picture.color.width, picture.color.height);
        let parts = (FINER * width).div_ceil(LANES);
        let mut marks = Self { bits: vec![0; parts * height], parts, first: 0 };
        let (colors, labels) = (&picture.color.pixels, &picture.labels);
        let differ = |i: usize, j: usize| {
            labels[i] != labels[j] || (0..3).any(|c| colors[i][c].abs_diff(colors[j][c]) > CONTRAST)
        };
        for i in 0..width * height {
            let left = (i % width > 0).then(|| i - 1);
            let above = i.checked_sub(width);
            for j in [left, above].into_iter().flatten().filter(|j| differ(i, *j)) {
                for k in [i, j] {
                    marks.set(k % width, k / width, true);
                }
            }
        }
        marks
    }

    /// The marks of some rows of pixels.
    fn rows(&self, rows: Range<usize>) -> Self {
        Self { bits: self.bits[rows.start * self.parts..rows.end * self.parts].to_vec(), first: rows.start, ..*self }
    }

    /// Which points of a part are refined, from point `left` of row `row` of points.
    pub fn at(&self, row: usize, left: usize) -> u64 {
        u64::from(self.bits[(row / FINER - self.first) * self.parts + left / LANES])
    }

    /// Whether pixel `u` of row `v` is refined.
    fn has(&self, u: usize, v: usize) -> bool {
        self.at(FINER * v, FINER * u) >> (FINER * u % LANES) & 1 != 0
    }

    fn set(&mut self, u: usize, v: usize, refined: bool) {
        let bits = &mut self.bits[(v - self.first) * self.parts + FINER * u / LANES];
        let own = 0b11 << (FINER * u % LANES);
        *bits = if refined { *bits | own } else { *bits & !own };
    }

    fn any(&self) -> bool {
        self.bits.iter().any(|bits| *bits != 0)
    }
}

impl Refined {
    /// Of a preview whose colours are refined where `marks` says.
    pub fn new(marks: Marks, colors: Vec<[u8; 3]>) -> Self {
        Self { marks, colors }
    }
}

impl KeptPoints<'_> {
    /// Takes the colours of pixels that nothing has changed, and removes their marks. `seen` is
    /// what the points of the marked rows show.
    fn take(
        &self,
        (stage, shadows, width): (&Stage, bool, usize),
        seen: &Seen<'_>,
        marks: &mut Marks,
        colors: &mut [[u8; 3]],
        candidates: &mut BundleCandidates,
    ) {
        let stride = self.points.triangle.len() / (FINER * self.refined.colors.len() / width);
        let tiles = (FINER * width).div_ceil(TILE);
        let mut shaded_anew = (usize::MAX, false);
        for (k, color) in colors.iter_mut().enumerate() {
            let (u, v) = (k % width, marks.first + k / width);
            if !marks.has(u, v) || !self.refined.marks.has(u, v) {
                continue;
            }
            let from = FINER * (k / width) * stride + FINER * u;
            let kept = FINER * v * stride + FINER * u;
            let same = |row: usize| {
                let (from, kept) = (from + row * stride, kept + row * stride);
                seen.triangle[from..from + FINER] == self.points.triangle[kept..kept + FINER]
            };
            if !(0..FINER).all(same) {
                continue;
            }
            let tile = FINER * v / TILE * tiles + FINER * u / TILE;
            if shaded_anew.0 != tile {
                shaded_anew = (tile, shadows && stage.shaded_anew(self.boxes[tile], self.moves, candidates));
            }
            if !shaded_anew.1 {
                *color = self.refined.colors[v * width + u];
                marks.set(u, v, false);
            }
        }
    }
}

/// Refines a preview where `marks` says. `drawing` is that of its points, and `points` memory for
/// what they show; `casting` says which bodies cast shadows, if any do.
pub(crate) fn antialias(
    (picture, marks): (&mut Picture, &Marks),
    drawing: &Drawing<'_>,
    casting: Option<&(dyn Fn(usize) -> bool + Sync)>,
    film: &Film,
    points: &mut Visibility,
    kept: Option<KeptPoints<'_>>,
) {
    let (width, rays) = (picture.color.width, drawing.view.rays);
    let whole = Shading::new(drawing.stage, drawing.view);
    let shadows = casting.is_some();
    let whole = Shading { shadows, casting: casting.unwrap_or(whole.casting), ..whole };
    let rows = picture.color.pixels.par_chunks_mut((width * ROWS / FINER).max(1));
    let bands = rows.zip(points.bands(rays, ROWS)).enumerate();
    let memory = || (Buffers::new(), Picture::new(FINER * width, ROWS));
    bands.for_each_init(memory, |(buffers, lit), (k, (colors, seen))| {
        let (first, count) = (k * ROWS, FINER * colors.len() / width);
        let mut marks = marks.rows(first / FINER..(first + count) / FINER);
        if !marks.any() {
            return;
        }
        drawing.draw(first, seen.depth, seen.triangle);
        if let Some(kept) = &kept {
            kept.take((drawing.stage, shadows, width), &seen, &mut marks, colors, buffers.candidates());
        }
        let mut rows = lit.first_rows(count);
        Shading { marks: Some(&marks), ..whole }.shade(first, &seen, &mut rows, buffers);
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
