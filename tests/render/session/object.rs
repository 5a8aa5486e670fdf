//! The object in motion, and the contact forces that move it.

use super::*;

/// The paper's sphere: 102 nodes.
fn sphere(stiffness: f64, damping: f64) -> Object {
    Object::build(&ObjectSpec {
        shape: Shape::Sphere { centre: DVec3::ZERO, radius: 0.05, rings: 10, segments: 10 },
        material: Material::Springs(SpringSpec { kind: SpringKind::Isotropic, stiffness }),
        skin: None,
        ground: Some(GroundSpec { stiffness: GroundStiffness::PerNode(0.3 * stiffness), nodes: GroundNodes::All }),
        node_mass: 1e-3,
        node_damping: damping,
    })
    .unwrap()
}

/// The paper's graphics loop.
fn graphics_60() -> GraphicsSpec {
    GraphicsSpec { rate: 60.0, effects: GraphicsEffects::default() }
}

/// Kinetic and elastic energy of the object (J).
fn energy(object: &Object, motion: &ObjectMotion<'_>) -> f64 {
    let mut force = vec![DVec3::ZERO; object.rest.len()];
    object.mechanics().unwrap().stiffness.apply(motion.displacement(), &mut force);
    let elastic: f64 = force.iter().zip(motion.displacement()).map(|(f, u)| f.dot(*u)).sum();
    let kinetic: f64 =
        object.mechanics().unwrap().mass.iter().zip(motion.velocity()).map(|(m, v)| m * v.length_squared()).sum();
    0.5 * (elastic + kinetic)
}

#[test]
fn the_object_never_gains_energy_without_input_and_balances_with_it() {
    for stiffness in [300.0, 3e7] {
        let object = sphere(stiffness, 0.05);
        for period in [1e-3, 1.0 / 60.0, 1.0] {
            let mut motion = ObjectMotion::new(&object, period, &GraphicsEffects::default()).unwrap();
            let mut before = 0.0;
            for frame in 0..200 {
                let pushed = frame < 20;
                let force =
                    |k: usize| if pushed { DVec3::new(0.0, 0.1, -(((k + frame) % 7) as f64)) } else { DVec3::ZERO };
                let forces: Vec<DVec3> = (0..object.rest.len()).map(force).collect();
                let v_hat = motion.step(&forces);
                let work: f64 = period * v_hat.iter().zip(&forces).map(|(v, f)| v.dot(*f)).sum::<f64>();
                let loss: f64 = period
                    * v_hat
                        .iter()
                        .zip(&object.mechanics().unwrap().damping)
                        .map(|(v, b)| b * v.length_squared())
                        .sum::<f64>();
                let after = energy(&object, &motion);
                let scale = before + after + work.abs() + loss;
                assert!(
                    (after - before - work + loss).abs() < 1e-11 * scale,
                    "{stiffness} N/m, {period} s, frame {frame}"
                );
                assert!(pushed || after <= before * (1.0 + 1e-12), "{stiffness} N/m, {period} s, frame {frame}");
                before = after;
            }
            assert!(before > 0.0);
        }
    }
}

#[test]
fn under_constant_forces_the_object_settles_where_its_springs_balance_them() {
    let object = sphere(300.0, 2.0);
    let mut motion = ObjectMotion::new(&object, 1.0 / 60.0, &GraphicsEffects::default()).unwrap();
    let mut forces = vec![DVec3::ZERO; object.rest.len()];
    forces[0] = DVec3::new(0.1, 0.0, -0.8);
    for _ in 0..4000 {
        motion.step(&forces);
    }
    let mut spring = vec![DVec3::ZERO; object.rest.len()];
    object.mechanics().unwrap().stiffness.apply(motion.displacement(), &mut spring);
    let error = spring.iter().zip(&forces).map(|(k, f)| (*k - *f).length()).fold(0.0, f64::max);
    assert!(error < 1e-6, "{error}");
    assert_eq!(motion.nodes().len(), 102);
}

/// A dataset in one joint over a sphere: node 3 is pushed from 0.2 rad on, node 7 with it from 0.4 rad on.
fn pushed() -> Dataset {
    let mut data = Dataset::of_field(grid(&[(0.0, 0.2, 4)]), |q| {
        (vector(&[-q[0]]), 0.0, if q[0] > 0.1 { Status::Contact } else { Status::Free })
    });
    let forces: Vec<f32> = vec![0.0, 0.0, -1.0, 0.0, 0.0, -2.0, 1.0, 0.0, 0.0, 0.0, 0.0, -3.0, 2.0, 0.0, 0.0];
    let contacts = Contacts {
        offsets: vec![0_u64, 0, 1, 3, 5].into(),
        nodes: vec![3_u32, 3, 7, 3, 7].into(),
        forces: forces.into(),
    };
    data.contacts = Some(contacts);
    data
}

