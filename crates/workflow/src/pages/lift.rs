//! The page of a lift: outcome, camera pictures, and channels of arms and tissue over time.

use super::cut;
use super::over_time::{self, Curve, TimePlot};
use crate::lift_result::FinishedLift;
use crate::{Result, counted};
use trocar_report::page::{self, Card, Columns};
use trocar_report::plots::Band;
use trocar_report::table::fixed;
use trocar_scene::Side;
use trocar_task::{ArmChannels, Channels};

/// Median RCM deviation of the paper's rollouts (mm).
const PAPER_RCM_MM: f64 = 0.12;
/// The paper's threshold of the RCM deviation (mm).
const THRESHOLD_MM: f64 = 3.0;

/// The sections of the outcome, and those of the details.
pub(super) fn sections(lifted: &FinishedLift) -> Result<(String, String)> {
    let s = &lifted.recording.summary;
    let mut lead = "The jaws close on the organ, lift it and hold it.".to_owned();
    if let Some(why) = &s.why {
        lead += &format!(" <b>Not passed:</b> {}.", page::escape(why));
    }
    if let Some(advice) = &s.advice {
        lead += &format!(" <b>Note:</b> {}.", page::escape(advice));
    }
    if let Some(said) = s.warnings.described() {
        lead += &format!(" <b>Beyond what tissue withstands:</b> {}.", page::escape(&said));
    }
    let title = if s.diverged { "The lift (diverged)" } else { "The lift" };
    let mut first = page::section(title, &lead, &cards(lifted)) + &over_time::pictures(&lifted.pictures)?;
    if let Some(cut) = &s.details.sever {
        first += &cut::section(cut);
    }
    let plots = page::grid(Columns::Two, &plots(lifted)?);
    let details = page::section("Over time", "Shaded: the phases of the script.", &plots)
        + &over_time::events(&lifted.recording.events)
        + &over_time::all_figures(&lifted.result);
    Ok((first, details))
}

fn cards(lifted: &FinishedLift) -> String {
    let (r, s) = (&lifted.result, &lifted.recording.summary);
    let (d, mm) = (&s.details, |v: f64| format!("{} mm", fixed(v, 2)));
    // A value that was not measured is shown as a dash.
    let of_grasp = |v: Option<f64>| v.unwrap_or(f64::NAN);
    let grasp = s.grasp_at.map_or("no grasp".to_owned(), |at| {
        format!(
            "{} grasp of {} of the {} at s = {}",
            d.design,
            counted(d.held_nodes.unwrap_or(0), "node"),
            d.organ,
            fixed(at, 2)
        )
    });
    let mut cards = vec![Card::new("Held", if s.held { "yes" } else { "no" }, grasp).met(s.held)];
    if let (Some(slip), Some(follow)) = (s.slip_mm, s.follow_ratio) {
        cards.extend([
            Card::new("Lift", mm(of_grasp(s.lift_mm)), format!("follows {}% of the jaws", fixed(100.0 * follow, 0)))
                .met(follow >= 0.8),
            Card::new("Slip", mm(slip), "less than 3 mm counts as held").met(slip < 3.0),
            Card::new("Snap", mm(of_grasp(d.snap_mm)), "largest displacement that the grasp prescribes at its start"),
            Card::new(
                "Activation step",
                mm(of_grasp(d.activation_step_mm)),
                "largest motion of a node in its first frame",
            ),
            Card::new(
                "Jaws",
                format!("{} N", fixed(of_grasp(d.closing_force_n), 2)),
                format!("of {} N; gap {} mm", fixed(d.jaw_force_n, 2), fixed(of_grasp(d.gap_mm), 1)),
            ),
        ]);
    }
    cards.extend([
        Card::new(
            "Peak force",
            format!("{} N", fixed(over_time::peak(s, |a| a.peak_constraint_n), 2)),
            format!("constraint; contact {} N", fixed(over_time::peak(s, |a| a.peak_contact_n), 2)),
        ),
        over_time::inverted_card(s),
        over_time::warnings_card(s),
        Card::new("Speed", format!("{}\u{d7}", fixed(r.real_time_factor, 2)), "of real time, arms and tissue"),
    ]);
    if s.arms.iter().any(|a| a.rcm_peak_mm > 0.0) {
        let note = format!("at most; the paper: {PAPER_RCM_MM} mm, median of 84; the threshold is 3 mm");
        cards.push(Card::new("RCM deviation", mm(s.rcm_peak_mm), note).met(s.rcm_peak_mm < THRESHOLD_MM));
    }
    if let Some(why) = s.end.as_ref().filter(|_| s.diverged) {
        cards.insert(0, Card::new("Diverged", "yes", why.to_string()).met(false));
    }
    page::cards(&cards)
}

