//! The page of a campaign: stages, distributions, gates, pairs of policies, failures first.

use crate::funnel;
use crate::pictures;
use crate::plan::Plan;
use crate::source::PolicySpec;
use crate::store::{Kept, Store};
use crate::table::{CampaignResult, Interval, PolicyRow};
use trocar_report::colors;
use trocar_report::figures;
use trocar_report::page::{self, Card, Columns};
use trocar_report::plots::{Line, Plot};
use trocar_report::table::{self, fixed, percent};
use trocar_task::{CHANNELS_FILE, GateRange, read_channels, sweep};
use trocar_workflow::Result;

/// Failures that the page lists.
const LISTED: usize = 40;
/// Episodes of each policy whose channels the gate sweeps read, at most.
const SWEPT: usize = 60;
/// Half the size of a mark, as a share of the plot.
const MARK: f64 = 0.012;
/// Beyond this the hardware stops [mm].
const ABORT_MM: f64 = 5.0;

/// The page of a campaign: how far each policy came, on what, and how it failed.
///
/// # Errors
/// A plot that cannot be drawn, channels that cannot be read.
pub(crate) fn campaign(plan: &Plan, result: &CampaignResult, kept: &[Kept], store: &Store) -> Result<String> {
    let title = format!("{}: {}", plan.scene, plan.task);
    let failed: usize = result.policies.iter().map(|p| p.ends[4]).sum();
    let again = match failed {
        0 => String::new(),
        1 => "; in one the policy failed, and --retry-failed does it again".to_owned(),
        n => format!("; in {n} the policy failed, and --retry-failed does them again"),
    };
    let subtitle = format!("Campaign of {} episodes, seeds from {}{again}", result.episodes, plan.seed);
    Ok(page::page(&title, &subtitle, &body(plan, result, kept, store)?))
}

fn body(plan: &Plan, r: &CampaignResult, kept: &[Kept], store: &Store) -> Result<String> {
    if kept.is_empty() {
        return Ok(page::section("No episodes", "Nothing has been run yet.", ""));
    }
    let failed = failures(plan, kept, store)?;
    let lead = format!(
        "{} of {} episodes of {} by {}. Policies had the same seeds. Intervals are Wilson\u{2019}s, 95%.",
        r.episodes,
        r.planned,
        plan.task,
        r.policies.iter().map(|p| p.policy.as_str()).collect::<Vec<_>>().join(", ")
    );
    let overview = page::section("Outcome", &lead, &cards(plan, r));
    let policies = page::section("Policies", "", &outcome(r));
    let stages = page::section(
        "Stages",
        "Stages pass in their order; each counts the episodes that passed it and all before.",
        &(page::figure(
            &funnel::funnel(r),
            "<b>How far episodes came.</b> Filled: the share that passed. Whiskers: 95% intervals.",
        ) + &stage_table(r)),
    );
    let distributions = [
        lift_and_rcm(plan, kept)?,
        distribution(plan, kept, "RCM deviation", "largest RCM deviation of the episode [mm]", &|k| {
            k.summary.rcm_peak_mm
        })?,
        distribution(plan, kept, "Contact force", "peak contact force on an instrument [N]", &|k| {
            k.peak(|a| a.peak_contact_n)
        })?,
        distribution(plan, kept, "Constraint force", "peak pull of held tissue [N]", &|k| {
            k.peak(|a| a.peak_constraint_n)
        })?,
        distribution(plan, kept, "Jaw force", "peak force of tissue on the blades of a jaw [N]", &|k| {
            k.peak(|a| a.peak_jaw_n)
        })?,
        lags(plan, kept)?,
        distribution(plan, kept, "Lift", "greatest lift of held tissue [mm]", &|k| k.summary.lift_mm)?,
    ];
    let spread = page::section(
        "Distributions",
        "Share of episodes at or below a value. Contact is what tissue does to the instrument; the pull of a latched grasp is a constraint and no contact.",
        &page::grid(Columns::Two, &distributions),
    );
    let gates = page::section(
        "Gates",
        "Stored channels judged anew at other thresholds, without simulating. An episode ends when it has passed at the scene\u{2019}s gates, so a stricter gate sees no more of it than there was.",
        &page::grid(Columns::Two, &sweeps(plan, kept, store)?),
    );
    Ok(overview + &failed + &policies + &stages + &spread + &gates + &pairs(r))
}

fn color(plan: &Plan, name: &str) -> [u8; 3] {
    colors::organ(plan.policies.iter().position(|p| p.name == name).unwrap_or(0))
}

