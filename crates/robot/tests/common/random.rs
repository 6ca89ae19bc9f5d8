//! Random numbers that are equal on every machine.
#![allow(dead_code, reason = "each test file uses its own part")]

use trocar_core::{mix, unit};

/// SplitMix64 (Steele, Lea, Flood 2014).
pub struct Random(pub u64);

impl Random {
    fn next(&mut self) -> u64 {
        let bits = mix(self.0);
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        bits
    }

    /// Uniform in [`low`, `high`).
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * unit(self.next())
    }

    /// Standard normal (Box-Muller).
    pub fn normal(&mut self) -> f64 {
        let radius = (-2.0 * self.between(f64::MIN_POSITIVE, 1.0).ln()).sqrt();
        radius * self.between(0.0, std::f64::consts::TAU).cos()
    }

    pub fn vector(&mut self) -> glam::DVec3 {
        glam::DVec3::new(self.normal(), self.normal(), self.normal())
    }

    pub fn rotation(&mut self) -> glam::DQuat {
        glam::DQuat::from_xyzw(self.normal(), self.normal(), self.normal(), self.normal()).normalize()
    }
}
