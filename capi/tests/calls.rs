//! Every function, as a program in C would call it: what it gives is what the library gives, and what cannot be taken
//! is refused.

#![allow(clippy::unwrap_used)] // clippy.toml allows it inside #[test] functions only; helpers need it, too.

mod common;

use assert_no_alloc::{AllocDisabler, assert_no_alloc};
use common::{Files, PRESSED};
use haptize::{dataset::Dataset, render::setup, scene::Scene, sweep::Direct};
use haptize_capi::*;
use std::{
    ffi::{CStr, CString, c_char},
    path::Path,
    ptr::{null, null_mut},
};

// In debug builds the process is aborted when it allocates within `assert_no_alloc`.
#[global_allocator]
static ALLOCATOR: AllocDisabler = AllocDisabler;

const ROOM: usize = 512;

/// A path as C has it.
fn c_path(path: &Path) -> CString {
    CString::new(path.to_str().unwrap()).unwrap()
}

/// Opens something; returns code, handle and message.
fn open<T>(call: impl FnOnce(*mut *mut T, *mut c_char) -> hz_code) -> (hz_code, *mut T, String) {
    let mut handle = std::ptr::dangling_mut::<T>();
    let mut message = [0x55; ROOM];
    let code = call(&raw mut handle, message.as_mut_ptr().cast());
    let text = CStr::from_bytes_until_nul(&message).unwrap().to_str().unwrap().to_owned();
    (code, handle, text)
}

fn field(files: &Files) -> *mut hz_field {
    let path = c_path(&files.path("small.haptize"));
    let (code, field, message) = open(|out, text| unsafe { hz_field_open(path.as_ptr(), out, text, ROOM) });
    assert_eq!((code, message.as_str()), (hz_code::HZ_OK, ""));
    field
}

fn haptic_loop(files: &Files, gains: *const hz_gains) -> (hz_code, *mut hz_loop, String) {
    let path = c_path(&files.path("small.haptize"));
    open(|out, text| unsafe { hz_loop_open(path.as_ptr(), gains, out, text, ROOM) })
}

#[test]
fn look_ups_are_those_of_the_library_and_allocate_nothing() {
    let files = Files::new();
    let opened = field(&files);
    let library = setup::field(&Dataset::open(&files.path("small.haptize")).unwrap(), None).unwrap();
    assert_eq!(unsafe { hz_field_joints(opened) }, 2);
    let (mut least, mut greatest) = ([0.0; 2], [0.0; 2]);
    assert_eq!(unsafe { hz_field_bounds(opened, least.as_mut_ptr(), greatest.as_mut_ptr()) }, hz_code::HZ_OK);
    assert_eq!((least[0], least[1]), (-0.3, 0.01));
    assert!((greatest[0] - 0.3).abs() < 1e-12 && (greatest[1] - 0.042).abs() < 1e-12);

    let places = [PRESSED, [0.0, 0.02], [0.31, 0.03], [5.0, 5.0]];
    let mut sample = hz_sample { size: size_of::<hz_sample>(), ..hz_sample::default() };
    for q in places {
        let mut tau = [f64::NAN; 2];
        let code = assert_no_alloc(|| unsafe { hz_field_torque(opened, q.as_ptr(), tau.as_mut_ptr()) });
        let expected = library.sample(&q);
        assert_eq!(tau, *expected.torque);
        // The torque may take the place of the configuration.
        let mut both = q;
        let place = both.as_mut_ptr();
        assert_eq!(unsafe { hz_field_torque(opened, place, place) }, code);
        assert_eq!(both, tau);
        let outside = (0..2).any(|a| q[a] > greatest[a]);
        assert_eq!(code, if outside { hz_code::HZ_OUTSIDE } else { hz_code::HZ_OK }, "{q:?}");
        let again = assert_no_alloc(|| unsafe { hz_field_sample(opened, q.as_ptr(), &raw mut sample) });
        assert_eq!((again, sample.status), (code, expected.status() as u32));
        assert_eq!((&sample.torque[..2], sample.energy), (&tau[..], expected.energy));
        // The configuration may lie within the sample.
        sample.torque[..2].copy_from_slice(&q);
        let place = &raw mut sample;
        assert_eq!(unsafe { hz_field_sample(opened, (&raw const (*place).torque).cast(), place) }, code);
        assert_eq!((&sample.torque[..2], sample.energy), (&tau[..], expected.energy));
    }
    assert!(library.sample(&PRESSED).torque.norm() > 0.0);

    let q = places.as_flattened();
    let (mut many, mut statuses) = ([f64::NAN; 8], [9; 4]);
    let code = unsafe { hz_field_torques(opened, 4, q.as_ptr(), many.as_mut_ptr(), statuses.as_mut_ptr()) };
    assert_eq!((code, statuses), (hz_code::HZ_OK, [1, 0, 4, 4]));
    let one_by_one: Vec<f64> = places.iter().flat_map(|q| library.sample(q).torque.to_vec()).collect();
    assert_eq!(many, *one_by_one);
    // In the place of the configurations, or of some of them.
    for shift in [0, 1, 2, 7] {
        let mut both = [0.0; 16];
        both[..8].copy_from_slice(q);
        let place = both.as_mut_ptr();
        let code = unsafe { hz_field_torques(opened, 4, place, place.add(shift), null_mut()) };
        assert_eq!((code, &both[shift..shift + 8]), (hz_code::HZ_OK, &many[..]), "{shift}");
    }
    unsafe { hz_field_close(opened) };
}

