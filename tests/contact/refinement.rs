//! Torque converges when the contact nodes of a link are refined.

use haptize::{
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

/// Force and torque in 20 configurations, with nodes `spacing` apart.
fn torques(spacing: &str) -> Vec<f64> {
    let scene = Scene::parse(&SCENE.replace("spacing = 0.004", &format!("spacing = {spacing}")), "link.toml").unwrap();
    let object = Object::build(&scene.object).unwrap();
    let chain = Chain::new(&scene.proxy);
    let model = Model::new(&object, &chain, scene.contact);
    let mut solver = Solver::new(&model);
    let mut torques = Vec::new();
    for k in 0..20 {
        let found = solver.solve(&[0.003 + 0.0002 * f64::from(k), -0.1 + 0.013 * f64::from(k)]);
        assert_eq!(found.status, Status::Contact);
        torques.extend([0.04 * found.torque[0], found.torque[1]]);
    }
    torques
}

#[test]
fn torque_converges_at_second_order_as_the_nodes_of_a_link_come_closer() {
    let [coarse, middle, fine] = ["0.004", "0.002", "0.001"].map(torques);
    let rms = |a: &[f64], b: &[f64]| {
        let squares = a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>();
        (squares / a.len() as f64).sqrt()
    };
    let size = rms(&fine, &vec![0.0; fine.len()]);
    let (first, second) = (rms(&coarse, &middle), rms(&middle, &fine));
    // Second order divides the change by four. Were the nodes at the ends as stiff as the others, it would be two.
    assert!(first > 2.8 * second && second < 0.01 * size, "{first} {second} of {size}");
}
