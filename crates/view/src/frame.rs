//! A frame as it is sent: built once, and assembled for each client from the parts that are new to
//! it.

use crate::message::{Binary, Data};
use crate::protocol::Overlay;
use serde_json::{Value, json};
use std::sync::Arc;

/// An organ's surface at an instant.
#[derive(Clone, Debug)]
pub(crate) struct OrganFrame {
    /// Grows whenever a node has moved.
    pub version: u64,
    /// Metres are `low + step * u`.
    pub low: [f64; 3],
    pub step: [f64; 3],
    /// Three 16-bit numbers a vertex.
    pub positions: Arc<[u8]>,
    /// Stretch and strain energy, one byte a vertex.
    pub values: [Option<Arc<[u8]>>; 2],
}

/// A frame.
#[derive(Debug)]
pub(crate) struct Frame {
    /// The fields of the header that are the same for all clients.
    pub header: Value,
    /// The number of the organs' surfaces that it is of.
    pub topology: u64,
    pub organs: Vec<OrganFrame>,
    pub ranges: [[f32; 2]; 2],
    /// Poses of bodies, columns of arms, channels, stages.
    pub poses: Vec<f32>,
    pub arms: Vec<f32>,
    pub arm_count: usize,
    pub row: Vec<f32>,
    pub stages: Vec<f32>,
    pub contacts: Option<Vec<f32>>,
    pub held: Option<Vec<f32>>,
}

/// The parts that a client has already.
#[derive(Debug, Default)]
pub(crate) struct Has {
    topology: u64,
    versions: Vec<u64>,
}

impl Frame {
    /// The message for a client that `has` earlier frames. `value` is the value that it wants on
    /// the organs.
    pub fn message(&self, has: &mut Has, value: Option<Overlay>, dropped: u64, whole: bool) -> Vec<u8> {
        if whole || has.topology != self.topology || has.versions.len() != self.organs.len() {
            *has = Has { topology: self.topology, versions: vec![0; self.organs.len()] };
        }
        let mut header = self.header.clone();
        let kind = value.map(|v| v as usize);
        let mut organs = Vec::new();
        let new = |has: &Has, k: usize| self.organs[k].version > has.versions[k];
        for (k, organ) in self.organs.iter().enumerate().filter(|(k, _)| new(has, *k)) {
            let mut said = json!({"organ": k, "low": organ.low, "step": organ.step, "positions": format!("{k}.x")});
            if kind.is_some_and(|v| organ.values[v].is_some()) {
                said["values"] = json!(format!("{k}.o"));
            }
            organs.push(said);
        }
        header["organs"] = Value::Array(organs);
        header["dropped"] = json!(dropped);
        if let (Some(value), Some(k)) = (value, kind) {
            let [low, high] = self.ranges[k];
            let (name, unit) = match value {
                Overlay::Stretch => ("stretch", ""),
                Overlay::Energy => ("energy", "J/m3"),
            };
            header["value"] = json!({"kind": name, "low": low, "high": high, "unit": unit});
        }
        let mut message = Binary::new(header);
        for (k, organ) in self.organs.iter().enumerate() {
            if !new(has, k) {
                continue;
            }
            let count = organ.positions.len() / 6;
            message.add(format!("{k}.x"), &[count, 3], Data::U16(&organ.positions));
            if let Some(values) = kind.and_then(|v| organ.values[v].as_ref()) {
                message.add(format!("{k}.o"), &[count], Data::U8(values));
            }
            has.versions[k] = organ.version;
        }
        let mut table = |name: &str, columns: usize, all: &[f32]| {
            message.add(name.to_owned(), &[all.len() / columns.max(1), columns], Data::F32(all.to_vec()));
        };
        table("poses", 7, &self.poses);
        table("arms", self.arms.len() / self.arm_count.max(1), &self.arms);
        table("stages", 3, &self.stages);
        if let Some(contacts) = &self.contacts {
            table("contacts", 8, contacts);
        }
        if let Some(held) = &self.held {
            table("held", 4, held);
        }
        if !self.row.is_empty() {
            message.add("row".to_owned(), &[self.row.len()], Data::F32(self.row.clone()));
        }
        message.into_bytes()
    }
}