fn legend(plan: &Plan) -> String {
    page::legend(plan.policies.iter().map(|p| (p.name.as_str(), color(plan, &p.name))))
}

fn share(i: &Interval) -> String {
    format!("{} ({}\u{2013}{})", percent(i.share, 0), percent(i.low, 0), percent(i.high, 0))
}

fn or_dash(value: Option<f64>, decimals: usize) -> String {
    value.map_or("\u{2013}".to_owned(), |v| fixed(v, decimals))
}

fn cards(plan: &Plan, r: &CampaignResult) -> String {
    let mut all: Vec<Card> = Vec::new();
    if let [only] = r.policies.as_slice() {
        all.push(Card::new("Passed", format!("{} of {}", only.passed, only.episodes), share(&only.interval)));
    // Of equals the first that was named.
    } else if let Some(best) = r.policies.iter().rev().max_by(|a, b| a.mean_score.total_cmp(&b.mean_score)) {
        let note = format!("passed {} of {}", best.passed, best.episodes);
        all.push(Card::new("Best mean score", format!("{}: {}", best.policy, fixed(best.mean_score, 2)), note));
    }
    let attached: usize = r.policies.iter().map(|p| p.attached).sum();
    let held: usize = r.policies.iter().map(|p| p.held_to_end).sum();
    all.push(Card::new("Held to the end", format!("{held} of {attached}"), "of the episodes that attached the organ"));
    let within: usize = r.policies.iter().map(|p| p.rcm_within).sum();
    all.push(Card::new(
        "RCM within the threshold",
        format!("{within} of {attached}"),
        format!("{} mm, the largest of the whole episode, of the attached", plan.rcm_threshold_mm),
    ));
    let inverted = r.policies.iter().map(|p| p.inverted_peak).max().unwrap_or(0);
    let diverged: usize = r.policies.iter().map(|p| p.ends[3]).sum();
    all.push(Card::new("Inverted elements", inverted.to_string(), "at worst, in any frame").met(inverted == 0));
    all.push(Card::new("Diverged", diverged.to_string(), "episodes").met(diverged == 0));
    let suspended: usize = r.policies.iter().map(|p| p.disabled_contacts + p.disabled_blades + p.relaxed).sum();
    let note = "of physics by safety rules: contacts disabled, contacts of blades disabled, organs relaxed";
    all.push(Card::new("Suspensions", suspended.to_string(), note).met(suspended == 0));
    page::cards(&all)
}

fn outcome(r: &CampaignResult) -> String {
    let head = [
        "policy",
        "episodes",
        "passed",
        "mean score",
        "time-out",
        "RCM abort",
        "diverged",
        "policy failed",
        "attached",
        "held",
        "lift mm",
        "RCM mm, loaded median",
        "RCM mm, max",
        "lag ms",
        "jaw N",
        "grasp at s",
        "suspensions",
    ];
    let row = |p: &PolicyRow| {
        let at = p.grasp_at.map_or("\u{2013}".to_owned(), |[m, l, h]| format!("{m:.2} ({l:.2}\u{2013}{h:.2})"));
        vec![
            p.policy.clone(),
            p.episodes.to_string(),
            format!("{}, {}", p.passed, share(&p.interval)),
            fixed(p.mean_score, 2),
            p.ends[1].to_string(),
            p.ends[2].to_string(),
            p.ends[3].to_string(),
            p.ends[4].to_string(),
            p.attached.to_string(),
            p.held_to_end.to_string(),
            or_dash(p.lift_median_mm, 1),
            or_dash(p.rcm_median_mm, 3),
            or_dash(p.rcm_max_mm, 3),
            or_dash(p.lag_ms, 0),
            or_dash(p.peak_jaw_n, 2),
            at,
            p.suspensions(),
        ]
    };
    table::plain(&head, &r.policies.iter().map(row).collect::<Vec<_>>())
}

