//! The sweep of stable neo-Hookean tissue, sixteen vertices at once.
//!
//! Its block at a vertex is V0 (mu |m|^2 I + psi'' g g'), g the gradient of the volume ratio. The first part is a constant Laplacian along the edges. The second needs of each
//! element the area vector A of the face opposite the vertex, g = A / (6 V0); a strip ([`crate::descent::strip`]) yields a face with each point that is read. What is rare (elements
//! below a quarter of their volume, vertices that touch something) is added lane by lane.

use crate::descent::groups::{Group, Groups};
use crate::descent::kernel::{Local, VolumeTerm};
use crate::descent::sweep::{FLOOR, KEPT_SHARE, LEAST_SQUARE, Substep, allowed_share};
use crate::simd::{BLOCK, Block, Lanes, Task, cross, dot, load3, minus, part_of, scaled, store3};
use glam::{Mat3A, Vec3A};
use rayon::prelude::*;

/// Longest strip that is swept in lanes; groups with longer ones are swept vertex by vertex.
const STEPS: usize = 64;

/// Groups a task; a colour of fewer than two tasks is swept by one thread.
const CHUNK: usize = 16;

/// A body's sweep.
pub(crate) struct LaneSweep<'a> {
    pub substep: &'a Substep<'a>,
    pub groups: &'a Groups,
    pub term: &'a VolumeTerm,
}

/// Area vectors and volume ratios of a group's elements, kept between the force and the guard; and where its vertices go.
struct Memory {
    faces: [Face; STEPS],
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
        Self { faces: [Face { area: [zero; 3], ratio: zero }; STEPS], to: [zero; 3] }
    }
}

/// Groups one after the other, in place.
struct InPlace<'a>(&'a LaneSweep<'a>, &'a [Group], &'a mut [Vec3A]);

/// Groups of one colour: where their vertices go from the positions of all, the first group's vertices first.
struct Apart<'a>(&'a LaneSweep<'a>, &'a [Group], &'a [Vec3A], &'a mut [Vec3A]);

impl Task for InPlace<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) {
        let Self(sweep, groups, x) = self;
        let mut memory = Memory::new();
        for group in groups {
            let active = sweep.relax(lanes, group, x, &mut memory);
            let first = group.first as usize;
            memory.write(active, &mut x[first..first + group.count as usize]);
        }
    }
}

impl Task for Apart<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) {
        let Self(sweep, groups, x, moved) = self;
        let mut memory = Memory::new();
        let base = groups.first().map_or(0, |group| group.first);
        for group in groups {
            let active = sweep.relax(lanes, group, x, &mut memory);
            let (first, at) = (group.first as usize, (group.first - base) as usize);
            let moved = &mut moved[at..at + group.count as usize];
            moved.copy_from_slice(&x[first..first + group.count as usize]);
            memory.write(active, moved);
        }
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
struct Sums<L: Lanes> {
    force: [L::F; 3],
    block: [L::F; 6],
}

impl<L: Lanes> Sums<L> {
    /// force -= k d
    #[inline(always)]
    fn pull(&mut self, k: L::F, d: [L::F; 3]) {
        self.force = [self.force[0] - k * d[0], self.force[1] - k * d[1], self.force[2] - k * d[2]];
    }

    /// block += k d d'
    #[inline(always)]
    fn add_outer(&mut self, k: L::F, d: [L::F; 3]) {
        let kd = scaled::<L>(k, d);
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
    fn solve(&self, lanes: L) -> [L::F; 3] {
        let [xx, xy, xz, yy, yz, zz] = self.block;
        let (a, b, c) = ([xx, xy, xz], [xy, yy, yz], [xz, yz, zz]);
        let (bc, ca, ab) = (cross::<L>(b, c), cross::<L>(c, a), cross::<L>(a, b));
        let inverse = lanes.splat(1.0) / dot::<L>(a, bc);
        let f = scaled::<L>(inverse, self.force);
        [dot::<L>(bc, f), dot::<L>(ca, f), dot::<L>(ab, f)]
    }

    /// Lets `change` alter the lanes of a part that are set in `mask`, one by one.
    #[inline(always)]
    fn alter(&mut self, lanes: L, part: usize, mask: u16, mut change: impl FnMut(usize, &mut Local)) {
        let mut spilled = [Block([0.0f32; BLOCK]); 9];
        for c in 0..3 {
            lanes.store(self.force[c], &mut spilled[c], part);
        }
        for c in 0..6 {
            lanes.store(self.block[c], &mut spilled[3 + c], part);
        }
        for lane in (0..L::WIDTH).filter(|lane| mask >> lane & 1 == 1).map(|lane| part * L::WIDTH + lane) {
            let [fx, fy, fz, xx, xy, xz, yy, yz, zz] = spilled.map(|block| block.0[lane]);
            let mut local = Local {
                force: Vec3A::new(fx, fy, fz),
                block: Mat3A::from_cols_array(&[xx, xy, xz, xy, yy, yz, xz, yz, zz]),
            };
            change(lane, &mut local);
            let Local { force: f, block: b } = local;
            let (a, b, c) = (b.x_axis, b.y_axis, b.z_axis);
            let values = [f.x, f.y, f.z, a.x, a.y, a.z, b.y, b.z, c.z];
            values.into_iter().zip(&mut spilled).for_each(|(value, to)| to.0[lane] = value);
        }
        for c in 0..3 {
            self.force[c] = lanes.load(&spilled[c], part);
        }
        for c in 0..6 {
            self.block[c] = lanes.load(&spilled[3 + c], part);
        }
    }
}

impl LaneSweep<'_> {
    /// Sweeps over all colours once; `moved` is scratch.
    pub fn sweep(&self, x: &mut [Vec3A], moved: &mut [Vec3A]) {
        assert!(x.len() == self.groups.points() && self.substep.start.len() == x.len());
        assert!(self.substep.predictor.len() == x.len());
        let isa = self.substep.isa;
        let alone = rayon::current_num_threads() == 1;
        if alone || self.groups.colors().all(|groups| groups.len() < 2 * CHUNK) {
            isa.run(InPlace(self, self.groups.all(), x));
            return;
        }
        for groups in self.groups.colors() {
            if groups.len() < 2 * CHUNK {
                isa.run(InPlace(self, groups, x));
                continue;
            }
            let (first, last) = (groups[0].first as usize, &groups[groups.len() - 1]);
            let end = (last.first + last.count) as usize;
            let (all, chunks) = (&*x, groups.par_chunks(CHUNK));
            // All groups of a colour but the last are full.
            moved[first..end].par_chunks_mut(CHUNK * BLOCK).zip(chunks).for_each(|(moved, groups)| {
                isa.run(Apart(self, groups, all, moved));
            });
            x[first..end].copy_from_slice(&moved[first..end]);
        }
    }

