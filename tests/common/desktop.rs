//! Gains and proxy of a desktop device, shared by the test binaries.

use haptize::{
    JointVector, MAX_JOINTS,
    render::npmi::Npmi,
    scene::{HandSpec, HapticsSpec, Interpolation, ProxyInertia},
};

/// Gains of a desktop device, alike at all `joints`.
pub fn haptics(joints: usize) -> HapticsSpec {
    let all = |value: f64| JointVector::from_slice(&vec![value; joints]);
    HapticsSpec {
        rate: 1000.0,
        threshold: 0.5,
        interpolation: Interpolation::Linear,
        boundary_slope: all(10.0),
        passivity_factor: 2.0,
        proxy_damping: all(0.02),
        proxy_damping_is_free: false,
        proxy_inertia: ProxyInertia::Constant,
        coupling_stiffness: all(15.0),
        coupling_damping: all(0.01),
        device_damping: all(0.02),
        device_inertia: all(1e-3),
        torque_limit: all(2.0),
        torque_rate_limit: all(500.0),
        speed_limit: all(50.0),
        encoder_step: all(0.0),
        device_friction: all(0.0),
        friction: None,
        relaxation: None,
        four_channel: None,
        passivity_control: false,
        hand: HandSpec { stiffness: all(20.0), damping: all(0.2), inertia: all(2e-3) },
    }
}

/// A proxy of constant inertia with wide limits.
pub fn proxy(joints: usize) -> Npmi {
    let mut inertia = [[0.0; MAX_JOINTS]; MAX_JOINTS];
    for (i, row) in inertia.iter_mut().enumerate().take(joints) {
        for (j, entry) in row.iter_mut().enumerate().take(joints) {
            *entry = if i == j { 1e-3 } else { 2e-4 };
        }
    }
    Npmi::new(&inertia, &[[-3.0, 3.0]; MAX_JOINTS][..joints]).unwrap()
}