#[test]
fn what_a_field_cannot_take_is_refused_with_zeros() {
    let files = Files::new();
    let opened = field(&files);
    let refused = hz_code::HZ_ARGUMENT;
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let (q, mut tau) = ([PRESSED[0], PRESSED[1], bad, PRESSED[1]], [7.0; 4]);
        assert_eq!(unsafe { hz_field_torque(opened, q[2..].as_ptr(), tau.as_mut_ptr()) }, refused);
        assert_eq!(tau, [0.0, 0.0, 7.0, 7.0]);
        assert_eq!(unsafe { hz_field_torques(opened, 2, q.as_ptr(), tau.as_mut_ptr(), null_mut()) }, refused);
        assert_eq!(tau, [0.0; 4]);
    }
    let (q, mut tau) = (PRESSED, [7.0; 2]);
    unsafe {
        assert_eq!(hz_field_torque(null(), q.as_ptr(), tau.as_mut_ptr()), refused);
        assert_eq!(hz_field_torque(opened, null(), tau.as_mut_ptr()), refused);
        assert_eq!(hz_field_torque(opened, q.as_ptr(), null_mut()), refused);
        assert_eq!(hz_field_bounds(opened, null_mut(), tau.as_mut_ptr()), refused);
        assert_eq!(hz_field_torques(opened, usize::MAX, q.as_ptr(), tau.as_mut_ptr(), null_mut()), refused);
        assert_eq!(hz_field_torques(opened, usize::MAX / 16, q.as_ptr(), tau.as_mut_ptr(), null_mut()), refused);
        assert_eq!(hz_field_torques(opened, 0, null(), null_mut(), null_mut()), hz_code::HZ_OK);
        for size in [0, size_of::<hz_sample>() - 1] {
            let mut sample = hz_sample { size, ..hz_sample::default() };
            assert_eq!(hz_field_sample(opened, q.as_ptr(), &raw mut sample), refused);
        }
        assert_eq!(hz_field_sample(opened, q.as_ptr(), null_mut()), refused);
        assert_eq!(hz_field_joints(null()), 0);
        hz_field_close(null_mut());
        hz_field_close(opened);
    }
}

