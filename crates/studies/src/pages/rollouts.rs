//! The page of the rollouts, beside the paper's Fig. 6(d, e).

use crate::Result;
use crate::experiment::RolloutsResult;
use trocar_campaign::{Kept, Plan, PolicyRow};
use trocar_campaign::{lift_and_rcm, lifts};
use trocar_report::page::{self, Card, Columns};
use trocar_report::table::{self, count, fixed};

pub(super) fn body(plan: &Plan, r: &RolloutsResult, kept: &[Kept]) -> Result<String> {
    let lead = format!(
        "{} rollouts of {} by {} controllers, seeds from {}. The paper\u{2019}s 140 are of its own six; counts compare by their shares of what attached.",
        r.rollouts,
        page::escape(&r.scene),
        plan.policies.len(),
        plan.seed
    );
    let cards = page::cards(&[
        Card::new("Held to the end", format!("{} of {}", r.held_to_end, r.attached), "of the attached; paper 83 of 84")
            .met(r.held_to_end == r.attached),
        Card::new("Diverged", count(r.diverged), "of all rollouts").met(r.diverged == 0),
        Card::new("Inverted elements", count(r.inverted_peak), "at worst, in any frame").met(r.inverted_peak == 0),
        Card::new("Passed", format!("{} of {}", r.passed, r.rollouts), "all stages"),
        Card::new(
            "Suspensions",
            super::grasp_designs::suspensions(&r.suspensions),
            "of physics: contacts disabled / contacts of blades disabled / organs relaxed",
        )
        .met(r.suspensions == [0; 3]),
    ]);
    let plots = [lift_and_rcm(plan, kept)?, lifts(plan, kept)?];
    Ok(page::section("Outcome", &lead, &(cards + &beside_paper(r)))
        + &page::section(
            "Lift and RCM deviation",
            "Every rollout that attached the organ.",
            &page::grid(Columns::Two, &plots),
        )
        + &page::section("Controllers", "", &controllers(&r.by_policy)))
}

fn or_dash(value: Option<f64>, decimals: usize) -> String {
    value.map_or("\u{2013}".to_owned(), |v| fixed(v, decimals))
}

fn beside_paper(r: &RolloutsResult) -> String {
    let p = &r.paper;
    let of = |n: usize, all: usize| format!("{n} of {all}");
    let row = |what: &str, here: String, paper: String| vec![what.to_owned(), here, paper];
    let rows = [
        row("Attached", of(r.attached, r.rollouts), of(p.attached, p.rollouts)),
        row("Held to the end", of(r.held_to_end, r.attached), of(p.held_to_end, p.attached)),
        row("Lift, median [mm]", or_dash(r.lift_median_mm, 1), fixed(p.lift_median_mm, 1)),
        row("Peak RCM deviation, median [mm]", or_dash(r.rcm_peak_median_mm, 3), fixed(p.rcm_peak_median_mm, 2)),
        row("RCM deviation under load, median of medians [mm]", or_dash(r.rcm_loaded_median_mm, 4), or_dash(None, 0)),
        row("RCM within 3 mm", of(r.rcm_within_3_mm, r.attached), of(p.rcm_within_3_mm, p.attached)),
        row("RCM within 5 mm", of(r.rcm_within_5_mm, r.attached), of(p.rcm_within_5_mm, p.attached)),
    ];
    table::plain(&["", "here", "paper"], &rows)
}

fn controllers(rows: &[PolicyRow]) -> String {
    let head = [
        "controller",
        "rollouts",
        "passed",
        "attached",
        "held",
        "lift mm",
        "RCM mm, loaded median",
        "RCM mm, max",
        "diverged",
    ];
    let row = |p: &PolicyRow| {
        vec![
            p.policy.clone(),
            count(p.episodes),
            count(p.passed),
            count(p.attached),
            count(p.held_to_end),
            or_dash(p.lift_median_mm, 1),
            or_dash(p.rcm_median_mm, 4),
            or_dash(p.rcm_max_mm, 3),
            count(p.ends[3]),
        ]
    };
    table::plain(&head, &rows.iter().map(row).collect::<Vec<_>>())
}
