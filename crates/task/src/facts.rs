//! Figures of an episode that its channels do not have: which tissue was grasped and how, how
//! organs came to rest, what remained after a cut.

use crate::Channels;
use serde::{Deserialize, Serialize};
use trocar_cell::blades::FRICTION;
use trocar_cell::{CellEvent, Settling, Severance};
use trocar_scene::{GraspDesignName, Program, Side, Task};

/// Figures that channels do not have.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Details {
    /// The task's organ.
    pub organ: String,
    /// Name of the grasp design.
    pub design: String,
    /// Force of the grasper's jaws (N).
    pub jaw_force_n: f64,
    /// Nodes that the last grasp held; 0 for friction. `None` without any grasp, like the next six.
    pub held_nodes: Option<usize>,
    /// Gap between the blades when they closed on it (mm).
    pub gap_mm: Option<f64>,
    /// Force with which tissue pushed the blades apart then (N).
    pub closing_force_n: Option<f64>,
    /// Largest distance between where the last grasp first prescribes a node and where it was (mm).
    /// Zero by construction for designs that capture nodes where they are.
    pub snap_mm: Option<f64>,
    /// Mean of that distance over the nodes (mm).
    pub snap_mean_mm: Option<f64>,
    /// Largest motion of any node in the first frame of the last grasp (mm): what moved.
    pub activation_step_mm: Option<f64>,
    /// Mean distance of the held nodes from their places at rest when the jaws closed (mm).
    pub displaced_mm: Option<f64>,
    /// Times that held tissue began to slide through the jaws.
    pub slipped: usize,
    /// Weight of the task's organ (N).
    pub organ_weight_n: f64,
    /// Inverted elements at rest, before the first step.
    pub inverted_rest: usize,
    /// Largest motion of a pinned node (mm).
    pub pin_drift_mm: f64,
    /// How the organs came to rest before the episode.
    #[serde(flatten)]
    pub settling: Settling,
    /// The cut, where the scene parts tissue and one was made.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sever: Option<Severed>,
}

/// A cut and what became of the pieces.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Severed {
    /// The cut.
    #[serde(flatten)]
    pub cut: Severance,
    /// Time of the control period in which the blades closed (s).
    pub time_s: f64,
    /// Most inverted elements of all organs in any frame since.
    pub inverted_peak: usize,
    /// Rise of the jaws since (mm).
    pub jaw_rise_mm: f64,
    /// Rise of the tissue in the jaws since (mm).
    pub held_rise_mm: f64,
    /// The organ was cut through, and the jaws still hold their piece: it followed at least 0.80 of
    /// their rise, and slipped less than 3 mm since.
    pub held: bool,
}

/// The inputs of the details.
pub(crate) struct Facts<'a> {
    pub task: &'a Task,
    pub program: &'a Program,
    /// The arm with the first grasper.
    pub grasper: Option<Side>,
    pub jaw_force_n: f64,
    pub settling: Settling,
    pub inverted_rest: usize,
    pub pin_drift_mm: f64,
    pub organ_weight_n: f64,
    pub events: &'a [(f64, CellEvent)],
    pub rows: &'a [Channels],
    /// Name and height of the centroid (m) of every body.
    pub heights: Vec<(String, f64)>,
}

