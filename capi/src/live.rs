//! Contact of a scene for which nothing was baked, solved wherever it is asked for, in the time of a tick.

use crate::{
    field::{code, configuration, hz_sample, told_sample},
    outcome::{self, Told, guarded, hz_code},
};
use haptize::{
    render::{driven::LiveField, live::LiveScene},
    scene::Scene,
};
use std::ffi::c_char;

/// The contact of a scene, before the surface at rest. One thread at a time may use it.
pub struct hz_live {
    field: LiveField,
}

/// Reads the scene file at `path` (UTF-8) and prepares its object and arm. That takes up to some seconds.
///
/// On success `*live` is to be closed with hz_live_close, and `message`, `message_size` bytes that may be NULL, says
/// where contact is solved otherwise than the scene has it; on failure `*live` is NULL and `message` says why, with file
/// and line. Returns HZ_OK, HZ_ARGUMENT, HZ_FILE or HZ_SCENE.
///
/// # Safety
/// All are NULL or as described.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hz_live_open(
    path: *const c_char,
    live: *mut *mut hz_live,
    message: *mut c_char,
    message_size: usize,
) -> hz_code {
    let make = || {
        // SAFETY: as the caller promises.
        let scene = Scene::load(unsafe { outcome::path(path)? })?;
        crate::check_joints(scene.proxy.joints.len())?;
        let scene = LiveScene::new(scene)?;
        let notice = scene.notice().unwrap_or_default().to_owned();
        Ok((hz_live { field: LiveField::new(scene) }, notice))
    };
    // SAFETY: as the caller promises.
    unsafe { outcome::open(live, message, message_size, make) }
}

/// Closes it; NULL is left alone. No other call may be using it.
///
/// # Safety
/// `live` is NULL or one that was opened and not yet closed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hz_live_close(live: *mut hz_live) {
    // SAFETY: as the caller promises.
    unsafe { outcome::close(live) }
}

/// Returns the number of joints, 1 to HZ_MAX_JOINTS; 0 for NULL.
///
/// # Safety
/// `live` is NULL or open.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hz_live_joints(live: *const hz_live) -> u32 {
    // SAFETY: as the caller promises.
    unsafe { live.as_ref() }.map_or(0, |live| live.field.grid().joints() as u32)
}

/// Solves contact at the configuration `q`, one entry per joint (rad; m): fast along a way, where `q` is near the one
/// before. Real-time safe: it allocates, locks and prints nothing, and waits for nothing; its work is bounded.
///
/// Returns HZ_OK; HZ_UNCONVERGED where contact is larger than what is solved, with what was solved last; HZ_ARGUMENT,
/// with zeros, for NULL or a `q` that is not finite.
///
/// # Safety
/// `live` is NULL or open; `q` is NULL or has one entry per joint; `sample` is NULL or tells its size.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hz_live_sample(live: *mut hz_live, q: *const f64, sample: *mut hz_sample) -> hz_code {
    guarded(|| {
        // SAFETY: as the caller promises.
        let (Some(live), Some(out)) = (unsafe { (live.as_mut(), Told::new(sample)) }) else {
            return hz_code::HZ_ARGUMENT;
        };
        // SAFETY: as the caller promises. `q` is copied before anything is written: it may lie within the sample.
        let q = unsafe { configuration(q, live.field.grid().joints()) };
        let found = q.map(|q| live.field.sample(&q));
        // SAFETY: as the caller promises; nothing borrows `q` any more.
        unsafe { out.write(&found.as_ref().map_or_else(hz_sample::default, told_sample)) };
        found.map_or(hz_code::HZ_ARGUMENT, |found| code(found.status()))
    })
}
