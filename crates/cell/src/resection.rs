//! The second instrument of a grasp-lift: it comes to the lifted organ between the grasp and what holds the organ, and parts it there.

use crate::hold::Hold;
use crate::jaw::Jaw;
use crate::measure::{HELD_FOLLOW_RATIO, HELD_SLIP_MM};
use crate::session::smoothstep;
use crate::{Cluster, CutOrgan, Error, Gripper, MAX_ANGLE, Mouth, Phase, Result, Scissors, SeverAt, Severance};
use crate::{SeveredPiece, World};
use glam::DVec3;
use std::time::Instant;
use trocar_core::Pose;
use trocar_geometry::TetMesh;
use trocar_tissue::StepReport;

/// How far the jaws rise after a cut [m].
pub(crate) const CARRY: f64 = 0.010;

/// How far behind its place the cutter sets out, and where it withdraws to [m].
const BACK: f64 = 0.060;

/// Least room between the tissue in the jaws and the cut [m]: half of the grasper's blades stands out beside that tissue's middle, and a cutter's edge beside them.
const LEAST_ROOM: f64 = 0.003;

/// With pins on both sides of the grasp there is no end to cut off; the cut is then this far from the grasp [m].
const BESIDE: f64 = 0.008;

/// The organ's middle and direction at the cut are those of its nodes this far to either side [m], or this many median edges.
const SECTION: f64 = 0.004;
const SECTION_EDGES: f64 = 1.5;

/// A cutter on its way, and what it has done.
pub(crate) struct Resection {
    organ: usize,
    /// Where the cutter closes.
    place: Pose,
    gripper: Gripper,
    jaw: Jaw,
    scissors: Scissors,
    cut: Option<CutOrgan>,
    /// When the blades had closed: height of the jaws and of each piece's centroid along `up` [m], and where the held tissue was in the jaws.
    jaw_height: f64,
    heights: Vec<f64>,
    held_height: f64,
    held_in_jaw: DVec3,
    through: bool,
    result: Severance,
}

impl Resection {
    /// Decides where the organ whose tissue is in `hold` is cut, `reach` [m] being how far jaws from above reach into it.
    ///
    /// # Errors
    /// When there is no room between the tissue in the jaws and what holds the organ.
    pub fn plan(world: &World, hold: &Hold, at: SeverAt, reach: f64) -> Result<Self> {
        let (organ, held) = hold.tissue();
        let s = match at {
            SeverAt::S(s) => s,
            SeverAt::Between => between(world, organ, held)?,
        };
        let (body, axis) = (&world.model.bodies()[organ], &world.axes[organ]);
        let half = SECTION.max(SECTION_EDGES * body.median_edge()) / axis.length;
        // Middle of the nodes around an organ coordinate, and the mean of theirs.
        let middle_of = |s: f64| {
            let near = |i: &u32| (axis.s[*i as usize] - s).abs() <= half;
            let nodes: Vec<u32> = (0..body.len() as u32).filter(near).collect();
            let mean = nodes.iter().map(|i| axis.s[*i as usize]).sum::<f64>() / nodes.len() as f64;
            let section = Cluster { s, nodes, clear: true };
            // A coarse organ may have no node there; its axis has a point everywhere, though at rest.
            if section.nodes.is_empty() {
                return (axis.point_at(s), s);
            }
            (section.within_reach(world, organ, reach).centroid(world, organ), mean)
        };
        let (middle, mean) = middle_of(s);
        let ends = [(s - half).max(0.0), (s + half).min(1.0)].map(|s| middle_of(s).0);
        let along = (ends[1] - ends[0]).try_normalize().unwrap_or_else(|| world.up.any_orthonormal_vector());
        // Next to an end the nodes lie to one side of the cut.
        let point = middle + (s - mean) * axis.length * along;
        // Square to the organ, so that the cut is short; from above as far as that goes.
        let back = (world.up - world.up.dot(along) * along).try_normalize();
        let back = back.unwrap_or_else(|| along.any_orthonormal_vector());
        let place = Gripper::over(point, back, along, MAX_ANGLE).pose;
        let result = Severance {
            outcome: "not closed",
            said: "the run ended before the cutter's blades had closed".to_owned(),
            aimed_at: s,
            ..Severance::default()
        };
        let mut resection = Self {
            organ,
            place,
            gripper: Gripper { pose: place, jaw_angle: MAX_ANGLE },
            jaw: Jaw::new(0.0),
            scissors: Scissors::default(),
            cut: None,
            jaw_height: 0.0,
            heights: Vec::new(),
            held_height: 0.0,
            held_in_jaw: DVec3::ZERO,
            through: false,
            result,
        };
        resection.gripper = resection.at(Phase::Reach, 0.0);
        Ok(resection)
    }