    /// Finds where a group's vertices go; returns the lanes that move.
    #[inline(always)]
    fn relax<L: Lanes>(&self, lanes: L, group: &Group, x: &[Vec3A], memory: &mut Memory) -> u16 {
        let active = group.active(self.substep.fixed);
        if active == 0 {
            return 0;
        }
        if self.groups.steps_of(group).len() > STEPS {
            for lane in (0..BLOCK).filter(|lane| active >> lane & 1 == 1) {
                let to = self.substep.relax(self.term, group.first as usize + lane, x).to_array();
                memory.to.iter_mut().zip(to).for_each(|(block, value)| block.0[lane] = value);
            }
            return active;
        }
        for part in 0..L::PARTS {
            if part_of::<L>(active, part) != 0 {
                if self.groups.damping_of(group).is_empty() {
                    self.relax_part::<L, false>(lanes, group, part, active, x, memory);
                } else {
                    self.relax_part::<L, true>(lanes, group, part, active, x, memory);
                }
            }
        }
        active
    }

    /// Points that a group's offsets name.
    #[inline(always)]
    #[allow(unsafe_code, reason = "points are read by indices that the groups vouch for")]
    fn read<L: Lanes>(&self, lanes: L, part: usize, points: &[Vec3A], offsets: &Block<u32>) -> [L::F; 3] {
        // SAFETY: the offsets are 16 times numbers below `Groups::points`, the length of all arrays of points (`sweep` asserts it).
        unsafe { lanes.rows(points, offsets, part) }
    }

    /// Adds the dashpot along the edge to the point of step `k`, which is at `d` from the vertex.
    #[inline(always)]
    fn add_dashpot<L: Lanes>(&self, lanes: L, group: &Group, part: usize, k: usize, d: [L::F; 3], sums: &mut Sums<L>) {
        let Substep { start, h, .. } = *self.substep;
        let to = self.groups.steps_of(group)[k].to();
        let before = minus::<L>(self.read(lanes, part, start, to), self.read(lanes, part, start, group.own()));
        let length = lanes.max(dot::<L>(before, before), lanes.splat(LEAST_SQUARE));
        let damping = lanes.load(&self.groups.damping_of(group)[k], part);
        let stiffness = damping * lanes.splat(1.0 / h) / length;
        let shortening = (dot::<L>(before, before) - dot::<L>(d, d)) * lanes.splat(0.5);
        sums.pull(stiffness * shortening, d);
        sums.add_outer(stiffness, d);
    }

