//! The controller, chosen out of 182 configurations as the paper's was (SPEC K4): seven kinds, thirteen bandwidths, two damping ratios.

use super::controller_motion::{ControllerFigures, ControllerInstant, judge, trace};
use super::trials::{Outcomes, Resumed, Trials, resumed};
use crate::Result;
use crate::study::{Job, Kind, Study};
use clap::Args;
use serde::{Deserialize, Serialize};
use trocar_report::colors;
use trocar_report::document::{Document, Section, Table};
use trocar_report::page::{self, Card};
use trocar_report::plots::{Line, Plot};
use trocar_report::table::{fixed, percent};
use trocar_robot::manipulator::{ControllerSettings, Law};

/// The paper's figures for its chosen controller (section VI-A), which are the bars.
const BARS: ControllerBars = ControllerBars { rcm_p95_mm: 0.34, tracking_rms_mm: 0.048, droop_mm: 0.26 };

/// A configuration that is chosen has its figures below this share of the bars.
const IN_HAND: f64 = 0.8;

/// Kinds: a law, its integral action's or observer's bandwidth [rad/s].
const KINDS: [(Law, f64); 7] = [
    (Law::JointImpedance, 0.0),
    (Law::ComputedTorque, 0.0),
    (Law::Integral, 5.0),
    (Law::Integral, 15.0),
    (Law::Observer, 15.0),
    (Law::Observer, 45.0),
    (Law::RcmImpedance, 45.0),
];
/// Bandwidths of the error [rad/s].
const BANDWIDTHS: [f64; 13] = [15.0, 20.0, 25.0, 30.0, 40.0, 50.0, 60.0, 80.0, 100.0, 120.0, 150.0, 190.0, 240.0];
/// Damping ratios.
const DAMPINGS: [f64; 2] = [0.7, 1.0];
/// One step in so many is kept of the chosen one's run.
const EVERY: usize = 4;

/// Figures that a controller must not exceed.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct ControllerBars {
    /// RCM deviation that 95% of all steps stay below [mm].
    pub rcm_p95_mm: f64,
    /// Tracking in free motion, RMS [mm].
    pub tracking_rms_mm: f64,
    /// Droop at rest [mm].
    pub droop_mm: f64,
}

/// The arms' controller chosen out of 182 configurations: RCM deviation, tracking and droop under a wrong model and friction.
#[derive(Clone, Copy, Debug, Args)]
pub struct ControllerGridExperiment {
    /// Configurations at once; as many as the machine has threads by default. The figures do not depend on it.
    #[arg(long, default_value_t = 0)]
    pub threads: usize,
}

/// One configuration and what it came to.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ControllerRow {
    /// The law by name.
    pub controller: String,
    /// Bandwidth of the error [rad/s].
    pub bandwidth: f64,
    /// Damping ratio.
    pub damping: f64,
    /// Bandwidth of the integral action [rad/s], where the law has it.
    pub integral: Option<f64>,
    /// Bandwidth of the disturbance observer [rad/s], where the law has it.
    pub observer: Option<f64>,
    /// Its figures.
    #[serde(flatten)]
    pub figures: ControllerFigures,
}

impl ControllerRow {
    /// The greatest of its figures as a share of its bar; infinite where it is not stable.
    pub fn share_of_bars(&self) -> f64 {
        let f = &self.figures;
        let shares =
            [f.rcm_p95_mm / BARS.rcm_p95_mm, f.tracking_rms_mm / BARS.tracking_rms_mm, f.droop_mm / BARS.droop_mm];
        if f.stable { shares.into_iter().fold(0.0, f64::max) } else { f64::INFINITY }
    }
}

