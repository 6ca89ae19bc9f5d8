//! `trocar experiment similarity`.

use crate::cli::SimilarityExperiment;
use crate::output;
use trocar_core::Progress;
use trocar_phantom::RecordOptions;
use trocar_studies::{Result, SimilarityResult, SimilarityRow};

pub fn run(arguments: &SimilarityExperiment, json: bool, progress: &dyn Progress) -> Result<()> {
    let named = &arguments.phantoms;
    let all = || trocar_phantom::NAMES.iter().map(|n| (*n).to_owned()).collect();
    let experiment = trocar_studies::SimilarityExperiment {
        phantoms: if named.is_empty() { all() } else { named.clone() },
        record: RecordOptions { frames: arguments.frames, seed: arguments.seed, ..RecordOptions::default() },
        data: arguments.data.clone(),
        samples: arguments.samples,
    };
    output::print(json, &experiment.run(&arguments.output, progress)?, text);
    Ok(())
}

fn text(r: &SimilarityResult) -> String {
    let header = ["specimen", "", "IoU", "SSIM", "PSNR dB", "matched SSIM", "matched PSNR dB"];
    let cells = |name: &str, what: &str, iou: Option<f64>, figures: [f64; 4]| {
        let [a, b, c, d] = figures;
        let number = |v: f64, digits: usize| if v.is_nan() { String::new() } else { format!("{v:.digits$}") };
        let iou = iou.map_or(String::new(), |v| number(v, 3));
        vec![name.to_owned(), what.to_owned(), iou, number(a, 3), number(b, 1), number(c, 3), number(d, 1)]
    };
    let mut rows = Vec::new();
    let mut specimen = |row: &SimilarityRow, place: &str| {
        let all = [
            Some((place, row.rendered)),
            row.second_frame.map(|l| ("second frame", l)),
            Some(("mean colour", row.mean_colour)),
        ];
        for (k, (what, l)) in all.into_iter().flatten().enumerate() {
            let (name, iou) = if k == 0 { (row.specimen.as_str(), Some(row.iou)) } else { ("", None) };
            rows.push(cells(name, what, iou, [l.ssim, l.psnr_db, l.ssim_matched, l.psnr_matched_db]));
        }
    };
    r.rows.iter().for_each(|row| specimen(row, "rendered"));
    r.in_vivo.iter().for_each(|row| specimen(row, "through the endoscope"));
    let p = r.paper;
    let none = [f64::NAN; 2];
    for (name, what, iou, [a, b], [c, d]) in [
        ("paper", "rendered", Some(p.iou), p.rendered, p.matched),
        ("", "second frame", None, none, p.second_frame),
        ("", "mean colour", None, none, p.mean_colour),
    ] {
        rows.push(cells(name, what, iou, [a, b, c, d]));
    }
    let mut out = output::table(&header, &rows);
    for skipped in &r.skipped {
        out += &format!("\nskipped {skipped}");
    }
    out + &format!("\nall of it in {:.0} s; report {}", r.seconds, r.report)
}