#[test]
fn files_that_cannot_be_opened_say_why_in_the_callers_buffer() {
    let files = Files::new();
    std::fs::write(files.path("broken.toml"), common::SCENE.replace("0.05", "-0.05")).unwrap();
    let dataset = |path: *const c_char| open(|out, text| unsafe { hz_field_open(path, out, text, ROOM) });
    let scene = |path: *const c_char| open(|out, text| unsafe { hz_solver_open(path, out, text, ROOM) });
    let (missing, toml, broken) =
        (c_path(&files.path("none.haptize")), c_path(&files.path("small.toml")), c_path(&files.path("broken.toml")));
    let no_text = CString::new([0xff, 0xfe]).unwrap();
    for (path, code, words) in [
        (missing.as_ptr(), hz_code::HZ_FILE, "none.haptize"),
        (toml.as_ptr(), hz_code::HZ_FORMAT, "not a haptize dataset"),
        (no_text.as_ptr(), hz_code::HZ_ARGUMENT, "UTF-8"),
        (null(), hz_code::HZ_ARGUMENT, "NULL"),
    ] {
        let (found, handle, message) = dataset(path);
        assert!(found == code && handle.is_null() && message.contains(words), "{found:?}: {message}");
    }
    let (code, handle, message) = scene(broken.as_ptr());
    assert!(code == hz_code::HZ_SCENE && handle.is_null() && message.contains("broken.toml:5:"), "{code:?}: {message}");
    let (code, ..) = scene(missing.as_ptr());
    assert_eq!(code, hz_code::HZ_FILE);

    // A message is cut to its buffer, and always ends.
    let mut handle = null_mut::<hz_field>();
    for room in [0, 1, 2, 40] {
        let mut text = [0x55_u8; 64];
        let code = unsafe { hz_field_open(missing.as_ptr(), &raw mut handle, text.as_mut_ptr().cast(), room) };
        assert_eq!(code, hz_code::HZ_FILE);
        assert!(text[room..].iter().all(|byte| *byte == 0x55), "{room}");
        assert!(room == 0 || CStr::from_bytes_until_nul(&text).unwrap().count_bytes() == room - 1);
    }
    assert_eq!(unsafe { hz_field_open(missing.as_ptr(), &raw mut handle, null_mut(), 7) }, hz_code::HZ_FILE);
    assert_eq!(unsafe { hz_field_open(missing.as_ptr(), null_mut(), null_mut(), 0) }, hz_code::HZ_ARGUMENT);
}

#[test]
fn the_loop_pushes_back_allocates_nothing_and_lets_go_of_a_leap() {
    let files = Files::new();
    let (code, opened, _) = haptic_loop(&files, null());
    assert_eq!((code, unsafe { hz_loop_joints(opened) }), (hz_code::HZ_OK, 2));
    let period = unsafe { hz_loop_period(opened) };
    assert_eq!(period, 1e-3);
    let (mut tau, mut tick) = ([7.0; 2], hz_tick { size: size_of::<hz_tick>(), ..hz_tick::default() });
    let mut touched = false;
    unsafe {
        // Not begun yet.
        let code = hz_loop_tick(opened, PRESSED.as_ptr(), 0.0, period, tau.as_mut_ptr(), &raw mut tick);
        assert_eq!((code, tau), (hz_code::HZ_ARGUMENT, [0.0; 2]));
        assert_no_alloc(|| {
            assert_eq!(hz_loop_start(opened, [PRESSED[0], 0.0].as_ptr()), hz_code::HZ_OK);
            for k in 0..=1000 {
                let y = [PRESSED[0], PRESSED[1] * f64::from(k) / 1000.0];
                let code = hz_loop_tick(opened, y.as_ptr(), 0.0, period, tau.as_mut_ptr(), &raw mut tick);
                assert_eq!(code, hz_code::HZ_OK);
                touched |= tick.contact == 1;
            }
        });
        assert!(touched && tau[1] < 0.0, "{tau:?} {tick:?}");
        let mut text = [0x55; ROOM];
        assert_eq!(hz_loop_fault(opened, text.as_mut_ptr().cast(), ROOM), hz_code::HZ_OK);
        assert_eq!(text[0], 0);

        // A leap: the torque goes to zero, no faster than the scene allows, and stays there.
        let mut before = tau[1];
        for k in 0..100 {
            let y = [PRESSED[0], if k == 0 { 5.0 } else { PRESSED[1] }];
            let code = hz_loop_tick(opened, y.as_ptr(), 0.0, period, tau.as_mut_ptr(), null_mut());
            assert_eq!(code, hz_code::HZ_LET_GO);
            assert!((tau[1] - before).abs() <= 5000.0 * period * (1.0 + 1e-12), "{before} to {}", tau[1]);
            before = tau[1];
        }
        assert_eq!(tau, [0.0; 2]);
        assert_eq!(hz_loop_fault(opened, text.as_mut_ptr().cast(), ROOM), hz_code::HZ_LET_GO);
        assert!(CStr::from_bytes_until_nul(&text).unwrap().to_str().unwrap().contains("leapt"));

        // Nor is it held by what is no position; it begins anew where the device is.
        for bad in [f64::NAN, f64::INFINITY] {
            assert_eq!(hz_loop_start(opened, [0.0, bad].as_ptr()), hz_code::HZ_ARGUMENT);
        }
        assert_eq!(hz_loop_start(opened, [0.0, 0.0].as_ptr()), hz_code::HZ_OK);
        assert_eq!(
            hz_loop_tick(opened, [0.0, 0.0].as_ptr(), 0.0, period, tau.as_mut_ptr(), null_mut()),
            hz_code::HZ_OK
        );
        for (age, dt) in [(f64::NAN, period), (0.0, f64::NAN), (0.0, 0.0), (1.0, period)] {
            assert_eq!(hz_loop_start(opened, [0.0, 0.0].as_ptr()), hz_code::HZ_OK);
            let code = hz_loop_tick(opened, [0.0, 0.0].as_ptr(), age, dt, tau.as_mut_ptr(), null_mut());
            assert_eq!(code, hz_code::HZ_LET_GO, "{age} {dt}");
        }
        hz_loop_close(opened);
        hz_loop_close(null_mut());
    }
}

