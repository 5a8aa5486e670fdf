//! Energy accounts, continuity and repeatability of sessions.

use super::*;

#[test]
fn accounts_close_to_rounding_and_the_proxy_never_gives_more_than_was_put_in() {
    for joints in [1, 2, 3, 6] {
        let trace = pressed(joints, &haptics(joints));
        let summary = trace.summary();
        assert!(summary.contact_share > 0.3, "{summary:?}");
        assert!(summary.max_relative_account_residual < 1e-11, "{summary:?}");
        assert!(summary.min_absorbed > -1e-15, "{summary:?}");
        let last = trace.ticks.last().unwrap().accounts;
        assert!(last.exchanged > 1e-3 && last.proxy_dissipation > 0.0 && last.coupling_dissipation > 0.0);
    }
}

#[test]
fn accounts_notice_energy_from_nowhere() {
    let mut accounts = pressed(2, &haptics(2)).ticks.last().unwrap().accounts;
    accounts.field_work += 1e-6;
    assert!(accounts.residual().abs() / accounts.exchanged > 1e-8);
}

#[test]
fn accounts_close_when_ticks_jitter_from_a_fifth_of_a_millisecond_to_twenty() {
    let (data, spec) = (half_space_of(3), haptics(3));
    let haptics = build(&data, &spec);
    let mut state = haptics.start(&all(3, -0.1)).unwrap();
    let (mut time, mut elapsed) = (0.0, 1e-3);
    for k in 0..20_000_u32 {
        let interval = 2e-3 * 10_f64.powf((f64::from(k) * 1.7).sin());
        let position = all(3, 0.1 + 0.25 * (3.0_f64 * time).sin() + 0.001 * (f64::from(k) * 2.9).sin());
        let output = haptics.tick(&mut state, &Inputs { position, age: 0.0, elapsed, interval });
        let accounts = output.accounts;
        assert!(accounts.residual().abs() <= 1e-10 * accounts.exchanged, "tick {k}: {accounts:?}");
        assert!(accounts.absorbed() >= -1e-10 * accounts.exchanged, "tick {k}: {accounts:?}");
        assert!(output.torque.is_finite() && output.proxy.is_finite());
        time += interval;
        elapsed = interval;
    }
}

#[test]
fn without_input_the_proxy_comes_to_rest_and_the_device_feels_the_contact_torque() {
    // The device held still, inside the object: at rest Kvc (y - x) = -tau(x), and that is what the hand feels.
    let (data, spec) = (half_space_of(3), haptics(3));
    let haptics = build(&data, &spec);
    let mut device = Scripted::new([all(3, 0.3)]);
    let trace = session::run(&haptics, &mut device, None, &plan(&data, 3.0)).unwrap();
    assert_eq!(device.torque, all(3, 0.0), "the session leaves the device without torque");
    let last = trace.ticks.last().unwrap();
    assert!(last.accounts.kinetic < 1e-20, "{:?}", last.accounts);
    // Springs in series: 5 of the object along the diagonal, 15 of the coupling.
    for (tau, contact) in last.device_torque.iter().zip(last.sample.torque.iter()) {
        assert!((tau - contact).abs() < 1e-9, "{tau} felt, {contact} rendered");
        assert!((tau + 0.3 * 15.0 * 5.0 / 20.0).abs() < 1e-9, "{tau}");
    }
}

#[test]
fn a_press_is_continuous() {
    let trace = pressed(3, &haptics(3));
    let summary = trace.summary();
    // The torque of the object and its layer changes by no more than 10 N m/rad at the hand's speed of about 2 rad/s.
    assert!(summary.max_contact_torque > 1.0, "{summary:?}");
    assert!(summary.max_contact_torque_step < 0.03, "{summary:?}");
    assert!(summary.max_device_torque_step < 0.06, "{summary:?}");
    assert_eq!((summary.faults, summary.outside, summary.limited), (0, 0, 0));
}

#[test]
fn the_same_session_gives_the_same_numbers_twice() {
    assert_eq!(pressed(3, &haptics(3)), pressed(3, &haptics(3)));
}