fn failures(plan: &Plan, kept: &[Kept], store: &Store) -> Result<String> {
    let failed = pictures::failures(plan, kept);
    if failed.is_empty() {
        return Ok(page::section("Failures", "There were none.", ""));
    }
    let mut films = Vec::new();
    for k in &failed {
        if let Ok(bytes) = std::fs::read(pictures::path(store, k)) {
            let [width, height] = pictures::SIZE;
            let name = format!("{} with seed {}", k.name, k.seed);
            let img = figures::img_of_bytes("webp", &bytes, width, height, &name);
            let text = format!(
                "<b>{}</b> stopped at {}: {}",
                page::escape(&name),
                page::escape(&k.summary.next),
                page::escape(&why(k))
            );
            films.push(page::figure(&img, &text));
        }
    }
    let rows: Vec<Vec<String>> = failed
        .iter()
        .take(LISTED)
        .map(|k| {
            let s = &k.summary;
            let folder = format!("episodes/{}/{:06}", k.name, k.index);
            vec![
                k.name.clone(),
                k.seed.to_string(),
                format!("{} of {}", s.stage, s.progress.stages.len()),
                s.next.clone(),
                fixed(s.score, 2),
                why(k),
                folder,
            ]
        })
        .collect();
    let lead = format!(
        "{} episodes did not pass{}; those that came least far first, the policies in turn. trocar replay FOLDER/episode.trocar does one again.",
        failed.len(),
        if failed.len() > LISTED { format!(", {LISTED} are listed") } else { String::new() }
    );
    let table = table::plain(&["policy", "seed", "stages", "stopped at", "score", "why", "folder"], &rows);
    Ok(page::section("Failures", &lead, &(page::grid(Columns::Two, &films) + &table)))
}

fn why(k: &Kept) -> String {
    let end = || k.summary.end.as_ref().map_or("no end".to_owned(), ToString::to_string);
    k.summary.why.clone().unwrap_or_else(end)
}

/// When stages passed.
fn stage_table(r: &CampaignResult) -> String {
    let Some(first) = r.policies.first() else { return String::new() };
    let head: Vec<&str> = ["median time [s]"].into_iter().chain(first.stages.iter().map(|s| s.stage)).collect();
    let row = |p: &PolicyRow| {
        let times = p.stages.iter().map(|s| or_dash(s.median_s, 2));
        [p.policy.clone()].into_iter().chain(times).collect()
    };
    table::plain(&head, &r.policies.iter().map(row).collect::<Vec<Vec<String>>>())
}

/// Fig. 6(d, e): every episode that attached the organ.
pub fn lift_and_rcm(plan: &Plan, kept: &[Kept]) -> Result<String> {
    let attached: Vec<&Kept> = kept.iter().filter(|k| k.summary.attached).collect();
    let most = |of: &dyn Fn(&Kept) -> f64| attached.iter().map(|k| of(k)).fold(1e-3, f64::max);
    let height = most(&|k| k.summary.rcm_peak_mm);
    // The x axis begins where the values do, the y axis at zero: marks are as long as they look.
    let least = attached.iter().map(|k| k.summary.lift_mm).fold(f64::INFINITY, f64::min);
    let width = (most(&|k| k.summary.lift_mm) - least).max(1.0);
    let mut lines = Vec::new();
    for k in &attached {
        let (x, y, color) = (k.summary.lift_mm, k.summary.rcm_peak_mm, color(plan, &k.name));
        let (a, b) = (MARK * width, 2.0 * MARK * height);
        lines.push(Line { points: vec![(x - a, y), (x + a, y)], color, filled: false });
        lines.push(Line { points: vec![(x, y - b), (x, y + b)], color, filled: false });
    }
    let plot = Plot {
        title: "Lift against RCM deviation",
        x: "greatest lift [mm]",
        y: "largest RCM deviation [mm]",
        lines,
        bands: vec![],
        show: vec![0.0],
        limits: if height > 0.5 * plan.rcm_threshold_mm { vec![plan.rcm_threshold_mm, ABORT_MM] } else { vec![] },
        log_x: false,
        log_y: false,
    };
    let caption = format!("<b>Lift against RCM deviation</b>, every episode that attached the organ.{}", legend(plan));
    Ok(page::figure(&plot.svg()?, &caption))
}

/// The lifts of every episode that attached the organ, as a distribution a policy.
pub fn lifts(plan: &Plan, kept: &[Kept]) -> Result<String> {
    let attached: Vec<Kept> = kept.iter().filter(|k| k.summary.attached).cloned().collect();
    distribution(plan, &attached, "Lift", "greatest lift of held tissue [mm]", &|k| k.summary.lift_mm)
}

/// Of the episodes in which an arm was off its command.
fn lags(plan: &Plan, kept: &[Kept]) -> Result<String> {
    let moved: Vec<Kept> = kept.iter().filter(|k| k.lag_ms().is_some()).cloned().collect();
    let x = "delay of the measured tip behind the commanded one [ms]";
    distribution(plan, &moved, "Tracking lag", x, &|k| k.lag_ms().unwrap_or(0.0))
}