#[test]
fn gains_are_taken_and_their_passivity_bounds_told() {
    let files = Files::new();
    let mut gains = hz_gains { size: size_of::<hz_gains>(), ..hz_gains::default() };
    let (code, opened, scene_remarks) = haptic_loop(&files, &raw const gains);
    assert_eq!(code, hz_code::HZ_OK);
    unsafe { hz_loop_close(opened) };
    gains.coupling_stiffness[..2].copy_from_slice(&[500.0, 500.0]);
    let (code, opened, remarks) = haptic_loop(&files, &raw const gains);
    assert!(code == hz_code::HZ_OK && remarks.contains("not passive") && remarks != scene_remarks, "{remarks}");
    unsafe { hz_loop_close(opened) };
    gains.coupling_stiffness[1] = -1.0;
    let (code, opened, message) = haptic_loop(&files, &raw const gains);
    assert!(
        code == hz_code::HZ_ARGUMENT && opened.is_null() && message.contains("coupling_stiffness is -1"),
        "{message}"
    );
    let gains = hz_gains { size: 8, ..hz_gains::default() };
    let (code, _, message) = haptic_loop(&files, &raw const gains);
    assert!(code == hz_code::HZ_ARGUMENT && message.contains("size"), "{message}");
}

/// A way into contact and out of it.
fn way() -> impl Iterator<Item = [f64; 2]> {
    (0..=200).map(|k| PRESSED.map(|q| q * (std::f64::consts::PI * f64::from(k) / 200.0).sin()))
}