#[test]
fn contact_forces_are_interpolated_over_the_nodes_of_all_corners() {
    let contact = ContactForces::new(&pushed(), 102).unwrap();
    let mut forces = vec![DVec3::ONE; 102];
    contact.at(&[0.25], 0.5, &mut forces);
    // Three quarters of the point at 0.2 rad and a quarter of that at 0.4 rad, times the share.
    assert!((forces[3] - DVec3::new(0.0, 0.0, -0.625)).length() < 1e-12, "{}", forces[3]);
    assert!((forces[7] - DVec3::new(0.125, 0.0, 0.0)).length() < 1e-12, "{}", forces[7]);
    assert_eq!(forces.iter().filter(|f| **f != DVec3::ZERO).count(), 2);
    contact.at(&[0.25], 0.0, &mut forces);
    assert!(forces.iter().all(|f| *f == DVec3::ZERO));
}

#[test]
fn contact_forces_that_do_not_fit_are_refused() {
    let refusal = |data: &Dataset, nodes| ContactForces::new(data, nodes).err().unwrap().to_string();
    assert!(refusal(&half_space_of(1), 102).contains("holds no contact forces"));
    assert!(refusal(&pushed(), 7).contains("do not fit its grid and an object of 7 nodes"));
    for offsets in [[0, 0, 1, 3, 6], [0, 3, 1, 3, 5], [0, 0, 1, 3, u64::MAX]] {
        let mut data = pushed();
        data.contacts.as_mut().unwrap().offsets = offsets.to_vec().into();
        assert!(refusal(&data, 102).contains("do not fit"), "{offsets:?}");
    }
    assert_eq!(
        ObjectMotion::new(&sphere(300.0, 0.05), f64::NAN, &GraphicsEffects::default())
            .err()
            .map(|e| e.to_string().contains("NaN")),
        Some(true)
    );
}

#[test]
fn two_loops_run_at_two_rates_and_repeat_bit_for_bit() {
    let (data, spec, object) = (pushed(), haptics(1), sphere(300.0, 0.05));
    let haptics = build(&data, &spec);
    let way = [(0.0, 0.0), (0.5, 0.5), (1.0, 0.5), (1.5, 0.0)];
    let run = || {
        let motion = Motion::through(&way.map(|(time, q)| Waypoint { time, q: vector(&[q]) }), 1).unwrap();
        let mut hand = SimulatedHand::new(&spec, motion).unwrap();
        let mut graphics =
            Graphics::new(ContactForces::new(&data, object.rest.len()).unwrap(), &object, &graphics_60(), None)
                .unwrap();
        let plan = Plan { snapshots: vec![0.0, 0.8, 0.8001, 1.45], ..plan(&data, 1.5) };
        session::run(&haptics, &mut hand, Some(&mut graphics), &plan).unwrap()
    };
    let trace = run();
    assert_eq!(trace, run());
    assert_eq!(trace.ticks.len(), 1500);
    // Graphics comes again from a recording, too.
    let mut graphics =
        Graphics::new(ContactForces::new(&data, object.rest.len()).unwrap(), &object, &graphics_60(), None).unwrap();
    let file = tempfile::NamedTempFile::new().unwrap();
    Recording::write(&trace, &mut file.as_file()).unwrap();
    let recording = Recording::read(file.path(), 1).unwrap();
    assert_eq!(recording.replay(&haptics, Some(&mut graphics), labels(&data.grid)).unwrap(), trace);
    // The first frame at or after each instant, each once.
    let times: Vec<f64> = trace.frames.iter().map(|frame| frame.time).collect();
    let expected = [0.0, 48.0 / 60.0, 49.0 / 60.0, 87.0 / 60.0];
    assert!(times.len() == 4 && times.iter().zip(expected).all(|(t, e)| (t - e).abs() < 1e-12), "{times:?}");
    assert_eq!(trace.summary().max_contact_nodes, 2);
    let moved = |frame: usize| trace.frames[frame].nodes[3] - object.rest[3];
    assert_eq!(moved(0), DVec3::ZERO);
    assert!(moved(1).z < -1e-4, "{}", moved(1));
}
