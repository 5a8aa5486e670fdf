//! The object moved and turned before the arm, and the arm's pose taken for grid and motions: changes of the scene's own
//! text, which leave its comments.

use super::{
    loaded::Loaded,
    theme::{FINE_GAP, GAP},
};
use crate::{
    Error, JointVector,
    object::{Object, corners},
    proxy::tip,
    scene::{Scene, SceneText, Shape, rotation},
    sweep::{Placing, build_object},
};
use eframe::egui::{DragValue, Response, RichText, Ui};
use glam::{DAffine3, DVec3};

/// A change of the scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Edit {
    /// Move the object by this (m), and turn it about the middle of its box to these angles about x, then y, then z
    /// (rad).
    Move(DVec3, DVec3),
    /// Bring the object before the tip, with a grid and motions there.
    Bring,
    /// Put the tip before the surface next to it, with a grid and motions there.
    UsePose(JointVector),
}

/// The panel's state.
#[derive(Clone, Copy, Debug)]
pub struct ObjectPlace {
    /// How far the object is to be moved (m).
    pub motion: DVec3,
    /// Its centre and its angles as the scene has them (m, rad); no angles where it is round.
    centre: DVec3,
    turn: Option<DVec3>,
    /// The angles to which it is to be turned.
    turned: DVec3,
    /// The middle of its box (m).
    middle: DVec3,
}

/// Change of a length and of an angle for each point of the pointer's way (mm/point, degrees/point).
const LENGTH_DRAG: f64 = 0.5;
const ANGLE_DRAG: f64 = 0.5;

impl ObjectPlace {
    /// Of what is open; none where that is no scene, or has no object to be moved.
    #[must_use]
    pub fn new(loaded: &Loaded) -> Option<Self> {
        let (Some(_), Some(scene), Some(object)) = (&loaded.live, &loaded.scene, &loaded.setup.object) else {
            return None;
        };
        let turn = match &scene.object.shape {
            Shape::Mesh { placement, .. } | Shape::Tetrahedra { placement, .. } => Some(placement.turn),
            Shape::Sphere { .. } | Shape::Icosphere { .. } => None,
        };
        let (centre, turned) = (scene.object.shape.centre(), turn.unwrap_or_default());
        Some(Self { motion: DVec3::ZERO, centre, turn, turned, middle: middle(object) })
    }

    /// From where the object is to where it is to be.
    #[must_use]
    pub fn frame(&self) -> DAffine3 {
        let turned = rotation(self.turned) * rotation(self.turn.unwrap_or_default()).inverse();
        DAffine3::from_translation(self.middle + self.motion)
            * DAffine3::from_quat(turned)
            * DAffine3::from_translation(-self.middle)
    }

    /// The change that puts it there, unless it is there.
    #[must_use]
    pub fn edit(&self) -> Option<Edit> {
        let is_there = self.motion == DVec3::ZERO && self.turned == self.turn.unwrap_or_default();
        (!is_there).then_some(Edit::Move(self.motion, self.turned))
    }

    /// Shows the fields, with the arm at `q`; answers with a change that is to be made.
    pub fn show(&mut self, ui: &mut Ui, q: &JointVector) -> Option<Edit> {
        let mut done = false;
        let places = 1e3 * (self.centre + self.motion);
        for (k, (place, response)) in numbers(ui, "Object at [mm]", places, LENGTH_DRAG).into_iter().enumerate() {
            let response = response.on_hover_text("Or drag the object in the picture with Ctrl held");
            if response.changed() {
                self.motion[k] = 1e-3 * place - self.centre[k];
            }
            done |= is_done(&response);
        }
        if self.turn.is_some() {
            let angles = self.turned.map(f64::to_degrees);
            for (k, (angle, response)) in numbers(ui, "Turned about [°]", angles, ANGLE_DRAG).into_iter().enumerate() {
                if response.changed() {
                    self.turned[k] = angle.to_radians();
                }
                done |= is_done(&response);
            }
        }
        let bring = ui.button("Bring it to the tip").on_hover_text("Moves the object before the tip of the arm");
        let pose = ui.button("Use this pose").on_hover_text("A grid, a press and a scrape where the tip is now");
        ui.add_space(GAP - FINE_GAP);
        match () {
            () if bring.clicked() => Some(Edit::Bring),
            () if pose.clicked() => Some(Edit::UsePose(*q)),
            () if done => self.edit(),
            () => None,
        }
    }
}