/// The experiment's outcome.
#[derive(Clone, Debug, Serialize)]
pub struct ControllerGridResult {
    /// All configurations.
    pub rows: Vec<ControllerRow>,
    /// The chosen one: of those that have a fifth of every bar in hand the one of the least bandwidth, and of these the best; none where no configuration has.
    pub chosen: Option<ControllerRow>,
    /// The chosen one with the FR3's own friction in place of the grid's.
    pub chosen_with_own_friction: Option<ControllerFigures>,
    /// Whether the program's default controller is the chosen one.
    pub chosen_is_default: bool,
    /// The paper's figures.
    pub bars: ControllerBars,
    /// How many configurations are stable, and how many of them meet all bars.
    pub stable: usize,
    /// Those that meet all bars.
    pub within_bars: usize,
    /// The left arm under the chosen controller.
    pub trace: Vec<ControllerInstant>,
    /// The same with the same gains without observer or integral action.
    pub plain_trace: Vec<ControllerInstant>,
    /// Configurations that an earlier run had finished.
    pub resumed: Resumed,
    /// Wall time [s].
    pub seconds: f64,
    /// The report's path.
    pub report: String,
}

/// All configurations.
fn grid() -> Vec<ControllerSettings> {
    let mut all = Vec::with_capacity(KINDS.len() * BANDWIDTHS.len() * DAMPINGS.len());
    for (law, correction) in KINDS {
        for bandwidth in BANDWIDTHS {
            for damping in DAMPINGS {
                let mut settings = ControllerSettings { law, ..ControllerSettings::default() };
                (settings.gains.bandwidth, settings.gains.damping) = (bandwidth, damping);
                match law {
                    Law::Integral => settings.gains.integral = correction,
                    Law::Observer | Law::RcmImpedance => settings.gains.observer = correction,
                    Law::JointImpedance | Law::ComputedTorque => {}
                }
                all.push(settings);
            }
        }
    }
    all
}

fn key(s: &ControllerSettings) -> String {
    let g = &s.gains;
    let of =
        |name: &str, value: f64| if s.law.gains().contains(&name) { format!(" {name} {value}") } else { String::new() };
    format!(
        "{}{}{}{}{}",
        s.law.name(),
        of("bandwidth", g.bandwidth),
        of("damping", g.damping),
        of("integral", g.integral),
        of("observer", g.observer)
    )
}

fn row(s: &ControllerSettings) -> Result<ControllerRow> {
    let has = |name: &str, value: f64| s.law.gains().contains(&name).then_some(value);
    Ok(ControllerRow {
        controller: s.law.name().to_owned(),
        bandwidth: s.gains.bandwidth,
        damping: s.gains.damping,
        integral: has("integral", s.gains.integral),
        observer: has("observer", s.gains.observer),
        figures: judge(s)?,
    })
}

/// The place of the configuration that is chosen.
fn choose(rows: &[ControllerRow]) -> Option<usize> {
    let good = |k: &usize| rows[*k].share_of_bars() <= IN_HAND;
    (0..rows.len()).filter(good).min_by(|&a, &b| {
        let (a, b) = (&rows[a], &rows[b]);
        a.bandwidth.total_cmp(&b.bandwidth).then(a.share_of_bars().total_cmp(&b.share_of_bars()))
    })
}

impl Study for ControllerGridExperiment {
    const NAME: &'static str = "controller-grid";
    const KIND: Kind = Kind::Experiment;
    const FOLDER: Option<&'static str> = Some("Folder for the report; finished configurations in it are used again.");
    type Figures = ControllerGridResult;

    fn run(&self, job: &Job<'_>) -> Result<(ControllerGridResult, Document)> {
        job.claim()?;
        let grid = grid();
        let store =
            Trials::open(job.output(), "controller-grid", &format!("{:?}", ControllerSettings::default().error))?;
        let Outcomes { rows, resumed } =
            store.run("configurations", &grid, key, self.threads, job.progress, |s, _| row(s))?;
        let chosen = choose(&rows);
        let (mut shown, mut plain) = (Vec::new(), Vec::new());
        if let Some(k) = chosen {
            shown = trace(&grid[k], EVERY)?;
            plain = trace(&ControllerSettings { law: Law::ComputedTorque, ..grid[k] }, EVERY)?;
        }
        let own = |k: usize| {
            let mut settings = grid[k];
            settings.error.friction = None;
            judge(&settings)
        };
        let result = ControllerGridResult {
            chosen_with_own_friction: chosen.map(own).transpose()?,
            chosen_is_default: chosen.is_some_and(|k| key(&grid[k]) == key(&ControllerSettings::default())),
            chosen: chosen.map(|k| rows[k].clone()),
            bars: BARS,
            stable: rows.iter().filter(|r| r.figures.stable).count(),
            within_bars: rows.iter().filter(|r| r.share_of_bars() <= 1.0).count(),
            rows,
            trace: shown,
            plain_trace: plain,
            resumed,
            seconds: job.seconds(),
            report: job.report(),
        };
        let document = document(&result)?;
        Ok((result, document))
    }
}

