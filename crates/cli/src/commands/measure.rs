//! `trocar measure`.

use crate::cli::Measure;
use crate::output;
use trocar_core::Progress;
use trocar_measure::{LiftFigures, PAPER};
use trocar_workflow::measure::{FilmFile, LiftRow, Measured, Measuring};
use trocar_workflow::{Result, counted};

pub fn run(arguments: &Measure, json: bool, progress: &dyn Progress) -> Result<()> {
    let measuring = Measuring {
        source: arguments.source.clone(),
        camera: arguments.camera.clone(),
        frames: [arguments.rest, arguments.first, arguments.last],
        click: arguments.click.as_ref().and_then(|c| c.as_slice().try_into().ok()),
        specimen: arguments.specimen.clone(),
        phantoms: arguments.phantoms.clone(),
        film: arguments.film.clone().map(|path| FilmFile { path, lift: arguments.lift }),
    };
    let measured = measuring.run(progress)?;
    output::print(json, &measured, |m| {
        let film = arguments.film.as_ref().map(|path| format!("\nfilm {}", path.display()));
        text(m) + &film.unwrap_or_default()
    });
    Ok(())
}

/// A number of millimetres in a column; a dash if it is unknown.
fn mm(value: Option<f64>) -> String {
    value.map_or("-".to_owned(), |v| format!("{v:.1}"))
}

fn row(lift: &LiftRow) -> String {
    let number = lift.lift;
    let Some(f) = &lift.figures else {
        return format!("{number:>4}  not measured: {}", lift.failure.as_deref().unwrap_or("unknown"));
    };
    let LiftFigures { lift_mm, d50_mm, static_rmse_mm, rigid_rmse_mm, landmark_floor_mm, .. } = f;
    format!(
        "{number:>4} {:>8} {:>7} {:>11} {:>9} {:>9} {:>9} {:>11} {:>8.0}%",
        mm(*lift_mm),
        mm(*d50_mm),
        format!("{} of {}", f.landmarks_seen, f.landmarks),
        mm(*static_rmse_mm),
        mm(*rigid_rmse_mm),
        mm(*landmark_floor_mm),
        mm(f.static_chamfer_mm),
        100.0 * f.plane_inlier_share
    )
}

fn text(m: &Measured) -> String {
    let mut lines = vec![
        format!("{}: {}", m.source, counted(m.lifts.len(), "lift")),
        "lift  lift mm  d50 mm   landmarks static mm  rigid mm  floor mm  chamfer mm    plane".to_owned(),
    ];
    lines.extend(m.lifts.iter().map(row));
    let medians = [m.lift_mm, m.d50_mm, m.static_rmse_mm, m.rigid_rmse_mm, m.landmark_floor_mm].map(mm);
    let [lift, d50, still, rigid, floor] = medians;
    lines.push(format!(
        "median lift {lift} mm, d50 {d50} mm; landmark error {still} mm without motion, {rigid} mm rigid, floor {floor} mm"
    ));
    if let Some(line) = &m.line {
        lines.push(format!(
            "d50 = {:.1} {:+.2} h mm (r {:.2}, residual SD {:.1} mm, {} lifts); paper: {} {:+} h (r {}, {} mm)",
            line.intercept,
            line.slope,
            line.r,
            line.residual_sd,
            line.count,
            PAPER.intercept,
            PAPER.slope,
            PAPER.r,
            PAPER.residual_sd
        ));
    }
    if let Some(error) = m.tracking_error_mm_median {
        lines.push(format!("tracked points are {error:.2} mm from the phantom's truth (median)"));
    }
    lines.join("\n")
}
