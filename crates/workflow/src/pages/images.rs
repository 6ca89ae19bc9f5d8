//! Sections on the recorded images and the fit: input frame, composite, masks, and depth errors of
//! the surfaces.

use crate::{Error, Result};
use trocar_core::Pose;
use trocar_reconstruct::Reconstruction;
use trocar_reconstruct::truth::quantile;
use trocar_render::phong::PhongScene;
use trocar_report::colors::{self, DIVERGING, INSTRUMENT, SEQUENTIAL};
use trocar_report::page::{self, Card, Columns};
use trocar_report::plots::{Line, Plot};
use trocar_report::table::{self, fixed, percent};
use trocar_report::{figures, overlays};

/// Refuses a reconstruction whose images differ in size.
///
/// # Errors
/// Names the image of another size.
pub fn check_sizes(r: &Reconstruction) -> Result<()> {
    let size = (r.composite.input.width, r.composite.input.height);
    let pixels = size.0 * size.1;
    let mut images = vec![
        ("input", (r.composite.input.width, r.composite.input.height), r.composite.input.pixels.len()),
        (
            "instrument mask",
            (r.composite.instruments.width, r.composite.instruments.height),
            r.composite.instruments.set.len(),
        ),
        ("composite", (r.composite.color.width, r.composite.color.height), r.composite.color.pixels.len()),
        ("composite depth", (r.composite.depth.width, r.composite.depth.height), r.composite.depth.depth.len()),
    ];
    for o in &r.organs {
        images.push((&o.name, (o.mask.width, o.mask.height), o.mask.set.len()));
        images.push((&o.name, (o.compared.width, o.compared.height), o.compared.set.len()));
        images.push((&o.name, size, o.depth_error.len()));
    }
    match images.iter().find(|i| i.1 != size || i.2 != pixels) {
        None => Ok(()),
        Some((name, (w, h), n)) => Err(Error::Mismatch(format!(
            "'{name}' is {w} x {h} with {n} pixels; the input frame is {} x {}",
            size.0, size.1
        ))),
    }
}

/// Figures of the composite and the bodies, beside the paper's.
pub(super) fn overview(r: &Reconstruction) -> String {
    let facts = || r.specimen.organs.iter().map(|o| &o.facts);
    let inverted: usize = facts().map(|f| f.inverted).sum();
    let tight = facts().filter(|f| f.watertight).count();
    let organs = facts().count();
    let doubtful = !r.warnings.is_empty();
    let errors: Vec<f64> = facts().filter_map(|f| f.depth_error_median_mm).collect();
    let worst = errors.iter().copied().fold(f64::NAN, f64::max);
    let cards = [
        Card::new(
            "Recovered under instruments",
            percent(r.composite.recovered_share, 1),
            "of the image; paper 3.4\u{202f}%",
        ),
        Card::new("Depth coverage", percent(r.composite.coverage, 1), "of the pixels; paper 90.3\u{202f}%"),
        Card::new(
            "Depth spread",
            format!("{} mm", fixed(1e3 * r.composite.depth_range_median, 2)),
            "10th to 90th percentile, median pixel; paper 2.0 mm",
        ),
        Card::new("Frames used", table::count(r.composite.frames_used), "in the composite"),
        Card::new("Depth error", format!("{} mm", fixed(worst, 2)), "median of the organ that fits worst"),
        judged(Card::new("Watertight", format!("{tight} of {organs}"), "organs"), tight == organs, doubtful),
        judged(Card::new("Inverted elements", table::count(inverted), "over all organs"), inverted == 0, doubtful),
    ];
    let warnings: String = r.warnings.iter().map(|w| page::warning(w)).collect();
    page::section("From the recording", "", &(warnings + &page::cards(&cards)))
}

/// The card with its target. A target that is met is not shown as good beside a warning.
fn judged(card: Card, met: bool, doubtful: bool) -> Card {
    if met && doubtful { card } else { card.met(met) }
}

/// Input, composite, masks, and the `surfaces` through the recording camera.
pub(super) fn images(r: &Reconstruction, surfaces: &PhongScene) -> Result<String> {
    let mut input = r.composite.input.clone();
    overlays::outline(&mut input, &r.composite.instruments, INSTRUMENT);
    let legend = page::legend([("instruments", INSTRUMENT)]);
    let input = figures::figure(
        &input,
        "input frame with the instruments outlined",
        &format!("<b>Input.</b> The recorded frame at the window's centre.{legend}"),
    )?;
    let composite = figures::figure(
        &r.composite.color,
        "composite without instruments",
        &format!(
            "<b>Composite.</b> Per-pixel median of {} frames, instruments removed; pixels that were never visible are empty.",
            table::count(r.composite.frames_used)
        ),
    )?;
    let mut masked = r.composite.color.clone();
    for (i, organ) in r.organs.iter().enumerate() {
        overlays::tint(&mut masked, &organ.mask, colors::organ(i), 0.42);
        overlays::outline(&mut masked, &organ.mask, colors::organ(i));
    }
    let names = r.organs.iter().enumerate().map(|(i, o)| (o.name.as_str(), colors::organ(i)));
    let masked = figures::figure(
        &masked,
        "organ masks over the composite",
        &format!("<b>Masks.</b> Each organ has this colour in all figures.{}", page::legend(names)),
    )?;
    let mut top = vec![input, composite, depth_figure(r)?, masked];
    if let Some(camera) = &r.specimen.camera {
        let rendered = surfaces.render(camera, &Pose::IDENTITY, 2).color;
        let caption = "<b>Composite,</b> for comparison.";
        top.push(figures::figure(&r.composite.color, "composite, for comparison", caption)?);
        top.push(figures::figure(
            &rendered,
            "reconstructed surfaces through the recording camera",
            "<b>Surfaces through the recording camera,</b> rendered with its lens; they should lie where the \
             photograph shows them.",
        )?);
    }
    Ok(page::section(
        "What the camera saw",
        "Instruments that move are removed over time: each pixel is the median of the frames in which no instrument \
         covers it.",
        &page::grid(Columns::Two, &top),
    ))
}

