//! The two loops of L-BFGS over all bodies of an island (Nocedal and Wright 2006, "Numerical
//! Optimization", algorithm 7.4).
//!
//! The products of the pairs with each other are known, so that each loop reads the pairs twice:
//! for their products with the vector that it begins with, and to add them to it.

use super::island_system::IslandSystem;
use super::memory::Half;
use crate::lanes::Row;

impl IslandSystem<'_> {
    /// direction = -H gradient.
    pub fn find_direction(&mut self) {
        self.list_pairs();
        self.assemble_rigid_modes();
        let scale = self.history.scale;
        let (used, mut shares) = (std::mem::take(&mut self.history.used), std::mem::take(&mut self.history.shares));
        self.for_active(|body| body.memory.measure(body.level, Half::Steps, &used, &body.iterate.gradient));
        self.first_loop(&used, &mut shares);
        self.for_active(|body| {
            let direction = &mut body.iterate.direction;
            direction.copy_from_slice(&body.iterate.gradient);
            body.memory.add(body.level, Half::Changes, &used, &shares, direction);
            body.remove_rigid_modes();
            body.precondition();
            if scale != 1.0 {
                scale_rows(&mut body.iterate.direction, scale);
            }
            body.add_rigid_modes();
            body.memory.measure(body.level, Half::Changes, &used, &body.iterate.direction);
        });
        self.second_loop(&used, &mut shares);
        self.for_active(|body| {
            body.memory.add(body.level, Half::Steps, &used, &shares, &mut body.iterate.direction);
            body.turn_downhill();
        });
        (self.history.used, self.history.shares) = (used, shares);
    }

    /// Records a step of `share` times the direction, between the gradient and the next.
    pub fn record_step(&mut self, share: f32) {
        self.list_pairs();
        let Some(next) = self.history.next() else { return };
        let used = std::mem::take(&mut self.history.used);
        let mut sums = [0.0; 3];
        for body in self.active() {
            let gradients = [&body.iterate.gradient[..], &body.iterate.next_gradient];
            let (level, direction) = (body.level, &body.iterate.direction);
            let products = body.memory.record(level, (next, &used), share, direction, gradients);
            sums.iter_mut().zip(products).for_each(|(sum, product)| *sum += product);
        }
        self.history.used = used;
        // Bodies that sleep or rest took no step; their old pair of this number is of another time.
        for body in self.all().filter(|body| !body.sleep.active) {
            body.memory.forget(next);
        }
        self.history.take(next, sums);
    }

    /// Lists the pairs whose curvature is positive over the bodies that take part.
    fn list_pairs(&mut self) {
        let Self { slots, history, .. } = self;
        history.list(|at| {
            let active = slots.iter().map(|slot| &slot.solver).filter(|body| body.sleep.active);
            active.map(|body| body.memory.product(at, at)).sum()
        });
    }

    /// step . change over the bodies that take part.
    fn product(&mut self, step: usize, change: usize) -> f64 {
        self.active().map(|body| body.memory.product(step, change)).sum()
    }

    /// What was measured last of a pair, over the bodies that take part.
    fn measured(&mut self, at: usize) -> f64 {
        self.active().map(|body| body.memory.measured[at]).sum()
    }

    /// First loop: the factors of the changes that remove from the gradient what the pairs explain,
    /// newest first. The products of steps and gradient are measured.
    fn first_loop(&mut self, used: &[usize], shares: &mut Vec<f64>) {
        shares.clear();
        for at in used {
            let newer = used.iter().zip(shares.iter()).map(|(newer, share)| share * self.product(*at, *newer));
            let product = newer.sum::<f64>() + self.measured(*at);
            shares.push(-product / self.product(*at, *at));
        }
    }

    /// Second loop: the factors of the steps that add the pairs' part again, oldest first. The
    /// products of changes and direction are measured; `shares` are those of the first loop.
    fn second_loop(&mut self, used: &[usize], shares: &mut [f64]) {
        for k in (0..used.len()).rev() {
            let older = (k + 1..used.len()).map(|old| shares[old] * self.product(used[old], used[k]));
            let product = older.sum::<f64>() + self.measured(used[k]);
            shares[k] = -shares[k] - product / self.product(used[k], used[k]);
        }
    }
}

fn scale_rows(rows: &mut [Row], by: f32) {
    rows.as_flattened_mut().iter_mut().for_each(|number| *number *= by);
}
