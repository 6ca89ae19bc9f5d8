//! Fig. 5: how far a shaft may lie beside the port's centre at each tilt, by the formula and by pushing one through the contact model.

use crate::names::millimetres;
use crate::study::{Job, Kind, Study};
use crate::{Error, Result};
use clap::Args;
use glam::{DVec2, DVec3};
use serde::Serialize;
use std::f64::consts::{FRAC_PI_2, PI};
use std::fmt::Write;
use trocar_core::Progress;
use trocar_report::colors;
use trocar_report::document::{Document, Section, Table};
use trocar_report::page::{self, Card};
use trocar_report::plots::{Line, Plot};
use trocar_report::table::fixed;
use trocar_robot::port::{Port, RimState, Shaft, Twist};

/// Tilts of the table [degrees]: from 0 ...
const LAST_TILT: f64 = 35.0;
/// ... in steps of this.
const STEP: f64 = 0.5;

/// What the paper says (section VI-A): the arm, its tilt at the start [degrees], the clearance there [mm].
const STARTS: [(&str, f64, f64); 2] = [("left", 13.3, 0.43), ("right", 18.3, 0.37)];

/// The paper's tilt without clearance [degrees].
const PAPER_LIMIT: f64 = 34.0;

/// Tilts at which the room is measured to all sides [degrees].
const AROUND: [f64; 5] = [0.0, 13.3, 18.3, 24.1, 30.0];

/// Directions of that, over half a turn; the other half is its mirror image.
const DIRECTIONS: usize = 90;

/// Sheets beside the one that was asked for [mm].
const SHEETS: [f64; 2] = [1.0, 2.0];

/// No shaft is pushed farther than this share of the hole.
const FARTHEST: f64 = 1.0;

/// Halvings of a search: to the last digits.
const HALVINGS: usize = 60;

/// Fig. 5: how far a shaft may lie beside its port's centre at each tilt, by the formula and by the contact model.
#[derive(Clone, Copy, Debug, Args)]
pub struct PortBudget {
    /// Diameter of the hole [mm].
    #[arg(long, default_value = "6", value_parser = millimetres, allow_negative_numbers = true)]
    pub hole: f64,
    /// Diameter of the shaft [mm].
    #[arg(long, default_value = "5", value_parser = millimetres, allow_negative_numbers = true)]
    pub shaft: f64,
    /// Thickness of the sheet [mm]; at 0 the clearance is the paper's.
    #[arg(long, default_value = "0", value_parser = millimetres, allow_negative_numbers = true)]
    pub thickness: f64,
    /// Force of the push for the deviation under load [N].
    #[arg(long, default_value_t = 5.0, allow_negative_numbers = true)]
    pub push: f64,
}

/// One tilt.
#[derive(Clone, Debug, Serialize)]
pub struct PortBudgetRow {
    /// Angle between the shaft and the port's normal [degrees].
    pub tilt_deg: f64,
    /// Lateral clearance by the formula [mm]; negative where the shaft does not fit.
    pub clearance_mm: f64,
    /// Farthest that a shaft is pushed in the direction of its tilt before the contact model touches [mm]; none where it does not fit.
    pub measured_mm: Option<f64>,
    /// The same against the direction of the tilt [mm].
    pub measured_against_mm: Option<f64>,
    /// The same across it [mm].
    pub measured_across_mm: Option<f64>,
    /// The least to any side [mm].
    pub measured_least_mm: Option<f64>,
    /// How far the push takes it in the direction of its tilt, the rim yielding [mm].
    pub pushed_mm: f64,
    /// Clearance by the formula in thicker sheets, 1 and 2 mm [mm].
    pub thicker_mm: [f64; 2],
}

/// A start pose of the paper.
#[derive(Clone, Debug, Serialize)]
pub struct PortStart {
    /// The arm.
    pub arm: &'static str,
    /// Its tilt [degrees].
    pub tilt_deg: f64,
    /// The paper's clearance [mm].
    pub paper_mm: f64,
    /// The formula's [mm].
    pub clearance_mm: f64,
    /// That of the contact model [mm].
    pub measured_mm: Option<f64>,
}

/// The room to all sides at one tilt.
#[derive(Clone, Debug, Serialize)]
pub struct PortRoom {
    /// The tilt [degrees].
    pub tilt_deg: f64,
    /// Direction of the push from that of the tilt [degrees], and the farthest before something touches [mm].
    pub room: Vec<(f64, f64)>,
}

