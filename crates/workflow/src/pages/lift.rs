//! The page of a lift: figures of merit, what the cameras saw, and what arms and tissue did over time.

use super::severed;
use crate::Result;
use crate::lifted::Lifted;
use trocar_report::page::{self, Card, Columns};
use trocar_report::plots::{Band, Line, Plot};
use trocar_report::table::{self, fixed};
use trocar_report::{colors, figures};
use trocar_scene::Side;
use trocar_task::{ArmChannels, Channels};

/// RCM deviation of the paper's rollouts, median (mm), and its threshold (mm).
const PAPER_RCM_MM: f64 = 0.12;
const THRESHOLD_MM: f64 = 3.0;

/// What of a row is plotted, by name and colour.
type Curve<'a> = (&'a str, &'a dyn Fn(&Channels) -> f64, usize);

/// The sections that come first, and those with details.
pub(super) fn sections(lifted: &Lifted) -> Result<(String, String)> {
    let s = &lifted.recording.summary;
    let mut lead = "The jaws close on the organ, lift it and hold it.".to_owned();
    if let Some(why) = &s.why {
        lead += &format!(" <b>Not passed:</b> {}.", page::escape(why));
    }
    if let Some(advice) = &s.advice {
        lead += &format!(" <b>Note:</b> {}.", page::escape(advice));
    }
    if let Some(said) = s.suspensions() {
        lead += &format!(" <b>Suspensions of physics:</b> {}.", page::escape(&said));
    }
    let title = if s.diverged { "The lift (diverged)" } else { "The lift" };
    let mut first = page::section(title, &lead, &cards(lifted)) + &seen(lifted)?;
    if let Some(cut) = &s.details.sever {
        first += &severed::section(cut);
    }
    let plots = page::grid(Columns::Two, &plots(lifted)?);
    let details = page::section("Over time", "Shaded: the phases of the script.", &plots)
        + &events(lifted)
        + &page::section("All figures of the run", "", &table::plain(&["Figure", "Value"], &all_figures(lifted)));
    Ok((first, details))
}

fn cards(lifted: &Lifted) -> String {
    let (r, s) = (&lifted.result, &lifted.recording.summary);
    let (d, mm) = (&s.details, |v: f64| format!("{} mm", fixed(v, 2)));
    let peak = |of: fn(&trocar_task::ArmSummary) -> f64| s.arms.iter().map(of).fold(0.0, f64::max);
    let grasp = s.grasp_at.map_or("nothing grasped".to_owned(), |at| {
        format!("{} grasp of {} nodes of the {} at s = {}", d.design, d.held_nodes, d.organ, fixed(at, 2))
    });
    let mut cards = vec![
        Card::new("Held", if s.held { "yes" } else { "no" }, grasp).met(s.held),
        Card::new("Lift", mm(s.lift_mm), format!("follows {}% of the jaws", fixed(100.0 * s.follow_ratio, 0)))
            .met(s.follow_ratio >= 0.8),
        Card::new("Slip", mm(s.slip_mm), "less than 3 mm counts as held").met(s.slip_mm < 3.0),
        Card::new("Snap", mm(d.snap_mm), "what the grasp prescribes when the jaws take hold"),
        Card::new("Activation step", mm(d.activation_step_mm), "what moves in its first frame"),
        Card::new(
            "Jaws",
            format!("{} N", fixed(d.closing_force_n, 2)),
            format!("of {} N; closed on {} mm", fixed(d.jaw_force_n, 2), fixed(d.gap_mm, 1)),
        ),
        Card::new(
            "Peak force",
            format!("{} N", fixed(peak(|a| a.peak_constraint_n), 2)),
            format!("constraint; contact {} N", fixed(peak(|a| a.peak_contact_n), 2)),
        ),
        Card::new("Inverted elements", s.inverted_peak.to_string(), "at worst").met(s.inverted_peak == 0),
        Card::new(
            "Suspensions",
            (s.disabled_contacts + s.disabled_blades + s.relaxed).to_string(),
            s.suspensions().unwrap_or_else(|| "of physics by safety rules".to_owned()),
        )
        .met(s.suspensions().is_none()),
        Card::new("Speed", format!("{}\u{d7}", fixed(r.real_time_factor, 2)), "of real time, arms and tissue"),
    ];
    if s.arms.iter().any(|a| a.rcm_peak_mm > 0.0) {
        let note = format!("at most; the paper: {PAPER_RCM_MM} mm, median of 84; the threshold is 3 mm");
        cards.push(Card::new("RCM deviation", mm(s.rcm_peak_mm), note).met(s.rcm_peak_mm < THRESHOLD_MM));
    }
    if let Some(why) = s.end.as_ref().filter(|_| s.diverged) {
        cards.insert(0, Card::new("Diverged", "yes", why.to_string()).met(false));
    }
    page::cards(&cards)
}

/// What the cameras saw.
fn seen(lifted: &Lifted) -> Result<String> {
    let mut all = Vec::new();
    if let Some((bytes, size)) = &lifted.pictures.film {
        let img = figures::img_of_bytes("webp", bytes, size[0], size[1], "the lift through a camera of the scene");
        all.push(page::figure(&img, "<b>The lift</b> in real time."));
    }
    for (caption, picture) in &lifted.pictures.stills {
        all.push(page::figure(&figures::img(picture, caption)?, &format!("<b>{}</b>", page::escape(caption))));
    }
    let lead = "Direct light; instruments and organs are where the simulation has them.";
    Ok(page::section("What the cameras saw", lead, &page::grid(Columns::Two, &all)))
}

