//! The passive haptic loop, driven tick by tick by the caller's own device.

use crate::{
    HZ_MAX_JOINTS,
    field::configuration,
    outcome::{self, Extensible, Failure, Told, argument, guarded, hz_code, write_text},
};
use haptize::{
    JointVector,
    dataset::Dataset,
    render::{driven::DrivenLoop, haptic::Inputs, live::LiveScene, setup::Setup},
    scene::{HapticsSpec, Scene},
};
use std::{ffi::c_char, mem::offset_of, sync::Arc};

/// A haptic loop: the virtual proxy, its coupling to the device, the torque field, and the watchdog. One thread at a
/// time may use it.
pub struct hz_loop {
    of: DrivenLoop,
    started: bool,
}

/// Gains in the place of the scene's. Initialise all of it with zeros, set `size`, and one entry per joint of what is
/// to change: a list of zeros leaves the scene's.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default)]
pub struct hz_gains {
    /// sizeof(hz_gains).
    pub size: usize,
    /// Stiffness of the virtual coupling at each joint (N m/rad; N/m).
    pub coupling_stiffness: [f64; HZ_MAX_JOINTS],
    /// Damping of the virtual coupling at each joint (N m s/rad; N s/m).
    pub coupling_damping: [f64; HZ_MAX_JOINTS],
    /// Greatest torque of each joint, in size (N m; N).
    pub torque_limit: [f64; HZ_MAX_JOINTS],
}

/// The report of a tick beside its torque. Set `size` before the call.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default)]
pub struct hz_tick {
    /// sizeof(hz_tick).
    pub size: usize,
    /// Position of the virtual proxy, one entry per joint, then zeros (rad; m).
    pub proxy: [f64; HZ_MAX_JOINTS],
    /// Contact torque on the proxy (N m; N).
    pub contact_torque: [f64; HZ_MAX_JOINTS],
    /// Energy that the object stores (J); zero where the dataset does not tell it.
    pub energy: f64,
    /// 1 in contact, else 0.
    pub contact: u32,
    /// Remarks, as bits: 1 outside the grid, 2 beside a grid point that was not computed, 4 beside one that did not
    /// converge, 8 held by the boundary layer, 16 a joint at its limit, 32 torque cut in size, 64 torque cut in rate,
    /// 128 held at the border of the haptized range.
    pub flags: u32,
}

// SAFETY: both begin with their size.
unsafe impl Extensible for hz_gains {
    const FIRST_SIZE: usize = offset_of!(Self, torque_limit) + size_of::<[f64; HZ_MAX_JOINTS]>();
}
// SAFETY: as above.
unsafe impl Extensible for hz_tick {
    const FIRST_SIZE: usize = offset_of!(Self, flags) + size_of::<u32>();
}

