#![allow(clippy::unwrap_used, reason = "helpers of tests may panic")]
mod common;
use common::*;
use trocar_cell::*;
use trocar_robot::instrument::Coordinates;
struct Dice(u64);
impl Dice {
    fn roll(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }
    fn within(&mut self, low: f64, high: f64) -> f64 { low + (high - low) * self.roll() }
    fn coordinates(&mut self, cell: &Cell, arm: &str) -> Coordinates {
        let limits = cell.limits(arm).unwrap();
        loop {
            let pivots = [(); 2].map(|()| self.within(-limits.tilt, limits.tilt));
            let low = if self.roll() < 0.5 { 0.09 } else { limits.insertion[0] };
            let c = Coordinates { pivots, insertion: self.within(low, limits.insertion[1]), roll: self.within(limits.roll[0], limits.roll[1]), jaw: self.roll() };
            if c.tilt() < limits.tilt { return c; }
        }
    }
}
#[test]
fn dbg() {
    let sp = meshed(ONE_END, 4e-3);
    for contact in [false, true] {
    for seed in 0..6 {
        let mut cell = Cell::with_contact(&scene(), &sp, 1, contact).unwrap();
        if seed == 0 { println!("{:?} {:?}", cell.limits("left"), cell.limits("right")); }
        let mut dice = Dice(seed);
        let mut left = 0; let mut action = None; let mut told = 0;
        for step in 0..500 {
            if left == 0 { action = Some(Action::pivots(&["left","right"].map(|a| dice.coordinates(&cell, a)))); left = 1 + (20.0 * dice.roll()) as usize; }
            left -= 1;
            let r = cell.step(action.as_ref().unwrap()).unwrap();
            for (k, a) in r.arms.iter().enumerate() {
                if a.rcm_peak > 2e-3 && told < 3 { told += 1; println!("contact {contact} seed {seed} step {step} arm {k} rcm {:.2} force {:.2} {:.2} limited {} cmd {:?} is {:?} q {:?}", a.rcm_peak*1e3, a.contact.length(), a.constraint.length(), a.load_limited, a.commanded, a.coordinates, cell.measured_js(["left","right"][k]).unwrap().position); }
            }
        }
    } }
}
