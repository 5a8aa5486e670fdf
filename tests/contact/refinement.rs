//! Torque converges when the contact nodes of a link are refined, and when the object's mesh is.

use haptize::{
    JointVector,
    contact::{Model, Solver, Status},
    object::Object,
    proxy::Chain,
    scene::Scene,
};

/// A link that ends above the middle of a sphere with a skin: turned about y, and pressed down.
const SCENE: &str = r#"
    [object]
    sphere = { radius = 0.05, subdivisions = 3 }
    skin = { tension = 260.0, width = 0.0175, foundation = 1.6e5 }
    [contact]
    stiffness_per_length = 1.7e5
    [grid]
    axes = [{ start = 0.0, stop = 0.01, count = 3 }, { start = -0.3, stop = 0.3, count = 3 }]
    [[proxy.joint]]
    kind = "prismatic"
    origin = [0.04, 0.0, 0.05]
    axis = [0.0, 0.0, -1.0]
    limits = [-0.1, 0.1]
    [[proxy.joint]]
    kind = "revolute"
    axis = [0.0, 1.0, 0.0]
    limits = [-1.0, 1.0]
    nodes = [{ from = [-0.036, 0.002, 0.0], to = [0.0, 0.002, 0.0], spacing = 0.004 }]
"#;

/// Force and torque in `count` configurations along a line, in a scene that differs from [`SCENE`] by these
/// replacements.
fn torques(count: u32, replacements: &[(&str, &str)]) -> Vec<f64> {
    let text = replacements.iter().fold(SCENE.to_string(), |text, (old, new)| {
        assert!(text.contains(old));
        text.replace(old, new)
    });
    let scene = Scene::parse(&text, "link.toml").unwrap();
    let object = Object::build(&scene.object).unwrap();
    let chain = Chain::new(&scene.proxy);
    let place = |k: u32| f64::from(k) / f64::from(count);
    let configurations: Vec<JointVector> =
        (0..count).map(|k| JointVector::from_slice(&[0.003 + 0.004 * place(k), -0.1 + 0.26 * place(k)])).collect();
    let model = Model::reaching(&object, &chain, scene.contact, &configurations).unwrap();
    let mut solver = Solver::new(&model);
    let mut torques = Vec::new();
    for q in &configurations {
        let found = solver.solve(q);
        assert_eq!(found.status, Status::Contact);
        torques.extend([0.04 * found.torque[0], found.torque[1]]);
    }
    torques
}

fn rms(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0.0), |(sum, count), value| (sum + value * value, count + 1.0));
    (sum / count).sqrt()
}

fn difference(a: &[f64], b: &[f64]) -> f64 {
    rms(a.iter().zip(b).map(|(a, b)| a - b))
}

#[test]
fn torque_converges_at_second_order_as_the_nodes_of_a_link_come_closer() {
    let [coarse, middle, fine] =
        ["0.004", "0.002", "0.001"].map(|spacing| torques(20, &[("spacing = 0.004", &format!("spacing = {spacing}"))]));
    let size = rms(fine.iter().copied());
    let (first, second) = (difference(&coarse, &middle), difference(&middle, &fine));
    // Second order divides the change by four. Were the nodes at the ends as stiff as the others, it would be two.
    assert!(first > 2.8 * second && second < 0.01 * size, "{first} {second} of {size}");
}

/// What is left of a sequence of joint torques, taken in turn, when its smooth part is taken out: third differences,
/// scaled so that independent errors keep their size.
fn ripple(torques: &[f64]) -> f64 {
    rms(torques.windows(7).map(|w| (w[6] - 3.0 * w[4] + 3.0 * w[2] - w[0]) / 20.0_f64.sqrt()))
}

#[test]
fn torque_converges_at_second_order_as_the_mesh_under_a_smooth_surface_is_refined() {
    let on = |subdivisions: u32, surface: &str| {
        let mesh = format!("subdivisions = {subdivisions}");
        let contact = format!("[contact]\nsurface = \"{surface}\"");
        torques(60, &[("subdivisions = 3", &mesh), ("[contact]", &contact), ("spacing = 0.004", "spacing = 0.002")])
    };
    let [coarse, middle, fine] = [3, 4, 5].map(|subdivisions| on(subdivisions, "smooth"));
    let [flat, flat_middle] = [3, 4].map(|subdivisions| on(subdivisions, "facets"));
    let size = rms(fine.iter().copied());
    // From 642 to 2,562 and to 10,242 nodes. Corners of facets make most of the changes of flat ones, and of the
    // ripple.
    let (first, second) = (difference(&coarse, &middle), difference(&middle, &fine));
    println!("{first} {second} {} of {size}, {} {}", difference(&flat, &flat_middle), ripple(&coarse), ripple(&flat));
    assert!(first > 3.2 * second && second < 0.005 * size, "{first} {second} of {size}");
    assert!(first < 0.6 * difference(&flat, &flat_middle));
    assert!(ripple(&coarse) < 0.25 * ripple(&flat));
}