fn bands(lifted: &Lifted) -> Vec<Band> {
    let mut bands: Vec<Band> = Vec::new();
    for (row, phase) in lifted.recording.channels.iter().zip(&lifted.phases) {
        match bands.last_mut().filter(|b| b.name == *phase) {
            Some(band) => band.to = row.time_s,
            None => {
                let from = bands.last().map_or(0.0, |b| b.to);
                bands.push(Band { name: (*phase).to_owned(), from, to: row.time_s });
            }
        }
    }
    bands
}

fn plot(
    lifted: &Lifted,
    (title, y): (&str, &str),
    curves: &[Curve<'_>],
    caption: &str,
    limits: Vec<f64>,
) -> Result<String> {
    let line = |(_, value, color): &Curve<'_>| Line {
        points: lifted.recording.channels.iter().map(|c| (c.time_s, value(c))).collect(),
        color: colors::organ(*color),
        filled: false,
    };
    let plot = Plot {
        title,
        x: "time [s]",
        y,
        lines: curves.iter().map(line).collect(),
        bands: bands(lifted),
        show: vec![0.0],
        limits,
        log_x: false,
        log_y: false,
    };
    let legend = page::legend(curves.iter().map(|(name, _, color)| (*name, colors::organ(*color))));
    Ok(page::figure(&plot.svg()?, &format!("<b>{title}</b>: {caption}{legend}")))
}

fn plots(lifted: &Lifted) -> Result<Vec<String>> {
    let grasper = lifted.recording.events.iter().find_map(|(_, e)| match e {
        trocar_cell::CellEvent::Attached { arm, .. } => Some(*arm),
        _ => None,
    });
    let side = grasper.unwrap_or(Side::Left);
    let arm = move |c: &Channels| -> ArmChannels { *c.arms()[side as usize] };
    let mut all = vec![
        plot(
            lifted,
            ("Lift", "[mm]"),
            &[
                ("jaws", &|c| c.task.jaw_lift_mm, 1),
                ("tissue", &|c| c.task.lift_mm, 4),
                ("slip", &|c| c.task.slip_mm, 2),
            ],
            "rise since the jaws took hold, and how far tissue moved in them.",
            vec![],
        )?,
        plot(
            lifted,
            ("Force", "force [N]"),
            &[
                ("contact", &|c| arm(c).contact_n(), 1),
                ("constraint", &|c| arm(c).constraint_n(), 2),
                ("on the jaws", &|c| arm(c).jaw_force_n, 4),
            ],
            "what tissue does to the instrument, by kind; contact cancels where both blades press.",
            vec![],
        )?,
        plot(
            lifted,
            ("Jaw", "opening [1]"),
            &[("opening", &|c| arm(c).jaw, 1)],
            "0 closed, 1 wide open. Jaws close with a force, not to an angle.",
            vec![],
        )?,
        plot(
            lifted,
            ("Largest node speed", "speed [m/s]"),
            &[("tissue", &|c| c.task.max_speed_m_s, 4)],
            "over all organs; dashed: settled, 0.01 m/s.",
            vec![0.01],
        )?,
        plot(
            lifted,
            ("Smallest volume ratio", "volume ratio [1]"),
            &[("tissue", &|c| c.task.min_volume, 4)],
            "volume of the most compressed element over its volume at rest; at 0 an element is inverted.",
            vec![],
        )?,
    ];
    if lifted.recording.summary.arms.iter().any(|a| a.rcm_peak_mm > 0.0) {
        all.push(plot(
            lifted,
            ("RCM deviation", "deviation [mm]"),
            &[("largest of the period", &|c| arm(c).rcm_peak_mm, 2), ("at its end", &|c| arm(c).rcm_mm, 1)],
            "from the port\u{2019}s centre to the shaft\u{2019}s axis; dashed the paper\u{2019}s median.",
            vec![PAPER_RCM_MM],
        )?);
        all.push(plot(
            lifted,
            ("Behind the command", "[mm]"),
            &[("tip", &|c| arm(c).tracking_mm, 1)],
            "distance from what was commanded at that time: the reference\u{2019}s lag and the tracking error.",
            vec![],
        )?);
    }
    Ok(all)
}

fn events(lifted: &Lifted) -> String {
    let events = lifted.recording.events.iter();
    let rows: Vec<Vec<String>> = events.map(|(time, event)| vec![fixed(*time, 2), event.to_string()]).collect();
    page::section("What happened", "", &table::plain(&["Time [s]", "Event"], &rows))
}

/// Every number, word and flag of the result by its key.
fn all_figures(lifted: &Lifted) -> Vec<Vec<String>> {
    let Ok(serde_json::Value::Object(all)) = serde_json::to_value(&lifted.result) else { return Vec::new() };
    let simple = all.into_iter().filter(|(_, v)| v.is_number() || v.is_string() || v.is_boolean());
    let text = |v: serde_json::Value| v.as_str().map_or_else(|| v.to_string(), str::to_owned);
    simple.map(|(key, value)| vec![key, text(value)]).collect()
}
