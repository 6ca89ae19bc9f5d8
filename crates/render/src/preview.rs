//! Previews: rasterised, with direct light.

use crate::background::Behind;
use crate::deferred::{Buffers, Shading};
use crate::film::Film;
use crate::picture::Picture;
use crate::raster::{View, Visibility};
use crate::stage::Stage;
use crate::visibility::draw;
use rayon::prelude::*;

/// Rows that are shaded together, a multiple of a tile's.
const ROWS: usize = 16;

/// Makes a preview. It starts with the bodies at rest, if these are kept for the camera.
pub(crate) fn preview(picture: &mut Picture, stage: &mut Stage, view: &View<'_>, shadows: bool, film: &Film) {
    let mut memory = std::mem::take(&mut stage.memory);
    let mut visibility = std::mem::take(&mut memory.visibility);
    let background = memory.background(view, stage.changes());
    if background.is_stale() {
        let mut drawn = Visibility::default();
        draw(&mut drawn, stage, view, &|body| background.rests(body), None);
        background.keep(drawn);
    }
    draw(&mut visibility, stage, view, &|body| !background.rests(body), background.visibility());
    let shadows = shadows && Shading::new(stage, view, &visibility).may_cast();
    if shadows {
        stage.update_acceleration();
    }
    let shading = Shading { shadows, ..Shading::new(stage, view, &visibility) };
    // The background has no noise, which differs from picture to picture.
    let clean = Film { noise: None, ..*film };
    if !shadows && background.wants_light(&stage.lights, stage.environment, clean) {
        let mut lit = Picture::new(view.rays.width(), view.rays.height());
        if let Some(visibility) = background.visibility() {
            shade(&mut lit, &Shading::new(stage, view, visibility), &clean);
        }
        background.keep_light(lit);
    }
    let behind = if shadows { None } else { background.lit() };
    shade(picture, &Shading { behind, ..shading }, film);
    memory.visibility = visibility;
    stage.memory = memory;
}

fn shade(picture: &mut Picture, shading: &Shading<'_>, film: &Film) {
    let rays = shading.view.rays;
    picture.bands(rays.width() * ROWS).for_each_init(Buffers::new, |buffers, (k, mut rows)| {
        let first = k * ROWS;
        if let Some(Behind { picture, .. }) = shading.behind {
            rows.copy_from(picture, first * rays.width());
        }
        shading.shade(first, &mut rows, buffers);
        if shading.behind.is_some() && film.noise.is_none() {
            rows.develop_parts(film, rays, first, &buffers.shaded);
        } else {
            rows.develop(film, rays, first);
        }
    });
}
