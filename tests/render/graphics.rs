//! Effects of the graphics loop on the CPU: what each does, what it does to energy, and that it is absent unless named.

use glam::DVec3;
use haptize::{
    object::Object,
    render::graphics::{ObjectMotion, Smoothing},
    scene::{
        GraphicsEffects, GroundNodes, GroundSpec, GroundStiffness, Material, ObjectSpec, Rendering, Shape, SpringKind,
        SpringSpec, StiffeningSpec,
    },
};

fn spec(kind: SpringKind, stiffness: f64, rings: usize) -> ObjectSpec {
    ObjectSpec {
        shape: Shape::Sphere { centre: DVec3::ZERO, radius: 0.05, rings, segments: rings },
        material: Material::Springs(SpringSpec { kind, stiffness }),
        skin: None,
        ground: Some(GroundSpec { stiffness: GroundStiffness::PerNode(0.3 * stiffness), nodes: GroundNodes::All }),
        node_mass: 1e-3,
        node_damping: 0.02,
    }
}

fn sphere(kind: SpringKind, stiffness: f64, rings: usize) -> Object {
    Object::build(&spec(kind, stiffness, rings)).unwrap()
}

const NONE: GraphicsEffects = GraphicsEffects { gravity: None, stiffening: None, smoothing: None, quasi_static: false };

const GRAVITY: DVec3 = DVec3::new(1.0, 0.0, -9.81);

fn effects(factor: f64) -> [GraphicsEffects; 4] {
    let stiffening = Some(StiffeningSpec { factor, strain: 0.05 });
    [
        NONE,
        GraphicsEffects { gravity: Some(GRAVITY), ..NONE },
        GraphicsEffects { stiffening, ..NONE },
        GraphicsEffects { gravity: Some(GRAVITY), stiffening, ..NONE },
    ]
}

/// Forces of about `size` (N) that change from frame to frame.
fn push(nodes: usize, frame: usize, size: f64) -> Vec<DVec3> {
    (0..nodes).map(|k| size * DVec3::new(0.1, 0.02 * (k % 3) as f64, -(((k + frame) % 7) as f64))).collect()
}

/// The object pushed hard for a while, then left alone: most that its energy rose in a frame beyond the work done on
/// it, relative to the most that it ever stored. Prints a line of the table.
fn greatest_gain(object: &Object, period: f64, effects: &GraphicsEffects, size: f64) -> f64 {
    let mut motion = ObjectMotion::new(object, period, effects).unwrap();
    let rest = motion.energy();
    let (mut before, mut gain, mut most) = (0.0, 0.0_f64, 0.0_f64);
    for frame in 0..100 {
        let forces =
            if frame < 20 { push(object.rest.len(), frame, size) } else { vec![DVec3::ZERO; object.rest.len()] };
        let v_hat = motion.step(&forces);
        let work = period * v_hat.iter().zip(&forces).map(|(v, f)| v.dot(*f)).sum::<f64>();
        let after = motion.energy() - rest;
        assert!(after.is_finite());
        (gain, most) = (gain.max(after - before - work), most.max(after));
        before = after;
    }
    assert!(most > 1e-9, "it was pushed");
    assert!(before <= most && before > -1e-9 * most, "{before} of {most}");
    println!("{period:>8} s  gain {:>9.2e} of {most:.2e} J  left {:>9.2e}", gain / most, before / most);
    gain / most
}

#[test]
fn energy_never_rises_beyond_the_work_done_for_stiff_springs_and_any_frame_time() {
    for kind in [SpringKind::Isotropic, SpringKind::Axial] {
        for stiffness in [300.0, 1e7] {
            let object = sphere(kind, stiffness, 8);
            for (effect, name) in effects(30.0).iter().zip(["none", "gravity", "stiffening", "gravity and stiffening"])
            {
                for period in [1e-3, 1.0 / 60.0, 0.1, 1.0] {
                    print!("{kind:?} {stiffness:>8} N/m  {name:<24}");
                    // Strong enough that strains reach the stiffened range.
                    let gain = greatest_gain(&object, period, effect, 1e-3 * stiffness);
                    assert!(gain < 1e-10, "{kind:?}, {stiffness} N/m, {period} s, {name}: {gain}");
                }
            }
        }
    }
}

