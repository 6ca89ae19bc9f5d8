//! `trocar reconstruct`.

use crate::cli::Reconstruct;
use crate::output;
use trocar_core::Progress;
use trocar_geometry::io::Unit;
use trocar_reconstruct::{Settings, SurfaceRule};
use trocar_report::document::Table;
use trocar_workflow::{Reconstructed, Result, counted, reconstruct_recording, reconstruct_surface};

pub fn run(arguments: &Reconstruct, json: bool, progress: &dyn Progress) -> Result<()> {
    let settings = Settings {
        window: arguments.window,
        stride: arguments.stride,
        centre: arguments.centre,
        sam: arguments.sam.folder.clone(),
        onnxruntime: arguments.sam.onnxruntime.clone(),
        back: arguments.back.into(),
        surface: if arguments.binary_grid { SurfaceRule::BinaryGrid } else { SurfaceRule::SignedDistance },
        mesher: arguments.mesher.into(),
        element_size: arguments.element_size.map(|mm| 1e-3 * mm),
        ..Settings::default()
    };
    let reconstructed = match (&arguments.recording, &arguments.surface) {
        (Some(recording), _) => reconstruct_recording(recording, &settings, &arguments.output, progress)?.figures,
        (None, Some(surface)) => {
            // clap requires the unit with a surface.
            let unit = arguments.units.map_or(Unit::Millimetre, Unit::from);
            reconstruct_surface(surface, unit, &settings, &arguments.output, progress)?
        }
        (None, None) => unreachable!("clap requires one of the two"),
    };
    output::print(json, &reconstructed, text);
    Ok(())
}

pub fn text(r: &Reconstructed) -> String {
    let number = |x: Option<f64>| x.map_or("-".to_owned(), |x| format!("{x:.2}"));
    let table = Table::of(
        &r.organs,
        &[
            ("organ", &|o| o.organ.clone()),
            ("nodes", &|o| o.facts.nodes.to_string()),
            ("tets", &|o| o.facts.tets.to_string()),
            ("min dihedral (deg)", &|o| format!("{:.1}", o.facts.min_dihedral_deg)),
            ("edge (mm)", &|o| format!("{:.2}", o.facts.median_edge_mm)),
            ("volume (cm3)", &|o| format!("{:.2}", o.facts.volume_cm3)),
            ("closed", &|o| if o.facts.watertight { "yes" } else { "NO" }.to_owned()),
            ("inverted", &|o| o.facts.inverted.to_string()),
            ("|error| (mm)", &|o| number(o.facts.depth_error_median_mm)),
            ("error (mm)", &|o| number(o.facts.depth_error_signed_mm)),
            ("covered", &|o| number(o.facts.covered)),
        ],
    );
    let mut out = table.text().trim_end().to_owned();
    if let Some(c) = &r.composite {
        out += &format!(
            "\ncomposite of {}: {:.1}% of the image recovered from under instruments, depth on {:.1}%, median depth range {:.2} mm",
            counted(c.frames_used, "frame"),
            100.0 * c.recovered_share,
            100.0 * c.coverage,
            c.depth_range_median_mm
        );
        if let Some(t) = &c.truth {
            out += &format!(
                "\nagainst the truth: depth error {:.2} mm (median; 95% below {:.2}){}",
                t.depth_error_median_mm,
                t.depth_error_p95_mm,
                t.under_instruments_median_mm.map_or(String::new(), |e| format!(", {e:.2} mm under the instruments"))
            );
        }
    }
    for warning in &r.warnings {
        out += &format!("\nwarning: {warning}");
    }
    for note in &r.notes {
        out += &format!("\nnote: {note}");
    }
    out += &format!("\nspecimen {} in {:.1} s; report {}", r.specimen, r.seconds, r.report);
    out
}
