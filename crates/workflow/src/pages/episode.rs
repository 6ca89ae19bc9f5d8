//! The page of an episode: its end and reason, stages, figures, pictures, and channels over time.

use super::over_time::{self, TimePlot};
use crate::Result;
use crate::recorder::Pictures;
use trocar_report::document::Table;
use trocar_report::page::{self, Card, Columns};
use trocar_report::plots::Band;
use trocar_report::table::{fixed, or_dash, yes_or_no};
use trocar_scene::TaskName;
use trocar_task::{ArmChannels, Channels, Recording, StageProgress, Summary};

/// Selects the channels of one arm.
type ArmOf = fn(&Channels) -> &ArmChannels;
/// The page of the episode `recording` with its `pictures`. `real_time_factor` is simulated time
/// over wall time.
pub(crate) fn episode(recording: &Recording, pictures: &Pictures, real_time_factor: f64) -> Result<String> {
    let (info, s) = (&recording.info, &recording.summary);
    let title = format!("{}: {}", info.scene, info.task.name());
    let subtitle = format!("Episode of the policy {}, seed {}", info.policy, info.seed);
    let body = page::section("Outcome", &lead(s), &cards(recording, real_time_factor))
        + &stages(s)
        + &over_time::pictures(pictures)?
        + &plots(recording)?
        + &arms(recording)
        + &over_time::events(&recording.events)
        + &over_time::all_figures(&recording.result());
    Ok(page::page(&title, &subtitle, &body))
}

/// The end of the episode, its reason, and warnings, as HTML.
fn lead(s: &Summary) -> String {
    let end = s.end.as_ref().map_or("no end".to_owned(), ToString::to_string);
    let why = s.why.clone().filter(|why| *why != end);
    let said = [
        ("Ended", Some(end)),
        ("Not passed", why),
        ("Note", s.advice.clone()),
        ("Beyond what tissue withstands", s.warnings.described()),
    ];
    let said = said.into_iter().filter_map(|(what, text)| Some(format!("<b>{what}:</b> {}.", page::escape(&text?))));
    said.collect::<Vec<_>>().join(" ")
}

fn cards(recording: &Recording, real_time_factor: f64) -> String {
    let s = &recording.summary;
    let mm = |v: f64| format!("{} mm", fixed(v, 2));
    let mut cards = vec![
        Card::new("Passed", if s.passed { "yes" } else { "no" }, format!("score {}", fixed(s.score, 2))).met(s.passed),
        Card::new("Stages", format!("{} of {}", s.stage, s.progress.stages.len()), format!("next: {}", s.next)),
        Card::new(
            "Simulated",
            format!("{} s", fixed(s.duration_s, 1)),
            format!("{}\u{d7} real time", fixed(real_time_factor, 2)),
        ),
    ];
    if recording.info.task != TaskName::PortReach {
        let at = s.grasp_at.map_or("no grasp".to_owned(), |at| {
            let organ = &s.details.organ;
            format!("{} grasp of the {organ} at s = {}", s.details.design, fixed(at, 2))
        });
        cards.push(Card::new("Held to the end", if s.held_to_end { "yes" } else { "no" }, at).met(s.held_to_end));
        if let (Some(lift), Some(slip), Some(follow)) = (s.lift_mm, s.slip_mm, s.follow_ratio) {
            cards.push(Card::new("Lift", mm(lift), format!("follows {}% of the jaws", fixed(100.0 * follow, 0))));
            cards.push(Card::new("Slip", mm(slip), "of held tissue in the jaws"));
        }
    }
    if s.duration_s == 0.0 {
        return page::cards(&cards);
    }
    let threshold = recording.info.rcm_threshold_mm;
    let within = Card::new("RCM deviation", mm(s.rcm_peak_mm), format!("at most; the threshold is {threshold} mm"));
    cards.push(within.met(s.rcm_within));
    let contact = format!(
        "contact on an instrument; pull of held tissue {} N",
        fixed(over_time::peak(s, |a| a.peak_constraint_n), 2)
    );
    cards.push(Card::new("Peak force", format!("{} N", fixed(over_time::peak(s, |a| a.peak_contact_n), 2)), contact));
    cards.push(over_time::inverted_card(s));
    cards.push(over_time::warnings_card(s));
    page::cards(&cards)
}

fn stages(s: &Summary) -> String {
    let table = Table::of(
        &s.progress.stages,
        &[
            ("Stage", &|p| p.stage.clone()),
            ("Passed", &|p| yes_or_no(p.passed)),
            ("Time (s)", &|p| or_dash(p.time_s, 2)),
            ("Share (%)", &|p| fixed(100.0 * p.share, 0)),
        ],
    );
    let lead = "Stages pass in order. Share: progress towards passing the stage.";
    page::section("Stages", lead, &table.html())
}

