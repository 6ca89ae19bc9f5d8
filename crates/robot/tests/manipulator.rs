//! Controlled arms in their ports: what is commanded, what they do and what they say.
#![allow(clippy::unwrap_used, reason = "tests")]

mod common;

use common::{cell, tip_circle};
use trocar_robot::manipulator::{Law, Settings};
use trocar_robot::wrench::Wrench;

const DT: f64 = 1.0 / 480.0;

#[test]
fn tracking() {
    for law in Law::ALL {
        for bandwidth in [20.0, 40.0, 60.0, 100.0, 150.0] {
            let mut s = Settings { law, ..Settings::default() };
            s.gains.bandwidth = bandwidth;
            let mut m = cell(1, s);
            let start = m.commanded();
            let mut worst = 0.0f64;
            let mut sum = 0.0;
            let mut rcm = 0.0f64;
            let t0 = std::time::Instant::now();
            let n = 480 * 4;
            for k in 0..n {
                if k % 16 == 0 {
                    let c = m.servo_tip(&tip_circle(&m, &start, k as f64 * DT), 0.5).unwrap();
                    assert!(c.reach == 1.0);
                }
                let r = m.step(Wrench::default(), DT).unwrap();
                let e = (m.measured_cp().translation - m.setpoint_cp().translation).length();
                worst = worst.max(e);
                sum += e * e;
                rcm = rcm.max(r.rcm_deviation);
            }
            let us = t0.elapsed().as_secs_f64() / n as f64 * 1e6;
            for _ in 0..480 * 2 {
                m.step(Wrench::default(), DT).unwrap();
            }
            let droop = (m.measured_cp().translation - m.setpoint_cp().translation).length();
            println!(
                "{} {bandwidth}: rms {:.4} max {:.4} mm rcm {:.4} droop {:.4} qd {:.1e}, {us:.1} us",
                law.name(),
                1e3 * (sum / n as f64).sqrt(),
                1e3 * worst,
                1e3 * rcm,
                1e3 * droop,
                m.measured_js().velocity.max_abs()
            );
        }
    }
}