#[test]
fn a_scene_is_felt_live_as_the_library_solves_it() {
    let files = Files::new();
    let path = c_path(&files.path("small.toml"));
    let direct = Direct::new(&Scene::load(files.path("small.toml")).unwrap()).unwrap();
    let (code, live, message) = open(|out, text| unsafe { hz_live_open(path.as_ptr(), out, text, ROOM) });
    assert_eq!((code, message.as_str()), (hz_code::HZ_OK, ""));
    assert_eq!(unsafe { hz_live_joints(live) }, 2);
    let mut sample = hz_sample { size: size_of::<hz_sample>(), ..hz_sample::default() };
    let mut touched = 0;
    for q in way() {
        let code = assert_no_alloc(|| unsafe { hz_live_sample(live, q.as_ptr(), &raw mut sample) });
        let exact = direct.inspect(&q).unwrap();
        let touches = exact.status == "contact";
        assert_eq!((code, sample.status, sample.index), (hz_code::HZ_OK, u32::from(touches), f64::from(sample.status)));
        assert!((sample.energy - exact.energy).abs() <= 1e-12 * exact.energy, "{} {}", sample.energy, exact.energy);
        for (tau, exact) in sample.torque.iter().zip(&exact.torque) {
            assert!((tau - exact).abs() <= 1e-9, "{tau} {exact}");
        }
        touched += u32::from(touches);
    }
    assert!(touched > 20, "{touched}");
    let refused = hz_code::HZ_ARGUMENT;
    unsafe {
        assert_eq!(hz_live_sample(live, [0.0, f64::NAN].as_ptr(), &raw mut sample), refused);
        assert_eq!((sample.torque, sample.energy), ([0.0; HZ_MAX_JOINTS], 0.0));
        assert_eq!(hz_live_sample(live, PRESSED.as_ptr(), null_mut()), refused);
        assert_eq!(hz_live_sample(null_mut(), PRESSED.as_ptr(), &raw mut sample), refused);
        assert_eq!(hz_live_joints(null()), 0);
        hz_live_close(live);
        hz_live_close(null_mut());
    }
}

#[test]
fn the_loop_of_a_scene_is_that_of_its_dataset_with_contact_solved_in_every_tick() {
    let files = Files::new();
    let text = common::SCENE.replace("[contact]", "[contact]\nlaw = \"following\"");
    std::fs::write(files.path("following.toml"), text).unwrap();
    let opened = |name: &str| {
        let path = c_path(&files.path(name));
        open(|out, text| unsafe { hz_loop_open(path.as_ptr(), null(), out, text, ROOM) })
    };
    let (code, following, remarks) = opened("following.toml");
    assert!(code == hz_code::HZ_OK && remarks.contains("before the surface at rest"), "{remarks}");
    let ((code, live, _), (_, stored, _)) = (opened("small.toml"), opened("small.haptize"));
    assert_eq!(code, hz_code::HZ_OK);
    let (mut greatest, mut error) = (0.0_f64, 0.0_f64);
    unsafe {
        let period = hz_loop_period(live);
        for handle in [live, stored] {
            assert_eq!(hz_loop_start(handle, [0.0; 2].as_ptr()), hz_code::HZ_OK);
        }
        for q in way() {
            let mut taus = [[f64::NAN; 2]; 2];
            for (handle, tau) in [live, stored].into_iter().zip(&mut taus) {
                let tick = || hz_loop_tick(handle, q.as_ptr(), 0.0, period, tau.as_mut_ptr(), null_mut());
                assert_eq!(assert_no_alloc(tick), hz_code::HZ_OK);
            }
            greatest = greatest.max(taus[1][1].abs());
            error = error.max((taus[0][1] - taus[1][1]).abs());
        }
        [live, stored, following].into_iter().for_each(|handle| hz_loop_close(handle));
    }
    // The small scene's grid is coarse.
    assert!(greatest > 0.0 && error < 0.2 * greatest && error > 1e-6 * greatest, "{error} of {greatest}");
}