fn distribution(plan: &Plan, kept: &[Kept], name: &str, x: &str, of: &dyn Fn(&Kept) -> f64) -> Result<String> {
    let line = |policy: &PolicySpec| {
        let mut values: Vec<f64> = kept.iter().filter(|k| k.name == policy.name).map(of).collect();
        values.sort_by(f64::total_cmp);
        let n = values.len().max(1) as f64;
        let steps = values.iter().enumerate().flat_map(|(k, v)| [(*v, k as f64 / n), (*v, (k as f64 + 1.0) / n)]);
        Line { points: steps.collect(), color: color(plan, &policy.name), filled: false }
    };
    let plot = Plot {
        title: name,
        x,
        y: "share of episodes",
        lines: plan.policies.iter().map(line).collect(),
        bands: vec![],
        show: vec![0.0, 1.0],
        limits: vec![],
        log_x: false,
        log_y: false,
    };
    Ok(page::figure(&plot.svg()?, &format!("<b>{name}.</b>{}", legend(plan))))
}

/// What is swept for a task: a gate with its range, and what it is called.
fn swept(task: &str) -> &'static [(&'static str, &'static str)] {
    match task {
        "appendix-resection" => &[
            ("lift_mm=2..16:0.5", "lift gate [mm]"),
            ("cut_closed=0.05..0.50:0.025", "jaw opening below which the cut counts"),
        ],
        "grasp-lift" => {
            &[("lift_mm=2..16:0.5", "lift gate [mm]"), ("lift_s=0.1..1.5:0.1", "time that the lift must last [s]")]
        }
        _ => &[],
    }
}

fn sweeps(plan: &Plan, kept: &[Kept], store: &Store) -> Result<Vec<String>> {
    let mut made = Vec::new();
    let mut channels = Vec::new();
    let of = |name: &str| kept.iter().filter(|k| k.name == name).count();
    let cut = plan.policies.iter().any(|p| of(&p.name) > SWEPT);
    for policy in &plan.policies {
        let own: Vec<&Kept> = kept.iter().filter(|k| k.name == policy.name).take(SWEPT).collect();
        // One that ended before its first step has no channels and passes no gate.
        let begun = own.iter().filter(|k| k.summary.duration_s > 0.0);
        let read = begun.map(|k| read_channels(&store.episode(&k.name, k.index).join(CHANNELS_FILE)));
        channels.push((own.len(), read.collect::<std::result::Result<Vec<_>, _>>()?));
    }
    for (range, x) in swept(&plan.task) {
        let range = GateRange::parse(range)?;
        let mut lines = Vec::new();
        for (policy, (taken, episodes)) in plan.policies.iter().zip(&channels).filter(|(_, (_, e))| !e.is_empty()) {
            let swept = sweep(episodes, std::slice::from_ref(&range), &mut || true)?;
            let points = swept.rows.iter().map(|r| (r.values[0], r.passed as f64 / *taken as f64));
            lines.push(Line { points: points.collect(), color: color(plan, &policy.name), filled: false });
        }
        let plot = Plot {
            title: x,
            x,
            y: "share of episodes that pass",
            lines,
            bands: vec![],
            show: vec![0.0, 1.0],
            limits: vec![],
            log_x: false,
            log_y: false,
        };
        let of = if cut { format!(" The first {SWEPT} episodes of each policy.") } else { String::new() };
        made.push(page::figure(&plot.svg()?, &format!("<b>{x}.</b>{of}{}", legend(plan))));
    }
    Ok(made)
}

fn pairs(r: &CampaignResult) -> String {
    if r.comparisons.is_empty() {
        return String::new();
    }
    let rows: Vec<Vec<String>> = r
        .comparisons
        .iter()
        .map(|c| {
            vec![
                format!("{} against {}", c.a, c.b),
                c.seeds.to_string(),
                c.only_a.to_string(),
                c.only_b.to_string(),
                if c.p < 1e-3 { "< 0.001".to_owned() } else { fixed(c.p, 3) },
                format!("{:+.2}", c.score_difference),
            ]
        })
        .collect();
    let head =
        ["policies", "seeds", "only the first passed", "only the second", "p (McNemar)", "difference of mean scores"];
    let lead = "Policies on the same seeds: what is alike in an episode cancels. p is how likely so uneven a split is by chance alone.";
    page::section("Policies in pairs", lead, &table::plain(&head, &rows))
}
