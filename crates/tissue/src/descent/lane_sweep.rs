//! The sweep of stable neo-Hookean tissue, sixteen vertices at once.
//!
//! The block at a vertex is V0 (mu |m|^2 I + psi'' g g'), g being the gradient of the volume ratio.
//! The first part is a constant Laplacian along the edges. The second needs the area vector A of
//! the face opposite the vertex in each element, g = A / (6 V0); a strip ([`crate::body::strip`])
//! yields a face with each point that is read. Rare parts (elements below a quarter of their
//! volume, contacts) are added lane by lane.

use super::kernel::{Local, VolumeTerm};
use super::vertex_step::Substep;
use crate::body::groups::{Group, Groups};
use crate::inversion_guard::{KEPT_SHARE, MIN_SQUARED_LENGTH, MIN_VOLUME_RATIO, allowed_share};
use crate::lanes::{add, cross, dot, scale, sub};
use crate::registers::{
    BLOCK, Block, Mask, Reg, Reg3, bits, lanes, load, load3, part_of, parts, rows, signed, splat, store, store3, width,
};
use fearless_simd::{ExtractToken, Select, Simd, SimdBase, SimdMask, dispatch};
use glam::{Mat3A, Vec3A};
use rayon::prelude::*;

/// Longest strip that is swept in lanes. Groups with longer ones are swept vertex by vertex.
const MAX_STRIP_STEPS: usize = 64;

/// Groups a task. A colour of fewer than two tasks is swept by one thread.
const GROUPS_PER_TASK: usize = 16;

/// A body's sweep.
pub(crate) struct LaneSweep<'a> {
    pub substep: &'a Substep<'a>,
    pub groups: &'a Groups,
    pub term: &'a VolumeTerm,
}

/// Area vectors and volume ratios of a group, kept between the force and the guard; its sums, and
/// the new positions of its vertices.
struct Memory {
    faces: [Face; MAX_STRIP_STEPS],
    /// Forces and blocks, as in [`Sums`]. They are in memory and not in registers during calls.
    sums: [Block<f32>; 9],
    to: [Block<f32>; 3],
}

#[derive(Clone, Copy)]
struct Face {
    area: [Block<f32>; 3],
    ratio: Block<f32>,
}

impl Memory {
    fn new() -> Self {
        let zero = Block([0.0; BLOCK]);
        Self { faces: [Face { area: [zero; 3], ratio: zero }; MAX_STRIP_STEPS], sums: [zero; 9], to: [zero; 3] }
    }
}

impl Memory {
    /// Moves the active lanes' vertices.
    #[inline(always)]
    fn write(&self, active: u16, x: &mut [Vec3A]) {
        let [a, b, c] = &self.to;
        for (lane, x) in x.iter_mut().enumerate().take(BLOCK) {
            if active >> lane & 1 == 1 {
                *x = Vec3A::new(a.0[lane], b.0[lane], c.0[lane]);
            }
        }
    }
}

/// Forces and blocks of lanes: xx, xy, xz, yy, yz, zz.
#[derive(Clone, Copy)]
struct Sums<S: Simd> {
    force: Reg3<S>,
    block: [Reg<S>; 6],
}

impl<S: Simd> Sums<S> {
    /// force -= k d
    #[inline(always)]
    fn pull(&mut self, k: Reg<S>, d: Reg3<S>) {
        self.force = [self.force[0] - k * d[0], self.force[1] - k * d[1], self.force[2] - k * d[2]];
    }

    /// block += k d d'
    #[inline(always)]
    fn add_outer(&mut self, k: Reg<S>, d: Reg3<S>) {
        let kd = scale(d, k);
        let b = self.block;
        self.block = [
            b[0] + kd[0] * d[0],
            b[1] + kd[0] * d[1],
            b[2] + kd[0] * d[2],
            b[3] + kd[1] * d[1],
            b[4] + kd[1] * d[2],
            b[5] + kd[2] * d[2],
        ];
    }

    /// The Newton step: the block's inverse times the force.
    #[inline(always)]
    fn solve(&self, simd: S) -> Reg3<S> {
        let [xx, xy, xz, yy, yz, zz] = self.block;
        let (a, b, c) = ([xx, xy, xz], [xy, yy, yz], [xz, yz, zz]);
        let (bc, ca, ab) = (cross(b, c), cross(c, a), cross(a, b));
        let inverse = splat(simd, 1.0) / dot(a, bc);
        let f = scale(self.force, inverse);
        [dot(bc, f), dot(ca, f), dot(ab, f)]
    }

