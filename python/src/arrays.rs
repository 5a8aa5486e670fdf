//! Arrays in and out: configurations from whatever NumPy takes for numbers, results into the caller's array or a new one.

use numpy::{
    Element, PyArray, PyArray1, PyArrayDyn, PyArrayMethods, PyReadonlyArrayDyn, PyUntypedArrayMethods,
    ndarray::Dimension,
};
use pyo3::{exceptions::PyValueError, intern, prelude::*, types::PyDict};

/// Rows from which on other Python threads run meanwhile: a few microseconds of work.
const MANY: usize = 32;

/// Configurations, one in each row of the last axis, in C order.
pub struct Configurations<'py> {
    array: PyReadonlyArrayDyn<'py, f64>,
}

impl<'py> Configurations<'py> {
    /// Takes `q`, an array or nested sequences, whose last axis has `joints` entries.
    pub fn new(q: &Bound<'py, PyAny>, joints: usize) -> PyResult<Self> {
        let array = match q.cast::<PyArrayDyn<f64>>() {
            Ok(array) if is_plain(array) => array.clone(),
            _ => converted(q)?,
        };
        if array.shape().last() != Some(&joints) {
            return Err(PyValueError::new_err(format!(
                "q has shape {:?}: its last axis must have one entry per joint, {joints}",
                array.shape()
            )));
        }
        let array = array.try_readonly().map_err(|error| PyValueError::new_err(format!("q: {error}")))?;
        Ok(Self { array })
    }

    pub fn numbers(&self) -> PyResult<&[f64]> {
        Ok(self.array.as_slice()?)
    }

    /// Shape without the last axis: that of one number for each configuration.
    pub fn shape(&self) -> &[usize] {
        let shape = self.array.shape();
        &shape[..shape.len() - 1]
    }

    fn rows(&self) -> usize {
        self.shape().iter().product()
    }

    /// Fills an array of `T`, for each configuration of the shape `row`, by `fill`. It is `out`, whose shape must be right and which must
    /// not be `q`, or a new one. Many rows are filled while other threads of Python run.
    pub fn fill<T: Element + Send>(
        &self,
        row: &[usize],
        out: Option<&Bound<'py, PyAny>>,
        fill: impl FnOnce(&[f64], &mut [T]) -> PyResult<()> + Send,
    ) -> PyResult<Bound<'py, PyArrayDyn<T>>> {
        let py = self.array.py();
        let shape = [self.shape(), row].concat();
        let out = match out {
            None => PyArray::zeros(py, shape, false),
            Some(out) => {
                let out = out.cast::<PyArrayDyn<T>>()?;
                if out.shape() != shape || !is_plain(out) {
                    return Err(PyValueError::new_err(format!(
                        "out has shape {:?}: it must be a contiguous, aligned array of shape {shape:?}",
                        out.shape()
                    )));
                }
                out.clone()
            }
        };
        let mut writer = out.try_readwrite().map_err(|error| PyValueError::new_err(format!("out: {error}")))?;
        let (numbers, results) = (self.numbers()?, writer.as_slice_mut()?);
        if self.rows() < MANY {
            fill(numbers, results)?;
        } else {
            py.detach(|| fill(numbers, results))?;
        }
        drop(writer);
        Ok(out)
    }
}

/// Whether `array` lies in C order at aligned addresses, and so is a slice.
pub fn is_plain<T: Element, D: Dimension>(array: &Bound<'_, PyArray<T, D>>) -> bool {
    array.is_c_contiguous() && array.data().is_aligned()
}

/// `values` as an array of f64 in C order, copied where they are not one.
fn converted<'py>(values: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
    let py = values.py();
    let numpy = py.import(intern!(py, "numpy"))?;
    let array = numpy.call_method1(intern!(py, "asarray"), (values,))?;
    // Integers are taken; complex numbers, texts and objects are not, whatever numbers they may hold.
    let options = PyDict::new(py);
    options.set_item(intern!(py, "casting"), intern!(py, "same_kind"))?;
    options.set_item(intern!(py, "order"), intern!(py, "C"))?;
    options.set_item(intern!(py, "copy"), false)?;
    let array = array.call_method(intern!(py, "astype"), (intern!(py, "float64"),), Some(&options))?;
    let array = array.cast_into::<PyArrayDyn<f64>>()?;
    if is_plain(&array) {
        return Ok(array);
    }
    // Misaligned: a copy is not.
    Ok(array.call_method0(intern!(py, "copy"))?.cast_into::<PyArrayDyn<f64>>()?)
}

/// Numbers from an array or a nested sequence, and its shape.
pub fn numbers(values: &Bound<'_, PyAny>) -> PyResult<(Vec<f64>, Vec<usize>)> {
    let array = converted(values)?;
    let read = array.try_readonly().map_err(|error| PyValueError::new_err(error.to_string()))?;
    Ok((read.as_slice()?.to_vec(), array.shape().to_vec()))
}

/// One vector of `joints` numbers.
pub fn vector(name: &str, values: &Bound<'_, PyAny>, joints: usize) -> PyResult<haptize::JointVector> {
    let (numbers, shape) = match values.cast::<PyArray1<f64>>() {
        // Without a copy for what a loop is called with.
        Ok(array) if is_plain(array) && array.len() == joints => {
            let read = array.try_readonly().map_err(|error| PyValueError::new_err(error.to_string()))?;
            return Ok(haptize::JointVector::from_slice(read.as_slice()?));
        }
        _ => numbers(values)?,
    };
    if shape != [joints] {
        let message = format!("{name} has shape {shape:?}: it must have one entry per joint, {joints}");
        return Err(PyValueError::new_err(message));
    }
    Ok(haptize::JointVector::from_slice(&numbers))
}

/// An array of `shape` that holds `values`.
pub fn array<T: Element>(py: Python<'_>, values: Vec<T>, shape: &[usize]) -> PyResult<Py<PyArrayDyn<T>>> {
    Ok(PyArray1::from_vec(py, values).reshape(shape.to_vec())?.unbind())
}