fn depth_figure(r: &Reconstruction) -> Result<String> {
    let valid: Vec<f64> = r.composite.depth.depth.iter().filter(|d| **d > 0.0).map(|d| f64::from(*d)).collect();
    // The ends are percentiles: stray depths must not stretch the colour scale.
    let low = quantile(&valid, 0.005).unwrap_or(0.0);
    let high = quantile(&valid, 0.995).unwrap_or(1.0);
    let bar = page::scale_bar(&SEQUENTIAL, &fixed(1e3 * low, 0), "depth (mm)", &fixed(1e3 * high, 0));
    let caption = format!("<b>Composite depth.</b> Distance along the view; black: no depth.{bar}");
    Ok(figures::figure(
        &overlays::depth(&r.composite.depth, (low, high)),
        "composite depth in false colours",
        &caption,
    )?)
}

/// Depth errors of the surfaces: their distance before or behind the depth they were made from.
pub(super) fn depth_errors(r: &Reconstruction) -> Result<String> {
    if r.organs.is_empty() {
        return Ok(String::new());
    }
    let ground = overlays::dimmed(&r.composite.color);
    let mut all = ground.clone();
    for organ in &r.organs {
        overlays::error(&mut all, &organ.depth_error, &organ.compared);
    }
    let bar = page::scale_bar(&DIVERGING, "\u{2212}5", "surface minus measured depth (mm)", "+5");
    let map = figures::figure(
        &all,
        "signed depth error of all organs",
        &format!("<b>Depth error.</b> Blue: the surface is nearer to the camera than measured; red: farther.{bar}"),
    )?;
    let names = r.organs.iter().enumerate().map(|(i, o)| (o.name.as_str(), colors::organ(i)));
    let spread = histogram(
        r,
        &format!("<b>Spread.</b> Share of an organ's compared pixels in bins of 0.25 mm.{}", page::legend(names)),
    )?;
    let mut each = Vec::new();
    for (i, organ) in r.organs.iter().enumerate() {
        let mut picture = ground.clone();
        overlays::error(&mut picture, &organ.depth_error, &organ.compared);
        overlays::outline(&mut picture, &organ.mask, colors::organ(i));
        let Some(part) = overlays::crop_box(&organ.mask, 12, 1.5) else { continue };
        let alt = format!("signed depth error of {}", organ.name);
        each.push(figures::figure(&overlays::crop(&picture, part), &alt, &error_caption(organ))?);
    }
    Ok(page::section(
        "Fit of the surfaces to the depth",
        "Each organ's surface is rendered through the recording camera and compared with the composite depth inside its mask.",
        &(page::grid(Columns::Two, &[map, spread]) + &page::grid(Columns::Three, &each)),
    ))
}

fn error_caption(organ: &trocar_reconstruct::OrganView) -> String {
    let errors = errors_mm(organ);
    let size: Vec<f64> = errors.iter().map(|e| e.abs()).collect();
    let mm = |v: Option<f64>| fixed(v.unwrap_or(f64::NAN), 2);
    format!(
        "<b>{}.</b> Median {} mm, signed {} mm, 95\u{202f}% under {} mm.",
        page::escape(&organ.name),
        mm(quantile(&size, 0.5)),
        mm(quantile(&errors, 0.5)),
        mm(quantile(&size, 0.95))
    )
}

fn errors_mm(organ: &trocar_reconstruct::OrganView) -> Vec<f64> {
    let compared = organ.depth_error.iter().zip(&organ.compared.set).filter(|(_, set)| **set);
    compared.map(|(e, _)| 1e3 * f64::from(*e)).collect()
}

fn histogram(r: &Reconstruction, caption: &str) -> Result<String> {
    const SPAN: f64 = 6.0;
    const BIN: f64 = 0.25;
    let bins = (2.0 * SPAN / BIN) as usize;
    let line = |(i, organ): (usize, &trocar_reconstruct::OrganView)| {
        let errors = errors_mm(organ);
        let mut counts = vec![0_usize; bins];
        for e in &errors {
            let bin = ((e + SPAN) / BIN).floor();
            if bin >= 0.0 && bin < bins as f64 {
                counts[bin as usize] += 1;
            }
        }
        let share = |n: usize| 100.0 * n as f64 / errors.len().max(1) as f64;
        let points = counts.iter().enumerate().map(|(b, n)| ((b as f64 + 0.5) * BIN - SPAN, share(*n))).collect();
        Line::new(points, colors::organ(i))
    };
    let plot = Plot {
        title: "distribution of the depth error",
        x: "surface minus measured depth (mm)",
        y: "share of pixels (%)",
        lines: r.organs.iter().enumerate().map(line).collect(),
        show: vec![0.0],
        ..Plot::default()
    };
    Ok(plot.figure(caption)?)
}
