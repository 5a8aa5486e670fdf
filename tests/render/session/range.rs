//! Datasets that cannot be rendered, and the border of the haptized range.

use super::*;

#[test]
fn datasets_that_cannot_be_rendered_say_why() {
    let refusal = |data: &Dataset| Setup::new(data).err().unwrap().to_string();
    let mut data = half_space_of(2);
    assert!(refusal(&data).contains("holds no scene"));
    data.scene = "name = 3".into();
    assert!(refusal(&data).starts_with("the scene in the dataset: scene:1"));
    data.scene = include_str!("../../scenes/sphere.toml").into();
    assert!(refusal(&data).contains("has 2 axes and the proxy of its scene 3 joints"));
}

#[test]
fn at_the_end_of_the_grid_the_device_is_held_by_the_coupling() {
    // Pressed into the half space and on beyond the grid, which ends at 0.6 rad; held there, and let out again.
    for joints in 1..=3 {
        let (data, mut spec) = (half_space_of(joints), haptics(joints));
        spec.torque_limit = all(joints, 10.0);
        let haptics = build(&data, &spec);
        let mut script: Vec<JointVector> = (0..1200).map(|k| all(joints, -0.2 + 1e-3 * f64::from(k))).collect();
        script.extend(vec![all(joints, 1.0); 2000]);
        script.extend((0..1200).map(|k| all(joints, 1.0 - 1e-3 * f64::from(k))));
        let count = script.len();
        let trace =
            session::run(&haptics, &mut Scripted::new(script), None, &plan(&data, 1e-3 * count as f64)).unwrap();
        let summary = trace.summary();
        assert!(summary.max_relative_account_residual < 1e-11 && summary.min_absorbed > -1e-12, "{summary:?}");
        assert_eq!((summary.outside, summary.faults), (0, 0));
        let last = trace.ticks.last().unwrap();
        assert!(!last.sample.contact && last.accounts.stop_work < 0.0, "{last:?}");
        let (mut deepest, mut torque) = (0.0_f64, 0.0_f64);
        for tick in &trace.ticks[..3200] {
            // The deeper the device is, the more it is pushed back: nowhere beyond the border does that end.
            let pushed = -tick.device_torque[0];
            if tick.device[0] > 0.3 && tick.device[0] > deepest {
                assert!(pushed > torque - 1e-3, "{pushed} after {torque}");
                (deepest, torque) = (tick.device[0], pushed);
            }
        }
        let held = &trace.ticks[3190];
        assert!(held.sample.contact && held.flags.contains(Flags::HELD) && !held.flags.contains(Flags::STOPPED));
        for a in 0..joints {
            assert!((held.proxy[a] - 0.6).abs() < 1e-12, "{held:?}");
            assert!((held.device_torque[a] + 15.0 * 0.4).abs() < 1e-9, "{held:?}");
        }
    }
}

#[test]
fn the_proxy_leaves_the_grid_where_space_is_free_and_nowhere_else() {
    let mut scene = Scene::load(concat!(env!("CARGO_MANIFEST_DIR"), "/datasets/sphere.toml")).unwrap();
    // A narrow grid over the middle of the sphere, touched at some of its borders; the joints reach farther.
    for (axis, (start, step, count)) in scene.grid.axes.iter_mut().zip([(-0.3, 0.1, 7), (1.0, 0.1, 6), (-2.25, 0.1, 5)])
    {
        (axis.start, axis.step, axis.count) = (start, step, count);
    }
    let data = baked(&scene).unwrap().0;
    let mut chain = Chain::new(&scene.proxy);
    for (joint, limits) in chain.joints.iter_mut().zip([[-1.5, 1.5], [0.4, 2.2], [-2.8, -1.2]]) {
        joint.limits = limits;
    }
    let spec = &scene.haptics;
    let field = TorqueField::interpolated(&data, spec.interpolation, spec.threshold, &spec.boundary_slope).unwrap();
    let haptics = Haptics::new(field, Npmi::of_chain(&chain).unwrap(), spec)
        .unwrap()
        .with_range(HaptizedRange::new(&data, &chain).unwrap());
    let object = Object::build(&scene.object).unwrap();
    let model = Model::new(&object, &chain, scene.contact);
    let mut proximity = Proximity::new(&model);
    let mut seed = 7_u64;
    let mut random = || {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (seed >> 11) as f64 / (1_u64 << 53) as f64
    };
    let (mut held, mut outside, mut far, mut least) = (0, 0, 0.0_f64, f64::INFINITY);
    for _ in 0..40 {
        let mut between = |[low, high]: [f64; 2]| low + (high - low) * random();
        let at: Vec<_> = (0..4).map(|_| [[-1.4, 1.4], [0.5, 2.1], [-2.7, -1.3]].map(&mut between)).collect();
        let way = at.iter().enumerate().map(|(k, q)| Waypoint { time: 0.7 * k as f64, q: vector(q) });
        let motion = Motion::through(&way.collect::<Vec<_>>(), 3).unwrap();
        let trace = session::run(&haptics, &mut Recorded::new(motion), None, &plan(&data, 2.1)).unwrap();
        let summary = trace.summary();
        assert!(summary.max_relative_account_residual < 1e-11, "{summary:?}");
        held += summary.held;
        for tick in trace.ticks.iter().filter(|tick| tick.flags.contains(Flags::OUTSIDE)) {
            outside += 1;
            let inside = data.grid.clamp(&tick.proxy);
            far = inside.iter().zip(tick.proxy.iter()).map(|(a, b)| (a - b).abs()).fold(far, f64::max);
            proximity.place(&tick.proxy);
            least = least.min(proximity.gap(&tick.proxy));
        }
    }
    assert!(least >= 0.0, "{least} m");
    assert!(held > 500 && outside > 500 && far > 0.2, "held {held}, outside {outside}, as far as {far} rad");
}

#[test]
fn beyond_a_measured_range_a_free_border_is_free_and_one_in_contact_holds() {
    // No gaps: steps from contact count. The half space fills the upper half of the grid.
    let data = half_space_of(2);
    let setup = Scene::load(concat!(env!("CARGO_MANIFEST_DIR"), "/datasets/sphere.toml")).unwrap();
    let joints = setup.proxy.joints[..2].to_vec();
    let mut chain =
        Chain { nodes: Vec::new(), ..Chain::new(&haptize::scene::ProxySpec { joints, ..Default::default() }) };
    chain.joints.iter_mut().for_each(|joint| joint.limits = [-3.0, 3.0]);
    let range = HaptizedRange::new(&data, &chain).unwrap();
    let haptics = build(&data, &haptics(2)).with_range(range);
    let mut script: Vec<JointVector> = (0..1000).map(|k| all(2, -0.2 - 1e-3 * f64::from(k))).collect();
    script.extend((0..2200).map(|k| all(2, -1.2 + 1e-3 * f64::from(k))));
    let trace = session::run(&haptics, &mut Scripted::new(script), None, &plan(&data, 3.2)).unwrap();
    let away = &trace.ticks[990];
    assert!(away.proxy[0] < -1.1 && away.flags.contains(Flags::OUTSIDE) && !away.flags.contains(Flags::HELD));
    let last = trace.ticks.last().unwrap();
    assert!(last.sample.contact && last.flags.contains(Flags::HELD) && last.proxy[0] <= 0.6, "{last:?}");
}