    /// The cutter now.
    pub fn cutter(&self) -> Gripper {
        self.gripper
    }

    /// The organ in its pieces, if it has been cut.
    pub fn cut(&self) -> Option<&CutOrgan> {
        self.cut.as_ref()
    }

    /// Whether the tissue in the jaws has come loose from everything that is pinned.
    pub fn freed(&self) -> bool {
        self.through && self.result.pieces.iter().any(|piece| piece.held > 0 && piece.pinned == 0)
    }

    /// The cutter's course through a phase; `share` runs from 0 to 1.
    fn at(&mut self, phase: Phase, share: f64) -> Gripper {
        let behind = match phase {
            Phase::Reach => BACK * (1.0 - smoothstep(share)),
            Phase::Snip => 0.0,
            Phase::Carry => BACK * smoothstep(share),
            _ => BACK,
        };
        let mut pose = self.place;
        pose.translation -= behind * (pose.rotation * DVec3::X);
        let to = if phase == Phase::Reach { MAX_ANGLE } else { 0.0 };
        Gripper { pose, jaw_angle: self.jaw.turn_to(self.gripper.jaw_angle, to) }
    }

    /// Moves the cutter to where it is when `share` of the phase is over; its blades cut when they close. `hold` goes on with the piece it holds.
    ///
    /// # Errors
    /// Pieces that cannot be stepped.
    pub fn advance(
        &mut self,
        world: &mut World,
        hold: &mut Hold,
        jaws: &Pose,
        phase: Phase,
        share: f64,
        time: f64,
    ) -> Result<()> {
        self.gripper = self.at(phase, share);
        if let Some(open) = self.scissors.follow(&self.gripper) {
            self.result.time_s = time;
            (self.result.opened_rad, self.result.closed_rad) = (open.jaw_angle, self.gripper.jaw_angle);
            self.close(world, hold, jaws, &open)?;
        }
        Ok(())
    }

    /// The blades have closed from where they are in `open`.
    fn close(&mut self, world: &mut World, hold: &mut Hold, jaws: &Pose, open: &Gripper) -> Result<()> {
        let organ = self.organ;
        let before = TetMesh {
            vertices: world.state.positions(&world.model, organ),
            tets: world.model.bodies()[organ].tets().to_vec(),
        };
        let s = world.axes[organ].s.clone();
        let was = hold.now(world);
        let between = Mouth::of(open).tissue_of(world, organ);
        let r = &mut self.result;
        r.between_blades_mm3 = between.map_or(0.0, |tissue| 1e9 * tissue.volume);
        r.volume_before_mm3 = 1e9 * before.volume();
        (r.volume_after_mm3, r.inverted_before) = (r.volume_before_mm3, before.inverted());
        r.inverted_after = r.inverted_before;
        let clock = Instant::now();
        let pieces = world.sever(&open.cut(organ))?;
        r.cut_ms = 1e3 * clock.elapsed().as_secs_f64();
        let name = world.model.bodies()[organ].name().to_owned();
        if pieces.is_empty() {
            r.outcome = "no tissue";
            let why = if r.between_blades_mm3 > 0.0 {
                "too little of it lies beyond them"
            } else {
                "they met no tissue of it"
            };
            r.said = format!("the blades closed at s = {:.2} of the {name} and nothing was cut: {why}", r.aimed_at);
            return Ok(());
        }
        hold.follow(world, &pieces, jaws, was);
        let cut = CutOrgan::new(organ, &before.tets, &pieces, world);
        let after = TetMesh { vertices: cut.positions(world), tets: cut.tets.clone() };
        let area = |face: &[u32; 3]| {
            let [a, b, c] = face.map(|i| after.vertices[i as usize]);
            0.5 * (b - a).cross(c - a).length()
        };
        r.faces = cut.faces.len() / 2;
        r.area_mm2 = 0.5e6 * cut.faces.iter().map(area).sum::<f64>();
        r.copies = cut.parents.len() - before.vertices.len();
        let mut copies = vec![0; before.vertices.len()];
        cut.parents.iter().for_each(|i| copies[*i as usize] += 1);
        // A lone face that opens inside leaves its nodes whole.
        let mut split: Vec<f64> = (0..copies.len()).filter(|i| copies[*i] > 1).map(|i| s[i]).collect();
        if split.is_empty() {
            split = cut.faces.iter().flatten().map(|i| s[cut.parents[*i as usize] as usize]).collect();
        }
        r.at = split.iter().sum::<f64>() / split.len().max(1) as f64;
        r.at_least = split.iter().copied().fold(1.0, f64::min);
        r.at_most = split.iter().copied().fold(0.0, f64::max);
        (r.volume_after_mm3, r.inverted_after) = (1e9 * after.volume(), after.inverted());
        r.volume_error = (r.volume_after_mm3 / r.volume_before_mm3 - 1.0).abs();
        let (holder, held) = hold.tissue();
        for piece in &pieces {
            let body = &world.model.bodies()[piece.body];
            let volume =
                |mesh: &TetMesh| 1e9 * piece.elements.iter().map(|t| mesh.tet_volume(*t as usize)).sum::<f64>();
            let along = || piece.nodes.iter().map(|i| s[*i as usize]);
            r.pieces.push(SeveredPiece {
                name: body.name().to_owned(),
                nodes: body.len(),
                elements: body.tets().len(),
                pinned: body.pinned().iter().filter(|p| **p).count(),
                held: if piece.body == holder { held.len() } else { 0 },
                s_from: along().fold(1.0, f64::min),
                s_to: along().fold(0.0, f64::max),
                volume_before_mm3: volume(&before),
                volume_after_mm3: volume(&after),
                rise_mm: 0.0,
            });
        }
        let end = |best: fn(&f64, &f64) -> bool| {
            (0..s.len()).fold(0, |found, i| if best(&s[i], &s[found]) { i } else { found }) as u32
        };
        self.through = cut.parts(end(|a, b| a < b), end(|a, b| a > b));
        (r.outcome, r.said) = said(&name, r, self.through);
        self.cut = Some(cut);
        self.start_counting(world, hold, jaws);
        Ok(())
    }