/// The experiment's outcome.
#[derive(Clone, Debug, Serialize)]
pub struct PortBudgetResult {
    /// Diameter of the hole [mm].
    pub hole_mm: f64,
    /// Diameter of the shaft [mm].
    pub shaft_mm: f64,
    /// Thickness of the sheet [mm].
    pub thickness_mm: f64,
    /// Stiffness of the rim [N/mm].
    pub stiffness_n_mm: f64,
    /// The push [N].
    pub push_n: f64,
    /// Every tilt.
    pub rows: Vec<PortBudgetRow>,
    /// The paper's start poses.
    pub starts: Vec<PortStart>,
    /// The room to all sides.
    pub rooms: Vec<PortRoom>,
    /// Tilt without clearance by the formula [degrees]; none where even an upright shaft has none.
    pub limit_deg: Option<f64>,
    /// The tilt at which a centred shaft touches in the contact model [degrees].
    pub measured_limit_deg: Option<f64>,
    /// The paper's [degrees].
    pub paper_limit_deg: f64,
    /// Largest difference between formula and contact model in the direction of the tilt [mm].
    pub largest_difference_mm: f64,
    /// Wall time [s].
    pub seconds: f64,
    /// The report's path.
    pub report: String,
}

impl Study for PortBudget {
    const NAME: &'static str = "port-budget";
    const KIND: Kind = Kind::Experiment;
    type Figures = PortBudgetResult;

    fn run(&self, job: &Job<'_>) -> Result<(PortBudgetResult, Document)> {
        let pushing = Pushing::new(self)?;
        job.claim()?;
        let measured = self.measure(&pushing, job.progress)?;
        let result = PortBudgetResult { report: job.report(), seconds: job.seconds(), ..measured };
        let document = document(&result)?;
        Ok((result, document))
    }
}

impl PortBudget {
    fn measure(&self, pushing: &Pushing, progress: &dyn Progress) -> Result<PortBudgetResult> {
        let (port, radius) = (&pushing.port, pushing.radius);
        let count = (LAST_TILT / STEP).round() as usize + 1;
        let mut rows = Vec::with_capacity(count);
        progress.begin("tilts", count as u64);
        for k in 0..count {
            if progress.interrupted() {
                return Err(Error::Interrupted);
            }
            rows.push(pushing.row(k as f64 * STEP, self.push));
            progress.advance(1);
        }
        progress.end();
        let start = |(arm, tilt_deg, paper_mm): (&'static str, f64, f64)| PortStart {
            arm,
            tilt_deg,
            paper_mm,
            clearance_mm: 1e3 * port.clearance(radius, tilt_deg.to_radians()),
            measured_mm: pushing.room(tilt_deg.to_radians(), 0.0).map(|r| 1e3 * r),
        };
        let around = |tilt_deg: f64| {
            let direction = |k: usize| 180.0 * k as f64 / DIRECTIONS as f64;
            let room = |d: f64| pushing.room(tilt_deg.to_radians(), d.to_radians()).map(|r| (d, 1e3 * r));
            PortRoom { tilt_deg, room: (0..=DIRECTIONS).filter_map(|k| room(direction(k))).collect() }
        };
        let differences = rows.iter().filter_map(|r| r.measured_mm.map(|m| (m - r.clearance_mm).abs()));
        Ok(PortBudgetResult {
            hole_mm: 1e3 * self.hole,
            shaft_mm: 1e3 * self.shaft,
            thickness_mm: 1e3 * self.thickness,
            stiffness_n_mm: 1e-3 * port.stiffness,
            push_n: self.push,
            largest_difference_mm: differences.fold(0.0, f64::max),
            rows,
            starts: STARTS.map(start).into(),
            rooms: AROUND.map(around).into(),
            limit_deg: port.tilt_with_clearance(radius, 0.0).map(f64::to_degrees),
            measured_limit_deg: pushing.limit().map(f64::to_degrees),
            paper_limit_deg: PAPER_LIMIT,
            seconds: 0.0,
            report: String::new(),
        })
    }
}

/// A port and the shaft that is pushed in it.
struct Pushing {
    port: Port,
    radius: f64,
}

