//! The page: reconstructions beside the real pictures.

use super::deforming::{DeformingRow, Moment};
use super::measure::{SimilarityPictures, SimilarityRow};
use super::result::SimilarityResult;
use crate::Result;
use trocar_camera::ColorImage;
use trocar_camera::metrics::ImageMetrics;
use trocar_report::colors::{self, SEQUENTIAL};
use trocar_report::document::{Document, Section, Table};
use trocar_report::figures;
use trocar_report::overlays;
use trocar_report::page::{self, Card};
use trocar_report::table::fixed;

/// Target of the silhouettes of phantoms.
const MIN_IOU: f64 = 0.95;
/// Colour difference drawn brightest (of 255).
const MAX_DIFFERENCE: f64 = 80.0;
/// Colours of silhouette pixels: only real, only rendered, both.
const ONLY_REAL: [u8; 3] = [70, 165, 225];
const ONLY_RENDERED: [u8; 3] = [214, 64, 52];
const BOTH: [u8; 3] = [0, 158, 115];

pub(super) fn document(
    r: &SimilarityResult,
    shown: &[SimilarityPictures],
    oblique: &[SimilarityPictures],
    lifted: &[SimilarityPictures],
) -> Result<Document> {
    let document = Document::new("Similarity", "Rendered reconstructions beside the recordings");
    let mut out = document.with(Section::new("Summary", "").cards(cards(r))).with(table(r));
    for (row, pictures) in r.rows.iter().zip(shown) {
        let lead = format!("Through the recovered recording camera. {}.", page::escape(&capital(&row.note)));
        out = out.with(views(pictures, Section::new(&row.specimen, lead))?.html(organs(row)));
    }
    for (row, pictures) in r.oblique.iter().zip(oblique) {
        let lead = format!(
            "An oblique view through the thirty-degree endoscope (86.2 x 54.6 degrees) at the place of the recording \
             camera, beside the real frame seen through that lens. {}.",
            page::escape(&capital(&row.note))
        );
        let title = format!("Oblique view: {}", row.specimen);
        out = out.with(views(pictures, Section::new(title, lead))?.html(organs(row)));
    }
    if !r.deforming.is_empty() {
        out = out.with(deforming(r));
    }
    for (row, pictures) in r.deforming.iter().zip(lifted) {
        let lead = match row.moment {
            Moment::Rest => "Before the lift.".to_owned(),
            Moment::Load => {
                format!("At the peak: the grasped place is carried by {} mm.", fixed(row.displacement_mm, 1))
            }
        };
        let title = format!("{}, {}", capital(&row.similarity.specimen), name(row.moment));
        out = out.with(views(pictures, Section::new(title, lead))?.html(organs(&row.similarity)));
    }
    if !r.skipped.is_empty() {
        out = out.with(Section::new("Skipped", "").lines(r.skipped.iter().cloned()));
    }
    Ok(out)
}

fn capital(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or(String::new(), |first| first.to_uppercase().collect::<String>() + letters.as_str())
}

fn cards(r: &SimilarityResult) -> [Card; 4] {
    let p = r.paper;
    let least = |rows: &[SimilarityRow]| rows.iter().map(|row| row.iou).fold(f64::INFINITY, f64::min);
    let mean = |f: &dyn Fn(&ImageMetrics) -> f64| {
        r.rows.iter().map(|row| f(&row.rendered)).sum::<f64>() / r.rows.len().max(1) as f64
    };
    let pair = |[ssim, psnr]: [f64; 2]| format!("{} / {} dB", fixed(ssim, 2), fixed(psnr, 1));
    [
        Card::new(
            "Silhouettes",
            fixed(least(&r.rows), 3),
            format!("IoU of the worst specimen; at least {MIN_IOU}; paper {}", p.iou),
        )
        .met(least(&r.rows) >= MIN_IOU),
        Card::new(
            "SSIM / PSNR",
            pair([mean(&|l| l.ssim), mean(&|l| l.psnr_db)]),
            format!("mean over specimens, as rendered; paper {}", pair(p.rendered)),
        ),
        Card::new(
            "Exposure matched",
            pair([mean(&|l| l.ssim_matched), mean(&|l| l.psnr_matched_db)]),
            format!("mean over specimens; paper {}", pair(p.matched)),
        ),
        Card::new(
            "Oblique views",
            fixed(least(&r.oblique), 3),
            "worst IoU through the endoscope; phantom and mug, not in vivo",
        ),
    ]
}