fn arms(recording: &Recording) -> String {
    if recording.summary.duration_s == 0.0 {
        return String::new();
    }
    let table = Table::of(
        &recording.summary.arms,
        &[
            ("Arm", &|a| a.arm.clone()),
            ("Under load (s)", &|a| fixed(a.loaded_s, 1)),
            ("RCM under load, median (mm)", &|a| or_dash(a.rcm_median_mm, 3)),
            ("95% (mm)", &|a| or_dash(a.rcm_p95_mm, 3)),
            ("Largest (mm)", &|a| or_dash(a.rcm_max_mm, 3)),
            ("Whole episode (mm)", &|a| fixed(a.rcm_peak_mm, 3)),
            ("Lag (ms)", &|a| or_dash(a.lag_ms, 0)),
            ("Contact (N)", &|a| fixed(a.peak_contact_n, 2)),
            ("Constraint (N)", &|a| fixed(a.peak_constraint_n, 2)),
            ("Jaw (N)", &|a| fixed(a.peak_jaw_n, 2)),
            ("Solids (N)", &|a| fixed(a.peak_solid_n, 2)),
            ("Tilt (\u{b0})", &|a| fixed(a.tilt_max_deg, 1)),
            ("Periods inside an organ", &|a| a.pierces.to_string()),
            ("Commands shortened", &|a| a.guarded.to_string()),
        ],
    );
    let lead = "Forces are peaks. A dash: the arm was never under load, or never without load.";
    page::section("Arms", lead, &table.html())
}

/// A band per stage, until the time at which it passed.
fn bands(s: &Summary) -> Vec<Band> {
    let mut from = 0.0;
    let mut bands = Vec::new();
    let mut stages: Vec<&StageProgress> = s.progress.stages.iter().collect();
    // Stages that pass in any order, in that in which they did.
    stages.sort_by(|a, b| a.time_s.unwrap_or(f64::INFINITY).total_cmp(&b.time_s.unwrap_or(f64::INFINITY)));
    for stage in stages {
        let to = stage.time_s.unwrap_or(s.duration_s);
        bands.push(Band { name: stage.stage.clone(), from, to });
        from = to;
        if stage.time_s.is_none() {
            break;
        }
    }
    bands
}

fn plots(recording: &Recording) -> Result<String> {
    let channels = &recording.channels;
    if channels.is_empty() {
        return Ok(String::new());
    }
    let has = |side: &str| recording.info.arms.iter().any(|arm| arm == side);
    let sides: Vec<(&str, ArmOf, usize)> = [("left", (|c| &c.left) as ArmOf, 1), ("right", |c| &c.right, 2)]
        .into_iter()
        .filter(|(name, ..)| has(name))
        .collect();
    let figure = |title: &str, y: &str, curves: &[over_time::Curve<'_>], caption: &str, limits: Vec<f64>| {
        TimePlot { title, y, curves, caption, limits }.figure(channels, bands(&recording.summary))
    };
    let both = |title: &str, y: &str, value: fn(&ArmChannels) -> f64, caption: &str, limits: Vec<f64>| {
        let of: Vec<_> = sides.iter().map(|(name, arm, color)| (*name, move |c: &_| value(arm(c)), *color)).collect();
        let curves: Vec<over_time::Curve<'_>> = of.iter().map(|(name, of, color)| (*name, of as _, *color)).collect();
        figure(title, y, &curves, caption, limits)
    };
    let task: Vec<over_time::Curve<'_>> = if recording.info.task == TaskName::PortReach {
        vec![
            ("first target", &|c| c.task.reach_1_mm, 1),
            ("second", &|c| c.task.reach_2_mm, 2),
            ("third", &|c| c.task.reach_3_mm, 4),
        ]
    } else {
        vec![("jaws", &|c| c.task.jaw_lift_mm, 1), ("tissue", &|c| c.task.lift_mm, 4), ("slip", &|c| c.task.slip_mm, 2)]
    };
    let (title, caption) = match recording.info.task {
        TaskName::PortReach => ("Distance to the targets", "largest distance of a blade tip from its target."),
        _ => {
            ("Lift", "rise of jaws and tissue since the grasp, and slip of the tissue in the jaws; 0 without a grasp.")
        }
    };
    let near = recording.summary.rcm_peak_mm > 0.5 * recording.info.rcm_threshold_mm;
    let limits = if near { vec![recording.info.rcm_threshold_mm] } else { vec![] };
    let all = [
        figure(title, "distance (mm)", &task, caption, vec![])?,
        both("Jaw", "opening (1)", |a| a.jaw, "0: closed, 1: wide open.", vec![])?,
        both("Contact force", "force (N)", ArmChannels::contact_n, "force of tissue on the instrument.", vec![])?,
        both(
            "Constraint force",
            "force (N)",
            ArmChannels::constraint_n,
            "pull of the tissue that the jaws hold.",
            vec![],
        )?,
        both(
            "RCM deviation",
            "deviation (mm)",
            |a| a.rcm_peak_mm,
            "distance of the port\u{2019}s centre from the shaft\u{2019}s axis, largest of the period; dashed: the threshold, if near.",
            limits,
        )?,
        both(
            "Tracking error",
            "distance (mm)",
            |a| a.tracking_mm,
            "distance of the tip from its command at the same time.",
            vec![],
        )?,
        figure(
            "Smallest volume ratio",
            "volume ratio (1)",
            &[("tissue", &|c| c.task.min_volume, 4)],
            "volume of the most compressed element over its volume at rest; at 0 an element is inverted.",
            vec![],
        )?,
    ];
    Ok(page::section("Over time", "Shaded: the next stage.", &page::grid(Columns::Two, &all)))
}
