//! Torque fields: a dataset, looked up at any configuration.

use crate::{
    HZ_MAX_JOINTS,
    outcome::{self, Extensible, Told, guarded, hz_code},
};
use haptize::{
    JointVector,
    contact::Status,
    dataset::Dataset,
    field::{Sample, TorqueField},
    render::setup,
};
use std::{ffi::c_char, mem::offset_of};

/// The torque field of a dataset. Any number of threads may look it up at once.
pub struct hz_field {
    field: TorqueField,
    least: JointVector,
    greatest: JointVector,
}

/// A look-up in full. Set `size` before the call.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default)]
pub struct hz_sample {
    /// sizeof(hz_sample).
    pub size: usize,
    /// Torque on the arm, one entry per joint, then zeros (N m; N at prismatic joints).
    pub torque: [f64; HZ_MAX_JOINTS],
    /// Energy that the object stores (J); zero where the dataset does not tell it.
    pub energy: f64,
    /// Share of the grid points around that are in contact, 0 to 1.
    pub index: f64,
    /// 0 free, 1 in contact, 2 not converged, 4 outside the grid or not computed.
    pub status: u32,
    /// Nodes of the object in contact; zero where nothing touches.
    pub contact_nodes: u32,
}

// SAFETY: it begins with its size.
unsafe impl Extensible for hz_sample {
    const FIRST_SIZE: usize = offset_of!(Self, contact_nodes) + size_of::<u32>();
}

/// Opens the dataset file at `path` (UTF-8) and makes the field of it in memory as its scene has it felt; without a
/// scene it is interpolated linearly. The file is checked in full, and not needed afterwards.
///
/// On success `*field` is to be closed with hz_field_close; on failure it is NULL and `message`, `message_size` bytes
/// that may be NULL, says why. Returns HZ_OK, HZ_ARGUMENT, HZ_FILE, HZ_FORMAT or HZ_SCENE.
///
/// # Safety
/// All are NULL or as described.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hz_field_open(
    path: *const c_char,
    field: *mut *mut hz_field,
    message: *mut c_char,
    message_size: usize,
) -> hz_code {
    let make = || {
        // SAFETY: as the caller promises.
        let dataset = Dataset::open(unsafe { outcome::path(path)? })?;
        let field = setup::field(&dataset, None)?;
        let joints = dataset.grid.joints();
        let [mut least, mut greatest] = [JointVector::zeros(joints); 2];
        for (a, axis) in dataset.grid.axes.iter().enumerate() {
            (least[a], greatest[a]) = (axis.coordinate(0), axis.coordinate(axis.count - 1));
        }
        Ok((hz_field { field, least, greatest }, String::new()))
    };
    // SAFETY: as the caller promises.
    unsafe { outcome::open(field, message, message_size, make) }
}

/// Closes a field; NULL is left alone. No other call may be using it.
///
/// # Safety
/// `field` is NULL or one that was opened and not yet closed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hz_field_close(field: *mut hz_field) {
    // SAFETY: as the caller promises.
    unsafe { outcome::close(field) }
}

/// Returns the number of joints, 1 to HZ_MAX_JOINTS; 0 for NULL.
///
/// # Safety
/// `field` is NULL or open.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hz_field_joints(field: *const hz_field) -> u32 {
    // SAFETY: as the caller promises.
    unsafe { field.as_ref() }.map_or(0, |field| field.field.joints() as u32)
}

/// Tells the grid's ends, one entry per joint each (rad; m at prismatic joints). Real-time safe.
///
/// # Safety
/// `field` is NULL or open; `least` and `greatest` are NULL or have one entry per joint.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hz_field_bounds(field: *const hz_field, least: *mut f64, greatest: *mut f64) -> hz_code {
    // SAFETY: as the caller promises.
    let Some(field) = (unsafe { field.as_ref() }) else { return hz_code::HZ_ARGUMENT };
    let joints = field.least.len();
    for (place, ends) in [(least, &field.least), (greatest, &field.greatest)] {
        // SAFETY: as the caller promises.
        let Some(out) = (unsafe { outcome::slice_mut(place, joints) }) else { return hz_code::HZ_ARGUMENT };
        out.copy_from_slice(ends);
    }
    hz_code::HZ_OK
}

/// Looks up the torque `tau` (N m; N at prismatic joints) at the configuration `q` (rad; m), one entry per joint each.
/// Real-time safe: it allocates, locks and prints nothing, waits for nothing, and takes the same time wherever `q` is.
/// Any number of threads may call it.
///
/// Returns HZ_OK, HZ_OUTSIDE or HZ_UNCONVERGED; HZ_ARGUMENT for NULL or a `q` that is not finite, with zeros for a
/// torque.
///
/// # Safety
/// `field` is NULL or open; `q` and `tau` are NULL or have one entry per joint.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hz_field_torque(field: *const hz_field, q: *const f64, tau: *mut f64) -> hz_code {
    guarded(|| {
        // SAFETY: as the caller promises.
        let Some(field) = (unsafe { field.as_ref() }) else { return hz_code::HZ_ARGUMENT };
        let joints = field.field.joints();
        // SAFETY: as the caller promises. `q` is copied before anything is written: it may lie where `tau` does.
        let q = unsafe { configuration(q, joints) };
        // SAFETY: as the caller promises; nothing borrows `q` any more.
        let Some(tau) = (unsafe { outcome::slice_mut(tau, joints) }) else { return hz_code::HZ_ARGUMENT };
        tau.fill(0.0);
        let Some(q) = q else { return hz_code::HZ_ARGUMENT };
        let sample = field.field.sample(&q);
        tau.copy_from_slice(&sample.torque);
        code(sample.status())
    })
}

