//! One configuration in full.

use crate::{
    common::program::json,
    equilibria::relative_error,
    fixture::{Folder, POINTS, SCENE, scene, sweep},
};
use glam::DVec3;
use haptize::{
    JointVector,
    contact::Model,
    object::Object,
    proxy::Chain,
    scene::{ContactLaw, ContactSpec, Scene},
    sweep::{CpuBackend, Direct, Inspection, ObjectNode, Run},
};
use std::sync::atomic::AtomicBool;

#[test]
fn an_inspection_tells_the_same_from_scene_and_dataset() {
    let folder = Folder::new();
    std::fs::write(folder.0.path().join("small.toml"), SCENE).unwrap();
    let json = |arguments: &[&str]| json(folder.0.path(), arguments);
    json(&["bake", "small.toml", "--backend", "cpu", "--json"]);
    std::fs::remove_file(folder.0.path().join("small.toml")).unwrap();
    let from_dataset = json(&["inspect", "small.haptize", "--q", "-0.2,0.042", "--json"]);
    std::fs::write(folder.0.path().join("small.toml"), SCENE).unwrap();
    let mut from_scene = json(&["inspect", "small.toml", "--q=-0.2,0.042", "--json"]);
    assert_eq!(from_scene["status"], "contact");
    // The grid point 1 x 8, as it was stored and as it is solved anew.
    assert_eq!(from_dataset["stored"]["point"], 9 + 8);
    let torque = |value: &serde_json::Value| serde_json::from_value::<Vec<f64>>(value["torque"].clone()).unwrap();
    assert!(relative_error(&torque(&from_dataset["stored"]), &torque(&from_dataset)) < 1e-6);
    // A grid point: every interpolation passes through what is stored there.
    assert!(relative_error(&torque(&from_dataset["interpolated"]), &torque(&from_dataset)) < 1e-6);
    for key in ["stored", "interpolated"] {
        from_scene[key] = from_dataset[key].clone();
    }
    assert_eq!(from_scene, from_dataset);
    assert_eq!(from_scene["warnings"].as_array().map(Vec::len), Some(0));
    let in_percent = json(&["inspect", "small.toml", "--q=16.6666666667%,100%", "--json"]);
    assert!(relative_error(&torque(&in_percent), &torque(&from_scene)) < 1e-6, "{in_percent}");
    let elsewhere = json(&["inspect", "small.toml", "--q=17%,100%", "--json"]);
    assert!(relative_error(&torque(&elsewhere), &torque(&from_scene)) > 1e-6, "{elsewhere}");
    let beyond = json(&["inspect", "small.toml", "--q=-9.0,0.042", "--json"]);
    assert!(beyond["warnings"][0].as_str().unwrap().contains("beyond the joint's limits"), "{beyond}");
}

#[test]
fn an_inspection_is_complete_enough_to_recompute_the_torque() {
    let scene = scene();
    let (object, chain) = (Object::build(&scene.object).unwrap(), Chain::new(&scene.proxy));
    // At rest the force on the arm has a part along the surface that does not act on the object.
    let model = Model::new(&object, &chain, ContactSpec { law: ContactLaw::Following, ..scene.contact });
    let inspection = Inspection::new(&model, &[0.05, 0.045]).unwrap();
    assert_eq!((inspection.status.as_str(), inspection.proxy_nodes.len()), ("contact", 3));
    assert_eq!(inspection.object_nodes.len(), object.surface_nodes);
    let mut torque = [0.0; 2];
    for node in &inspection.proxy_nodes {
        let force = node.contact.as_ref().map_or(DVec3::ZERO, |contact| contact.force);
        torque.iter_mut().zip(&node.jacobian).for_each(|(tau, column)| *tau += column.dot(force));
    }
    assert!(relative_error(&torque, &inspection.torque) < 1e-12);
    let pushed: DVec3 = inspection.object_nodes.iter().map(|node| node.force).sum();
    let pushing: DVec3 =
        inspection.proxy_nodes.iter().filter_map(|node| node.contact.as_ref()).map(|contact| contact.force).sum();
    assert!((pushed + pushing).length() < 1e-12 * pushed.length());
}

/// Whatever the compliance covers.
#[test]
fn every_node_of_a_body_is_known_to_move_as_it_does() {
    let scene =
        Scene::parse(&SCENE.replace("rings = 4, segments = 5", "rings = 20, segments = 20"), "fine.toml").unwrap();
    let (object, chain) = (Object::build(&scene.object).unwrap(), Chain::new(&scene.proxy));
    let whole = Model::new(&object, &chain, scene.contact);
    for (q, touches) in [([0.05, 0.033], true), ([0.05, 0.0], false)] {
        let near = Model::at(&object, &chain, scene.contact, &JointVector::from_slice(&q)).unwrap();
        assert!(!near.compliance.is_whole());
        let [near, whole] = [&near, &whole].map(|model| Inspection::new(model, &q).unwrap());
        assert_eq!((near.status == "contact", near.dent.is_some()), (touches, touches));
        assert_eq!(near.torque, whole.torque);
        let off = |(a, b): (&ObjectNode, &ObjectNode)| a.position.distance(b.position);
        let moved =
            |of: &Inspection| of.object_nodes.iter().map(|at| at.position.distance(at.rest)).fold(0.0, f64::max);
        let worst = near.object_nodes.iter().zip(&whole.object_nodes).map(off).fold(0.0, f64::max);
        assert!(worst <= 1e-12 * moved(&whole) && touches == (moved(&near) > 1e-4), "{worst} of {}", moved(&whole));
    }
}

#[test]
fn a_scene_solved_directly_gives_what_its_inspection_and_its_dataset_tell() {
    let scene = scene();
    let direct = Direct::new(&scene).unwrap();
    let run = Run { chunk: 10, stop: &AtomicBool::new(false), progress: &mut |_| () };
    let (dataset, _) = sweep().run(&mut CpuBackend::new(direct.model(), 1).unwrap(), run).unwrap();
    let q: Vec<f64> = (0..POINTS).flat_map(|point| dataset.grid.configuration(point).to_vec()).collect();
    let (torques, statuses) = direct.torques(&q).unwrap();
    assert_eq!(torques, *dataset.torque);
    assert!(statuses.iter().zip(dataset.status.iter()).all(|(solved, stored)| *solved as u8 == *stored));
    let inspection = direct.inspect(&[0.05, 0.045]).unwrap();
    assert_eq!(inspection.torque, direct.torques(&[0.05, 0.045]).unwrap().0);
    assert_eq!(inspection.status, "contact");
}

#[test]
fn what_is_no_configuration_is_not_solved() {
    let direct = Direct::new(&scene()).unwrap();
    let refused = |q: &[f64]| direct.inspect(q).unwrap_err().to_string();
    assert!(refused(&[0.0]).contains("1 coordinate was given for a proxy of 2 joints"));
    assert!(refused(&[0.0, f64::NAN]).contains("coordinate 1 of configuration 0 is not a finite number"));
    assert!(direct.torques(&[0.0; 3]).is_err());
    assert!(direct.torques(&[f64::INFINITY, 0.0]).is_err());
}