impl Pushing {
    fn new(experiment: &PortBudget) -> Result<Self> {
        let port = Port {
            hole_diameter: experiment.hole,
            thickness: experiment.thickness,
            ..Port::new(DVec3::ZERO, DVec3::Z, DVec3::X)?
        };
        port.check()?;
        let radius = 0.5 * experiment.shaft;
        let instrument = trocar_robot::instrument::Instrument::grasper();
        trocar_robot::instrument::Instrument { shaft_radius: radius, ..instrument }.check()?;
        if experiment.shaft >= experiment.hole {
            let (shaft, hole) = (1e3 * experiment.shaft, 1e3 * experiment.hole);
            let reason = format!("{shaft} mm do not go through a hole of {hole} mm; it must be thinner");
            return Err(trocar_robot::Error::Invalid { what: "shaft".into(), reason }.into());
        }
        if !(experiment.push.is_finite() && experiment.push > 0.0) {
            let reason = format!("{} N must be above 0", experiment.push);
            return Err(trocar_robot::Error::Invalid { what: "push".into(), reason }.into());
        }
        Ok(Self { port, radius })
    }

    /// A shaft tilted towards x whose axis goes through the port's plane at `at`.
    fn shaft(&self, tilt: f64, at: DVec2) -> Shaft {
        let direction = DVec3::new(tilt.sin(), 0.0, tilt.cos());
        Shaft { base: at.extend(0.0) - 0.2 * direction, direction, radius: self.radius, length: 0.33 }
    }

    /// What the rim does to a shaft at rest there, in the port's plane [N], and whether it touches.
    fn rim(&self, tilt: f64, at: DVec2) -> (DVec2, bool) {
        let shaft = self.shaft(tilt, at);
        let contacts = self.port.contacts(&shaft, &Twist::default(), &RimState::default());
        (contacts.on_shaft(shaft.base).0.truncate(), contacts.touching().next().is_some())
    }

    /// The farthest push from the centre in a direction (from the tilt's) before something touches [m]; none where the centred shaft touches. What fits is convex, so
    /// halving finds it.
    fn room(&self, tilt: f64, direction: f64) -> Option<f64> {
        let along = DVec2::from_angle(direction);
        let touches = |d: f64| self.rim(tilt, d * along).1;
        (!touches(0.0)).then(|| halve(0.0, FARTHEST * self.port.hole_diameter, touches))
    }

    /// How far a push of `force` [N] takes the shaft in the direction of its tilt [m].
    fn pushed(&self, tilt: f64, force: f64) -> f64 {
        halve(0.0, FARTHEST * self.port.hole_diameter, |d| -self.rim(tilt, d * DVec2::X).0.x >= force)
    }

    /// The tilt at which a centred shaft touches [rad].
    fn limit(&self) -> Option<f64> {
        let touches = |tilt: f64| self.rim(tilt, DVec2::ZERO).1;
        (!touches(0.0)).then(|| halve(0.0, 85_f64.to_radians(), touches))
    }

    fn row(&self, tilt_deg: f64, push: f64) -> PortBudgetRow {
        let tilt = tilt_deg.to_radians();
        let room = |direction: f64| self.room(tilt, direction).map(|r| 1e3 * r);
        let all = (0..=DIRECTIONS).filter_map(|k| room(PI * k as f64 / DIRECTIONS as f64));
        let thicker = |mm: f64| 1e3 * Port { thickness: 1e-3 * mm, ..self.port }.clearance(self.radius, tilt);
        PortBudgetRow {
            tilt_deg,
            clearance_mm: 1e3 * self.port.clearance(self.radius, tilt),
            measured_mm: room(0.0),
            measured_against_mm: room(PI),
            measured_across_mm: room(FRAC_PI_2),
            measured_least_mm: all.reduce(f64::min),
            pushed_mm: 1e3 * self.pushed(tilt, push),
            thicker_mm: SHEETS.map(thicker),
        }
    }
}

/// Where a condition begins to hold between `low` and `high`.
fn halve(mut low: f64, mut high: f64, holds: impl Fn(f64) -> bool) -> f64 {
    for _ in 0..HALVINGS {
        let middle = 0.5 * (low + high);
        if holds(middle) { high = middle } else { low = middle }
    }
    low
}

/// Every so many rows are in the page's table; the JSON has all.
const EVERY: usize = 5;

