//! A glTF 2.0 document and its buffer (Khronos Group, "glTF 2.0 Specification").

use crate::{Error, Result};
use glam::DVec3;
use serde_json::{Value, json};
use trocar_core::Pose;
use trocar_geometry::TriMesh;
use trocar_render::srgb;

/// Component types and targets of buffers, by their numbers in the specification.
const UNSIGNED_SHORT: u32 = 5123;
const UNSIGNED_INT: u32 = 5125;
const FLOAT: u32 = 5126;
const VERTICES: u32 = 34962;
const INDICES: u32 = 34963;

/// The root turns the cell's axes (z up) into those of glTF (y up): quaternion with the scalar
/// last.
const Y_UP: [f64; 4] = [-std::f64::consts::FRAC_1_SQRT_2, 0.0, 0.0, std::f64::consts::FRAC_1_SQRT_2];

/// A metallic and rough material; the colour is linear.
pub(super) struct Material {
    pub color: [f32; 3],
    pub roughness: f32,
    pub metallic: f32,
}

/// The property of a node that an animation changes.
pub(super) enum Track<'a> {
    /// Its pose at each time.
    Poses(&'a [Pose]),
    /// Weights of so many shapes: at time 0 none, at time k the one before k.
    Weights(usize),
    /// Whether it is seen from each time on.
    Shown(&'a [bool]),
}

/// A document that grows.
pub(super) struct Document {
    title: String,
    buffer: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
    materials: Vec<Value>,
    meshes: Vec<Value>,
    nodes: Vec<Value>,
    samplers: Vec<Value>,
    channels: Vec<Value>,
}

impl Document {
    pub fn new(title: String) -> Self {
        let (views, accessors, materials, meshes) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        let (nodes, samplers, channels) = (vec![json!({})], Vec::new(), Vec::new());
        Self { title, buffer: Vec::new(), views, accessors, materials, meshes, nodes, samplers, channels }
    }

    /// Adds a mesh with its vertices at `positions` (m) and other shapes of the same vertices;
    /// returns its index.
    pub fn mesh(
        &mut self,
        name: &str,
        mesh: &TriMesh,
        positions: &[DVec3],
        shapes: &[Vec<DVec3>],
        material: &Material,
    ) -> usize {
        let normals = normals(mesh, positions);
        let mut attributes = json!({
            "POSITION": self.vectors(positions, Some(VERTICES), true),
            "NORMAL": self.vectors(&normals, Some(VERTICES), false),
        });
        let colored = mesh.colors.len() == positions.len() && !mesh.colors.is_empty();
        if colored {
            attributes["COLOR_0"] = self.colors(&mesh.colors).into();
        }
        let targets: Vec<Value> = shapes
            .iter()
            .map(|shape| {
                let moved: Vec<DVec3> = shape.iter().zip(positions).map(|(a, b)| *a - *b).collect();
                let turned: Vec<DVec3> =
                    self::normals(mesh, shape).iter().zip(&normals).map(|(a, b)| *a - *b).collect();
                json!({"POSITION": self.vectors(&moved, Some(VERTICES), true),
                    "NORMAL": self.vectors(&turned, Some(VERTICES), false)})
            })
            .collect();
        let indices = mesh.triangles.as_flattened();
        let bytes = indices.iter().flat_map(|i| i.to_le_bytes()).collect();
        let indices = self.accessor(
            bytes,
            json!({"componentType": UNSIGNED_INT, "count": indices.len(), "type": "SCALAR"}),
            Some(INDICES),
        );
        let color = if colored { [1.0; 3] } else { material.color };
        self.materials.push(json!({
            "pbrMetallicRoughness": {
                "baseColorFactor": [color[0], color[1], color[2], 1.0],
                "metallicFactor": material.metallic, "roughnessFactor": material.roughness,
            },
            "doubleSided": true,
        }));
        let mut primitive = json!({"attributes": attributes, "indices": indices, "material": self.materials.len() - 1});
        let mut entry = json!({"name": name});
        if !targets.is_empty() {
            entry["weights"] = vec![0.0; targets.len()].into();
            primitive["targets"] = targets.into();
        }
        entry["primitives"] = json!([primitive]);
        self.meshes.push(entry);
        self.meshes.len() - 1
    }

    /// Adds a node that shows a mesh; returns its index.
    pub fn node(&mut self, name: &str, mesh: usize, pose: &Pose) -> usize {
        let (t, q) = (pose.translation, pose.rotation);
        let (t, q) = (t.to_array(), [q.x, q.y, q.z, q.w]);
        self.nodes.push(json!({"name": name, "mesh": mesh, "translation": t, "rotation": q}));
        self.nodes.len() - 1
    }

    /// Animates a node at `times` (s).
    pub fn animate(&mut self, node: usize, times: &[f64], track: &Track<'_>) {
        let input = self.scalars(&times.iter().map(|t| *t as f32).collect::<Vec<_>>(), true);
        match *track {
            Track::Poses(poses) => {
                let places: Vec<DVec3> = poses.iter().map(|pose| pose.translation).collect();
                let output = self.vectors(&places, None, false);
                self.channel(node, "translation", input, output, "LINEAR");
                let output = self.rotations(poses);
                self.channel(node, "rotation", input, output, "LINEAR");
            }
            Track::Weights(count) => {
                let weight = |k: usize, shape: usize| if k == shape + 1 { 1.0 } else { 0.0 };
                let all: Vec<f32> =
                    (0..times.len()).flat_map(|k| (0..count).map(move |shape| weight(k, shape))).collect();
                let output = self.scalars(&all, false);
                self.channel(node, "weights", input, output, "LINEAR");
            }
            Track::Shown(shown) => {
                let scales: Vec<DVec3> = shown.iter().map(|s| DVec3::splat(f64::from(u8::from(*s)))).collect();
                let output = self.vectors(&scales, None, false);
                self.channel(node, "scale", input, output, "STEP");
            }
        }
    }

    fn channel(&mut self, node: usize, path: &str, input: usize, output: usize, interpolation: &str) {
        self.samplers.push(json!({"input": input, "output": output, "interpolation": interpolation}));
        self.channels.push(json!({"sampler": self.samplers.len() - 1, "target": {"node": node, "path": path}}));
    }

    fn vectors(&mut self, vectors: &[DVec3], target: Option<u32>, bounded: bool) -> usize {
        let floats: Vec<[f32; 3]> = vectors.iter().map(|v| v.as_vec3().to_array()).collect();
        let mut about = json!({"componentType": FLOAT, "count": floats.len(), "type": "VEC3"});
        if bounded {
            let fold = |of: fn(f32, f32) -> f32, from: f32| -> [f32; 3] {
                std::array::from_fn(|c| floats.iter().map(|v| v[c]).fold(from, of))
            };
            about["min"] = json!(fold(f32::min, f32::INFINITY));
            about["max"] = json!(fold(f32::max, f32::NEG_INFINITY));
        }
        self.accessor(floats.as_flattened().iter().flat_map(|v| v.to_le_bytes()).collect(), about, target)
    }

    fn rotations(&mut self, poses: &[Pose]) -> usize {
        // The shorter way between neighbours: a quaternion and its negative are one rotation.
        let mut last = poses[0].rotation;
        let mut bytes = Vec::with_capacity(16 * poses.len());
        for pose in poses {
            let q = if pose.rotation.dot(last) < 0.0 { -pose.rotation } else { pose.rotation };
            last = q;
            [q.x, q.y, q.z, q.w].iter().for_each(|v| bytes.extend((*v as f32).to_le_bytes()));
        }
        self.accessor(bytes, json!({"componentType": FLOAT, "count": poses.len(), "type": "VEC4"}), None)
    }

    fn scalars(&mut self, values: &[f32], bounded: bool) -> usize {
        let mut about = json!({"componentType": FLOAT, "count": values.len(), "type": "SCALAR"});
        if bounded {
            about["min"] = json!([values.iter().copied().fold(f32::INFINITY, f32::min)]);
            about["max"] = json!([values.iter().copied().fold(f32::NEG_INFINITY, f32::max)]);
        }
        self.accessor(values.iter().flat_map(|v| v.to_le_bytes()).collect(), about, None)
    }

    /// Colours of vertices: linear, as the specification asks, in 16 bits.
    fn colors(&mut self, colors: &[[u8; 3]]) -> usize {
        let mut bytes = Vec::with_capacity(8 * colors.len());
        for color in colors {
            let [r, g, b] = srgb::to_linear(*color).map(|c| (65535.0 * c).round() as u16);
            [r, g, b, u16::MAX].iter().for_each(|c| bytes.extend(c.to_le_bytes()));
        }
        let about = json!({"componentType": UNSIGNED_SHORT, "normalized": true, "count": colors.len(), "type": "VEC4"});
        self.accessor(bytes, about, Some(VERTICES))
    }

    /// Adds bytes to the buffer, and an accessor of them.
    fn accessor(&mut self, bytes: Vec<u8>, mut about: Value, target: Option<u32>) -> usize {
        self.buffer.resize(self.buffer.len().next_multiple_of(4), 0);
        let mut view = json!({"buffer": 0, "byteOffset": self.buffer.len(), "byteLength": bytes.len()});
        if let Some(target) = target {
            view["target"] = target.into();
        }
        self.buffer.extend(bytes);
        self.views.push(view);
        about["bufferView"] = (self.views.len() - 1).into();
        self.accessors.push(about);
        self.accessors.len() - 1
    }

    /// The file: a header, the JSON, the buffer.
    ///
    /// # Errors
    /// A file of more than 4 GB.
    pub fn into_bytes(mut self) -> Result<Vec<u8>> {
        self.buffer.resize(self.buffer.len().next_multiple_of(4), 0);
        let children: Vec<usize> = (1..self.nodes.len()).collect();
        self.nodes[0] = json!({"name": "cell", "rotation": Y_UP, "children": children});
        let mut root = json!({
            "asset": {"version": "2.0", "generator": concat!("trocar ", env!("CARGO_PKG_VERSION"))},
            "scene": 0, "scenes": [{"name": self.title, "nodes": [0]}],
            "nodes": self.nodes, "meshes": self.meshes, "materials": self.materials,
            "accessors": self.accessors, "bufferViews": self.views, "buffers": [{"byteLength": self.buffer.len()}],
        });
        if !self.channels.is_empty() {
            root["animations"] = json!([{"name": "episode", "samplers": self.samplers, "channels": self.channels}]);
        }
        let mut text = root.to_string().into_bytes();
        text.resize(text.len().next_multiple_of(4), b' ');
        let length = |bytes: usize| {
            u32::try_from(bytes)
                .map_err(|_| Error::Format("a glTF file is at most 4 GB; fewer keyframes make it smaller".to_owned()))
        };
        let mut file = Vec::with_capacity(28 + text.len() + self.buffer.len());
        file.extend(b"glTF");
        file.extend(2u32.to_le_bytes());
        file.extend(length(28 + text.len() + self.buffer.len())?.to_le_bytes());
        for (kind, chunk) in [(b"JSON", &text), (b"BIN\0", &self.buffer)] {
            file.extend(length(chunk.len())?.to_le_bytes());
            file.extend(kind);
            file.extend(chunk);
        }
        Ok(file)
    }
}

/// Unit normals of the vertices, weighted by the area of their triangles.
fn normals(mesh: &TriMesh, positions: &[DVec3]) -> Vec<DVec3> {
    let mut sums = vec![DVec3::ZERO; positions.len()];
    for triangle in &mesh.triangles {
        let [a, b, c] = triangle.map(|i| positions[i as usize]);
        let normal = (b - a).cross(c - a);
        triangle.iter().for_each(|i| sums[*i as usize] += normal);
    }
    sums.into_iter().map(|sum| sum.normalize_or(DVec3::Z)).collect()
}
