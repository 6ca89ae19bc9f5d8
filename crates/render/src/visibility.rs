//! Draws the visible triangle of every pixel.

mod band;

use crate::raster::{NOTHING, View, Visibility};
use crate::stage::Stage;
use band::Band;
use fearless_simd::dispatch;

/// Which bodies are drawn, and before what.
#[derive(Clone, Copy)]
pub(crate) struct Drawing<'a> {
    pub stage: &'a Stage,
    pub view: &'a View<'a>,
    /// By body.
    pub drawn: &'a (dyn Fn(usize) -> bool + Sync),
    pub behind: Option<&'a Visibility>,
}

impl Drawing<'_> {
    /// Draws rows of a picture from row `first`, which starts a tile. The order of bodies does not
    /// matter: of triangles at the same distance the first in number is visible.
    pub fn draw(&self, first: usize, depth: &mut [f32], triangle: &mut [u32]) {
        if let Some(behind) = self.behind {
            let held = first * self.view.rays.stride()..first * self.view.rays.stride() + depth.len();
            depth.copy_from_slice(&behind.depth[held.clone()]);
            triangle.copy_from_slice(&behind.triangle[held]);
        } else {
            depth.fill(f32::INFINITY);
            triangle.fill(NOTHING);
        }
        let mut band = Band::new(self.view, first, depth, triangle);
        dispatch!(self.stage.level, simd => band.draw(simd, self.stage, &self.drawn));
    }
}
