//! An open ONNX network: names, shapes, and running it.

use crate::{Error, Result};
use ort::environment::Environment;
use ort::session::{Session, SessionInputValue};
use ort::value::{TensorElementType, TensorRef, ValueType};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

/// A tensor outside the runtime.
#[derive(Clone, Debug)]
pub(super) struct Tensor {
    pub shape: Vec<usize>,
    pub data: Vec<f32>,
}

/// The element type of a tensor in the file.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Kind {
    F32,
    I32,
    I64,
    Bool,
    Other(String),
}

/// An input or output; -1 is an open dimension.
#[derive(Clone, Debug)]
pub(super) struct Port {
    pub name: String,
    pub kind: Kind,
    pub shape: Vec<i64>,
}

/// One network.
#[derive(Debug)]
pub(super) struct Network {
    pub path: PathBuf,
    pub inputs: Vec<Port>,
    pub outputs: Vec<Port>,
    /// The runtime's binding needs exclusive access for a run.
    session: Mutex<Session>,
}

impl Network {
    pub fn open(environment: &Environment, path: &Path) -> Result<Self> {
        let bad = |e: &dyn std::fmt::Display| Error::file(path, format!("it is not a usable ONNX network ({e})"));
        // The runtime's message for an unreadable file lacks the reason.
        std::fs::File::open(path).map_err(|e| Error::file(path, e))?;
        let session = Session::builder(environment)
            .map_err(|e| bad(&e))?
            .with_deterministic_compute(true)
            .map_err(|e| bad(&e))?
            .commit_from_file(path)
            .map_err(|e| bad(&e))?;
        let ports = |outlets: &[ort::value::Outlet]| outlets.iter().map(|o| Port::new(o.name(), o.dtype())).collect();
        let (inputs, outputs) = (ports(session.inputs()), ports(session.outputs()));
        Ok(Self { path: path.to_owned(), inputs, outputs, session: Mutex::new(session) })
    }

    /// Runs the network on named inputs, converted to the file's types. Returns the `wanted`
    /// outputs in order; flags become 1 and -1.
    pub fn run(&self, feeds: &[(&str, &Tensor)], wanted: &[&str]) -> Result<Vec<(String, Tensor)>> {
        let bad = |e: &dyn std::fmt::Display| Error::file(&self.path, format!("the network does not run ({e})"));
        let mut values: Vec<(String, SessionInputValue<'_>)> = Vec::new();
        for (name, tensor) in feeds {
            let port = self.inputs.iter().find(|p| p.name == *name);
            let port = port.ok_or_else(|| bad(&format!("it has no input '{name}'")))?;
            let shape: Vec<i64> = tensor.shape.iter().map(|s| *s as i64).collect();
            let value: SessionInputValue<'_> = match port.kind {
                Kind::F32 => TensorRef::from_array_view((shape, tensor.data.as_slice())).map_err(|e| bad(&e))?.into(),
                Kind::I32 => {
                    let data: Vec<i32> = tensor.data.iter().map(|x| *x as i32).collect();
                    ort::value::Tensor::from_array((shape, data)).map_err(|e| bad(&e))?.into()
                }
                Kind::I64 => {
                    let data: Vec<i64> = tensor.data.iter().map(|x| *x as i64).collect();
                    ort::value::Tensor::from_array((shape, data)).map_err(|e| bad(&e))?.into()
                }
                ref other => {
                    let text = format!("input '{name}' holds {other:?}; export the network with 32-bit floats");
                    return Err(Error::file(&self.path, text));
                }
            };
            values.push(((*name).to_owned(), value));
        }
        let mut session = self.session.lock().unwrap_or_else(PoisonError::into_inner);
        let outputs = session.run(values).map_err(|e| bad(&e))?;
        let mut found = Vec::new();
        for name in wanted {
            let value = outputs.get(*name).ok_or_else(|| bad(&format!("it has no output '{name}'")))?;
            let (shape, data) = if let Ok((shape, data)) = value.try_extract_tensor::<f32>() {
                (shape, data.to_vec())
            } else if let Ok((shape, data)) = value.try_extract_tensor::<bool>() {
                (shape, data.iter().map(|set| if *set { 1.0 } else { -1.0 }).collect())
            } else {
                let text = format!("output '{name}' is {}; export the network with 32-bit floats", value.dtype());
                return Err(Error::file(&self.path, text));
            };
            let shape: Vec<usize> = shape.iter().map(|s| usize::try_from(*s).unwrap_or(0)).collect();
            found.push(((*name).to_owned(), Tensor { shape, data }));
        }
        Ok(found)
    }
}

impl Port {
    fn new(name: &str, value: &ValueType) -> Self {
        let (kind, shape) = match value {
            ValueType::Tensor { ty, shape, .. } => {
                let kind = match ty {
                    TensorElementType::Float32 => Kind::F32,
                    TensorElementType::Int32 => Kind::I32,
                    TensorElementType::Int64 => Kind::I64,
                    TensorElementType::Bool => Kind::Bool,
                    other => Kind::Other(other.to_string()),
                };
                (kind, shape.to_vec())
            }
            other => (Kind::Other(other.to_string()), Vec::new()),
        };
        Self { name: name.to_owned(), kind, shape }
    }
}
