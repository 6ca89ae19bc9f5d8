//! First hits of the rays through a grid of samples, found by drawing the triangles.
//!
//! Each triangle is tested against the samples in the box around its projection, by the tracer's
//! own intersection in double precision. The hits are those of the tracer to the bit, for a
//! fraction of the time: most triangles cover a few samples. Where two are equally near, the tracer
//! decides.

use super::scene::View;
use super::trace::{Hit, Tracer, edges, intersect};
use glam::{DVec2, DVec3};
use trocar_camera::Camera;

/// Rows of samples that share a list of triangles.
const BAND: usize = 8;

/// Margin of the boxes in samples. It covers rounding and the tolerance of the intersection.
const MARGIN: f64 = 0.01;

/// Distance of the plane in front of which triangles are drawn from that of the lens (m).
const NEAR: f64 = 1e-6;

/// The samples in the box around a triangle's projection: columns and rows, the ends included.
#[derive(Clone, Copy)]
struct Covered {
    columns: [u32; 2],
    rows: [u32; 2],
}

/// The hits of all samples of a camera, row by row.
pub(super) struct Hits<'a> {
    tracer: &'a Tracer,
    view: &'a View<'a>,
    /// Samples along each side of a pixel.
    finer: usize,
    columns: usize,
    /// The triangles, as they are drawn. None for a lens with distortion, whose edges are not
    /// straight: the tracer finds its hits.
    drawing: Option<Drawing>,
}

/// The triangles of a tracer on a grid of samples.
struct Drawing {
    covered: Vec<Covered>,
    /// The triangles of each band, and where its list begins; one more at the end.
    lists: Vec<u32>,
    first: Vec<usize>,
}

/// The samples of a row.
#[derive(Default)]
pub(super) struct Row {
    /// World directions of the rays, with z = 1 in the camera's frame; zero beside all triangles.
    pub directions: Vec<DVec3>,
    pub hits: Vec<Option<Hit>>,
    /// Samples for which several triangles are equally near.
    ties: Vec<bool>,
}

impl<'a> Hits<'a> {
    /// With `finer` x `finer` samples in a pixel.
    pub fn new(tracer: &'a Tracer, view: &'a View<'a>, finer: usize) -> Self {
        let straight = view.camera.distortion.is_none();
        let drawing = straight.then(|| Drawing::new(tracer, view, finer));
        Self { tracer, view, finer, columns: view.camera.width * finer, drawing }
    }

    /// Finds the hits of a row of samples.
    pub fn row(&self, row: usize, out: &mut Row) {
        let v = self.place(row);
        out.directions.clear();
        out.directions.resize(self.columns, DVec3::ZERO);
        let [first, end] = self.drawing.as_ref().map_or([0, self.columns], |drawing| drawing.columns(row));
        for column in first..end {
            out.directions[column] = self.view.direction(self.place(column), v);
        }
        let origin = self.view.pose.translation;
        let traced = |direction: &DVec3| self.tracer.first(origin, *direction, f64::INFINITY);
        out.hits.clear();
        let Some(drawing) = &self.drawing else {
            out.hits.extend(out.directions.iter().map(traced));
            return;
        };
        out.hits.resize(self.columns, None);
        out.ties.clear();
        out.ties.resize(self.columns, false);
        drawing.draw(self.tracer, origin, row, out);
        for column in (0..self.columns).filter(|column| out.ties[*column]) {
            out.hits[column] = traced(&out.directions[column]);
        }
    }

    /// Where a row or column of samples is, in pixels.
    fn place(&self, sample: usize) -> f64 {
        let (pixel, within) = (sample / self.finer, sample % self.finer);
        pixel as f64 + ((within as f64 + 0.5) / self.finer as f64 - 0.5)
    }
}

