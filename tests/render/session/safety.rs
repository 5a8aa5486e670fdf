//! Limits of the torque, faults of the device, gains beyond their bounds.

use super::*;

#[test]
fn torque_is_limited_in_size_and_rate() {
    let mut spec = haptics(2);
    spec.torque_limit = all(2, 0.4);
    spec.torque_rate_limit = all(2, 20.0);
    // The device is thrown by a radian within 40 ms.
    let positions = (0..400).map(|k| all(2, -0.5 + f64::from(k - 100).clamp(0.0, 40.0) / 40.0));
    let data = half_space_of(2);
    let haptics = build(&data, &spec);
    let trace = session::run(&haptics, &mut Scripted::new(positions), None, &plan(&data, 0.4)).unwrap();
    let mut before = all(2, 0.0);
    for tick in &trace.ticks {
        for (tau, before) in tick.device_torque.iter().zip(before.iter()) {
            assert!(tau.abs() <= 0.4 && (tau - before).abs() <= 0.02 + 1e-15, "{tau} after {before}");
        }
        before = tick.device_torque;
    }
    assert!(trace.ticks.iter().any(|tick| tick.flags.contains(Flags::SIZE_LIMITED)));
    assert!(trace.ticks.iter().any(|tick| tick.flags.contains(Flags::RATE_LIMITED)));
    assert!(trace.summary().max_relative_account_residual < 1e-11);
}

#[test]
fn a_device_that_fails_is_let_go_smoothly_with_the_reason() {
    let (data, spec) = (half_space_of(2), haptics(2));
    let haptics = build(&data, &spec);
    let good = Inputs { position: all(2, 0.3), age: 0.0, elapsed: 1e-3, interval: 1e-3 };
    let failures = [
        (Inputs { position: all(2, f64::NAN), ..good }, Fault::NotFinite),
        (Inputs { position: all(2, f64::INFINITY), ..good }, Fault::NotFinite),
        (Inputs { position: all(2, -1e300), ..good }, Fault::NotFinite),
        (Inputs { position: all(3, 0.3), ..good }, Fault::Joints),
        (Inputs { position: all(0, 0.3), ..good }, Fault::Joints),
        (Inputs { age: 1.0, ..good }, Fault::Stale),
        (Inputs { age: f64::NAN, ..good }, Fault::Stale),
        (Inputs { elapsed: 0.0, ..good }, Fault::Late),
        (Inputs { elapsed: f64::NAN, ..good }, Fault::Late),
        (Inputs { interval: -1e-3, ..good }, Fault::Late),
        (Inputs { interval: f64::INFINITY, ..good }, Fault::Late),
        (Inputs { position: all(2, 1.3), ..good }, Fault::Leap),
    ];
    for (bad, reason) in failures {
        let mut state = haptics.start(&good.position).unwrap();
        for _ in 0..500 {
            assert_eq!(haptics.tick(&mut state, &good).fault, None);
        }
        let mut before = haptics.tick(&mut state, &good).torque;
        assert!(before.norm() > 0.5);
        let mut ticks = 0;
        while before.norm() > 0.0 {
            let output = haptics.tick(&mut state, &bad);
            assert_eq!(output.fault, Some(reason), "{bad:?}");
            // 500 N m/s.
            assert!(output.torque.iter().zip(before.iter()).all(|(tau, b)| (tau - b).abs() <= 0.5 + 1e-12));
            assert!(
                output.torque.norm() < before.norm()
                    && output.proxy.is_finite()
                    && output.accounts.residual().is_finite()
            );
            before = output.torque;
            ticks += 1;
            assert!(ticks < 10);
        }
        // The device comes back: the torque does not, until somebody asks for it, and then without a blow.
        let mut output = haptics.tick(&mut state, &good);
        assert_eq!((output.fault, output.torque.norm()), (Some(reason), 0.0));
        assert!(haptics.restart(&mut state, &all(2, f64::NAN)).is_err());
        assert_eq!(haptics.tick(&mut state, &good).fault, Some(reason));
        haptics.restart(&mut state, &good.position).unwrap();
        for _ in 0..500 {
            let before = output.torque;
            output = haptics.tick(&mut state, &good);
            assert!(
                output.torque.iter().zip(before.iter()).all(|(tau, b)| (tau - b).abs() <= 0.5 + 1e-12),
                "{output:?}"
            );
        }
        assert_eq!(output.fault, None);
        assert!(output.torque.norm() > 0.5 && output.accounts.residual().abs() < 1e-11 * output.accounts.exchanged);
    }
    let field = TorqueField::interpolated(&data, Interpolation::Linear, 0.5, &spec.boundary_slope).unwrap();
    let refused = Haptics::new(field, proxy(3), &spec).err().unwrap().to_string();
    assert!(refused.starts_with("the dataset has 2 joints, the proxy 3, and the haptic gains are for 2"), "{refused}");
    assert_eq!(haptics.start(&all(2, f64::NAN)).err(), Some(Fault::NotFinite));
    assert_eq!(haptics.start(&all(1, 0.0)).err(), Some(Fault::Joints));
}