/// Rows of the table.
const BEST: usize = 10;
/// Half the size of a mark, as a share of its value.
const MARK: f64 = 0.025;
/// What of the run the response shows [s].
const RESPONSE: (f64, f64) = (0.9, 2.6);

fn document(r: &ControllerGridResult) -> Result<Document> {
    let lead = format!(
        "{} configurations: seven kinds of control, thirteen bandwidths, two damping ratios. Each sends both arms of the cell through the same motion: corners, \
         sines, 1\u{202f}N on the tip, rest; then it is knocked with 25\u{202f}N and told to leap; with links believed 2% and instruments 5% lighter than they are and 0.2\u{202f}N\u{202f}m of unknown friction in every joint, in place of the arm\u{2019}s own. \
         Chosen is the softest with {} of every bar in hand: nothing in this plant (no noise of sensors, no give in the gears) charges for bandwidth, a real arm does.",
        r.rows.len(),
        percent(1.0 - IN_HAND, 0)
    );
    let section = Section::new("Controller grid", lead).cards(cards(r)).figures([
        scatter(r)?,
        droops(r)?,
        response(r)?,
        errors(r)?,
    ]);
    let subtitle = "182 configurations on the same motion, and the one that is chosen";
    Ok(Document::new("Controllers", subtitle).with(section).with(friction(r)).with(best(r)))
}

fn cards(r: &ControllerGridResult) -> Vec<Card> {
    let mut all = Vec::new();
    if let Some(c) = &r.chosen {
        let f = &c.figures;
        let mm = |v: f64| format!("{} mm", fixed(v, 3));
        let gains = format!(
            "{} rad/s, damping {}{}; {}",
            fixed(c.bandwidth, 0),
            fixed(c.damping, 1),
            c.observer.or(c.integral).map_or(String::new(), |o| format!(", correction {} rad/s", fixed(o, 0))),
            if r.chosen_is_default { "the program\u{2019}s default" } else { "not the program\u{2019}s default" }
        );
        all.push(Card::new("Chosen", c.controller.clone(), gains));
        let paper = |v: f64| format!("the paper: {v} mm");
        let note = paper(r.bars.rcm_p95_mm);
        all.push(Card::new("RCM deviation, p95", mm(f.rcm_p95_mm), note).met(f.rcm_p95_mm <= r.bars.rcm_p95_mm));
        let note = format!("RMS, at the same time; {}", paper(r.bars.tracking_rms_mm));
        let met = f.tracking_rms_mm <= r.bars.tracking_rms_mm;
        all.push(Card::new("Tracking against the filtered reference", mm(f.tracking_rms_mm), note).met(met));
        let note = format!(
            "RMS, at the same time; the command is held at 30 Hz and comes {} ms before the tip",
            fixed(1e3 * f.command_lag_s, 1)
        );
        all.push(Card::new("Tracking against the command", mm(f.command_rms_mm), note));
        let note = paper(r.bars.droop_mm);
        all.push(Card::new("Droop", mm(f.droop_mm), note).met(f.droop_mm <= r.bars.droop_mm));
        let note = format!("behind the command, held at 30 Hz; {} ms behind the reference", fixed(1e3 * f.lag_s, 2));
        all.push(Card::new("Lag", format!("{} ms", fixed(1e3 * f.command_lag_s, 1)), note));
    }
    let note = format!("knocked too; {} of them meet all bars", r.within_bars);
    all.push(Card::new("Stable", format!("{} of {}", r.stable, r.rows.len()), note));
    all
}

