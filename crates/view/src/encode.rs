//! Makes frames of snapshots in its own thread.

use crate::frame::{Frame, OrganFrame};
use crate::hub::Hub;
use crate::inbox::lock;
use crate::shapes::Topology;
use crate::snapshot::{OrganShot, Snapshot};
use crate::values::{energies, stretches};
use glam::DVec3;
use serde_json::json;
use std::sync::{Arc, Condvar, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::Instant;

/// The newest snapshot that has not been encoded.
#[derive(Default)]
struct Slot {
    snapshot: Option<Box<Snapshot>>,
    stop: bool,
}

/// The thread that makes frames.
pub(crate) struct Encoder {
    shared: Arc<(Mutex<Slot>, Condvar)>,
    thread: Option<JoinHandle<()>>,
}

impl Encoder {
    /// Starts the thread.
    pub fn start(hub: Arc<Hub>) -> std::io::Result<Self> {
        let shared: Arc<(Mutex<Slot>, Condvar)> = Arc::default();
        let own = Arc::clone(&shared);
        let work = move || {
            let mut making = Making::default();
            while let Some(snapshot) = next(&own) {
                making.publish(*snapshot, &hub);
            }
        };
        let thread = std::thread::Builder::new().name("view-frames".to_owned()).spawn(work)?;
        Ok(Self { shared, thread: Some(thread) })
    }

    /// Puts a snapshot into the slot, in the place of one that was not encoded yet.
    pub fn give(&self, snapshot: Snapshot) {
        let (slot, news) = &*self.shared;
        lock(slot).snapshot = Some(Box::new(snapshot));
        news.notify_one();
    }
}

impl Drop for Encoder {
    fn drop(&mut self) {
        let (slot, news) = &*self.shared;
        lock(slot).stop = true;
        news.notify_one();
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

fn next((slot, news): &(Mutex<Slot>, Condvar)) -> Option<Box<Snapshot>> {
    let mut slot = lock(slot);
    loop {
        if slot.stop {
            return None;
        }
        if let Some(snapshot) = slot.snapshot.take() {
            return Some(snapshot);
        }
        slot = news.wait(slot).unwrap_or_else(PoisonError::into_inner);
    }
}

/// The state between frames.
#[derive(Default)]
struct Making {
    scene: Option<Arc<Vec<u8>>>,
    topology: Option<Arc<Topology>>,
    organs: Vec<OrganFrame>,
    ranges: [[f32; 2]; 2],
    frames: u64,
}

impl Making {
    fn publish(&mut self, snapshot: Snapshot, hub: &Hub) {
        let clock = Instant::now();
        let new_scene = self.scene.as_ref().is_none_or(|own| !Arc::ptr_eq(own, &snapshot.scene));
        let new_organs = self.topology.as_ref().is_none_or(|own| !Arc::ptr_eq(own, &snapshot.topology));
        if new_scene || new_organs {
            let scene = new_scene.then(|| snapshot.scene.to_vec());
            hub.tell_shapes(scene, Some(snapshot.topology.message()));
            (self.scene, self.topology) = (Some(Arc::clone(&snapshot.scene)), Some(Arc::clone(&snapshot.topology)));
            self.organs.clear();
        }
        let ranges = hub.ranges();
        let same_ranges = ranges == self.ranges;
        self.ranges = ranges;
        let mut organs = Vec::with_capacity(snapshot.organs.len());
        for (k, shot) in snapshot.organs.iter().enumerate() {
            let wants = [snapshot.wants.stretch, snapshot.wants.energy];
            let known = self.organs.get(k).filter(|o| {
                o.version == shot.version && same_ranges && (0..2).all(|v| !wants[v] || o.values[v].is_some())
            });
            organs.push(match known {
                Some(known) => known.clone(),
                None => self.organ(&snapshot.topology, k, shot, wants),
            });
        }
        self.organs = organs;
        self.frames += 1;
        let mut header = snapshot.header;
        header["type"] = json!("frame");
        header["frame"] = json!(self.frames);
        header["scene"] = json!(snapshot.topology.scene);
        header["topology"] = json!(snapshot.topology.number);
        header["built_ms"] = json!((clock.elapsed().as_secs_f64() * 1e5).round() / 1e2);
        header["age_ms"] = json!((snapshot.taken.elapsed().as_secs_f64() * 1e5).round() / 1e2);
        hub.offer(&Arc::new(Frame {
            header,
            topology: snapshot.topology.number,
            organs: self.organs.clone(),
            ranges,
            poses: snapshot.poses,
            arms: snapshot.arms,
            arm_count: snapshot.arm_count,
            row: snapshot.row,
            stages: snapshot.stages,
            contacts: snapshot.contacts,
            held: snapshot.held,
        }));
    }

    fn organ(&self, topology: &Topology, k: usize, shot: &OrganShot, wants: [bool; 2]) -> OrganFrame {
        let surface = &topology.surfaces[k];
        let (low, step, positions) = quantised(&shot.skin);
        let nodes = &shot.nodes[..];
        let mut values = [None, None];
        for (v, value) in values.iter_mut().enumerate().filter(|(v, _)| wants[*v]) {
            let of_nodes = if v == 0 { stretches(topology, k, nodes) } else { energies(topology, k, nodes) };
            let mut of_vertices = Vec::new();
            surface.values(&of_nodes, &mut of_vertices);
            let [low, high] = self.ranges[v];
            let byte = |x: &f32| (255.0 * ((x - low) / (high - low)).clamp(0.0, 1.0)).round() as u8;
            *value = Some(of_vertices.iter().map(byte).collect());
        }
        OrganFrame { version: shot.version, low: low.to_array(), step: step.to_array(), positions, values }
    }
}

/// Points as three 16-bit numbers each in their box: its corner, and the step of each axis (m).
fn quantised(points: &[DVec3]) -> (DVec3, DVec3, Arc<[u8]>) {
    let all = |f: fn(DVec3, DVec3) -> DVec3, from: DVec3| points.iter().fold(from, |a, p| f(a, *p));
    let (low, high) = (all(DVec3::min, DVec3::INFINITY), all(DVec3::max, DVec3::NEG_INFINITY));
    if !(low.is_finite() && high.is_finite()) {
        // Tissue whose numbers are lost is drawn nowhere.
        return (DVec3::ZERO, DVec3::ONE, vec![0; 6 * points.len()].into());
    }
    let step = ((high - low) / f64::from(u16::MAX)).max(DVec3::splat(1e-12));
    let scale = step.recip();
    let mut bytes = Vec::with_capacity(6 * points.len());
    for p in points {
        let at = (*p - low) * scale;
        for x in at.to_array() {
            bytes.extend((x.round() as u16).to_le_bytes());
        }
    }
    (low, step, bytes.into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_are_within_half_a_step() {
        let point = |k: u32| DVec3::new(f64::from(k).sin(), 0.25, 1e-3 * f64::from(k % 7));
        let points: Vec<DVec3> = (0..100).map(point).collect();
        let (low, step, bytes) = quantised(&points);
        assert!(step.max_element() < 4e-5);
        for (p, six) in points.iter().zip(bytes.chunks_exact(6)) {
            let word = |k: usize| f64::from(u16::from_le_bytes([six[2 * k], six[2 * k + 1]]));
            let back = low + step * DVec3::new(word(0), word(1), word(2));
            assert!((back - *p).abs().cmple(0.501 * step + 1e-12).all(), "{p} {back}");
        }
        let lost = quantised(&[DVec3::NAN, DVec3::ZERO]);
        assert_eq!(lost.2.len(), 12);
    }
}