#[test]
fn a_torque_that_is_no_number_never_reaches_the_device() {
    let (data, mut spec) = (half_space_of(2), haptics(2));
    (spec.coupling_stiffness, spec.speed_limit) = (all(2, 1e308), all(2, 1e9));
    let haptics = build(&data, &spec);
    let mut state = haptics.start(&all(2, 0.0)).unwrap();
    let mut fault = None;
    for k in 0..40 {
        let position = all(2, 10.0 * f64::from(k));
        let output = haptics.tick(&mut state, &Inputs { position, age: 0.0, elapsed: 1e-3, interval: 1e-3 });
        assert!(output.torque.iter().all(|tau| tau.abs() <= spec.torque_limit[0]));
        fault = output.fault;
    }
    assert_eq!(fault, Some(Fault::Torque));
}

#[test]
fn gains_beyond_their_bound_are_named_with_the_safe_value() {
    let (data, mut spec) = (half_space_of(2), haptics(2));
    let field = |spec: &HapticsSpec| {
        TorqueField::interpolated(&data, Interpolation::Linear, 0.5, &spec.boundary_slope).unwrap()
    };
    assert_eq!(passivity::exceeded(&spec, &field(&spec).into(), &labels(&data.grid)), []);
    spec.boundary_slope[1] = 50.0;
    spec.coupling_stiffness[0] = 30.0;
    let found = passivity::exceeded(&spec, &field(&spec).into(), &labels(&data.grid));
    let safe: Vec<(f64, f64)> = found.iter().map(|bound| (bound.value, bound.safe)).collect();
    assert_eq!(safe[..2], [(30.0, 20.0), (50.0, 40.0)]);
    // Layer and object together: sqrt((Ks / safe)^2 + L^2) with the object's own relative stiffness L, which is less
    // than one.
    let &[_, _, (together, 1.0)] = &safe[..] else { panic!("{safe:?}") };
    assert!(together > 50.0 / 40.0 && together < (1.0 + (50.0_f64 / 40.0).powi(2)).sqrt(), "{together}");
    assert!(found[1].to_string().contains("boundary slope Ks of joint joint 1 is 50.0000, beyond the passive 40.0000"));
    // The values that it names are safe; beside the object's own stiffness, which takes a hundredth of it, a slope a
    // little less.
    spec.boundary_slope[1] = 0.98 * safe[1].1;
    spec.coupling_stiffness[0] = safe[0].1;
    assert_eq!(passivity::exceeded(&spec, &field(&spec).into(), &labels(&data.grid)), []);
    spec.proxy_damping = all(2, 1e-3);
    assert!(
        passivity::exceeded(&spec, &field(&spec).into(), &labels(&data.grid))
            .iter()
            .any(|b| b.what.starts_with("stiffness"))
    );
}