/// The colour of a law.
fn color(controller: &str) -> [u8; 3] {
    colors::organ(Law::ALL.iter().position(|l| l.name() == controller).unwrap_or(7))
}

/// The plot has lines only: a mark on logarithmic axes is a cross of two short ones.
fn cross(x: f64, y: f64, size: f64, color: [u8; 3]) -> [Line; 2] {
    // The y axes span more decades on less length.
    let line = |points| Line { points, color, filled: false };
    let (a, b, tall) = (1.0 - size, 1.0 + size, 1.0 + 3.0 * size);
    [line(vec![(x * a, y), (x * b, y)]), line(vec![(x, y / tall), (x, y * tall)])]
}

/// All stable rows, one figure against another, with the chosen one and the paper's.
fn marks(r: &ControllerGridResult, of: impl Fn(&ControllerRow) -> (f64, f64), paper: (f64, f64)) -> Vec<Line> {
    let mut lines = Vec::new();
    for row in r.rows.iter().filter(|row| row.figures.stable) {
        let (x, y) = of(row);
        lines.extend(cross(x, y, MARK, color(&row.controller)));
    }
    if let Some(c) = &r.chosen {
        let (x, y) = of(c);
        let corner = |a: f64, b: f64| (x * (1.0 + a), y * (1.0 + b));
        let (s, d) = (0.13, -0.115);
        let points = vec![corner(d, d), corner(s, d), corner(s, s), corner(d, s), corner(d, d)];
        lines.push(Line { points, color: color(&c.controller), filled: false });
    }
    lines.extend(cross(paper.0, paper.1, 4.0 * MARK, PAPER));
    lines
}

/// The paper's point.
const PAPER: [u8; 3] = [200, 30, 40];

fn legend(r: &ControllerGridResult) -> String {
    let laws = Law::ALL.iter().filter(|l| r.rows.iter().any(|row| row.controller == l.name()));
    page::legend(laws.map(|l| (l.name(), color(l.name()))).chain([("the paper\u{2019}s (large cross)", PAPER)]))
}

fn scatter(r: &ControllerGridResult) -> Result<String> {
    let of = |row: &ControllerRow| (row.figures.tracking_rms_mm, row.figures.rcm_p95_mm);
    let plot = Plot {
        title: "RCM deviation against tracking",
        x: "tracking, RMS [mm]",
        y: "RCM deviation, p95 [mm]",
        lines: marks(r, of, (r.bars.tracking_rms_mm, r.bars.rcm_p95_mm)),
        bands: vec![],
        show: vec![],
        limits: vec![r.bars.rcm_p95_mm],
        log_x: true,
        log_y: true,
    };
    let caption = format!("<b>All stable configurations</b>, the chosen one framed.{}", legend(r));
    Ok(page::figure(&plot.svg()?, &caption))
}

fn droops(r: &ControllerGridResult) -> Result<String> {
    let of = |row: &ControllerRow| (row.bandwidth, row.figures.droop_mm.max(1e-4));
    let mut lines = marks(r, of, (f64::NAN, f64::NAN));
    lines.retain(|l| l.points.iter().all(|p| p.0.is_finite()));
    let plot = Plot {
        title: "Droop over bandwidth",
        x: "bandwidth [rad/s]",
        y: "droop at rest [mm]",
        lines,
        bands: vec![],
        show: vec![],
        limits: vec![r.bars.droop_mm],
        log_x: true,
        log_y: true,
    };
    let caption = "<b>Droop at rest</b> over the bandwidth; dashed the paper\u{2019}s. Without integral action or observer it falls with the stiffness.";
    Ok(page::figure(&plot.svg()?, caption))
}