/// Looks up all that the field knows of the configuration `q` (rad; m). Real-time safe as hz_field_torque, with the
/// same codes.
///
/// # Safety
/// `field` is NULL or open; `q` is NULL or has one entry per joint; `sample` is NULL or tells its size.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hz_field_sample(field: *const hz_field, q: *const f64, sample: *mut hz_sample) -> hz_code {
    guarded(|| {
        // SAFETY: as the caller promises.
        let (Some(field), Some(out)) = (unsafe { (field.as_ref(), Told::new(sample)) }) else {
            return hz_code::HZ_ARGUMENT;
        };
        // SAFETY: as the caller promises. `q` is copied before anything is written: it may lie within the sample.
        let q = unsafe { configuration(q, field.field.joints()) };
        let found = q.map(|q| field.field.sample(&q));
        let told = found.as_ref().map_or_else(hz_sample::default, told_sample);
        // SAFETY: as the caller promises; nothing borrows `q` any more.
        unsafe { out.write(&told) };
        found.map_or(hz_code::HZ_ARGUMENT, |found| code(found.status()))
    })
}

/// Looks up `count` torques on all cores: row k of `tau` at row k of `q`, rows of one entry per joint. `status`, which
/// may be NULL, is told the status of each, as hz_sample has it. `tau` may be `q`. Not for the real-time thread.
///
/// Returns HZ_OK; HZ_ARGUMENT for NULL or a `q` that is not finite, with zeros for all torques.
///
/// # Safety
/// `field` is NULL or open; `q` and `tau` are NULL or have `count` rows, `status` is NULL or has `count` entries, and
/// overlaps neither.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hz_field_torques(
    field: *const hz_field,
    count: usize,
    q: *const f64,
    tau: *mut f64,
    status: *mut u8,
) -> hz_code {
    guarded(|| {
        // SAFETY: as the caller promises.
        let Some(field) = (unsafe { field.as_ref() }) else { return hz_code::HZ_ARGUMENT };
        let Some(entries) = count.checked_mul(field.field.joints()) else { return hz_code::HZ_ARGUMENT };
        if count == 0 {
            return hz_code::HZ_OK;
        }
        // SAFETY: as the caller promises.
        let mut q = unsafe { outcome::slice(q, entries) };
        let copy = q.filter(|q| overlap(q.as_ptr(), tau, entries)).map(<[f64]>::to_vec);
        if copy.is_some() {
            q = copy.as_deref();
        }
        // SAFETY: as the caller promises; `q` lies elsewhere.
        let Some(tau) = (unsafe { outcome::slice_mut(tau, entries) }) else { return hz_code::HZ_ARGUMENT };
        tau.fill(0.0);
        // SAFETY: as the caller promises.
        let (Some(q), status) = (q, unsafe { outcome::slice_mut(status, count) }) else { return hz_code::HZ_ARGUMENT };
        match field.field.torques(q, tau, status) {
            Ok(()) => hz_code::HZ_OK,
            Err(_) => hz_code::HZ_ARGUMENT,
        }
    })
}

/// The configuration at `q`; `None` where it is NULL or not finite.
///
/// # Safety
/// `q` is NULL or has `joints` entries.
pub unsafe fn configuration(q: *const f64, joints: usize) -> Option<JointVector> {
    // SAFETY: as the caller promises.
    let q = JointVector::from_slice(unsafe { outcome::slice(q, joints) }?);
    q.is_finite().then_some(q)
}

/// Whether `entries` numbers at `a` and at `b` have some in common.
fn overlap(a: *const f64, b: *const f64, entries: usize) -> bool {
    a.addr().abs_diff(b.addr()) < entries * size_of::<f64>()
}

/// `found` as it is told.
pub fn told_sample(found: &Sample) -> hz_sample {
    hz_sample {
        size: 0,
        torque: crate::padded(&found.torque),
        energy: found.energy,
        index: found.index,
        status: found.status() as u32,
        contact_nodes: found.contact_nodes,
    }
}

/// How a look-up ended that found `status`.
pub fn code(status: Status) -> hz_code {
    match status {
        Status::Free | Status::Contact => hz_code::HZ_OK,
        Status::Unconverged | Status::Overflow => hz_code::HZ_UNCONVERGED,
        Status::Outside => hz_code::HZ_OUTSIDE,
    }
}