    #[inline(always)]
    fn relax_part<L: Lanes, const VISCOUS: bool>(
        &self,
        lanes: L,
        group: &Group,
        part: usize,
        active: u16,
        x: &[Vec3A],
        memory: &mut Memory,
    ) {
        let h = self.substep.h;
        let here = self.read(lanes, part, x, group.own());
        let inertia = lanes.load(&group.mass, part) * lanes.splat(1.0 / (h * h));
        let zero = lanes.splat(0.0);
        let diagonal = inertia + lanes.load(&group.laplacian, part);
        let pulled = minus::<L>(self.read(lanes, part, self.substep.predictor, group.own()), here);
        let mut sums =
            Sums::<L> { force: scaled::<L>(inertia, pulled), block: [diagonal, zero, zero, diagonal, zero, diagonal] };
        let (sixth, plain) = (lanes.splat(self.term.lambda / 6.0), lanes.splat(VolumeTerm::PLAIN));
        let pressure = lanes.splat(self.term.lambda * self.term.alpha / 6.0);
        let steps = self.groups.steps_of(group);
        let drops = self.groups.drops_of(group);
        // The window, relative to the vertex. It takes two points to fill it.
        let (mut p, mut q, mut r) = ([zero; 3], [zero; 3], [zero; 3]);
        for k in 0..2.min(steps.len()) {
            let step = &steps[k];
            (p, q, r) = (q, r, minus::<L>(self.read(lanes, part, x, step.to()), here));
            sums.pull(lanes.load(&step.edge, part), r);
            if VISCOUS {
                self.add_dashpot(lanes, group, part, k, r, &mut sums);
            }
        }
        let mut low = 0;
        for k in 2..steps.len() {
            let (step, drop, face) = (&steps[k], drops[k], &mut memory.faces[k]);
            let d = minus::<L>(self.read(lanes, part, x, step.to()), here);
            sums.pull(lanes.load(&step.edge, part), d);
            if VISCOUS {
                self.add_dashpot(lanes, group, part, k, d, &mut sums);
            }
            let drop = part_of::<L>(drop, part);
            p = [lanes.select(drop, q[0], p[0]), lanes.select(drop, q[1], p[1]), lanes.select(drop, q[2], p[2])];
            (q, r) = (r, d);
            let area = cross::<L>(minus::<L>(q, p), minus::<L>(r, p));
            let six_v = zero - dot::<L>(area, p);
            let inverse = lanes.load(&step.inverse_6v, part);
            let ratio = inverse * six_v;
            // V0 psi'' = |inverse| lambda / 6 on A, and V0 psi' = lambda / 6 (|inverse| 6V - alpha sign).
            let stiffness = lanes.abs(inverse) * sixth;
            sums.pull(stiffness * six_v - lanes.signed(pressure, inverse), area);
            sums.add_outer(stiffness, area);
            low |= lanes.less(lanes.abs(inverse) * ratio, lanes.abs(inverse) * plain);
            store3(lanes, area, &mut face.area, part);
            lanes.store(ratio, &mut face.ratio, part);
        }
        low &= part_of::<L>(active, part);
        let pressed = part_of::<L>(active & self.pressed(group, x), part);
        if (low | pressed) != 0 {
            let memory = &*memory;
            sums.alter(lanes, part, low | pressed, |lane, local| self.add_rare(group, lane, x, memory, local));
        }
        let step = sums.solve(lanes);
        let to = self.guarded(lanes, group, part, step, memory);
        let to = [here[0] + to[0], here[1] + to[1], here[2] + to[2]];
        store3(lanes, to, &mut memory.to, part);
    }

    /// Vertices of a group that something presses or holds.
    #[inline(always)]
    fn pressed(&self, group: &Group, x: &[Vec3A]) -> u16 {
        let (contacts, first) = (self.substep.contacts, group.first as usize);
        if !contacts.any(first..first + group.count as usize) {
            return 0;
        }
        let pressed = |i: usize| contacts.of(i).iter().any(|touch| touch.push(x[i]).is_some());
        (0..group.count as usize).fold(0, |lanes, lane| lanes | u16::from(pressed(first + lane)) << lane)
    }

    /// What the plain sums lack in one lane: what it touches, and the barrier in elements of little volume.
    #[cold]
    #[inline(never)]
    fn add_rare(&self, group: &Group, lane: usize, x: &[Vec3A], memory: &Memory, local: &mut Local) {
        let vertex = group.first as usize + lane;
        self.substep.add_touches(vertex, x[vertex], local);
        for (step, face) in self.groups.steps_of(group).iter().zip(&memory.faces).skip(2) {
            let (inverse, ratio) = (step.inverse_6v.0[lane], face.ratio.0[lane]);
            if inverse != 0.0 && ratio <= VolumeTerm::PLAIN {
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
    fn guarded<L: Lanes>(&self, lanes: L, group: &Group, part: usize, step: [L::F; 3], memory: &Memory) -> [L::F; 3] {
        let (kept, least) = (lanes.splat(KEPT_SHARE), lanes.splat(FLOOR));
        let mut too_far = 0;
        let steps = self.groups.steps_of(group);
        for k in 2..steps.len() {
            let (corner, face) = (&steps[k], &memory.faces[k]);
            let ratio = lanes.load(&face.ratio, part);
            let change = lanes.load(&corner.inverse_6v, part) * dot::<L>(load3(lanes, &face.area, part), step);
            too_far |= lanes.less(ratio + change, lanes.min(lanes.max(kept * ratio, least), ratio));
        }
        if too_far == 0 {
            return step;
        }
        let mut spilled = [Block([0.0f32; BLOCK]); 3];
        store3(lanes, step, &mut spilled, part);
        for lane in (0..L::WIDTH).filter(|lane| too_far >> lane & 1 == 1).map(|lane| part * L::WIDTH + lane) {
            let step = [spilled[0].0[lane], spilled[1].0[lane], spilled[2].0[lane]];
            let share = self.share(group, lane, step, memory);
            for block in &mut spilled {
                block.0[lane] *= share;
            }
        }
        load3(lanes, &spilled, part)
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
