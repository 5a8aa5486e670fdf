//! Arrays in and out: configurations from whatever NumPy takes for numbers, results into the caller's array or a new
//! one.

use crate::{errors, threads};
use haptize::{JointVector, field::check_rows};
use numpy::{
    Element, PyArray, PyArray1, PyArrayDescrMethods, PyArrayDyn, PyArrayMethods, PyReadonlyArrayDyn, PyUntypedArray,
    PyUntypedArrayMethods,
    npyffi::{NPY_ARRAY_ALIGNED, NPY_ARRAY_C_CONTIGUOUS, NPY_ARRAY_WRITEABLE, NPY_TYPES},
};
use pyo3::{
    exceptions::{PyTypeError, PyValueError},
    intern,
    prelude::*,
    types::PyDict,
};
use std::time::{Duration, Instant};

/// Rows from which on other Python threads run meanwhile: a few microseconds of work.
const MANY: usize = 32;

/// How often signals are looked at meanwhile: well below what a person notices.
const TURN: Duration = Duration::from_millis(50);

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

    /// Fills an array of `T`, for each configuration of the shape `row`, by `fill`, which takes the number of the first of
    /// some configurations, these, and their results. The array is `out`, whose shape must be right and which must not be
    /// `q`, or a new one. Many rows are filled while other threads of Python run, and Ctrl-C ends the call.
    pub fn fill<T: Element + Send>(
        &self,
        row: &[usize],
        out: Option<&Bound<'py, PyAny>>,
        fill: impl Fn(usize, &[f64], &mut [T]) -> PyResult<()> + Send + Sync,
    ) -> PyResult<Bound<'py, PyArrayDyn<T>>> {
        let py = self.array.py();
        let (rows, joints) = (self.rows(), self.array.shape().last().copied().unwrap_or_default());
        check_rows(self.numbers()?, joints).map_err(errors::rows)?;
        let shape = [self.shape(), row].concat();
        let out = match out {
            None => PyArray::zeros(py, shape, false),
            Some(out) => {
                let out = output(out)?;
                if out.shape() != shape || !is_plain(out) {
                    return Err(wrong_output(out.shape(), &shape));
                }
                out.clone()
            }
        };
        let mut writer = out.try_readwrite().map_err(|error| PyValueError::new_err(format!("out: {error}")))?;
        let (numbers, results) = (self.numbers()?, writer.as_slice_mut()?);
        if rows < MANY {
            fill(0, numbers, results)?;
        } else {
            let width = results.len() / rows;
            let (mut done, mut piece) = (0, 1);
            while done < rows {
                threads::detach(py, || {
                    let begun = Instant::now();
                    while done < rows && begun.elapsed() < TURN {
                        let (since, end) = (Instant::now(), rows.min(done + piece));
                        fill(done, &numbers[done * joints..end * joints], &mut results[done * width..end * width])?;
                        done = end;
                        // Pieces come to take between a sixteenth of a turn and a half of it.
                        piece = match since.elapsed() {
                            took if took < TURN / 16 => 8 * piece,
                            took if took > TURN / 2 => piece.div_ceil(8),
                            _ => piece,
                        };
                    }
                    PyResult::Ok(())
                })??;
                py.check_signals()?;
            }
        }
        drop(writer);
        Ok(out)
    }
}

/// Whether `array` lies in C order at aligned addresses, and so is a slice.
fn is_plain<T: Element>(array: &Bound<'_, PyArrayDyn<T>>) -> bool {
    array.is_c_contiguous() && array.data().is_aligned()
}

/// `out` as an array of `T`.
fn output<'a, 'py, T: Element>(out: &'a Bound<'py, PyAny>) -> PyResult<&'a Bound<'py, PyArrayDyn<T>>> {
    out.cast().map_err(|_| {
        let kind = T::get_dtype(out.py());
        let found = out.getattr("dtype").map_or_else(|_| out.get_type().to_string(), |kind| format!("of {kind}"));
        PyTypeError::new_err(format!("out is {found}: it must be an array of {kind}"))
    })
}

