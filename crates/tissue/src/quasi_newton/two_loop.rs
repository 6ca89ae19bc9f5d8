//! The two loops of L-BFGS over all bodies of an island.

use super::history::MIN_CURVATURE_SHARE;
use super::island_system::IslandSystem;
use crate::lanes::{Row, add_rows, dot_rows};
use fearless_simd::dispatch;

impl IslandSystem<'_> {
    /// direction = -H gradient.
    pub fn find_direction(&mut self) {
        self.assemble_rigid_modes();
        self.active().for_each(|body| body.iterate.direction.copy_from_slice(&body.iterate.gradient));
        self.first_loop();
        let scale = self.history.scale;
        self.for_active(|body| {
            body.remove_rigid_modes();
            body.precondition();
            if scale != 1.0 {
                scale_rows(&mut body.iterate.direction, scale);
            }
            body.add_rigid_modes();
        });
        self.second_loop();
        self.active().for_each(|body| body.turn_downhill());
    }

    /// Records a step of `share` times the direction, between the gradient and the next.
    pub fn record_step(&mut self, share: f32) {
        let pairs = self.history.inverses.len();
        if pairs == 0 {
            return;
        }
        let next = (self.history.newest + 1) % pairs;
        let mut sums = [0.0f32; 3];
        for body in self.active() {
            let gradients = [&body.iterate.gradient[..], &body.iterate.next_gradient];
            let products = body.memory.record(body.level, next, share, &body.iterate.direction, gradients);
            sums.iter_mut().zip(products).for_each(|(sum, product)| *sum += product);
        }
        // Bodies that sleep or rest took no step; their old pair of this number is of another time.
        for body in self.all().filter(|body| !body.sleep.active) {
            body.memory.forget(next);
        }
        let [curvature, steps, changes] = sums;
        let lengths: f32 = steps * changes;
        if curvature > MIN_CURVATURE_SHARE * lengths.sqrt() && curvature > f32::MIN_POSITIVE {
            self.history.inverses[next] = 1.0 / curvature;
            self.history.newest = next;
            self.history.count = (self.history.count + 1).min(pairs);
        } else {
            // The oldest pair was written over.
            self.history.count = self.history.count.min(pairs - 1);
        }
    }

    /// Computes the curvatures again after other bodies take part: each step's share of them is a
    /// step as well.
    pub fn recompute_curvatures(&mut self) {
        for age in 0..self.history.count {
            let at = self.history.at(age);
            let curvature: f32 = self.active().map(|body| body.memory.curvature(body.level, at)).sum();
            if curvature <= f32::MIN_POSITIVE || curvature.is_nan() {
                self.history.count = age;
                return;
            }
            self.history.inverses[at] = 1.0 / curvature;
        }
    }

    /// First loop: removes from the direction the part that the pairs explain, newest first.
    fn first_loop(&mut self) {
        for age in 0..self.history.count {
            let at = self.history.at(age);
            let mut product = 0.0;
            for body in self.active() {
                let (pair, direction) = (&body.memory.pairs[at], &body.iterate.direction);
                product += dispatch!(body.level, simd => dot_rows(simd, &pair.step, direction));
            }
            let share = self.history.inverses[at] * product;
            self.history.shares[at] = share;
            for body in self.active() {
                let (pair, direction) = (&body.memory.pairs[at], &mut body.iterate.direction);
                dispatch!(body.level, simd => add_rows(simd, direction, -share, &pair.change));
            }
        }
    }

    /// Second loop: adds the pairs' part again, oldest first.
    fn second_loop(&mut self) {
        for age in (0..self.history.count).rev() {
            let at = self.history.at(age);
            let mut product = 0.0;
            for body in self.active() {
                let (pair, direction) = (&body.memory.pairs[at], &body.iterate.direction);
                product += dispatch!(body.level, simd => dot_rows(simd, &pair.change, direction));
            }
            let share = self.history.shares[at] - self.history.inverses[at] * product;
            for body in self.active() {
                let (pair, direction) = (&body.memory.pairs[at], &mut body.iterate.direction);
                dispatch!(body.level, simd => add_rows(simd, direction, share, &pair.step));
            }
        }
    }
}

fn scale_rows(rows: &mut [Row], by: f32) {
    rows.as_flattened_mut().iter_mut().for_each(|number| *number *= by);
}
