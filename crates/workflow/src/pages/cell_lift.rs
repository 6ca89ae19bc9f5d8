//! The page of a grasp-lift in the two-arm cell: figures of merit, and what the arm and the tissue did over time.

use crate::Result;
use crate::cell_figures::CellRun;
use crate::watched::Pictures;
use trocar_cell::{CellLiftRun, CellLiftSample};
use trocar_report::colors;
use trocar_report::figures;
use trocar_report::page::{self, Card, Columns};
use trocar_report::plots::{Band, Line, Plot};
use trocar_report::table::{self, fixed};

/// RCM deviation of the paper's rollouts, median [mm]; its threshold [mm] (SPEC E2, E3).
const PAPER_RCM_MM: f64 = 0.12;
const THRESHOLD_MM: f64 = 3.0;

pub(super) fn body(made: &CellRun, run: &CellLiftRun, pictures: &Pictures) -> Result<String> {
    let s = &made.summary;
    let mm = |v: f64| format!("{} mm", fixed(v, 3));
    let cards = [
        Card::new(
            "Held",
            if s.held { "yes" } else { "no" },
            format!("{} grasp of {} nodes of the {} at s = {}", s.design, s.held_nodes, s.organ, fixed(s.at, 2)),
        )
        .met(s.held),
        Card::new("Lift", mm(s.lift_mm), format!("follows {}% of the jaws", fixed(100.0 * s.follow_ratio, 0)))
            .met(s.follow_ratio >= 0.8),
        Card::new("Slip", mm(s.slip_mm), "less than 3 mm counts as held").met(s.slip_mm < 3.0),
        Card::new("RCM deviation under load", mm(s.rcm_median_mm), "median"),
        Card::new(
            "Peak RCM deviation",
            mm(s.rcm_run_max_mm),
            format!("of the whole run; the paper: {PAPER_RCM_MM} mm, median of 84; the threshold is 3 mm"),
        )
        .met(s.rcm_run_max_mm < THRESHOLD_MM),
        Card::new(
            "Peak force",
            format!("{} N", fixed(s.peak_constraint_n, 2)),
            format!("constraint; contact {} N", fixed(s.peak_contact_n, 2)),
        ),
        Card::new("Snap", mm(s.snap_mm), "when the jaws took hold"),
        Card::new("Inverted elements", s.inverted_peak.to_string(), "at worst").met(s.inverted_peak == 0),
        Card::new("Speed", format!("{}\u{d7}", fixed(s.real_time_factor, 2)), "of real time, arms and tissue"),
    ];
    let figures = [rcm(run)?, lift(run)?, force(run)?, behind(run)?];
    let lead = format!("The {} arm works through its port by actions, thirty a second.", page::escape(&s.arm));
    Ok(page::section("Grasp-lift in the cell", &lead, &(page::cards(&cards) + &page::grid(Columns::Two, &figures)))
        + &seen(pictures)?
        + &events(made))
}

/// What the cameras saw.
fn seen(pictures: &Pictures) -> Result<String> {
    let mut figures = Vec::new();
    if let Some((bytes, size)) = &pictures.film {
        let img = figures::img_of_bytes("webp", bytes, size[0], size[1], "the lift through the endoscope");
        figures.push(page::figure(&img, "<b>The lift</b>, as fast as it was."));
    }
    for (caption, picture) in &pictures.stills {
        figures.push(page::figure(&figures::img(picture, caption)?, &format!("<b>{}</b>", page::escape(caption))));
    }
    let lead = "Direct light; instruments and organs are where the simulation has them.";
    Ok(page::section("What the cameras saw", lead, &page::grid(Columns::Two, &figures)))
}

fn bands(run: &CellLiftRun) -> Vec<Band> {
    let mut bands: Vec<Band> = Vec::new();
    for sample in &run.samples {
        match bands.last_mut().filter(|b| b.name == sample.phase) {
            Some(band) => band.to = sample.time_s,
            None => {
                let from = bands.last().map_or(0.0, |b| b.to);
                bands.push(Band { name: sample.phase.to_owned(), from, to: sample.time_s });
            }
        }
    }
    bands
}

type Channel = (&'static str, fn(&CellLiftSample) -> f64, usize);

fn plot(
    run: &CellLiftRun,
    title: &str,
    y: &str,
    channels: &[Channel],
    caption: &str,
    limits: Vec<f64>,
) -> Result<String> {
    let line = |(_, value, color): &Channel| Line {
        points: run.samples.iter().map(|s| (s.time_s, value(s))).collect(),
        color: colors::organ(*color),
        filled: false,
    };
    let plot = Plot {
        title,
        x: "time [s]",
        y,
        lines: channels.iter().map(line).collect(),
        bands: bands(run),
        show: vec![0.0],
        limits,
        log_x: false,
        log_y: false,
    };
    let legend = page::legend(channels.iter().map(|(name, _, color)| (*name, colors::organ(*color))));
    Ok(page::figure(&plot.svg()?, &format!("<b>{title}</b>: {caption}{legend}")))
}

fn rcm(run: &CellLiftRun) -> Result<String> {
    let channels: [Channel; 2] = [("largest of the period", |s| s.rcm_peak_mm, 2), ("at its end", |s| s.rcm_mm, 1)];
    let caption = "from the port\u{2019}s centre to the shaft\u{2019}s axis; dashed the paper\u{2019}s median.";
    plot(run, "RCM deviation", "deviation [mm]", &channels, caption, vec![PAPER_RCM_MM])
}

fn lift(run: &CellLiftRun) -> Result<String> {
    let channels: [Channel; 3] =
        [("jaws", |s| s.jaw_lift_mm, 1), ("tissue", |s| s.tissue_lift_mm, 4), ("slip", |s| s.slip_mm, 2)];
    plot(run, "Lift", "[mm]", &channels, "rise since the jaws took hold.", vec![])
}

fn force(run: &CellLiftRun) -> Result<String> {
    let channels: [Channel; 3] =
        [("contact", |s| s.contact_n, 1), ("constraint", |s| s.constraint_n, 2), ("on the jaws", |s| s.jaw_force_n, 4)];
    let caption = "what tissue does to the instrument, by kind; contact cancels where both blades press.";
    plot(run, "Force", "[N]", &channels, caption, vec![])
}

fn behind(run: &CellLiftRun) -> Result<String> {
    let channels: [Channel; 1] = [("tip", |s| s.behind_mm, 1)];
    let caption =
        "distance from what was commanded at that time: the reference\u{2019}s lag of 50 ms and the tracking error.";
    plot(run, "Behind the command", "[mm]", &channels, caption, vec![])
}

fn events(made: &CellRun) -> String {
    let rows: Vec<Vec<String>> = made.events.iter().map(|e| vec![fixed(e.time_s, 2), e.event.to_string()]).collect();
    page::section("What happened", "", &table::plain(&["Time [s]", "Event"], &rows))
}