/// Shows three numbers, each after the name of its axis, that change by `speed` for each point of the pointer's way.
fn numbers(ui: &mut Ui, title: &str, numbers: DVec3, speed: f64) -> [(f64, Response); 3] {
    ui.label(RichText::new(title).small());
    let row = ui.horizontal(|ui| {
        [("x", numbers.x), ("y", numbers.y), ("z", numbers.z)].map(|(axis, mut number)| {
            let label = ui.label(axis);
            let response = ui.add(DragValue::new(&mut number).speed(speed).max_decimals(1)).labelled_by(label.id);
            (number, response)
        })
    });
    row.inner
}

/// Whether a number is as it is to be: a drag has ended, or typing.
fn is_done(response: &Response) -> bool {
    response.drag_stopped() || response.lost_focus()
}

/// Middle of the object's box (m).
fn middle(object: &Object) -> DVec3 {
    let [low, high] = corners(&object.rest[..object.surface_nodes]);
    low.midpoint(high)
}

/// Returns `scene` with a change of its text, and where the arm is to stand then, if elsewhere.
///
/// # Errors
/// When the object is refused, or the tip gets nowhere.
pub fn edited(scene: &Scene, edit: &Edit) -> Result<(Scene, Option<JointVector>), Error> {
    let mut text = SceneText::new(&scene.text, &scene.path)?;
    let place = |text: &mut SceneText<'_>, placing: Placing| {
        if let Some(why) = placing.refusal() {
            return Err(Error::from(why));
        }
        text.replace(&placing.tables(&scene.proxy.joints)?)?;
        Ok(Some(JointVector::from_slice(&placing.q)))
    };
    let no_node = || Error::from("the arm has no contact node");
    let q = match edit {
        Edit::Move(motion, angles) => {
            let object = build_object(scene)?;
            let (about, surface) = (middle(&object), &object.rest[..object.surface_nodes]);
            if let Shape::Mesh { placement, .. } | Shape::Tetrahedra { placement, .. } = &scene.object.shape {
                let turned = rotation(*angles) * rotation(placement.turn).inverse();
                let low = |turned: glam::DQuat| {
                    surface.iter().map(|node| (turned * (*node - about)).z).fold(f64::INFINITY, f64::min)
                };
                // It lies on the same part of its height.
                text.turn_object(*angles, turned, about, low(turned) - low(glam::DQuat::IDENTITY));
            }
            text.move_object(*motion);
            None
        }
        Edit::Bring => {
            let (motion, placing) = Placing::brought(scene)?.ok_or_else(no_node)?;
            text.move_object(motion);
            place(&mut text, placing)?
        }
        Edit::UsePose(q) => place(&mut text, Placing::here(scene, q)?.ok_or_else(no_node)?)?,
    };
    Ok((Scene::parse(&text.to_string(), &scene.path)?, q))
}

/// Distance of the tip from the surface at rest, negative inside, for an object moved by `frame` (m); none where nothing
/// is solved live.
#[must_use]
pub fn tip_gap(loaded: &Loaded, at: DVec3, frame: DAffine3) -> Option<f64> {
    let model = loaded.live.as_ref()?.direct().model();
    let radius = model.chain.nodes[tip(model.chain)?].radius;
    let place = frame.inverse().transform_point3(at) - model.surface.centre;
    Some(model.surface.signed_distance(place, u32::MAX) - radius)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::GroundNodes;
    use std::{f64::consts::FRAC_PI_2, path::Path};

    #[test]
    fn an_object_turns_about_its_middle_and_lies_on_the_same_part_of_it() {
        let scene = Scene::load(Path::new("datasets/mesh.toml")).unwrap();
        let before = Object::build(&scene.object).unwrap();
        let motion = DVec3::new(0.01, -0.02, 0.03);
        let edit = Edit::Move(motion, DVec3::new(0.0, 0.0, FRAC_PI_2));
        let (moved, q) = edited(&scene, &edit).unwrap();
        let after = Object::build(&moved.object).unwrap();
        assert!(q.is_none());
        let expected = |place: DVec3| {
            let from = place - middle(&before);
            middle(&before) + motion + DVec3::new(-from.y, from.x, from.z)
        };
        // The scene's text holds nanometres.
        for (before, after) in before.rest.iter().zip(&after.rest) {
            assert!(after.distance(expected(*before)) < 1e-8, "{before} comes to {after}");
        }
        let held = |scene: &Scene| match scene.object.ground.as_ref().map(|ground| &ground.nodes) {
            Some(GroundNodes::Below(height)) => *height,
            _ => f64::NAN,
        };
        let [below, raised] = [held(&scene), held(&moved)];
        assert!((raised - below - motion.z).abs() < 1e-8, "{below} m comes to {raised} m");
        let comments = |text: &str| text.matches('#').count();
        assert_eq!(comments(&moved.text), comments(&scene.text));
    }
}
