//! The page of the study.

use super::film::HeldOutFilm;
use super::result::{BAR_MM, ErrorRow, LiftsResult, TrendRow};
use super::support::Support;
use crate::Result;
use crate::trials::resumed;
use trocar_measure::PAPER;
use trocar_report::colors;
use trocar_report::document::{Document, Section, Table};
use trocar_report::page::{self, Card};
use trocar_report::plots::{Line, Plot};
use trocar_report::table::{fixed, or_dash, percent};

/// Colour of the paper's line and points, and of the recorded lifts.
const GREY: [u8; 3] = [120, 126, 132];
const RECORDED: [u8; 3] = [214, 84, 40];

/// The paper's simulated points: lift and d50 (mm).
const PAPER_SIMULATED: [(f64, f64); 2] = [(15.7, 11.4), (31.5, 19.7)];

/// What the film shows.
const SAID: &str = "At the left the recording with what is measured in it, at the right the simulated tissue through \
                    the same camera. Below: the lift along the appendix, with the half-drop distance d50 marked.";

/// Heights between which the paper's line is drawn (mm).
const DRAWN: [f64; 2] = [5.0, 50.0];

pub(super) fn document(r: &LiftsResult, film: Option<&HeldOutFilm>) -> Result<Document> {
    let lead = format!(
        "Lifts of a phantom's appendix are filmed, measured and reproduced. The filmed tissue has {} kPa, corotated \
         elasticity, a mesh of half the edge length and the hidden support '{}'; the simulated one has {} kPa, stable \
         neo-Hookean elasticity and the reconstruction's pins. The cluster at the same arc length is moved by the \
         measured displacement of the apex.",
        fixed(r.true_modulus_kpa, 1),
        r.true_support,
        fixed(r.modulus_kpa, 1)
    );
    let section = Section::new("Recorded grasp-lifts", lead)
        .cards(cards(r))
        .figures([heights(r)?, profiles(r)?])
        .table(recorded(r))
        .lines(resumed(&r.resumed, "lift"));
    let trend = Section::new(
        "Half-drop distance over height",
        "Lifts straight up at three places, means. Residual: d50 less that of the paper's line at the same lift.",
    )
    .table(trend(r));
    let errors = Section::new(
        "Errors of reproduced lifts",
        "Medians over the recorded lifts. In the paper the landmark error falls from 12.3 to 11.6 mm from 6 to 192 kPa.",
    )
    .table(errors(r));
    let identified = Section::new(
        "Identified support",
        "From the even lifts the support and the tissue are identified, and the odd lifts are reproduced with them, \
         and the other way round.",
    )
    .table(identified(r));
    let document = Document::new("Grasp-lifts", "Recorded lifts beside simulated ones").with(section);
    let document = match film {
        Some(film) => document.with(Section::new("A lift, filmed and simulated", SAID).html(film.figure())),
        None => document,
    };
    Ok(document.with(trend).with(errors).with(identified))
}

fn cards(r: &LiftsResult) -> Vec<Card> {
    let mm = |value: Option<f64>| format!("{} mm", or_dash(value, 2));
    let note = format!("largest distance from the paper's line at 15 and 30 mm; bar {BAR_MM} mm");
    let landmarks = format!(
        "no motion {}, rigid {}, floor {}; paper 11.8 (14.2, 5.9, 2.4)",
        mm(r.static_rmse_mm),
        mm(r.rigid_rmse_mm),
        mm(r.landmark_floor_mm)
    );
    vec![
        Card::new("d50 residual", mm(r.d50_residual_mm), note).met(r.d50_residual_mm.is_some_and(|d| d <= BAR_MM)),
        Card::new("Landmark error", mm(r.specimen_landmark_rmse_mm), landmarks),
        held_out(r),
        Card::new("Local Chamfer", mm(r.chamfer_mm), "paper 4.3 mm"),
        Card::new("Tracking error", mm(r.tracking_error_mm_median), "median distance from the truth; bar 1.0 mm")
            .met(r.tracking_error_mm_median.is_some_and(|e| e <= 1.0)),
        Card::new("Lift", mm(r.lift_mm), "median of the recorded lifts"),
    ]
}

/// The landmark error of lifts that were not fitted, beside its bar: the larger of 1.5 times the
/// floor and a tenth of the lift.
fn held_out(r: &LiftsResult) -> Card {
    let bar = r.lift_mm.map(|lift| (0.1 * lift).max(1.5 * r.landmark_floor_mm.unwrap_or(0.0)));
    let error = r.landmark_rmse_mm;
    let note = format!(
        "lifts that were not fitted, identified support; without its threads {} mm; bar {} mm",
        or_dash(r.identified.without_threads_mm, 2),
        or_dash(bar, 2)
    );
    let met = error.zip(bar).is_some_and(|(error, bar)| error <= bar);
    Card::new("Landmark error, identified", format!("{} mm", or_dash(error, 2)), note).met(met)
}