fn document(r: &PortBudgetResult) -> Result<Document> {
    let lead = format!(
        "A {} mm shaft in a {} mm hole of a sheet {} mm thick. By the formula: (D \u{2212} d/cos \u{2212} t tan)/2 at each tilt, the paper\u{2019}s where t is 0. Measured: a shaft pushed sideways through \
         the contact model until the rim pushes back.",
        r.shaft_mm, r.hole_mm, r.thickness_mm
    );
    let section =
        Section::new("Port budget", lead).cards(cards(r)).figures([clearance(r)?, sections(r), around(r)?, loaded(r)?]);
    let subtitle = "How far a shaft may lie beside its port's centre";
    Ok(Document::new("Port budget", subtitle).with(section).with(starts(r)).with(rows(r)))
}

fn cards(r: &PortBudgetResult) -> Vec<Card> {
    let degrees = |v: Option<f64>| v.map_or("none".to_owned(), |v| format!("{}\u{b0}", fixed(v, 2)));
    let start = |s: &PortStart| {
        let name = if s.arm == "left" { "Left arm's start" } else { "Right arm's start" };
        let near = s.measured_mm.is_some_and(|m| (m - s.paper_mm).abs() < 0.005);
        let note = format!("at {}\u{b0}, measured; the paper: {} mm", s.tilt_deg, fixed(s.paper_mm, 2));
        Card::new(name, format!("{} mm", fixed(s.measured_mm.unwrap_or(f64::NAN), 3)), note).met(near)
    };
    let mut all: Vec<Card> = r.starts.iter().map(start).collect();
    let note = format!("formula {}; the paper: about {}\u{b0}", degrees(r.limit_deg), r.paper_limit_deg);
    all.push(Card::new("No clearance from", degrees(r.measured_limit_deg), note));
    let worst = format!("{:.0e} mm", r.largest_difference_mm);
    all.push(Card::new("Formula and contact model", worst, "largest difference, in the direction of the tilt"));
    all
}

fn start_color(k: usize) -> [u8; 3] {
    colors::organ([0, 3][k % 2])
}

fn clearance(r: &PortBudgetResult) -> Result<String> {
    let (formula, measured) = (colors::organ(1), colors::organ(4));
    let thick = |k: usize| colors::organ([2, 7][k % 2]);
    let mut lines: Vec<Line> = (0..SHEETS.len())
        .rev()
        .map(|k| {
            let points = r.rows.iter().map(|row| (row.tilt_deg, row.thicker_mm[k]));
            Line { points: points.filter(|p| p.1 > -0.15).collect(), color: thick(k), filled: false }
        })
        .collect();
    let points = r.rows.iter().map(|row| (row.tilt_deg, row.clearance_mm)).collect();
    lines.push(Line { points, color: formula, filled: false });
    // The plot has lines only: a measured value is a short one.
    for row in r.rows.iter().step_by(EVERY) {
        let points = row.measured_mm.map(|m| vec![(row.tilt_deg - 0.25, m), (row.tilt_deg + 0.25, m)]);
        lines.extend(points.map(|points| Line { points, color: measured, filled: false }));
    }
    for (k, s) in r.starts.iter().enumerate() {
        let points = vec![(s.tilt_deg, 0.0), (s.tilt_deg, s.clearance_mm), (0.0, s.clearance_mm)];
        lines.push(Line { points, color: start_color(k), filled: false });
    }
    let plot = Plot {
        title: "Lateral clearance over tilt",
        x: "tilt [\u{b0}]",
        y: "clearance [mm]",
        lines,
        bands: vec![],
        show: vec![],
        limits: vec![0.0],
        log_x: false,
        log_y: false,
    };
    let sheet = format!("formula, {} mm sheet", r.thickness_mm);
    let thicker = SHEETS.map(|mm| format!("{mm} mm sheet"));
    let starts: Vec<String> = r.starts.iter().map(|s| format!("{} start, {}\u{b0}", s.arm, s.tilt_deg)).collect();
    let entries = [(sheet.as_str(), formula), ("measured (dashes)", measured)]
        .into_iter()
        .chain(thicker.iter().enumerate().map(|(k, t)| (t.as_str(), thick(k))))
        .chain(starts.iter().enumerate().map(|(k, s)| (s.as_str(), start_color(k))));
    let caption = format!("<b>Lateral clearance</b> in the direction of the tilt.{}", page::legend(entries));
    Ok(page::figure(&plot.svg()?, &caption))
}