    /// From here on rise and slip are counted.
    fn start_counting(&mut self, world: &World, hold: &Hold, jaws: &Pose) {
        self.jaw_height = jaws.translation.dot(world.up);
        self.held_height = hold.now(world).dot(world.up);
        self.held_in_jaw = jaws.inverse().transform(hold.now(world));
        self.heights = self.pieces_heights(world);
    }

    /// Heights of the pieces' centroids along `up` [m].
    fn pieces_heights(&self, world: &World) -> Vec<f64> {
        let Some(cut) = &self.cut else { return Vec::new() };
        let mut sums = vec![(0.0, 0.0); self.result.pieces.len()];
        for (x, piece) in cut.positions(world).iter().zip(&cut.piece) {
            let sum: &mut (f64, f64) = &mut sums[*piece as usize];
            *sum = (sum.0 + x.dot(world.up), sum.1 + 1.0);
        }
        sums.iter().map(|(sum, count)| sum / count).collect()
    }

    /// What has become of the pieces, after a frame.
    pub fn measure(&mut self, world: &World, hold: &Hold, jaws: &Pose, report: &StepReport) {
        if self.cut.is_none() {
            return;
        }
        let heights = self.pieces_heights(world);
        let r = &mut self.result;
        for (piece, (now, then)) in r.pieces.iter_mut().zip(heights.iter().zip(&self.heights)) {
            piece.rise_mm = 1e3 * (now - then);
        }
        r.inverted_peak = r.inverted_peak.max(report.inverted);
        r.jaw_rise_mm = 1e3 * (jaws.translation.dot(world.up) - self.jaw_height);
        r.held_rise_mm = 1e3 * (hold.now(world).dot(world.up) - self.held_height);
        let slip = 1e3 * jaws.inverse().transform(hold.now(world)).distance(self.held_in_jaw);
        let follows = r.jaw_rise_mm <= 0.0 || r.held_rise_mm >= HELD_FOLLOW_RATIO * r.jaw_rise_mm;
        r.held = self.through && follows && slip < HELD_SLIP_MM;
    }

    /// The cut in figures and the organ in its pieces.
    pub fn finish(self) -> (Severance, Option<CutOrgan>) {
        (self.result, self.cut)
    }
}