fn response(r: &ControllerGridResult) -> Result<String> {
    let names = ["raw command, held", "reference", "tip"];
    let colors = [colors::organ(7), colors::organ(1), colors::organ(4)];
    let within = |i: &&ControllerInstant| (RESPONSE.0..RESPONSE.1).contains(&i.time_s);
    let line = |k: usize| Line {
        points: r.trace.iter().filter(within).map(|i| (i.time_s, i.along_mm[k])).collect(),
        color: colors[k],
        filled: false,
    };
    let plot = Plot {
        title: "Response to a move",
        x: "time [s]",
        y: "along the move [mm]",
        lines: (0..3).map(line).collect(),
        bands: vec![],
        show: vec![],
        limits: vec![],
        log_x: false,
        log_y: false,
    };
    let entries = names.iter().zip(colors).map(|(n, c)| (*n, c));
    let caption = format!(
        "<b>The first move of the left arm</b>: the reference is a spline through the commands and behind them, the tip lies on it.{}",
        page::legend(entries)
    );
    Ok(page::figure(&plot.svg()?, &caption))
}

fn errors(r: &ControllerGridResult) -> Result<String> {
    let shades = [colors::organ(7), colors::organ(4), colors::organ(2)];
    let line = |points: Vec<(f64, f64)>, color| Line { points, color, filled: false };
    let of = |trace: &[ControllerInstant], f: fn(&ControllerInstant) -> f64| {
        trace.iter().map(|i| (i.time_s, f(i).max(1e-4))).collect()
    };
    let plot = Plot {
        title: "Error over time",
        x: "time [s]",
        y: "error [mm]",
        lines: vec![
            line(of(&r.plain_trace, |i| i.error_mm), shades[0]),
            line(of(&r.trace, |i| i.rcm_mm), shades[2]),
            line(of(&r.trace, |i| i.error_mm), shades[1]),
        ],
        bands: vec![],
        show: vec![],
        limits: vec![],
        log_x: false,
        log_y: true,
    };
    let entries = [
        ("tip, same gains without observer", shades[0]),
        ("tip, chosen", shades[1]),
        ("RCM deviation, chosen", shades[2]),
    ];
    let caption = format!("<b>The whole run of the left arm</b>.{}", page::legend(entries));
    Ok(page::figure(&plot.svg()?, &caption))
}

/// The chosen controller with the grid's friction and with the arm's own.
fn friction(r: &ControllerGridResult) -> Section {
    let head = [
        "Friction in each joint",
        "RCM p95 [mm]",
        "Tracking against the reference [mm]",
        "against the command [mm]",
        "Droop [mm]",
        "Stable",
    ];
    let row = |name: &str, f: &ControllerFigures| {
        vec![
            name.to_owned(),
            fixed(f.rcm_p95_mm, 4),
            fixed(f.tracking_rms_mm, 4),
            fixed(f.command_rms_mm, 3),
            fixed(f.droop_mm, 4),
            if f.stable { "yes" } else { "no" }.to_owned(),
        ]
    };
    let grid = r.chosen.iter().map(|c| row("0.2 N m, as in the grid", &c.figures));
    let own = r.chosen_with_own_friction.iter().map(|f| row("the FR3\u{2019}s own, 1.137 and 0.763 N m", f));
    Section::new(
        "Friction",
        "In the grid 0.2 N m in every joint take the place of the FR3\u{2019}s own Coulomb friction, which its model states as \
         1.137 N m for joints 1 to 4 and 0.763 N m for joints 5 to 7. The chosen controller with both.",
    )
    .table(Table::new(head, grid.chain(own).collect()))
}

