//! NumPy arrays as columns of the library, without copies.

use crate::errors::InputError;
use numpy::ndarray::{ArrayD, ArrayView, IxDyn};
use numpy::{
    IntoPyArray, PyArray, PyArrayDescrMethods, PyArrayDyn, PyReadonlyArrayDyn, PyUntypedArray, PyUntypedArrayMethods,
};
use particlegs_formats::Array;
use particlegs_particles::Column;
use pyo3::prelude::*;
use std::sync::Arc;

/// The memory of an array. It keeps the array alive and does not write to it; writes from Python change the particles.
struct ArrayMemory {
    start: *const u8,
    bytes: usize,
    _owner: Py<PyAny>,
}

// SAFETY: the memory is only read, and the Python object is only dropped, which takes the lock if needed.
unsafe impl Send for ArrayMemory {}
// SAFETY: as above.
unsafe impl Sync for ArrayMemory {}

impl AsRef<[u8]> for ArrayMemory {
    fn as_ref(&self) -> &[u8] {
        // SAFETY: the owner keeps the memory, which is all within the array.
        unsafe { std::slice::from_raw_parts(self.start, self.bytes) }
    }
}

impl AsRef<[f32]> for ArrayMemory {
    fn as_ref(&self) -> &[f32] {
        // SAFETY: [`column`] accepts only aligned native f32.
        unsafe { std::slice::from_raw_parts(self.start.cast(), self.bytes / 4) }
    }
}

/// A C-contiguous, aligned array of native float32, of any shape, as one run of numbers; nothing is copied.
pub fn column(array: &PyReadonlyArrayDyn<'_, f32>) -> PyResult<Column> {
    if !array.is_c_contiguous() {
        return Err(InputError::new_err("the array is not contiguous"));
    }
    let values = array.as_slice().map_err(|e| InputError::new_err(e.to_string()))?;
    let held = ArrayMemory {
        start: values.as_ptr().cast(),
        bytes: std::mem::size_of_val(values),
        _owner: array.as_any().clone().unbind(),
    };
    // The pointer of an empty array may be null.
    Ok(if values.is_empty() { Column::owned(Vec::new()) } else { Column::lent(Arc::new(held)) })
}

/// An (n, 3) array of any number type, byte order and positive strides, not copied.
pub fn rows(array: &Bound<'_, PyUntypedArray>) -> PyResult<Array> {
    let (shape, strides) = (array.shape(), array.strides());
    let ([rows, 3], [row, axis]) = (shape, strides) else {
        return Err(InputError::new_err("positions must have shape (n, 3)"));
    };
    let size = array.dtype().itemsize();
    let (Ok(row_bytes), Ok(axis_bytes)) = (usize::try_from(*row), usize::try_from(*axis)) else {
        return Err(InputError::new_err("positions must not have negative strides"));
    };
    let bytes = match rows {
        0 => 0,
        n => (n - 1) * row_bytes + 2 * axis_bytes + size,
    };
    // SAFETY: the data pointer of a live array.
    let start = unsafe { (*array.as_array_ptr()).fields.data.cast::<u8>().cast_const() };
    let dtype: String = array.dtype().getattr("str")?.extract()?;
    Ok(Array {
        bytes: Arc::new(ArrayMemory { start, bytes, _owner: array.as_any().clone().unbind() }),
        rows: *rows as u64,
        dtype,
        first: [0, axis_bytes as u64, 2 * axis_bytes as u64],
        stride: row_bytes as u64,
    })
}

/// Points of an (n, 3) float64 array.
pub fn points(array: &PyReadonlyArrayDyn<'_, f64>) -> PyResult<Vec<[f64; 3]>> {
    let [_, 3] = array.shape() else { return Err(InputError::new_err("points must have shape (n, 3)")) };
    let values = array.as_slice().map_err(|e| InputError::new_err(e.to_string()))?;
    Ok(values.as_chunks().0.to_vec())
}

/// Values in the order of C as an array of a shape.
pub fn shaped<'py, T: numpy::Element>(
    py: Python<'py>,
    shape: &[usize],
    values: Vec<T>,
) -> PyResult<Bound<'py, PyArrayDyn<T>>> {
    let array = ArrayD::from_shape_vec(IxDyn(shape), values).map_err(|e| InputError::new_err(e.to_string()))?;
    Ok(array.into_pyarray(py))
}

/// A read-only array of values kept by `owner`.
pub fn view<'py, T: numpy::Element>(
    owner: &Bound<'py, PyAny>,
    values: &[T],
    shape: &[usize],
) -> PyResult<Bound<'py, PyArrayDyn<T>>> {
    let values = ArrayView::from_shape(shape, values).map_err(|e| InputError::new_err(e.to_string()))?;
    // SAFETY: the owner is frozen, so its values neither move nor change while the array keeps it alive.
    let array = unsafe { PyArray::borrow_from_array(&values, owner.clone()) };
    array.getattr("flags")?.setattr("writeable", false)?;
    Ok(array)
}