/// The shaft's elliptic section in the hole's plane, pushed until it touches in the direction of the tilt.
fn sections(r: &PortBudgetResult) -> String {
    let hole = 0.5 * r.hole_mm;
    let step = 2.5 * hole;
    let shown: Vec<_> = r.rooms.iter().filter(|room| !room.room.is_empty()).collect();
    let columns = shown.len().clamp(1, 3);
    let lines = shown.len().div_ceil(columns).max(1);
    let (width, height) = (columns as f64 * step, lines as f64 * (step + 0.3 * hole));
    let mut svg = format!(
        "<svg viewBox=\"0 0 {width:.3} {height:.3}\" role=\"img\" aria-label=\"Sections of the shaft in the hole\">"
    );
    for (k, room) in shown.iter().enumerate() {
        let x = (0.5 + (k % columns) as f64) * step;
        let y = 0.5 * step + (k / columns) as f64 * (step + 0.3 * hole);
        let cos = room.tilt_deg.to_radians().cos();
        let pushed = room.room.first().map_or(0.0, |p| p.1);
        let thin = 0.02 * hole;
        let _ = write!(
            svg,
            "<circle cx=\"{x:.3}\" cy=\"{y:.3}\" r=\"{hole:.3}\" fill=\"none\" stroke=\"currentColor\" stroke-width=\"{thin:.3}\"/>\
             <ellipse cx=\"{:.3}\" cy=\"{y:.3}\" rx=\"{:.3}\" ry=\"{:.3}\" fill=\"{}\" fill-opacity=\"0.35\" stroke=\"{}\" stroke-width=\"{thin:.3}\"/>\
             <text x=\"{x:.3}\" y=\"{:.3}\" font-size=\"{:.3}\" text-anchor=\"middle\" fill=\"currentColor\">{}\u{b0}</text>",
            x + pushed,
            0.5 * r.shaft_mm / cos,
            0.5 * r.shaft_mm,
            page::hex(colors::organ(1)),
            page::hex(colors::organ(1)),
            y + 1.36 * hole,
            0.26 * hole,
            room.tilt_deg
        );
    }
    svg.push_str("</svg>");
    page::figure(
        &svg,
        "<b>The shaft\u{2019}s section in the port\u{2019}s plane</b> at five tilts (to the right), pushed to the right until it touches.",
    )
}

fn around(r: &PortBudgetResult) -> Result<String> {
    let line = |(k, points): (usize, &Vec<(f64, f64)>)| Line {
        points: points.clone(),
        color: colors::organ(k),
        filled: false,
    };
    let plot = Plot {
        title: "Room to all sides",
        x: "direction of the push from that of the tilt [\u{b0}]",
        y: "admissible deviation [mm]",
        lines: r.rooms.iter().map(|room| &room.room).enumerate().map(line).collect(),
        bands: vec![],
        show: vec![0.0],
        limits: vec![],
        log_x: false,
        log_y: false,
    };
    let names: Vec<String> = r.rooms.iter().map(|room| format!("{}\u{b0}", room.tilt_deg)).collect();
    let legend = page::legend(names.iter().enumerate().map(|(k, n)| (n.as_str(), colors::organ(k))));
    let caption = format!(
        "<b>Admissible deviation</b> to all sides, measured. Across the tilt it is (D \u{2212} d)/2 up to acos \u{221a}(d/D), 24.1\u{b0} for 5 in 6 mm; beyond, the section is \
         blunter than the hole and touches at two points.{legend}"
    );
    Ok(page::figure(&plot.svg()?, &caption))
}

fn loaded(r: &PortBudgetResult) -> Result<String> {
    let (free, pushed) = (colors::organ(1), colors::organ(2));
    let points = |value: &dyn Fn(&PortBudgetRow) -> Option<f64>| -> Vec<(f64, f64)> {
        r.rows.iter().filter_map(|row| value(row).map(|v| (row.tilt_deg, v))).collect()
    };
    let plot = Plot {
        title: "Deviation under load",
        x: "tilt [\u{b0}]",
        y: "deviation [mm]",
        lines: vec![
            Line { points: points(&|row| row.measured_least_mm), color: free, filled: true },
            Line { points: points(&|row| Some(row.pushed_mm)), color: pushed, filled: false },
        ],
        bands: vec![],
        show: vec![0.0],
        limits: vec![],
        log_x: false,
        log_y: false,
    };
    let push = format!("pushed with {} N", r.push_n);
    let legend = page::legend([("free to every side", free), (push.as_str(), pushed)]);
    let caption = format!(
        "<b>Deviation under load</b>: the rim gives by {} N/mm (our assumption; the paper states none).{legend}",
        fixed(r.stiffness_n_mm, 0)
    );
    Ok(page::figure(&plot.svg()?, &caption))
}