/// Objects so large that their frames are shared out among threads: each step solves the equation of the integrator.
#[test]
fn frames_that_threads_share_solve_their_equation() {
    let period = 1.0 / 60.0;
    for (kind, rings) in [(SpringKind::Isotropic, 150), (SpringKind::Axial, 60)] {
        let object = sphere(kind, 300.0, rings);
        assert!(
            object.mechanics().unwrap().factor.is_shared(),
            "{kind:?}: {} B are too few",
            object.mechanics().unwrap().factor.bytes()
        );
        let nodes = object.rest.len();
        let gravity = GraphicsEffects { gravity: Some(GRAVITY), ..NONE };
        let mut motion = ObjectMotion::new(&object, period, &gravity).unwrap();
        for frame in 0..3 {
            let (u, v) = (motion.displacement().to_vec(), motion.velocity().to_vec());
            let forces = push(nodes, frame, 1e-3);
            let v_hat = motion.step(&forces);
            let [mut held, mut bent] = [vec![DVec3::ZERO; nodes], vec![DVec3::ZERO; nodes]];
            object.mechanics().unwrap().stiffness.apply(&u, &mut held);
            object.mechanics().unwrap().stiffness.apply(v_hat, &mut bent);
            let (mut left, mut size) = (0.0f64, 0.0f64);
            for k in 0..nodes {
                let mass = object.mechanics().unwrap().mass[k];
                let given = (2.0 * mass / period) * v[k] - held[k] + forces[k] + mass * GRAVITY;
                let taken =
                    (2.0 * mass / period + object.mechanics().unwrap().damping[k]) * v_hat[k] + 0.5 * period * bent[k];
                (left, size) = (left.max((given - taken).length()), size.max(given.length()));
            }
            assert!(size > 1e-3 && left < 1e-10 * size, "{kind:?}, frame {frame}: {left} of {size}");
        }
    }
}

#[test]
fn under_gravity_the_object_hangs_by_its_compliance_and_stays_there() {
    let object = sphere(SpringKind::Isotropic, 300.0, 8);
    let mut motion = ObjectMotion::new(&object, 1.0 / 60.0, &effects(4.0)[1]).unwrap();
    // All nodes alike: the springs between them rest, and each ground spring carries m g.
    for u in motion.displacement() {
        assert!((*u - 1e-3 * GRAVITY / 90.0).length() < 1e-15, "{u}");
    }
    let sag = motion.displacement().to_vec();
    for _ in 0..200 {
        motion.step(&vec![DVec3::ZERO; object.rest.len()]);
    }
    let moved = motion.displacement().iter().zip(&sag).map(|(u, sag)| u.distance(*sag)).fold(0.0, f64::max);
    assert!(moved < 1e-14, "{moved}");
}

#[test]
fn stiffened_springs_settle_where_they_balance_the_forces_and_yield_less() {
    let object = Object::build(&ObjectSpec { node_damping: 5.0, ..spec(SpringKind::Axial, 300.0, 8) }).unwrap();
    let settle = |effects: &GraphicsEffects| {
        let mut motion = ObjectMotion::new(&object, 0.02, effects).unwrap();
        let mut forces = vec![DVec3::ZERO; object.rest.len()];
        forces[0] = DVec3::new(0.1, 0.0, -4.0);
        for _ in 0..3000 {
            motion.step(&forces);
        }
        // In equilibrium the energy less the work of the force is stationary.
        let work = motion.displacement()[0].dot(forces[0]);
        (motion.displacement()[0].length(), motion.energy(), work, motion.velocity()[0].length())
    };
    let [soft, _, stiff, _] = effects(10.0).map(|effects| settle(&effects));
    assert!(soft.3 < 1e-7 && stiff.3 < 1e-7, "{soft:?} {stiff:?}");
    assert!((soft.1 / soft.2 - 0.5).abs() < 1e-6, "a linear object stores half the work of a constant force: {soft:?}");
    // The force grows faster than the displacement, so that less than half of it is stored.
    assert!(stiff.0 < 0.8 * soft.0 && stiff.1 < 0.49 * stiff.2, "{soft:?} {stiff:?}");
}

#[test]
fn quasi_static_graphics_takes_its_equilibrium_at_once_and_holds_no_motion() {
    let object = sphere(SpringKind::Isotropic, 300.0, 8);
    let effects = GraphicsEffects { quasi_static: true, gravity: Some(GRAVITY), ..NONE };
    let mut motion = ObjectMotion::new(&object, 1.0 / 60.0, &effects).unwrap();
    let forces = push(object.rest.len(), 3, 0.1);
    motion.step(&forces);
    let mut held = vec![DVec3::ZERO; forces.len()];
    object.mechanics().unwrap().stiffness.apply(motion.displacement(), &mut held);
    for (held, force) in held.iter().zip(&forces) {
        assert!((*held - *force - 1e-3 * GRAVITY).length() < 1e-10);
    }
    assert!(motion.velocity().is_empty());
}