fn wrong_output(shape: &[usize], expected: &[usize]) -> PyErr {
    PyValueError::new_err(format!(
        "out has shape {shape:?}: it must be a contiguous, aligned array of shape {expected:?}"
    ))
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
pub fn vector(name: &str, values: &Bound<'_, PyAny>, joints: usize) -> PyResult<JointVector> {
    if let Some(vector) = plain_vector(values, joints) {
        return Ok(vector.read());
    }
    let (numbers, shape) = numbers(values)?;
    if shape != [joints] {
        let message = format!("{name} has shape {shape:?}: it must have one entry per joint, {joints}");
        return Err(PyValueError::new_err(message));
    }
    Ok(JointVector::from_slice(&numbers))
}

/// A NumPy vector of one f64 per joint, contiguous and aligned: what a loop is called with a thousand times a second.
/// It is told by its flags, which takes a few nanoseconds, where NumPy's own comparison of types and the ledger of
/// borrows take some hundred.
pub struct PlainVector<'a, 'py> {
    array: &'a Bound<'py, PyUntypedArray>,
    joints: usize,
}

/// `values` as a plain vector of `joints` numbers; `None` where it is anything else.
pub fn plain_vector<'a, 'py>(values: &'a Bound<'py, PyAny>, joints: usize) -> Option<PlainVector<'a, 'py>> {
    let array = values.cast::<PyUntypedArray>().ok()?;
    let (vector, kind) = (PlainVector { array, joints }, array.dtype());
    let numbers = kind.num() == NPY_TYPES::NPY_DOUBLE as i32 && kind.is_native_byteorder() == Some(true);
    let plain = numbers && array.shape() == [joints] && vector.has(NPY_ARRAY_C_CONTIGUOUS | NPY_ARRAY_ALIGNED);
    plain.then_some(vector)
}

impl<'py> PlainVector<'_, 'py> {
    fn has(&self, flags: i32) -> bool {
        // SAFETY: the array is alive, and nothing else writes its flags while this thread holds the interpreter.
        unsafe { (*self.array.as_array_ptr()).fields.flags & flags == flags }
    }

    fn place(&self) -> *mut f64 {
        // SAFETY: as above; the type was checked.
        unsafe { (*self.array.as_array_ptr()).fields.data.cast() }
    }

    /// Copies the numbers.
    pub fn read(&self) -> JointVector {
        // SAFETY: there are as many numbers, aligned and side by side; they are copied while this thread holds the
        // interpreter.
        JointVector::from_slice(unsafe { std::slice::from_raw_parts(self.place(), self.joints) })
    }
}

/// Where one vector of results goes: the caller's array, which may be the one that the question came in, or a new one.
pub struct Output<'a, 'py>(Option<PlainVector<'a, 'py>>);

impl<'a, 'py> Output<'a, 'py> {
    /// Takes `out`, if there is one, for `joints` numbers.
    pub fn new(out: Option<&'a Bound<'py, PyAny>>, joints: usize) -> PyResult<Self> {
        let Some(out) = out else { return Ok(Self(None)) };
        match plain_vector(out, joints) {
            Some(vector) if vector.has(NPY_ARRAY_WRITEABLE) => Ok(Self(Some(vector))),
            Some(_) => Err(PyValueError::new_err("out: the array is read-only")),
            None => Err(wrong_output(output::<f64>(out)?.shape(), &[joints])),
        }
    }

    /// Writes `values`, one per joint, and returns the array.
    pub fn write(self, py: Python<'py>, values: &JointVector) -> Bound<'py, PyAny> {
        let Some(vector) = self.0 else { return PyArray1::from_slice(py, values).into_any() };
        let numbers = &values[..vector.joints];
        // SAFETY: there is room for as many numbers, aligned and side by side, which NumPy lets be written. No
        // reference to them lives: those that calls hold end with them, or while other threads run belong to a batch,
        // whose array nobody is to write meanwhile.
        unsafe { vector.place().copy_from_nonoverlapping(numbers.as_ptr(), numbers.len()) };
        vector.array.as_any().clone()
    }
}

/// An array of `shape` that holds `values`.
pub fn array<T: Element>(py: Python<'_>, values: Vec<T>, shape: &[usize]) -> PyResult<Py<PyArrayDyn<T>>> {
    Ok(PyArray1::from_vec(py, values).reshape(shape.to_vec())?.unbind())
}