/// Whatever later versions add: these are the sizes of the first header with this number.
#[cfg(target_pointer_width = "64")]
#[test]
fn structures_of_the_first_header_are_taken() {
    let files = Files::new();
    let (opened, path) = (field(&files), c_path(&files.path("small.toml")));
    let mut sample = hz_sample { size: 80, ..hz_sample::default() };
    let gains = hz_gains { size: 152, ..hz_gains::default() };
    let mut tick = hz_tick { size: 120, ..hz_tick::default() };
    let mut found = hz_equilibrium { size: 96, ..hz_equilibrium::default() };
    let (code, felt, _) = haptic_loop(&files, &raw const gains);
    assert_eq!(code, hz_code::HZ_OK);
    let (_, solver, _) = open(|out, text| unsafe { hz_solver_open(path.as_ptr(), out, text, ROOM) });
    let (q, mut tau) = (PRESSED.as_ptr(), [0.0; 2]);
    unsafe {
        assert_eq!(hz_field_sample(opened, q, &raw mut sample), hz_code::HZ_OK);
        assert_eq!(hz_loop_start(felt, q), hz_code::HZ_OK);
        assert_eq!(hz_loop_tick(felt, q, 0.0, 1e-3, tau.as_mut_ptr(), &raw mut tick), hz_code::HZ_OK);
        assert_eq!(hz_solver_solve(solver, q, &raw mut found, null_mut(), 0), hz_code::HZ_OK);
        hz_field_close(opened);
        hz_loop_close(felt);
        hz_solver_close(solver);
    }
    assert_eq!([sample.size, tick.size, found.size], [80, 120, 96]);
}

#[test]
fn a_scene_is_solved_as_the_library_solves_it() {
    let files = Files::new();
    let path = c_path(&files.path("small.toml"));
    let (code, solver, message) = open(|out, text| unsafe { hz_solver_open(path.as_ptr(), out, text, ROOM) });
    assert_eq!((code, message.as_str()), (hz_code::HZ_OK, ""));
    let expected = Direct::new(&Scene::load(files.path("small.toml")).unwrap()).unwrap().inspect(&PRESSED).unwrap();
    let pushed = expected.object_nodes.iter().filter(|node| node.force.length() > 0.0).count();
    let mut found = hz_equilibrium { size: size_of::<hz_equilibrium>(), ..hz_equilibrium::default() };
    let mut forces = [hz_force::default(); 2];
    unsafe {
        assert_eq!(hz_solver_joints(solver), 2);
        let code = hz_solver_solve(solver, PRESSED.as_ptr(), &raw mut found, forces.as_mut_ptr(), forces.len());
        assert_eq!((code, found.status, found.forces), (hz_code::HZ_OK, 1, pushed));
        assert_eq!((&found.torque[..2], found.energy), (&expected.torque[..], expected.energy));
        for force in forces {
            assert_eq!(force.force, expected.object_nodes[force.node].force.to_array());
        }
        // The configuration may lie within the equilibrium.
        let before = found.torque;
        found.torque[..2].copy_from_slice(&PRESSED);
        let place = &raw mut found;
        assert_eq!(hz_solver_solve(solver, (&raw const (*place).torque).cast(), place, null_mut(), 0), hz_code::HZ_OK);
        assert_eq!(found.torque, before);
        let refused = hz_code::HZ_ARGUMENT;
        assert_eq!(hz_solver_solve(solver, [0.0, f64::NAN].as_ptr(), &raw mut found, null_mut(), 0), refused);
        assert_eq!((found.forces, found.torque), (0, [0.0; HZ_MAX_JOINTS]));
        assert_eq!(hz_solver_solve(solver, PRESSED.as_ptr(), null_mut(), null_mut(), 0), refused);
        assert_eq!(hz_solver_solve(null(), PRESSED.as_ptr(), &raw mut found, null_mut(), 0), refused);
        hz_solver_close(solver);
        hz_solver_close(null_mut());
    }
}

#[test]
fn threads_share_a_field() {
    let files = Files::new();
    let opened = field(&files) as usize;
    let mut alone = [0.0; 2];
    unsafe { hz_field_torque(opened as *const hz_field, PRESSED.as_ptr(), alone.as_mut_ptr()) };
    std::thread::scope(|scope| {
        for _ in 0..4 {
            scope.spawn(|| {
                for _ in 0..1000 {
                    let mut tau = [0.0; 2];
                    unsafe { hz_field_torque(opened as *const hz_field, PRESSED.as_ptr(), tau.as_mut_ptr()) };
                    assert_eq!(tau, alone);
                }
            });
        }
    });
    unsafe { hz_field_close(opened as *mut hz_field) };
}