fn table(r: &SimilarityResult) -> Section {
    let head =
        ["Specimen", "Compared with the first frame", "IoU", "SSIM", "PSNR (dB)", "matched SSIM", "matched PSNR (dB)"];
    let cells = |l: &ImageMetrics| [l.ssim, l.psnr_db, l.ssim_matched, l.psnr_matched_db];
    let row = |name: &str, what: &str, iou: Option<f64>, [a, b, c, d]: [f64; 4]| {
        let iou = iou.map_or(String::new(), |v| fixed(v, 3));
        vec![name.to_owned(), what.to_owned(), iou, fixed(a, 3), fixed(b, 1), fixed(c, 3), fixed(d, 1)]
    };
    let mut rows = Vec::new();
    for (s, place) in r.rows.iter().map(|s| (s, "rendered")).chain(r.oblique.iter().map(|s| (s, "endoscope"))) {
        rows.push(row(&s.specimen, place, Some(s.iou), cells(&s.rendered)));
        if let Some(second) = &s.second_frame {
            rows.push(row("", "second frame", None, cells(second)));
        }
        rows.push(row("", "mean colour", None, cells(&s.mean_colour)));
    }
    let p = r.paper;
    let both = |[a, b]: [f64; 2], [c, d]: [f64; 2]| [a, b, c, d];
    let none = [f64::NAN; 2];
    rows.push(row("paper", "rendered", Some(p.iou), both(p.rendered, p.matched)));
    rows.push(row("", "second frame", None, both(none, p.second_frame)));
    rows.push(row("", "mean colour", None, both(none, p.mean_colour)));
    let lead = "Within the masks of the organs, without instruments. SSIM after Wang and others (2004), 8-bit sRGB, \
                mean over the channels. Matching scales each channel by least squares.";
    Section::new("Beside the paper", lead).table(Table::new(head, rows))
}

fn name(moment: Moment) -> &'static str {
    match moment {
        Moment::Rest => "at rest",
        Moment::Load => "under load",
    }
}

fn deforming(r: &SimilarityResult) -> Section {
    let head = [
        "Lift",
        "Moment",
        "Carried (mm)",
        "IoU of the lifted organ",
        "the same, not lifted",
        "mean IoU",
        "mean IoU, wrong camera",
        "SSIM",
        "PSNR (dB)",
        "second frame",
    ];
    let row = |d: &DeformingRow| {
        let (s, second) = (&d.similarity, d.similarity.second_frame.as_ref());
        let second = second.map_or(String::new(), |l| format!("{} / {} dB", fixed(l.ssim, 3), fixed(l.psnr_db, 1)));
        vec![
            d.lift.to_string(),
            name(d.moment).to_owned(),
            fixed(d.displacement_mm, 1),
            fixed(d.lifted_iou, 3),
            fixed(d.static_iou, 3),
            fixed(s.iou, 3),
            fixed(d.wrong_camera_iou, 3),
            fixed(s.rendered.ssim, 3),
            fixed(s.rendered.psnr_db, 1),
            second,
        ]
    };
    let lead = format!(
        "Filmed lifts of a phantom beside the same lifts simulated, with support and tissue identified from the other \
         half of the lifts. Pixels that instruments hide are left out. The wrong camera is 7.9 mm and 4.6 mm beside \
         the recording's; the paper has {} through its own.",
        r.paper.wrong_camera_iou
    );
    Section::new("Deforming scenes", lead).table(Table::new(head, r.deforming.iter().map(row).collect()))
}

fn organs(row: &SimilarityRow) -> String {
    let all: Vec<String> = row.organ_iou.iter().map(|(name, iou)| format!("{name} {}", fixed(*iou, 3))).collect();
    format!(
        "<p class=\"lead\">Silhouettes: {}; all together {}.</p>\n",
        page::escape(&all.join(", ")),
        fixed(row.union_iou, 3)
    )
}

fn views(p: &SimilarityPictures, section: Section) -> Result<Section> {
    let part = overlays::crop_box(&p.silhouettes[0], 30, 1.5).unwrap_or([0, 0, p.real.width, p.real.height]);
    let figure = |picture: &ColorImage, alt: &str, caption: &str| -> Result<String> {
        Ok(figures::figure(&overlays::crop(picture, part), alt, caption)?)
    };
    let bar = page::scale_bar(&SEQUENTIAL, "0", "mean difference of the channels, of 255", "80");
    let legend = page::legend([("both", BOTH), ("real only", ONLY_REAL), ("rendered only", ONLY_RENDERED)]);
    let mut all = vec![
        figure(&p.real, "the real picture", "<b>Real.</b> A frame of the recording.")?,
        figure(&p.rendered, "the rendered picture", "<b>Rendered.</b> Organs and surroundings, path traced.")?,
        figure(&difference(p), "their difference", &format!("<b>Difference.</b>{bar}"))?,
        figure(&silhouettes(p), "their silhouettes", &format!("<b>Silhouettes.</b>{legend}"))?,
    ];
    if let Some((what, picture)) = &p.other {
        all.push(figure(picture, what, &format!("<b>Relit.</b> {}", page::escape(what)))?);
    }
    Ok(section.figures(all))
}

fn difference(p: &SimilarityPictures) -> ColorImage {
    let mut out = overlays::dimmed(&p.real);
    for i in (0..out.pixels.len()).filter(|i| p.compared.set[*i]) {
        let (a, b) = (p.real.pixels[i], p.rendered.pixels[i]);
        let mean = (0..3).map(|c| f64::from(a[c].abs_diff(b[c]))).sum::<f64>() / 3.0;
        out.pixels[i] = colors::map(&SEQUENTIAL, mean / MAX_DIFFERENCE);
    }
    out
}

fn silhouettes(p: &SimilarityPictures) -> ColorImage {
    let mut out = overlays::dimmed(&p.real);
    let [real, rendered] = &p.silhouettes;
    for (i, pixel) in out.pixels.iter_mut().enumerate() {
        match (real.set[i], rendered.set[i]) {
            (true, true) => *pixel = colors::mix(*pixel, BOTH, 0.45),
            (true, false) => *pixel = ONLY_REAL,
            (false, true) => *pixel = ONLY_RENDERED,
            (false, false) => {}
        }
    }
    out
}
