//! Draws the visible triangle of every pixel.

mod band;

use crate::raster::{NOTHING, View, Visibility};
use crate::stage::Stage;
use band::Band;
use fearless_simd::dispatch;
use rayon::prelude::*;

/// Rows of a band, a multiple of a tile's. Fewer give more clusters that are in two bands, more
/// give less to do in parallel.
const BAND: usize = 112;

/// Draws bodies of a stage, those that `drawn` says, before what `behind` shows. The order of bodies
/// does not matter: of triangles at the same distance the first in number is visible.
pub(crate) fn draw(
    to: &mut Visibility,
    stage: &Stage,
    view: &View<'_>,
    drawn: &(impl Fn(usize) -> bool + Sync),
    behind: Option<&Visibility>,
) {
    let (stride, height) = (view.rays.stride(), view.rays.height());
    to.depth.resize(stride * height, f32::INFINITY);
    to.triangle.resize(stride * height, NOTHING);
    let bands = to.depth.par_chunks_mut(stride * BAND).zip(to.triangle.par_chunks_mut(stride * BAND));
    bands.enumerate().for_each(|(k, (depth, triangle))| {
        if let Some(behind) = behind {
            let held = k * BAND * stride..k * BAND * stride + depth.len();
            depth.copy_from_slice(&behind.depth[held.clone()]);
            triangle.copy_from_slice(&behind.triangle[held]);
        } else {
            depth.fill(f32::INFINITY);
            triangle.fill(NOTHING);
        }
        let mut band = Band::new(view, k * BAND, depth, triangle);
        dispatch!(stage.level, simd => band.draw(simd, stage, drawn));
    });
}