fn best(r: &ControllerGridResult) -> Section {
    let mut sorted: Vec<&ControllerRow> = r.rows.iter().collect();
    sorted.sort_by(|a, b| a.share_of_bars().total_cmp(&b.share_of_bars()));
    let chosen = r.chosen.iter().map(|c| ("chosen", c));
    let head = [
        "",
        "Controller",
        "Bandwidth [rad/s]",
        "Damping",
        "Correction [rad/s]",
        "RCM p95 [mm]",
        "Tracking against the reference [mm]",
        "against the command [mm]",
        "Droop [mm]",
        "Lag [ms]",
        "Knocked, RCM peak [mm]",
        "Peak torque [N m]",
        "of its limit",
        "Worst share of a bar",
    ];
    let rows: Vec<Vec<String>> = chosen
        .chain(sorted.into_iter().take(BEST).map(|row| ("", row)))
        .map(|(name, row)| {
            let f = &row.figures;
            vec![
                name.to_owned(),
                row.controller.clone(),
                fixed(row.bandwidth, 0),
                fixed(row.damping, 1),
                row.observer.or(row.integral).map_or("\u{2013}".to_owned(), |v| fixed(v, 0)),
                fixed(f.rcm_p95_mm, 4),
                fixed(f.tracking_rms_mm, 4),
                fixed(f.command_rms_mm, 3),
                fixed(f.droop_mm, 4),
                fixed(1e3 * f.lag_s, 2),
                fixed(f.rough_rcm_mm.unwrap_or(f64::NAN), 2),
                fixed(f.torque_peak, 1),
                percent(f.torque_share, 0),
                percent(row.share_of_bars(), 0),
            ]
        })
        .collect();
    Section::new("The chosen and the best ten", "By their worst figure as a share of its bar.")
        .table(Table::new(head, rows))
        .lines(resumed(&r.resumed, "configurations"))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A result of made-up rows.
    fn made_up_result() -> ControllerGridResult {
        let row = |k: usize, s: &ControllerSettings| {
            let size = 1.0 + k as f64;
            ControllerRow {
                controller: s.law.name().to_owned(),
                bandwidth: s.gains.bandwidth,
                damping: s.gains.damping,
                integral: None,
                observer: (s.law == Law::Observer).then_some(s.gains.observer),
                figures: ControllerFigures {
                    rcm_p95_mm: 2.0 / size,
                    rcm_peak_mm: 3.0 / size,
                    tracking_rms_mm: 1.0 / size,
                    lag_s: 1e-4,
                    command_rms_mm: 0.8,
                    command_lag_s: 0.034,
                    droop_mm: 0.5 / size,
                    torque_peak: 50.0,
                    torque_share: 0.6,
                    rough_rcm_mm: Some(1.0),
                    restless_rad_s: 0.0,
                    stable: k != 5,
                },
            }
        };
        let rows: Vec<ControllerRow> = grid().iter().enumerate().map(|(k, s)| row(k, s)).collect();
        let chosen = choose(&rows).map(|k| rows[k].clone());
        let instant = |k: usize| ControllerInstant {
            time_s: 0.01 * k as f64,
            along_mm: [k as f64, k as f64 - 1.0, k as f64 - 1.01],
            error_mm: 0.01,
            rcm_mm: 0.02,
        };
        ControllerGridResult {
            chosen,
            chosen_is_default: false,
            chosen_with_own_friction: None,
            bars: BARS,
            stable: 181,
            within_bars: 150,
            trace: (0..400).map(instant).collect(),
            plain_trace: (0..400).map(instant).collect(),
            rows,
            resumed: Resumed::default(),
            seconds: 1.0,
            report: String::new(),
        }
    }

    #[test]
    fn there_are_182_and_no_two_are_one() {
        let mut keys: Vec<String> = grid().iter().map(key).collect();
        keys.sort();
        keys.dedup();
        assert_eq!(keys.len(), 182);
        grid().iter().for_each(|s| s.check().unwrap());
        assert!(grid().iter().any(|s| key(s) == key(&ControllerSettings::default())), "the default is one of them");
    }

    #[test]
    fn the_softest_with_something_in_hand_is_chosen() {
        let r = made_up_result();
        let chosen = r.chosen.unwrap();
        assert!(chosen.share_of_bars() <= IN_HAND);
        for row in r.rows.iter().filter(|row| row.share_of_bars() <= IN_HAND) {
            assert!(row.bandwidth >= chosen.bandwidth);
        }
        assert!(r.rows[5].share_of_bars().is_infinite(), "unstable");
        assert_eq!(choose(&r.rows[..4]), None);
    }

    #[test]
    fn the_chosen_stands_beside_the_papers() {
        let html = document(&made_up_result()).unwrap().page();
        assert_eq!(html.matches("<svg").count(), 4);
        assert!(html.contains("182 configurations") && html.contains("the paper: 0.34 mm") && !html.contains("NaN"));
        assert_eq!(html.matches("card good").count(), 3);
        assert!(html.contains("Tracking against the command") && html.contains("1.137 N m"));
    }
}
