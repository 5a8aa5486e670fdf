//! Direct equilibria: a scene solved at one configuration, without a dataset.

use crate::{
    HZ_MAX_JOINTS,
    field::configuration,
    outcome::{self, Extensible, Told, guarded, hz_code},
};
use haptize::{
    contact::{Solver, Status},
    scene::Scene,
    sweep::Direct,
};
use std::{ffi::c_char, mem::offset_of};

/// The object and the arm of a scene, ready to be solved at any configuration. Any number of threads may use it at
/// once.
pub struct hz_solver {
    direct: Direct,
}

/// An equilibrium. Set `size` before the call.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default)]
pub struct hz_equilibrium {
    /// sizeof(hz_equilibrium).
    pub size: usize,
    /// Torque on the arm, one entry per joint, then zeros (N m; N at prismatic joints).
    pub torque: [f64; HZ_MAX_JOINTS],
    /// Energy that object and contact store (J).
    pub energy: f64,
    /// Smallest signed distance of the arm's nodes to the surface at rest (m).
    pub gap: f64,
    /// Relative imbalance of forces (1).
    pub residual: f64,
    /// 0 free, 1 in contact, 2 not converged, 3 more contacts than there is room for.
    pub status: u32,
    /// Iterations of the contact solver.
    pub iterations: u32,
    /// Number of nodes of the object that are pushed.
    pub forces: usize,
}

// SAFETY: it begins with its size.
unsafe impl Extensible for hz_equilibrium {
    const FIRST_SIZE: usize = offset_of!(Self, forces) + size_of::<usize>();
}

/// The contact force on a node of the object.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default)]
pub struct hz_force {
    /// Number of the node.
    pub node: usize,
    /// Force on it (N).
    pub force: [f64; 3],
}

/// Reads the scene file at `path` (UTF-8) and prepares its object and arm. That takes up to some seconds.
///
/// On success `*solver` is to be closed with hz_solver_close; on failure it is NULL and `message`, `message_size` bytes
/// that may be NULL, says why, with file and line. Returns HZ_OK, HZ_ARGUMENT, HZ_FILE or HZ_SCENE.
///
/// # Safety
/// All are NULL or as described.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hz_solver_open(
    path: *const c_char,
    solver: *mut *mut hz_solver,
    message: *mut c_char,
    message_size: usize,
) -> hz_code {
    let make = || {
        // SAFETY: as the caller promises.
        let scene = Scene::load(unsafe { outcome::path(path)? })?;
        crate::check_joints(scene.proxy.joints.len())?;
        Ok((hz_solver { direct: Direct::new(&scene)? }, String::new()))
    };
    // SAFETY: as the caller promises.
    unsafe { outcome::open(solver, message, message_size, make) }
}

/// Closes a solver; NULL is left alone. No other call may be using it.
///
/// # Safety
/// `solver` is NULL or one that was opened and not yet closed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hz_solver_close(solver: *mut hz_solver) {
    // SAFETY: as the caller promises.
    unsafe { outcome::close(solver) }
}

/// Returns the number of joints, 1 to HZ_MAX_JOINTS; 0 for NULL.
///
/// # Safety
/// `solver` is NULL or open.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hz_solver_joints(solver: *const hz_solver) -> u32 {
    // SAFETY: as the caller promises.
    unsafe { solver.as_ref() }.map_or(0, |solver| solver.direct.joints() as u32)
}

/// Solves the equilibrium at the configuration `q`, one entry per joint (rad; m), from the object at rest. `forces`,
/// which may be NULL, is told as many contact forces as it has room for, `room`; `equilibrium` tells how many there
/// are. Takes some tenths of a millisecond and more, and allocates: not for the real-time thread.
///
/// Returns HZ_OK, HZ_UNCONVERGED, or HZ_ARGUMENT for NULL or a `q` that is not finite.
///
/// # Safety
/// `solver` is NULL or open; `q` is NULL or has one entry per joint; `equilibrium` is NULL or tells its size; `forces`
/// is NULL or has `room` entries.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn hz_solver_solve(
    solver: *const hz_solver,
    q: *const f64,
    equilibrium: *mut hz_equilibrium,
    forces: *mut hz_force,
    room: usize,
) -> hz_code {
    guarded(|| {
        // SAFETY: as the caller promises.
        let (Some(solver), Some(out)) = (unsafe { (solver.as_ref(), Told::new(equilibrium)) }) else {
            return hz_code::HZ_ARGUMENT;
        };
        // SAFETY: as the caller promises. `q` is copied before anything is written: it may lie within the equilibrium.
        let Some(q) = (unsafe { configuration(q, solver.direct.joints()) }) else {
            // SAFETY: as the caller promises.
            unsafe { out.write(&hz_equilibrium::default()) };
            return hz_code::HZ_ARGUMENT;
        };
        let found = Solver::new(solver.direct.model()).solve(&q);
        let told = hz_equilibrium {
            size: 0,
            torque: crate::padded(&found.torque),
            energy: found.energy,
            gap: found.gap,
            residual: found.residual,
            status: found.status as u32,
            iterations: found.iterations,
            forces: found.forces.len(),
        };
        // SAFETY: as the caller promises; nothing borrows `q` any more.
        unsafe { out.write(&told) };
        // SAFETY: as the caller promises.
        if let Some(forces) = unsafe { outcome::slice_mut(forces, room) } {
            for (to, from) in forces.iter_mut().zip(&found.forces) {
                *to = hz_force { node: from.node as usize, force: from.force.to_array() };
            }
        }
        match found.status {
            Status::Free | Status::Contact => hz_code::HZ_OK,
            Status::Unconverged | Status::Overflow | Status::Outside => hz_code::HZ_UNCONVERGED,
        }
    })
}