/// The organ coordinate half way between the tissue `held` of organ `organ` and the part of it that is pinned.
fn between(world: &World, organ: usize, held: &[u32]) -> Result<f64> {
    let (body, axis) = (&world.model.bodies()[organ], &world.axes[organ]);
    let of = |i: usize| axis.s[i];
    let held: Vec<f64> = held.iter().map(|i| of(*i as usize)).collect();
    let pins: Vec<f64> = (0..body.len()).filter(|i| body.pinned()[*i]).map(of).collect();
    place(&held, &pins, axis.length).map_err(|room| {
        Error::Option(format!(
            "no room to cut the {} between the grasp at s = {:.2} and what holds it: {:.1} mm, and {:.0} are needed; grasp farther away with --at, or say where to cut with --sever=S",
            body.name(),
            mean(&held),
            1e3 * room,
            1e3 * LEAST_ROOM
        ))
    })
}

/// The same for organ coordinates of held and pinned nodes and the organ's length [m]; the room there is [m] where that is too little.
fn place(held: &[f64], pins: &[f64], length: f64) -> std::result::Result<f64, f64> {
    let middle = mean(held);
    let towards_base = pins.iter().filter(|s| **s < middle).count();
    let towards_tip = pins.iter().filter(|s| **s > middle).count();
    let to_base = towards_base >= towards_tip;
    // Counted from the grasp towards what holds the organ [m].
    let along = |s: f64| if to_base { middle - s } else { s - middle } * length;
    let grasp_ends = held.iter().map(|s| along(*s)).fold(0.0, f64::max);
    let end = along(if to_base { 0.0 } else { 1.0 });
    let (room_ends, wanted) = if towards_base == 0 || towards_tip == 0 {
        let pin = pins.iter().map(|s| along(*s)).filter(|d| *d > 0.0).fold(end, f64::min);
        (pin, 0.5 * (grasp_ends + pin))
    } else {
        (end, grasp_ends + LEAST_ROOM + BESIDE)
    };
    if grasp_ends + LEAST_ROOM > room_ends {
        return Err((room_ends - grasp_ends).max(0.0));
    }
    let at = wanted.clamp(grasp_ends + LEAST_ROOM, room_ends) / length;
    Ok((middle + if to_base { -at } else { at }).clamp(0.0, 1.0))
}

/// The mean; 0 of nothing.
fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

/// Name of the outcome, and a sentence of it.
fn said(name: &str, r: &Severance, through: bool) -> (&'static str, String) {
    let area = format!("{} faces, {:.0} mm2", r.faces, r.area_mm2);
    if !through {
        let loose = match r.pieces.len() {
            1 => "it is still one piece".to_owned(),
            n => format!("its ends are still joined, though {} came loose", if n == 2 { "a bit" } else { "some bits" }),
        };
        let text = format!("the blades closed at s = {:.2} and cut the {name} in part ({area}): {loose}", r.at);
        return ("cut in part", text);
    }
    let pinned = r.pieces.iter().filter(|p| p.pinned > 0).count();
    let hangs = if pinned > 1 { "; both sides are pinned" } else { "" };
    let text = format!(
        "the blades closed at s = {:.2} and parted the {name} into {} pieces ({area}){hangs}",
        r.at,
        r.pieces.len()
    );
    ("severed", text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_cut_lies_between_the_grasp_and_what_holds_the_organ() {
        let held = [0.65, 0.75];
        let near = |found: std::result::Result<f64, f64>, right: f64| found.is_ok_and(|s| (s - right).abs() < 1e-9);
        // 100 mm long; half way to the nearest pin on the one side that has any.
        assert!(near(place(&held, &[0.1, 0.45], 0.1), 0.55));
        assert!(near(place(&held, &[0.95], 0.1), 0.85));
        assert!(near(place(&held, &[], 0.1), 0.325), "unpinned, on its base's side");
        // Pinned on both sides: 11 mm from the tissue in the jaws, or at the end.
        assert!(near(place(&held, &[0.1, 0.5, 0.6, 0.9], 0.1), 0.54));
        assert!(near(place(&[0.04, 0.06], &[0.02, 0.03, 0.9], 0.1), 0.0));
        // 2 mm of room are too few.
        assert!(place(&held, &[0.63], 0.1).is_err_and(|room| (room - 0.002).abs() < 1e-9));
        assert!(near(place(&held, &[0.61], 0.1), 0.62), "3 mm from the grasp at least");
    }
}