impl Facts<'_> {
    pub fn details(&self) -> Details {
        let mut details = Details {
            organ: self.task.organ.clone(),
            design: design_name(self.task.grasp).to_owned(),
            jaw_force_n: self.jaw_force_n,
            slipped: self.rows.iter().map(|c| c.task.slipped).sum::<f64>() as usize,
            organ_weight_n: self.organ_weight_n,
            inverted_rest: self.inverted_rest,
            pin_drift_mm: self.pin_drift_mm,
            settling: self.settling,
            sever: self.severed(),
            ..Details::default()
        };
        let attached =
            |(_, e): &&(f64, CellEvent)| matches!(e, CellEvent::Attached { arm, .. } if Some(*arm) == self.grasper);
        if let Some((
            time,
            CellEvent::Attached { nodes, snap_mm, snap_mean_mm, displaced_mm, gap_mm, closing_force_n, .. },
        )) = self.events.iter().rfind(attached)
        {
            details.held_nodes = Some(*nodes);
            details.snap_mm = Some(*snap_mm);
            details.snap_mean_mm = Some(*snap_mean_mm);
            details.displaced_mm = Some(*displaced_mm);
            details.gap_mm = Some(*gap_mm);
            details.closing_force_n = Some(*closing_force_n);
            // The first frame of the grasp lies in the period in which the jaws closed, or in the
            // next.
            let first = self.rows.iter().position(|c| c.time_s >= time - 1e-9).unwrap_or(self.rows.len());
            let steps = self.rows[first..].iter().take(2).map(|c| c.task.activation_step_mm);
            details.activation_step_mm = Some(steps.fold(0.0, f64::max));
        }
        details
    }

    fn severed(&self) -> Option<Severed> {
        let mut cuts = self.events.iter().filter_map(|(time, e)| match e {
            CellEvent::Cut { parted: Some(cut), .. } => Some((*time, cut)),
            _ => None,
        });
        // The first event that severed the organ; otherwise how far the blades came.
        let last = cuts.clone().next_back();
        let (time_s, cut) = cuts.find(|(_, cut)| cut.outcome == "severed").or(last)?;
        let mut cut = Severance::clone(cut);
        for piece in &mut cut.pieces {
            let now = self.heights.iter().find(|(name, _)| *name == piece.name).map(|(_, height)| *height);
            piece.rise_mm = 1e3 * (now.unwrap_or(piece.height_m) - piece.height_m);
        }
        let since: Vec<&Channels> = self.rows.iter().filter(|c| c.time_s >= time_s - 1e-9).collect();
        let mut severed = Severed { time_s, ..Severed::default() };
        severed.inverted_peak = since.iter().map(|c| c.task.inverted as usize).max().unwrap_or(0);
        if let (Some(first), Some(last)) = (since.first(), since.last()) {
            let (a, b) = (&first.task, &last.task);
            severed.jaw_rise_mm = b.jaw_lift_mm - a.jaw_lift_mm;
            severed.held_rise_mm = b.lift_mm - a.lift_mm;
            let follows =
                severed.jaw_rise_mm <= 0.0 || severed.held_rise_mm >= crate::stages::HELD_FOLLOW * severed.jaw_rise_mm;
            let slips = b.slip_mm - a.slip_mm >= crate::stages::HELD_SLIP_MM;
            severed.held = cut.outcome == "severed" && b.grasped > 0.0 && follows && !slips;
        }
        severed.cut = cut;
        Some(severed)
    }

    /// For a grasp that slipped and whose design presses, a sentence on the jaw force that would
    /// bear the organ's weight. None for designs that tie nodes, which no force of the jaws makes
    /// hold.
    pub fn advice(&self) -> Option<String> {
        let presses = matches!(self.task.grasp, GraspDesignName::Friction | GraspDesignName::Compliant);
        if !presses {
            return None;
        }
        let (force, weight, organ) = (self.jaw_force_n, self.organ_weight_n, &self.task.organ);
        let (bears, needs) = (2.0 * FRICTION * force, weight / (2.0 * FRICTION));
        Some(if needs > force {
            // Rounded up: the named force must be enough.
            let enough = (20.0 * needs).ceil() / 20.0;
            format!(
                "it slipped: the {organ} weighs {weight:.2} N and jaws of {force} N bear 2 x {FRICTION} x {force} = {bears:.2} N; \
                 --jaw-force {enough:.2} or more bears its weight (and what its pins pull comes on top)"
            )
        } else {
            format!(
                "it slipped: jaws of {force} N bear 2 x {FRICTION} x {force} = {bears:.2} N, more than the {organ}'s weight of \
                 {weight:.2} N, so its pins hold it back; lift less, grasp farther from the pins, or raise --jaw-force"
            )
        })
    }
}

fn design_name(design: GraspDesignName) -> &'static str {
    match design {
        GraspDesignName::Friction => "friction",
        GraspDesignName::RestPose => "rest-pose",
        GraspDesignName::LivePose => "live-pose",
        GraspDesignName::Compliant => "compliant",
    }
}
