//! Arrays that the caller owns, cut into one piece per cell: all cells can be written at once.

use crate::error::wrong;
use numpy::{Element, PyArrayDyn, PyArrayMethods, PyReadwriteArray, PyUntypedArrayMethods, ndarray::IxDyn};
use pyo3::prelude::*;

/// An array (cells, ...) of the caller's, to be written.
pub struct Rows<'py, T: Element> {
    array: PyReadwriteArray<'py, T, IxDyn>,
    name: &'static str,
    cells: usize,
}

impl<'py, T: Element> Rows<'py, T> {
    /// `array` as (`cells`, numbers of `shape`...), contiguous.
    pub fn new(array: &Bound<'py, PyArrayDyn<T>>, name: &'static str, cells: usize, shape: &[usize]) -> PyResult<Self> {
        let wanted: Vec<usize> = std::iter::once(cells).chain(shape.iter().copied()).collect();
        if array.shape() != wanted || !array.is_c_contiguous() {
            return Err(wrong(format!(
                "{name}: has shape {:?}; a contiguous array of shape {wanted:?} is needed",
                array.shape()
            )));
        }
        let array = array.try_readwrite().map_err(|e| wrong(format!("{name}: {e}")))?;
        Ok(Self { array, name, cells })
    }

    /// One piece a cell.
    pub fn pieces(&mut self) -> PyResult<Vec<&mut [T]>> {
        let (name, cells) = (self.name, self.cells);
        let all = self.array.as_slice_mut().map_err(|e| wrong(format!("{name}: {e}")))?;
        let size = all.len() / cells.max(1);
        if size == 0 {
            return Ok((0..cells).map(|_| Default::default()).collect());
        }
        Ok(all.chunks_exact_mut(size).collect())
    }
}