fn identified(r: &LiftsResult) -> Table {
    let head = ["Lift", "Moved (mm)", "Landmark error (mm)", "Without threads (mm)", "Local Chamfer (mm)"];
    let mut judged: Vec<_> = r.identified.folds.iter().flat_map(|f| &f.judged).collect();
    judged.sort_by_key(|j| j.lift);
    let row = |j: &&super::result::JudgedRow| {
        vec![
            j.lift.to_string(),
            fixed(j.displacement_mm, 1),
            or_dash(j.landmark_rmse_mm, 2),
            or_dash(j.without_threads_mm, 2),
            or_dash(j.chamfer_mm, 2),
        ]
    };
    Table::new(head, judged.iter().map(row).collect())
}

fn heights(r: &LiftsResult) -> Result<String> {
    let dot = |(x, y): (f64, f64), color: [u8; 3]| {
        // A small cross: plots have lines only.
        let cross = |a: (f64, f64), b: (f64, f64)| Line::new(vec![a, b], color);
        [cross((x - 0.4, y), (x + 0.4, y)), cross((x, y - 0.4), (x, y + 0.4))]
    };
    let mut lines = vec![Line::new(DRAWN.map(|h| (h, PAPER.at(h))).to_vec(), GREY)];
    lines.extend(PAPER_SIMULATED.into_iter().flat_map(|p| dot(p, GREY)));
    for (k, support) in Support::ALL.iter().enumerate() {
        let own = |t: &&TrendRow| t.support == support.name() && t.modulus_kpa == r.modulus_kpa;
        let points = r.trend.iter().filter(own).map(|t| (t.lift_mm, t.d50_mm)).collect();
        lines.push(Line::new(points, colors::organ(k)));
    }
    let recorded = r.recorded.lifts.iter().filter_map(|l| l.figures.as_ref());
    lines.extend(recorded.filter_map(|f| Some((f.lift_mm?, f.d50_mm?))).flat_map(|p| dot(p, RECORDED)));
    let plot = Plot {
        title: "Half-drop distance over height",
        x: "lift (mm)",
        y: "d50 (mm)",
        lines,
        show: vec![0.0],
        ..Plot::default()
    };
    let supports = Support::ALL.iter().enumerate().map(|(k, s)| (s.name(), colors::organ(k)));
    let legend = page::legend(supports.chain([("paper", GREY), ("recorded", RECORDED)]));
    Ok(plot.figure(&format!("<b>Half-drop distance</b> over height, {} kPa.{legend}", fixed(r.modulus_kpa, 0)))?)
}

fn profiles(r: &LiftsResult) -> Result<String> {
    let line = |profile: &[[f64; 2]], color| Line::new(profile.iter().map(|p| (p[0], p[1])).collect(), color);
    let recorded = r.recorded.lifts.iter().filter_map(|l| l.figures.as_ref()).map(|f| line(&f.profile, RECORDED));
    let own = r.rows.iter().filter(|row| {
        row.recorded.is_some() && row.support == Support::Specimen.name() && row.modulus_kpa == r.modulus_kpa
    });
    let lines = recorded.chain(own.map(|row| line(&row.profile, colors::organ(0)))).collect();
    let plot = Plot {
        title: "Normalised lift profile",
        x: "distance from the apex (mm), negative towards the base",
        y: "lift over the greatest lift",
        lines,
        show: vec![0.0, 1.0],
        ..Plot::default()
    };
    let legend = page::legend([("recorded", RECORDED), ("simulated", colors::organ(0))]);
    Ok(plot.figure(&format!("<b>Normalised lift profile</b>, recorded and reproduced.{legend}"))?)
}

fn recorded(r: &LiftsResult) -> Table {
    let head = [
        "Lift",
        "Height (mm)",
        "True (mm)",
        "d50 (mm)",
        "True d50 (mm)",
        "Landmarks",
        "No motion (mm)",
        "Rigid (mm)",
        "Floor (mm)",
        "Tracking (mm)",
        "Plane inliers",
    ];
    let row = |l: &trocar_workflow::measure::LiftRow| {
        let (f, t) = (l.figures.as_ref(), l.truth.as_ref());
        vec![
            l.lift.to_string(),
            or_dash(f.and_then(|f| f.lift_mm), 1),
            or_dash(t.and_then(|t| t.lift_mm), 1),
            or_dash(f.and_then(|f| f.d50_mm), 1),
            or_dash(t.and_then(|t| t.d50_mm), 1),
            f.map_or("\u{2013}".to_owned(), |f| format!("{} of {}", f.landmarks_seen, f.landmarks)),
            or_dash(f.and_then(|f| f.static_rmse_mm), 1),
            or_dash(f.and_then(|f| f.rigid_rmse_mm), 1),
            or_dash(f.and_then(|f| f.landmark_floor_mm), 2),
            or_dash(t.and_then(|t| t.tracking_error_mm_median), 2),
            f.map_or("\u{2013}".to_owned(), |f| percent(f.plane_inlier_share, 0)),
        ]
    };
    Table::new(head, r.recorded.lifts.iter().map(row).collect())
}

