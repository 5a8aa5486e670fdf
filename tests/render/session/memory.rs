//! The loop's one number a term beside the object itself, every node of which remembers.

use super::*;
use haptize::{
    render::{driven::LiveField, live::LiveScene},
    sweep::Inspection,
};
use std::sync::Arc;

/// The scene in `text`, whose object relaxes, with springs of contact much stiffer than it: they do not relax, and in the loop
/// they do.
fn relaxing(text: &str, path: &str, more: &str) -> Scene {
    let (object, contact) = text.split_at(text.find("[contact]").unwrap());
    let contact = contact.replacen("stiffness_per_length", "stiffness", 1);
    let contact = contact.replacen("stiffness = ", "stiffness = 1e5 # ", 1);
    let relaxation = format!("\n[object.relaxation]\nterms = [[0.4, 0.05], [0.2, 0.5]]\n{more}\n");
    Scene::parse(&(object.to_owned() + &contact + &relaxation), path).unwrap()
}

/// Trace of the loop over `scene`, solved live, its device led along the scene's press, or else its scrape.
fn felt(scene: &Scene, is_press: bool) -> Trace {
    let live = Arc::new(LiveScene::new(scene.clone()).unwrap());
    let dataset = live.dataset();
    let setup = Setup::live(live, &dataset).unwrap();
    let motion = &setup.scene.motion;
    let way = Motion::through(if is_press { &motion.press } else { &motion.scrape }, setup.chain.joints.len()).unwrap();
    let plan = setup.plan(&dataset, way.duration(), 0);
    session::run(&setup.haptics, &mut setup.hand(way).unwrap(), None, &plan).unwrap()
}

/// Difference of the loop's contact torque from that of the object with its history, where the proxy went, rms over the
/// rms of the latter (1).
fn error(scene: &Scene, is_press: bool) -> f64 {
    let mut object = LiveField::new(LiveScene::remembering(scene).unwrap());
    let (mut missed, mut whole) = (0.0, 0.0);
    for tick in &felt(scene, is_press).ticks {
        let expected = object.sample(&tick.proxy);
        assert_eq!((tick.fault, expected.flags), (None, Flags::empty()), "{}", tick.time);
        for (found, expected) in tick.sample.torque.iter().zip(expected.torque.iter()) {
            missed += (found - expected).powi(2);
            whole += expected.powi(2);
        }
    }
    (missed / whole).sqrt()
}

/// A stylus on a ball, a hook on an organ, and two links on a sphere.
#[test]
fn the_loop_relaxes_as_an_object_every_node_of_which_remembers() {
    for (name, bounds) in [("touch", [0.02, 0.07]), ("organ", [0.02, 0.07]), ("sphere", [0.03, 0.16])] {
        let path = format!("{}/datasets/{name}.toml", env!("CARGO_MANIFEST_DIR"));
        let text = std::fs::read_to_string(&path).unwrap();
        // The sphere and its arm on a coarser mesh.
        let text = text.replace("subdivisions = 4", "subdivisions = 3").replace("spacing = 0.0022", "spacing = 0.0044");
        let plain = relaxing(&text, &path, "");
        // The dent where the scrape presses most.
        let trace = felt(&plain, false);
        let size = |tick: &&Tick| tick.sample.torque.norm();
        let deepest = trace.ticks.iter().max_by(|a, b| size(a).total_cmp(&size(b))).unwrap();
        let solved = LiveScene::new(plain).unwrap();
        let dent = Inspection::new(solved.direct().model(), &deepest.proxy).unwrap().dent.unwrap();
        let scene = relaxing(&text, &path, &format!("dent = {dent}"));
        let errors = [true, false].map(|is_press| error(&scene, is_press));
        println!(
            "{name}: press {:.2} %, scrape {:.2} %, dent {:.1} mm",
            100.0 * errors[0],
            100.0 * errors[1],
            1e3 * dent
        );
        assert!(errors.iter().zip(bounds).all(|(error, bound)| *error < bound), "{name}: {errors:?}");
    }
}