fn starts(r: &PortBudgetResult) -> Section {
    let head = ["Start pose", "Tilt [\u{b0}]", "Paper [mm]", "Formula [mm]", "Measured [mm]"];
    let number = |v: Option<f64>| fixed(v.unwrap_or(f64::NAN), 4);
    let rows: Vec<Vec<String>> = r
        .starts
        .iter()
        .map(|s| {
            let numbers = [fixed(s.tilt_deg, 1), fixed(s.paper_mm, 2), fixed(s.clearance_mm, 4), number(s.measured_mm)];
            [s.arm.to_owned()].into_iter().chain(numbers).collect()
        })
        .collect();
    Section::new("Beside the paper", "").table(Table::new(head, rows))
}

fn rows(r: &PortBudgetResult) -> Section {
    let head = [
        "Tilt [\u{b0}]",
        "Formula [mm]",
        "Measured, with the tilt [mm]",
        "against it [mm]",
        "across it [mm]",
        "Least to any side [mm]",
        "Pushed [mm]",
        "1 mm sheet [mm]",
        "2 mm sheet [mm]",
    ];
    let number = |v: Option<f64>| fixed(v.unwrap_or(f64::NAN), 4);
    let rows: Vec<Vec<String>> = r
        .rows
        .iter()
        .step_by(EVERY)
        .map(|row| {
            vec![
                fixed(row.tilt_deg, 1),
                fixed(row.clearance_mm, 4),
                number(row.measured_mm),
                number(row.measured_against_mm),
                number(row.measured_across_mm),
                number(row.measured_least_mm),
                fixed(row.pushed_mm, 4),
                fixed(row.thicker_mm[0], 4),
                fixed(row.thicker_mm[1], 4),
            ]
        })
        .collect();
    Section::new("Over tilt", "A dash: a centred shaft touches already.").table(Table::new(head, rows).on_page_only())
}

#[cfg(test)]
mod tests {
    use super::*;
    use trocar_core::Silent;

    fn measured() -> PortBudgetResult {
        let experiment = PortBudget { hole: 6e-3, shaft: 5e-3, thickness: 0.0, push: 5.0 };
        experiment.measure(&Pushing::new(&experiment).unwrap(), &Silent).unwrap()
    }

    #[test]
    fn the_contact_model_has_the_papers_budget() {
        let r = measured();
        assert!(r.largest_difference_mm < 1e-9);
        for start in &r.starts {
            assert!((start.measured_mm.unwrap() - start.paper_mm).abs() < 0.005, "{start:?}");
        }
        assert!((r.limit_deg.unwrap() - 33.557).abs() < 1e-3);
        assert!((r.measured_limit_deg.unwrap() - r.limit_deg.unwrap()).abs() < 1e-6);
        assert_eq!(r.rows.len(), 71);
        assert!(r.rows.last().unwrap().measured_mm.is_none(), "35 degrees do not fit");
        // 5 N on 20 N/mm, a little more where the rim pushes aslant.
        let upright = &r.rows[0];
        assert!((upright.pushed_mm - 0.75).abs() < 1e-6, "{}", upright.pushed_mm);
        assert!(r.rooms.iter().all(|room| room.room.len() == DIRECTIONS + 1));
    }

    #[test]
    fn options_that_make_no_port_are_refused() {
        let good = PortBudget { hole: 6e-3, shaft: 5e-3, thickness: 0.0, push: 5.0 };
        let refused = |e: PortBudget| Pushing::new(&e).err().unwrap().to_string();
        assert!(refused(PortBudget { hole: f64::NAN, ..good }).contains("hole_diameter"));
        assert!(refused(PortBudget { shaft: -1.0, ..good }).contains("shaft_radius"));
        assert!(refused(PortBudget { push: 0.0, ..good }).contains("push"));
        assert!(refused(PortBudget { shaft: 7e-3, ..good }).contains("7 mm do not go through"));
    }

    #[test]
    fn the_paper_stands_beside() {
        let html = document(&measured()).unwrap().page();
        assert_eq!(html.matches("<svg").count(), 4);
        assert_eq!(html.matches("card good").count(), 2, "both starts are the paper's");
        assert!(
            html.contains("A 5 mm shaft in a 6 mm hole")
                && html.contains("0.43")
                && html.contains("33.56\u{b0}")
                && !html.contains("NaN")
        );
        assert_eq!(html.matches("<ellipse").count(), 5);
    }
}
