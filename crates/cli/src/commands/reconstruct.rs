//! `trocar reconstruct`.

use crate::cli::Reconstruct;
use crate::output;
use trocar_core::Progress;
use trocar_geometry::io::Unit;
use trocar_reconstruct::{Settings, SurfaceRule};
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
        (Some(recording), _) => reconstruct_recording(recording, &settings, &arguments.output, progress)?.0,
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

/// The specimen as text.
pub fn text(r: &Reconstructed) -> String {
    let number = |x: Option<f64>| x.map_or("-".to_owned(), |x| format!("{x:.2}"));
    let rows: Vec<Vec<String>> = r
        .organs
        .iter()
        .map(|o| {
            vec![
                o.organ.clone(),
                o.facts.nodes.to_string(),
                o.facts.tets.to_string(),
                format!("{:.1}", o.facts.min_dihedral_deg),
                format!("{:.2}", o.facts.median_edge_mm),
                format!("{:.2}", o.facts.volume_cm3),
                if o.facts.watertight { "yes" } else { "NO" }.to_owned(),
                o.facts.inverted.to_string(),
                number(o.facts.depth_error_median_mm),
                number(o.facts.depth_error_signed_mm),
                number(o.facts.covered),
            ]
        })
        .collect();
    let header = [
        "organ",
        "nodes",
        "tets",
        "min dihedral (deg)",
        "edge (mm)",
        "volume (cm3)",
        "closed",
        "inverted",
        "|error| (mm)",
        "error (mm)",
        "covered",
    ];
    let mut out = output::table(&header, &rows);
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
                "\nagainst the truth: depth error {:.2} mm (median; 95% below {:.2}), {} mm under the instruments",
                t.depth_error_median_mm,
                t.depth_error_p95_mm,
                t.under_instruments_median_mm.map_or("-".to_owned(), |e| format!("{e:.2}"))
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