fn trend(r: &LiftsResult) -> Table {
    Table::of(
        &r.trend,
        &[
            ("Support", &|t: &&TrendRow| t.support.clone()),
            ("Modulus (kPa)", &|t| fixed(t.modulus_kpa, 0)),
            ("Moved (mm)", &|t| fixed(t.displacement_mm, 1)),
            ("Lift (mm)", &|t| fixed(t.lift_mm, 1)),
            ("d50 (mm)", &|t| fixed(t.d50_mm, 1)),
            ("Residual (mm)", &|t| fixed(t.residual_mm, 1)),
        ],
    )
}

fn errors(r: &LiftsResult) -> Table {
    Table::of(
        &r.errors,
        &[
            ("Support", &|e: &&ErrorRow| e.support.clone()),
            ("Modulus (kPa)", &|e| fixed(e.modulus_kpa, 0)),
            ("Lifts", &|e| e.lifts.to_string()),
            ("Diverged", &|e| e.diverged.to_string()),
            ("Landmark error (mm)", &|e| or_dash(e.landmark_rmse_mm, 1)),
            ("Local Chamfer (mm)", &|e| or_dash(e.chamfer_mm, 1)),
        ],
    )
}

#[cfg(test)]
mod tests {
    use super::super::result::{IdentifiedSummary, SimulatedRow, errors, residual, trend as means};
    use super::*;
    use crate::trials::Resumed;
    use trocar_workflow::measure::Measured;

    fn simulated(support: Support, recorded: Option<usize>, moved: f64) -> SimulatedRow {
        SimulatedRow {
            support: support.name().to_owned(),
            modulus_kpa: 12.0,
            recorded,
            grasp_s: 0.6,
            displacement_mm: moved,
            diverged: false,
            lift_mm: Some(moved),
            d50_mm: Some(8.0 + 0.3 * moved),
            landmark_rmse_mm: recorded.map(|_| 5.0),
            chamfer_mm: recorded.map(|_| 3.0),
            profile: vec![[-10.0, 0.5], [0.0, 1.0], [10.0, 0.5]],
        }
    }

    #[test]
    fn the_page_shows_every_row() {
        let ups = [15.0, 30.0].map(|mm| simulated(Support::Specimen, None, mm));
        let rows: Vec<SimulatedRow> = ups.into_iter().chain([simulated(Support::Specimen, Some(0), 20.0)]).collect();
        let (trend, errors) = (means(&rows), errors(&rows));
        let recorded = Measured {
            source: "recording".into(),
            lifts: Vec::new(),
            line: None,
            lift_mm: Some(20.0),
            d50_mm: None,
            static_rmse_mm: Some(9.0),
            rigid_rmse_mm: Some(6.0),
            landmark_floor_mm: Some(0.1),
            tracking_error_mm_median: Some(0.4),
        };
        let result = LiftsResult {
            d50_residual_mm: residual(&trend, 12.0),
            specimen_landmark_rmse_mm: errors[0].landmark_rmse_mm,
            landmark_floor_mm: Some(0.1),
            lift_mm: Some(20.0),
            static_rmse_mm: Some(9.0),
            rigid_rmse_mm: Some(6.0),
            tracking_error_mm_median: Some(0.4),
            chamfer_mm: Some(3.0),
            landmark_rmse_mm: Some(1.2),
            identified: IdentifiedSummary::of(Vec::new()),
            alignment_mm: Some(1.0),
            recorded_line: None,
            recorded,
            trend,
            errors,
            rows,
            modulus_kpa: 12.0,
            true_modulus_kpa: 20.0,
            true_support: "mesentery".into(),
            resumed: Resumed::default(),
        };
        let html = document(&result, None).unwrap().page();
        assert_eq!(html.matches("<svg").count(), 2);
        // Two rows of the trend, one of the errors, and four heads.
        assert_eq!(html.matches("<tr>").count(), 7);
        assert!(html.contains("0.50 mm") && !html.contains("card bad"), "the residual at both heights is met");
    }
}
