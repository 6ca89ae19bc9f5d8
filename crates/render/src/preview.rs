//! Previews: rasterised, with direct light.

use crate::antialias::{Marks, Refined, antialias};
use crate::background::{Background, Behind};
use crate::deferred::{Buffers, Shading, may_cast};
use crate::film::Film;
use crate::picture::{Picture, Rows};
use crate::raster::{Seen, View, Visibility};
use crate::stage::Stage;
use crate::visibility::Drawing;
use rayon::prelude::*;

/// Rows that are drawn and shaded together, a multiple of a tile's. Fewer give more clusters that
/// are in two bands, more give less to do in parallel.
pub(crate) const ROWS: usize = 56;

/// Makes a preview, with smooth edges if `smooth`. It starts with the bodies at rest, if these are
/// kept for the camera.
pub(crate) fn preview(
    picture: &mut Picture,
    stage: &mut Stage,
    view: &View<'_>,
    (shadows, smooth): (bool, bool),
    film: &Film,
) {
    let mut memory = std::mem::take(&mut stage.memory);
    let mut visibility = std::mem::take(&mut memory.visibility);
    let mut points = std::mem::take(&mut memory.points);
    let background = memory.background(view, stage.changes());
    let before = keep(background, stage, view);
    let drawn = |body| !background.rests(body);
    let drawing = Drawing { stage, view, drawn: &drawn, behind: background.visibility() };
    let casts = shadows && {
        draw(&mut visibility, &drawing);
        // Rays are at least as long as their parameter says.
        may_cast(stage, view.origin, visibility.depth.iter().copied().fold(f32::INFINITY, f32::min))
    };
    if casts {
        stage.update_acceleration();
    }
    light(background, before, stage, view, casts, film);
    let drawn = |body| !background.rests(body);
    let drawing = Drawing { stage, view, drawn: &drawn, behind: background.visibility() };
    let shading = Shading { shadows: casts, behind: background.lit(), ..Shading::new(stage, view) };
    let bands = picture.bands(view.rays.width() * ROWS).zip(visibility.bands(view.rays, ROWS));
    bands.for_each_init(Buffers::new, |buffers, ((k, rows), seen)| {
        if !shadows {
            drawing.draw(k * ROWS, seen.depth, seen.triangle);
        }
        shade(&shading, k, rows, &seen, film, buffers);
    });
    if smooth {
        smooth_edges(picture, background, stage, view, casts, film, &mut points);
    }
    memory.points = points;
    memory.visibility = visibility;
    stage.memory = memory;
}

/// Draws the bodies at rest, if they differ from before. Bodies that have newly come to rest are
/// drawn over the kept ones. Returns what was kept before, if it was lit.
fn keep(background: &mut Background, stage: &Stage, view: &View<'_>) -> Option<(Visibility, Picture)> {
    if !background.is_stale() {
        return None;
    }
    let behind = background.visibility().filter(|_| background.is_right());
    let drawn = |body| background.rests(body) && !(behind.is_some() && background.shows(body));
    let mut fresh = Visibility::default();
    draw(&mut fresh, &Drawing { stage, view, drawn: &drawn, behind });
    background.keep(fresh, view)
}

/// Lights the bodies at rest, if that is worth while, with the shadows that they cast on each
/// other. Without shadows only pixels that show another triangle than `before` are lit.
fn light(
    background: &mut Background,
    before: Option<(Visibility, Picture)>,
    stage: &Stage,
    view: &View<'_>,
    casts: bool,
    film: &Film,
) {
    // Noise differs from picture to picture.
    let clean = Film { noise: None, ..*film };
    if !background.wants_light(stage, clean, casts) {
        return;
    }
    let mut lit = Picture::new(view.rays.width(), view.rays.height());
    let before = before.filter(|_| !casts);
    let behind = before.as_ref().map(|(visibility, picture)| Behind::unshaded(visibility, picture));
    let drawn: Vec<bool> = stage.changes().enumerate().map(|(body, _)| background.shows(body)).collect();
    let casting = |body: usize| drawn[body];
    if let Some(visibility) = background.visibility_mut() {
        let shading = Shading { shadows: casts, behind, casting: &casting, ..Shading::new(stage, view) };
        let bands = lit.bands(view.rays.width() * ROWS).zip(visibility.bands(view.rays, ROWS));
        bands.for_each_init(Buffers::new, |buffers, ((k, rows), seen)| {
            shade(&shading, k, rows, &seen, &clean, buffers);
        });
    }
    background.keep_light(lit);
}

/// Refines the picture. Edges of bodies at rest are kept.
fn smooth_edges(
    picture: &mut Picture,
    background: &mut Background,
    stage: &Stage,
    view: &View<'_>,
    casts: bool,
    film: &Film,
    points: &mut Visibility,
) {
    let view = &View { rays: view.rays.finer(), ..*view };
    background.keep_points(view, |background| {
        let mut at_rest = Visibility::default();
        draw(&mut at_rest, &Drawing { stage, view, drawn: &|body| background.shows(body), behind: None });
        at_rest
    });
    background.keep_refined(|background, mut lit| {
        let marks = Marks::of(&lit);
        let casting = |body| background.shows(body);
        let drawing = Drawing { stage, view, drawn: &|_| false, behind: background.points() };
        antialias((&mut lit, &marks), &drawing, casts.then_some(&casting), film, points, None);
        Refined::new(marks, lit.color.pixels)
    });
    let moves = |body| !background.shows(body);
    let drawing = Drawing { stage, view, drawn: &moves, behind: background.points() };
    let kept = background.kept_points(&moves);
    let marks = Marks::of(picture);
    antialias((picture, &marks), &drawing, casts.then_some(&|_| true), film, points, kept);
}

fn draw(visibility: &mut Visibility, drawing: &Drawing<'_>) {
    let bands = visibility.bands(drawing.view.rays, ROWS).enumerate();
    bands.for_each(|(k, seen)| drawing.draw(k * ROWS, seen.depth, seen.triangle));
}

fn shade(shading: &Shading<'_>, k: usize, mut rows: Rows<'_>, seen: &Seen<'_>, film: &Film, buffers: &mut Buffers) {
    let (rays, first) = (shading.view.rays, k * ROWS);
    if let Some(Behind { picture, .. }) = shading.behind {
        rows.copy_from(picture, first * rays.width());
    }
    shading.shade(first, seen, &mut rows, buffers);
    if shading.behind.is_some() && film.noise.is_none() {
        rows.develop_parts(film, rays, first, &buffers.shaded);
    } else {
        rows.develop(film, rays, first);
    }
}