impl Drawing {
    fn new(tracer: &Tracer, view: &View<'_>, finer: usize) -> Self {
        let camera = view.camera;
        let (columns, rows) = (camera.width * finer, camera.height * finer);
        let (to_camera, bands) = (view.pose.inverse(), rows.div_ceil(BAND));
        let size = DVec2::new(columns as f64, rows as f64);
        let covered = tracer
            .triangles()
            .iter()
            .map(|corners| covered(camera, corners.map(|p| to_camera.transform(p)), finer as f64, size));
        let covered: Vec<Covered> = covered.collect();
        let bands_of = |c: &Covered| c.rows[0] as usize / BAND..(c.rows[1] as usize / BAND + 1).min(bands);
        let mut first = vec![0; bands + 1];
        for c in covered.iter().filter(|c| c.is_any()) {
            bands_of(c).for_each(|band| first[band + 1] += 1);
        }
        for band in 0..bands {
            first[band + 1] += first[band];
        }
        let (mut next, mut lists) = (first.clone(), vec![0; first[bands]]);
        for (triangle, c) in (0..).zip(&covered).filter(|(_, c)| c.is_any()) {
            for band in bands_of(c) {
                lists[next[band]] = triangle;
                next[band] += 1;
            }
        }
        Self { covered, lists, first }
    }

    /// The triangles that a row of samples may show, and their boxes.
    fn of_row(&self, row: usize) -> impl Iterator<Item = (u32, Covered)> {
        let list = &self.lists[self.first[row / BAND]..self.first[row / BAND + 1]];
        let covered = |triangle: &u32| (*triangle, self.covered[*triangle as usize]);
        list.iter().map(covered).filter(move |(_, c)| (c.rows[0]..=c.rows[1]).contains(&(row as u32)))
    }

    /// The columns of a row that may show a triangle: the first, and the one after the last.
    fn columns(&self, row: usize) -> [usize; 2] {
        let ends = self.of_row(row).map(|(_, c)| [c.columns[0] as usize, c.columns[1] as usize + 1]);
        ends.reduce(|a, b| [a[0].min(b[0]), a[1].max(b[1])]).unwrap_or([0, 0])
    }

    /// Draws what of the triangles is in a row of samples.
    fn draw(&self, tracer: &Tracer, origin: DVec3, row: usize, out: &mut Row) {
        for (triangle, Covered { columns, .. }) in self.of_row(row) {
            let corners = &edges(tracer.triangles()[triangle as usize]);
            for column in columns[0] as usize..=columns[1] as usize {
                let Some((t, u, v)) = intersect(corners, origin, out.directions[column]) else { continue };
                let nearest = out.hits[column].map_or(f64::INFINITY, |hit| hit.t);
                if t > 0.0 && t < nearest {
                    out.hits[column] = Some(Hit { triangle, t, u, v });
                    out.ties[column] = false;
                } else if t == nearest {
                    out.ties[column] = true;
                }
            }
        }
    }
}

impl Covered {
    const NONE: Self = Self { columns: [1, 0], rows: [1, 0] };

    fn is_any(&self) -> bool {
        self.columns[0] <= self.columns[1]
    }
}

/// The samples in the box around what is seen of a triangle with its corners at `corners` (m, in
/// the camera's frame), `finer` to a pixel, in a grid of `size`.
fn covered(camera: &Camera, corners: [DVec3; 3], finer: f64, size: DVec2) -> Covered {
    let (mut low, mut high) = (DVec2::INFINITY, DVec2::NEG_INFINITY);
    let mut widen = |p: DVec3| {
        if let Some(pixel) = camera.project(p) {
            let sample = (pixel + 0.5) * finer - 0.5;
            (low, high) = (low.min(sample - MARGIN), high.max(sample + MARGIN));
        }
    };
    for k in 0..3 {
        let (a, b) = (corners[k], corners[(k + 1) % 3]);
        if a.z >= NEAR {
            widen(a);
        }
        if (a.z >= NEAR) != (b.z >= NEAR) {
            widen(a.lerp(b, (NEAR - a.z) / (b.z - a.z)));
        }
    }
    let (low, high) = (low.ceil().max(DVec2::ZERO), high.floor().min(size - 1.0));
    if !low.cmple(high).all() {
        return Covered::NONE;
    }
    Covered { columns: [low.x as u32, high.x as u32], rows: [low.y as u32, high.y as u32] }
}