fn bands(lifted: &FinishedLift) -> Vec<Band> {
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
    lifted: &FinishedLift,
    (title, y): (&str, &str),
    curves: &[Curve<'_>],
    caption: &str,
    limits: Vec<f64>,
) -> Result<String> {
    TimePlot { title, y, curves, caption, limits }.figure(&lifted.recording.channels, bands(lifted))
}

fn plots(lifted: &FinishedLift) -> Result<Vec<String>> {
    let grasper = lifted.recording.events.iter().find_map(|(_, e)| match e {
        trocar_cell::CellEvent::Attached { arm, .. } => Some(*arm),
        _ => None,
    });
    let side = grasper.unwrap_or(Side::Left);
    let arm = move |c: &Channels| -> ArmChannels { *c.arms()[side as usize] };
    let mut all = vec![
        plot(
            lifted,
            ("Lift", "height (mm)"),
            &[
                ("jaws", &|c| c.task.jaw_lift_mm, 1),
                ("tissue", &|c| c.task.lift_mm, 4),
                ("slip", &|c| c.task.slip_mm, 2),
            ],
            "rise of jaws and tissue since the grasp, and slip of the tissue in the jaws.",
            vec![],
        )?,
        plot(
            lifted,
            ("Force", "force (N)"),
            &[
                ("contact", &|c| arm(c).contact_n(), 1),
                ("constraint", &|c| arm(c).constraint_n(), 2),
                ("on the jaws", &|c| arm(c).jaw_force_n, 4),
            ],
            "force of tissue on the instrument, by kind; contact forces on the two blades cancel.",
            vec![],
        )?,
        plot(
            lifted,
            ("Jaw", "opening (1)"),
            &[("opening", &|c| arm(c).jaw, 1)],
            "0: closed, 1: wide open. Jaws close with a force, not to an angle.",
            vec![],
        )?,
        plot(
            lifted,
            ("Largest node speed", "speed (m/s)"),
            &[("tissue", &|c| c.task.max_speed_m_s, 4)],
            "of all organs; dashed: limit of settled tissue, 0.01 m/s.",
            vec![0.01],
        )?,
        plot(
            lifted,
            ("Smallest volume ratio", "volume ratio (1)"),
            &[("tissue", &|c| c.task.min_volume, 4)],
            "volume of the most compressed element over its volume at rest; at 0 an element is inverted.",
            vec![],
        )?,
    ];
    if lifted.recording.summary.arms.iter().any(|a| a.rcm_peak_mm > 0.0) {
        all.push(plot(
            lifted,
            ("RCM deviation", "deviation (mm)"),
            &[
                ("largest of the period", &|c| arm(c).rcm_peak_mm, 2),
                ("at the end of the period", &|c| arm(c).rcm_mm, 1),
            ],
            "distance of the port\u{2019}s centre from the shaft\u{2019}s axis; dashed: the paper\u{2019}s median.",
            vec![PAPER_RCM_MM],
        )?);
        all.push(plot(
            lifted,
            ("Tracking error", "distance (mm)"),
            &[("tip", &|c| arm(c).tracking_mm, 1)],
            "distance of the tip from its command at the same time, which includes the lag of the reference.",
            vec![],
        )?);
    }
    Ok(all)
}