    /// Loads the sums of a part.
    #[inline(always)]
    fn load(simd: S, from: &[Block<f32>; 9], part: usize) -> Self {
        let mut sums = Self { force: [splat(simd, 0.0); 3], block: [splat(simd, 0.0); 6] };
        for c in 0..3 {
            sums.force[c] = load(simd, &from[c], part);
        }
        for c in 0..6 {
            sums.block[c] = load(simd, &from[3 + c], part);
        }
        sums
    }

    /// Stores the sums of a part.
    #[inline(always)]
    fn store(&self, to: &mut [Block<f32>; 9], part: usize) {
        for c in 0..3 {
            store::<S>(self.force[c], &mut to[c], part);
        }
        for c in 0..6 {
            store::<S>(self.block[c], &mut to[3 + c], part);
        }
    }
}

impl LaneSweep<'_> {
    /// Sweeps over all colours once; `moved` is scratch.
    pub fn sweep(&self, x: &mut [Vec3A], moved: &mut [Vec3A]) {
        assert!(x.len() == self.groups.points() && self.substep.start.len() == x.len());
        assert!(self.substep.predictor.len() == x.len());
        let level = self.substep.isa.level();
        if self.substep.single_thread || self.groups.colors().all(|groups| groups.len() < 2 * GROUPS_PER_TASK) {
            dispatch!(level, simd => self.in_place(simd, self.groups.all(), x));
            return;
        }
        for groups in self.groups.colors() {
            if groups.len() < 2 * GROUPS_PER_TASK {
                dispatch!(level, simd => self.in_place(simd, groups, x));
                continue;
            }
            let (first, last) = (groups[0].first as usize, &groups[groups.len() - 1]);
            let end = (last.first + last.count) as usize;
            let (all, chunks) = (&*x, groups.par_chunks(GROUPS_PER_TASK));
            // All groups of a colour but the last are full.
            moved[first..end].par_chunks_mut(GROUPS_PER_TASK * BLOCK).zip(chunks).for_each(|(moved, groups)| {
                dispatch!(level, simd => self.apart(simd, groups, all, moved));
            });
            x[first..end].copy_from_slice(&moved[first..end]);
        }
    }

    /// Sweeps groups one after the other, in place.
    #[inline(always)]
    fn in_place<S: Simd>(&self, simd: S, groups: &[Group], x: &mut [Vec3A]) {
        let mut memory = Memory::new();
        for group in groups {
            let active = self.relax(simd, group, x, &mut memory);
            let first = group.first as usize;
            memory.write(active, &mut x[first..first + group.count as usize]);
        }
    }

    /// Computes where the vertices of the groups of one colour go, from the positions of all; the
    /// first group's vertices come first.
    #[inline(always)]
    fn apart<S: Simd>(&self, simd: S, groups: &[Group], x: &[Vec3A], moved: &mut [Vec3A]) {
        let mut memory = Memory::new();
        let base = groups.first().map_or(0, |group| group.first);
        for group in groups {
            let active = self.relax(simd, group, x, &mut memory);
            let (first, at) = (group.first as usize, (group.first - base) as usize);
            let moved = &mut moved[at..at + group.count as usize];
            moved.copy_from_slice(&x[first..first + group.count as usize]);
            memory.write(active, moved);
        }
    }

    /// Computes where the vertices of a group go. Returns the lanes that move.
    #[inline(always)]
    fn relax<S: Simd>(&self, simd: S, group: &Group, x: &[Vec3A], memory: &mut Memory) -> u16 {
        let active = group.active(self.substep.fixed);
        // There are points; callees need not check.
        if active == 0 || x.is_empty() || self.substep.start.is_empty() || self.substep.predictor.is_empty() {
            return 0;
        }
        if self.groups.steps_of(group).len() > MAX_STRIP_STEPS {
            for lane in (0..BLOCK).filter(|lane| active >> lane & 1 == 1) {
                let to = self.substep.relax(self.term, group.first as usize + lane, x).to_array();
                memory.to.iter_mut().zip(to).for_each(|(block, value)| block.0[lane] = value);
            }
            return active;
        }
        for part in 0..parts::<S>() {
            if part_of::<S>(active, part) != 0 {
                if self.groups.damping_of(group).is_empty() {
                    self.relax_part::<S, false>(simd, group, part, active, x, memory);
                } else {
                    self.relax_part::<S, true>(simd, group, part, active, x, memory);
                }
            }
        }
        active
    }

    /// Adds the dashpot along the edge to a step's point, which is at `d` from the vertex and was
    /// at `before`.
    #[inline(always)]
    fn add_dashpot<S: Simd>(&self, damping: Reg<S>, before: Reg3<S>, d: Reg3<S>, sums: &mut Sums<S>) {
        let (simd, h) = (damping.token(), self.substep.h);
        let length = dot(before, before).max(splat(simd, MIN_SQUARED_LENGTH));
        let stiffness = damping * splat(simd, 1.0 / h) / length;
        let shortening = (dot(before, before) - dot(d, d)) * splat(simd, 0.5);
        sums.pull(stiffness * shortening, d);
        sums.add_outer(stiffness, d);
    }

    #[inline(always)]
    fn relax_part<S: Simd, const VISCOUS: bool>(
        &self,
        simd: S,
        group: &Group,
        part: usize,
        active: u16,
        x: &[Vec3A],
        memory: &mut Memory,
    ) {
        let h = self.substep.h;
        let here = rows(simd, x, &group.own, part);
        let inertia = load(simd, &group.mass, part) * splat(simd, 1.0 / (h * h));
        let zero = splat(simd, 0.0);
        let diagonal = inertia + load(simd, &group.laplacian, part);
        let pulled = sub(rows(simd, self.substep.predictor, &group.own, part), here);
        let mut sums: Sums<S> =
            Sums { force: scale(pulled, inertia), block: [diagonal, zero, zero, diagonal, zero, diagonal] };
        let (sixth, plain) = (splat(simd, self.term.lambda / 6.0), splat(simd, VolumeTerm::MIN_PLAIN_RATIO));
        let pressure = splat(simd, self.term.lambda * self.term.alpha / 6.0);
        let steps = self.groups.steps_of(group);
        let drops = &self.groups.drops_of(group)[..steps.len()];
        let faces = &mut memory.faces[..steps.len()];
        let (start, damping) = (self.substep.start, self.groups.damping_of(group));
        let began = if VISCOUS { rows(simd, start, &group.own, part) } else { [zero; 3] };
        // The window, relative to the vertex. It takes two points to fill it.
        let (mut p, mut q, mut r) = ([zero; 3], [zero; 3], [zero; 3]);
        for k in 0..2.min(steps.len()) {
            let step = &steps[k];
            (p, q, r) = (q, r, sub(rows(simd, x, &step.to, part), here));
            sums.pull(load(simd, &step.edge, part), r);
            if VISCOUS {
                let before = sub(rows(simd, start, &step.to, part), began);
                self.add_dashpot(load(simd, &damping[k], part), before, r, &mut sums);
            }
        }
        let mut low = Mask::<S>::splat(simd, false);
        for k in 2..steps.len() {
            let (step, drop, face) = (&steps[k], drops[k], &mut faces[k]);
            let d = sub(rows(simd, x, &step.to, part), here);
            sums.pull(load(simd, &step.edge, part), d);
            if VISCOUS {
                let before = sub(rows(simd, start, &step.to, part), began);
                self.add_dashpot(load(simd, &damping[k], part), before, d, &mut sums);
            }
            let drop = lanes(simd, part_of::<S>(drop, part));
            p = [drop.select(q[0], p[0]), drop.select(q[1], p[1]), drop.select(q[2], p[2])];
            (q, r) = (r, d);
            let area = cross(sub(q, p), sub(r, p));
            let six_v = zero - dot(area, p);
            let inverse = load(simd, &step.inverse_6v, part);
            let ratio = inverse * six_v;
            // V0 psi'' = |inverse| lambda / 6 on A, and V0 psi' = lambda / 6 (|inverse| 6V - alpha
            // sign).
            let stiffness = inverse.abs() * sixth;
            sums.pull(stiffness * six_v - signed(simd, pressure, inverse), area);
            sums.add_outer(stiffness, area);
            low |= ratio.simd_lt(plain) & !inverse.simd_eq(zero);
            store3::<S>(area, &mut face.area, part);
            store::<S>(ratio, &mut face.ratio, part);
        }
        sums.store(&mut memory.sums, part);
        let low = bits::<S>(low) & part_of::<S>(active, part);
        let pressed = part_of::<S>(active & self.pressed(group, x), part);
        if (low | pressed) != 0 {
            self.add_rare(group, (low | pressed) << (part * width::<S>()), x, memory);
        }
        let step = Sums::load(simd, &memory.sums, part).solve(simd);
        let to = self.guarded(simd, group, part, step, memory);
        let to = add(here, to);
        store3::<S>(to, &mut memory.to, part);
    }

    /// Vertices of a group that are in contact or in tissue that is stretched far.
    #[inline(always)]
    fn pressed(&self, group: &Group, x: &[Vec3A]) -> u16 {
        let (Substep { contacts, stretched, .. }, first) = (self.substep, group.first as usize);
        if !contacts.any(first..first + group.count as usize) && stretched.is_empty() {
            return 0;
        }
        let pressed = |i: usize| contacts.of(i).any(|contact| contact.push(x[i]).is_some()) || stretched.any(i);
        (0..group.count as usize).fold(0, |lanes, lane| lanes | u16::from(pressed(first + lane)) << lane)
    }

    /// Adds the parts that the plain sums lack in some lanes.
    #[cold]
    #[inline(never)]
    fn add_rare(&self, group: &Group, rare: u16, x: &[Vec3A], memory: &mut Memory) {
        for lane in (0..BLOCK).filter(|lane| rare >> lane & 1 == 1) {
            let [fx, fy, fz, xx, xy, xz, yy, yz, zz] = memory.sums.each_ref().map(|block| block.0[lane]);
            let mut local = Local {
                force: Vec3A::new(fx, fy, fz),
                block: Mat3A::from_cols_array(&[xx, xy, xz, xy, yy, yz, xz, yz, zz]),
            };
            self.add_rare_to(&mut local, group, lane, x, memory);
            let Local { force: f, block: b } = local;
            let (a, b, c) = (b.x_axis, b.y_axis, b.z_axis);
            let values = [f.x, f.y, f.z, a.x, a.y, a.z, b.y, b.z, c.z];
            values.into_iter().zip(&mut memory.sums).for_each(|(value, to)| to.0[lane] = value);
        }
    }

    /// Adds the parts that the plain sums lack in one lane: contacts, the limit of stretch, and the
    /// barrier in elements of small volume.
    fn add_rare_to(&self, local: &mut Local, group: &Group, lane: usize, x: &[Vec3A], memory: &Memory) {
        let vertex = group.first as usize + lane;
        self.substep.add_contacts(vertex, x[vertex], local);
        self.substep.stretched.add(vertex, x, local);
        for (step, face) in self.groups.steps_of(group).iter().zip(&memory.faces).skip(2) {
            let (inverse, ratio) = (step.inverse_6v.0[lane], face.ratio.0[lane]);
            if inverse != 0.0 && ratio <= VolumeTerm::MIN_PLAIN_RATIO {
                let gradient = inverse * Vec3A::from(face.area.each_ref().map(|area| area.0[lane]));
                let volume = 1.0 / (6.0 * inverse.abs());
                let (slope, curvature) = self.term.at(ratio);
                let plain = self.term.lambda * (ratio - self.term.alpha);
                local.force -= volume * (slope - plain) * gradient;
                local.add_outer(volume * (curvature - self.term.lambda), gradient);
            }
        }
    }

    /// The step, cut where it would take too much of an element's volume.
    #[inline(always)]
    fn guarded<S: Simd>(&self, simd: S, group: &Group, part: usize, step: Reg3<S>, memory: &Memory) -> Reg3<S> {
        let (kept, least) = (splat(simd, KEPT_SHARE), splat(simd, MIN_VOLUME_RATIO));
        let mut too_far = Mask::<S>::splat(simd, false);
        let steps = self.groups.steps_of(group);
        for k in 2..steps.len() {
            let (corner, face) = (&steps[k], &memory.faces[k]);
            let ratio = load(simd, &face.ratio, part);
            let change = load(simd, &corner.inverse_6v, part) * dot(load3(simd, &face.area, part), step);
            too_far |= (ratio + change).simd_lt((kept * ratio).max(least).min(ratio));
        }
        let too_far = bits::<S>(too_far);
        if too_far == 0 {
            return step;
        }
        let mut spilled = [Block([0.0f32; BLOCK]); 3];
        store3::<S>(step, &mut spilled, part);
        for lane in (0..width::<S>()).filter(|lane| too_far >> lane & 1 == 1).map(|lane| part * width::<S>() + lane) {
            let step = [spilled[0].0[lane], spilled[1].0[lane], spilled[2].0[lane]];
            let share = self.share(group, lane, step, memory);
            for block in &mut spilled {
                block.0[lane] *= share;
            }
        }
        load3(simd, &spilled, part)
    }

    /// The share of one lane's step that the guard allows.
    #[cold]
    #[inline(never)]
    fn share(&self, group: &Group, lane: usize, [x, y, z]: [f32; 3], memory: &Memory) -> f32 {
        let mut share = 1.0f32;
        for (corner, face) in self.groups.steps_of(group).iter().zip(&memory.faces).skip(2) {
            let [a, b, c] = face.area.each_ref().map(|area| area.0[lane]);
            let change = corner.inverse_6v.0[lane] * (a * x + b * y + c * z);
            share = share.min(allowed_share(face.ratio.0[lane], change));
        }
        share
    }
}
