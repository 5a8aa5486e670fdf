//! Scene files: the shipped ones load, and broken ones say what is wrong and where.

use haptize::scene::Scene;
use std::path::Path;

fn shipped(name: &str) -> Scene {
    Scene::load(Path::new(env!("CARGO_MANIFEST_DIR")).join("datasets").join(name)).unwrap_or_else(|e| panic!("{e}"))
}

#[test]
fn sphere_scene_has_the_paper_s_grid() {
    let scene = shipped("sphere.toml");
    assert_eq!(scene.proxy.joints.len(), 3);
    assert_eq!(scene.grid.axes.iter().map(|axis| axis.count).product::<usize>(), 8_064);
    for axis in &scene.grid.axes {
        assert!((axis.step - std::f64::consts::PI / 60.0).abs() < 1e-15);
    }
    assert!(scene.graphics.is_some() && !scene.motion.press.is_empty() && !scene.motion.scrape.is_empty());
}