/// Opens the dataset file at `path` (UTF-8) and makes the haptic loop of its scene, with `gains` in the place of the
/// scene's where that is not NULL. A path that ends in .toml is that of a scene: nothing of it is baked, and contact is
/// solved in every tick, before the surface at rest. The file is not needed afterwards.
///
/// On success `*loop` is to be closed with hz_loop_close, and `message`, `message_size` bytes that may be NULL, names
/// the gains that are beyond their passivity bound, each with a remedy, and says where contact is solved otherwise than
/// the scene has it; it is empty where there is nothing to say. On failure
/// `*loop` is NULL and `message` says why. Returns HZ_OK, HZ_ARGUMENT, HZ_FILE, HZ_FORMAT or HZ_SCENE.
///
/// # Safety
/// All are NULL or as described; `gains` tells its size.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hz_loop_open(
    path: *const c_char,
    gains: *const hz_gains,
    r#loop: *mut *mut hz_loop,
    message: *mut c_char,
    message_size: usize,
) -> hz_code {
    let make = || {
        // SAFETY: as the caller promises.
        let path = unsafe { outcome::path(path)? };
        let (dataset, setup, notice) = if Scene::is_at(path) {
            let scene = Arc::new(LiveScene::new(Scene::load(path)?)?);
            let (dataset, notice) = (scene.dataset(), scene.notice());
            let setup = Setup::live(scene, &dataset)?;
            (dataset, setup, notice)
        } else {
            let dataset = Dataset::open(path)?;
            let setup = Setup::new(&dataset)?;
            (dataset, setup, None)
        };
        let (haptics, advice) = if gains.is_null() {
            (setup.haptics.clone(), setup.advice)
        } else {
            // SAFETY: as the caller promises.
            let gains = unsafe { outcome::given(gains) };
            let gains = gains.ok_or_else(|| argument("gains.size is not sizeof(hz_gains)"))?;
            let mut spec = setup.scene.haptics.clone();
            take(&gains, &mut spec)?;
            let (haptics, advice) = setup.retuned(&dataset, &spec)?;
            (Arc::new(haptics), advice)
        };
        crate::check_joints(haptics.joints())?;
        let begin = JointVector::zeros(haptics.joints());
        let of = DrivenLoop::new(haptics, &begin).map_err(|fault| argument(fault.to_string()))?;
        let remarks: Vec<String> =
            advice.map(|advice| advice.text).into_iter().chain(notice.map(str::to_owned)).collect();
        Ok((hz_loop { of, started: false }, remarks.join("\n")))
    };
    // SAFETY: as the caller promises.
    unsafe { outcome::open(r#loop, message, message_size, make) }
}

/// Puts what `gains` tell into `spec`.
fn take(gains: &hz_gains, spec: &mut HapticsSpec) -> Result<(), Failure> {
    let lists = [
        ("coupling_stiffness", &gains.coupling_stiffness),
        ("coupling_damping", &gains.coupling_damping),
        ("torque_limit", &gains.torque_limit),
    ];
    for (key, list) in lists {
        let given = &list[..spec.torque_limit.len()];
        if given.iter().any(|gain| *gain != 0.0) {
            spec.set_gain(key, given).map_err(|error| argument(error.to_string()))?;
        }
    }
    Ok(())
}

/// Closes a loop; NULL is left alone. No other call may be using it.
///
/// # Safety
/// `loop` is NULL or one that was opened and not yet closed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hz_loop_close(r#loop: *mut hz_loop) {
    // SAFETY: as the caller promises.
    unsafe { outcome::close(r#loop) }
}

/// Returns the number of joints, 1 to HZ_MAX_JOINTS; 0 for NULL.
///
/// # Safety
/// `loop` is NULL or open.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hz_loop_joints(r#loop: *const hz_loop) -> u32 {
    // SAFETY: as the caller promises.
    unsafe { r#loop.as_ref() }.map_or(0, |handle| handle.of.haptics().joints() as u32)
}

/// Returns the time between two ticks for which the gains are meant (s); 0 for NULL.
///
/// # Safety
/// `loop` is NULL or open.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hz_loop_period(r#loop: *const hz_loop) -> f64 {
    // SAFETY: as the caller promises.
    unsafe { r#loop.as_ref() }.map_or(0.0, |handle| handle.of.haptics().period())
}

/// Begins at the device's position `y`, one entry per joint (rad; m): before the first tick, and to end a fault. The
/// torque goes on from what the device is under, so that there is no jump. Real-time safe: it allocates, locks and
/// prints nothing, and waits for nothing.
///
/// Returns HZ_OK, or HZ_ARGUMENT for NULL or a position that is none; a fault then stays.
///
/// # Safety
/// `loop` is NULL or open; `y` is NULL or has one entry per joint.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hz_loop_start(r#loop: *mut hz_loop, y: *const f64) -> hz_code {
    guarded(|| {
        // SAFETY: as the caller promises.
        let Some(hz_loop { of, started }) = (unsafe { r#loop.as_mut() }) else { return hz_code::HZ_ARGUMENT };
        // SAFETY: as the caller promises.
        let Some(position) = (unsafe { configuration(y, of.haptics().joints()) }) else { return hz_code::HZ_ARGUMENT };
        match of.restart(&position) {
            Ok(()) => {
                *started = true;
                hz_code::HZ_OK
            }
            Err(_) => hz_code::HZ_ARGUMENT,
        }
    })
}

/// Does one tick: `tau` is what the device is to exert until the next one (N m; N), for its position `y` (rad; m), one
/// entry per joint each. `age` is the time since that was measured (s), `dt` the time since the tick before (s).
/// `tick`, which may be NULL, is told the rest. Real-time safe: it allocates, locks and prints nothing, and waits for
/// nothing.
///
/// Returns HZ_OK, or HZ_LET_GO once something was wrong with a position, its age, the time between ticks or the energy
/// at the device; the torque then goes to zero at the rate to which the scene limits it, and stays there until
/// hz_loop_start. HZ_ARGUMENT, with zeros for a torque, for NULL or before hz_loop_start.
///
/// # Safety
/// `loop` is NULL or open; `y` and `tau` are NULL or have one entry per joint; `tick` is NULL or tells its size.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hz_loop_tick(
    r#loop: *mut hz_loop,
    y: *const f64,
    age: f64,
    dt: f64,
    tau: *mut f64,
    tick: *mut hz_tick,
) -> hz_code {
    guarded(|| {
        // SAFETY: as the caller promises.
        let Some(hz_loop { of, started }) = (unsafe { r#loop.as_mut() }) else { return hz_code::HZ_ARGUMENT };
        let joints = of.haptics().joints();
        // SAFETY: as the caller promises. `y` is copied before anything is written: it may lie where `tau` does.
        let y = unsafe { outcome::slice(y, joints) }.map(JointVector::from_slice);
        // SAFETY: as the caller promises; nothing borrows `y` any more.
        let Some(tau) = (unsafe { outcome::slice_mut(tau, joints) }) else { return hz_code::HZ_ARGUMENT };
        tau.fill(0.0);
        // SAFETY: as the caller promises.
        let (Some(position), info) = (y, unsafe { Told::new(tick) }) else { return hz_code::HZ_ARGUMENT };
        if !*started || (info.is_none() && !tick.is_null()) {
            return hz_code::HZ_ARGUMENT;
        }
        let inputs = Inputs { position, age, elapsed: dt, interval: dt };
        let output = of.tick(&inputs);
        tau.copy_from_slice(&output.torque);
        if let Some(info) = info {
            let told = hz_tick {
                size: 0,
                proxy: crate::padded(&output.proxy),
                contact_torque: crate::padded(&output.sample.torque),
                energy: output.sample.energy,
                contact: output.sample.contact.into(),
                flags: output.flags.bits().into(),
            };
            // SAFETY: as the caller promises.
            unsafe { info.write(&told) };
        }
        if output.fault.is_some() { hz_code::HZ_LET_GO } else { hz_code::HZ_OK }
    })
}

/// Tells in `message`, `message_size` bytes, why the loop has let go and what to do about it; an empty text where it
/// has not.
///
/// Returns HZ_OK, HZ_LET_GO, or HZ_ARGUMENT for NULL.
///
/// # Safety
/// `loop` is NULL or open; `message` is NULL or has `message_size` bytes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hz_loop_fault(r#loop: *const hz_loop, message: *mut c_char, message_size: usize) -> hz_code {
    guarded(|| {
        // SAFETY: as the caller promises.
        let Some(hz_loop { of, .. }) = (unsafe { r#loop.as_ref() }) else { return hz_code::HZ_ARGUMENT };
        let fault = of.fault();
        // SAFETY: as the caller promises.
        unsafe {
            match fault {
                None => write_text(message, message_size, &""),
                Some(fault) => write_text(message, message_size, &fault),
            }
        }
        if fault.is_some() { hz_code::HZ_LET_GO } else { hz_code::HZ_OK }
    })
}