#[test]
fn smoothing_answers_a_step_as_its_time_constant_says_at_any_frame_rate() {
    for period in [1e-3, 1.0 / 60.0, 0.5] {
        let mut smoothing = Smoothing::new(0.1, period, 1);
        let mut filtered = DVec3::ZERO;
        for _ in 0..10 {
            filtered = smoothing.toward(&[DVec3::X])[0];
        }
        let expected = 1.0 - (-10.0 * period / 0.1_f64).exp();
        assert!((filtered.x - expected).abs() < 1e-14 && filtered.y == 0.0, "{period} s: {filtered}");
    }
}

#[test]
fn what_is_not_named_takes_no_memory() {
    let object = sphere(SpringKind::Isotropic, 300.0, 8);
    let bytes = |effects: &GraphicsEffects| ObjectMotion::new(&object, 1.0 / 60.0, effects).unwrap().bytes();
    let vectors = |count: usize| count * object.rest.len() * size_of::<DVec3>();
    let [none, gravity, stiffening, _] = effects(4.0).map(|effects| bytes(&effects));
    assert_eq!(gravity - none, vectors(1));
    assert_eq!(
        stiffening - none,
        object.mechanics().unwrap().stiffness.blocks.len() * (size_of::<glam::DMat3>() + size_of::<f64>())
    );
    // Without dynamics neither velocities nor a second factor.
    assert_eq!(bytes(&GraphicsEffects { quasi_static: true, ..NONE }), vectors(2));
    // Isotropic springs are multiplied with one number a block.
    let scales = object.mechanics().unwrap().stiffness.blocks.len() * size_of::<f64>();
    assert_eq!(none, vectors(3) + object.mechanics().unwrap().factor.bytes() + scales);
    // Smoothing lives where the forces are made, and nowhere else.
    assert_eq!(bytes(&GraphicsEffects { smoothing: Some(0.1), ..NONE }), none);
}

#[test]
fn scenes_name_effects_or_have_none_and_what_cannot_act_is_an_error_with_its_line() {
    let sphere = include_str!("../scenes/sphere.toml");
    let parse = |graphics: &str| {
        let text = sphere.replace("rate = 60.0                             # Hz", graphics);
        assert_ne!(text, sphere);
        Rendering::parse(&text, "s.toml").map(|scene| scene.graphics.unwrap().effects).map_err(|e| e.to_string())
    };
    assert_eq!(parse("rate = 30"), Ok(NONE));
    let named =
        "gravity = [0, 0, -9.81]\nstiffening = { factor = 4, strain = 0.2 }\nsmoothing = 0.05\nquasi_static = false";
    let expected = GraphicsEffects {
        gravity: Some(DVec3::new(0.0, 0.0, -9.81)),
        stiffening: Some(StiffeningSpec { factor: 4.0, strain: 0.2 }),
        smoothing: Some(0.05),
        quasi_static: false,
    };
    assert_eq!(parse(named), Ok(expected));
    for (wrong, why) in [
        ("gravity = [0, 0, 0]", "leave it out"),
        ("gravity = [0, 0, nan]", "gravity"),
        ("smoothing = 0", "positive"),
        ("stiffening = { factor = 1, strain = 0.2 }", "between 1 and 100"),
        ("stiffening = { factor = 4, strain = 0 }", "positive"),
        ("stiffening = { factor = 4 }", "strain"),
        ("quasi_static = true\nstiffening = { factor = 4, strain = 0.2 }", "leave out one"),
    ] {
        let message = parse(wrong).unwrap_err();
        assert!(message.starts_with("s.toml:") && message.contains(why), "{wrong}: {message}");
    }
    let springs = &sphere[sphere.find("[object.springs]").unwrap()..sphere.find("[object.ground]").unwrap()];
    let solid = sphere.replace(springs, "[object.elasticity]\nyoung = 1e4\npoisson = 0.3\ncell = 0.01\n");
    let stiffening = "[graphics]\nstiffening = { factor = 4, strain = 0.2 }";
    let message = Rendering::parse(&solid.replace("[graphics]", stiffening), "solid.toml").unwrap_err().to_string();
    assert!(message.contains("the object is an elastic solid or has a skin: leave it out"), "{message}");
    let scan = include_str!("../../datasets/sponge.toml");
    let message = Rendering::parse(&format!("{scan}\n[graphics]\nsmoothing = 0.1\n"), "scan.toml").unwrap_err();
    assert!(message.to_string().contains("the scene has none: leave it out"), "{message}");
}
