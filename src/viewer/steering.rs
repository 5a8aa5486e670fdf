//! Whence the 3-D scene is seen, and the hand in it: orbit, pan, zoom, reset; the pointer takes the proxy by a node and
//! drags it; keys move joints.

use super::{
    aspect,
    guide::{Guide, Keys},
    in_picture,
    node_drag::NodeDrag,
};
use crate::{
    draw::camera::Camera,
    proxy::{Chain, Pose},
};
use eframe::egui::{CursorIcon, InputState, Key, PointerButton, Pos2, Rect, Response, Ui};
use glam::{DVec2, DVec3};
use std::f64::consts::FRAC_PI_2;

/// A side from which a scene is seen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// Along y, x to the right.
    Front,
    /// Against x, y to the right.
    Right,
    /// Down, x to the right.
    Top,
}

/// Camera and grip.
pub struct Steering {
    /// Whence the scene is seen.
    pub camera: Camera,
    home: Camera,
    /// The node in the pointer's hand.
    pub grip: Option<NodeDrag>,
}

/// Actions of pointer and keys over the scene, for the window's help.
pub const HELP: [(&str, &str); 14] = [
    ("Drag a node of the arm", "move the device"),
    ("A D, W S, Q E", "turn its joints 1, 2, 3"),
    ("F H, T G, R Y", "turn its joints 4, 5, 6"),
    ("Home", "lead it back to the start"),
    ("Click the object", "probe a vertex"),
    ("Ctrl-drag", "move the object of a scene"),
    ("Drag elsewhere", "orbit"),
    ("Right-drag, Shift-drag", "pan"),
    ("Wheel, pinch", "zoom"),
    ("Double-click", "reset the view"),
    ("1, 2, 3", "look from the front, the right, the top"),
    ("4, 5", "fit object and tip, reset the view"),
    ("Space", "pause the motion, or let it go on"),
    ("Ctrl+O, Ctrl+S, Ctrl+Q", "open, save, quit"),
];

/// Zoom for each point that the wheel turns, as a logarithm (1/point): a notch, some 50 points, brings the eye nearer
/// by a tenth.
const ZOOM_PER_POINT: f64 = 0.002;

impl Steering {
    /// Looks from `home`.
    #[must_use]
    pub fn new(home: Camera) -> Self {
        Self { camera: home, home, grip: None }
    }

    /// Looks from where one looked first.
    pub fn reset(&mut self) {
        self.camera = self.home;
    }

    /// Looks from `side` at what one looks at.
    pub fn look_from(&mut self, side: Side) {
        (self.camera.azimuth, self.camera.elevation) = match side {
            Side::Front => (-FRAC_PI_2, 0.0),
            Side::Right => (0.0, 0.0),
            // From the very top, up has no meaning: there the camera stops a little before.
            Side::Top => (-FRAC_PI_2, FRAC_PI_2),
        };
        self.camera.orbit(DVec2::ZERO);
    }

    /// Sees a ball of `radius` about `target` whole (m), from where one looks.
    pub fn fit(&mut self, target: DVec3, radius: f64) {
        self.camera = Camera { target, distance: Camera::looking_at(target, radius).distance, ..self.camera };
    }

    /// Does what pointer and keys ask for over the picture in `rect`: `response` is that of the picture, `pose` the
    /// proxy's as it is shown there; `object` is how far the object is moved (m), where it can be.
    pub fn steer(
        &mut self,
        ui: &Ui,
        response: &Response,
        rect: Rect,
        (chain, pose): (&Chain, &Pose),
        guide: &mut Guide,
        object: Option<&mut DVec3>,
    ) {
        let aspect = aspect(rect);
        let at = |place: Pos2| in_picture(rect, place);
        let pressed = ui.input(|input| input.pointer.press_origin());
        let places = ui.input(|input| input.modifiers.command);
        if !places
            && !guide.is_handed_over()
            && response.drag_started_by(PointerButton::Primary)
            && let Some(origin) = pressed
        {
            self.grip = NodeDrag::take(&self.camera, aspect, at(origin), pose);
        }
        if response.drag_stopped() {
            self.grip = None;
        }
        let moved = response.drag_delta() / rect.height().max(1.0);
        let moved = DVec2::new(moved.x.into(), moved.y.into());
        match (self.grip, response.interact_pointer_pos()) {
            (None, _) if places && response.dragged() => {
                if let Some(object) = object {
                    let [right, up, _] = self.camera.axes();
                    *object += self.camera.height_at_target() * (moved.x * right - moved.y * up);
                }
            }
            (Some(grip), Some(pointer)) if response.dragged() => {
                let from = guide.goal();
                if let Some(goal) = grip.lead(&self.camera, aspect, at(pointer), chain, &from) {
                    guide.point(goal);
                }
            }
            _ if response.dragged_by(PointerButton::Primary) && !ui.input(|input| input.modifiers.shift) => {
                self.camera.orbit(moved);
            }
            _ if response.dragged() => self.camera.pan(moved),
            _ => {}
        }
        if response.double_clicked() {
            self.reset();
        }
        if response.contains_pointer() {
            let (scroll, pinch) = ui.input(|input| (input.smooth_scroll_delta().y, input.zoom_delta()));
            self.camera.zoom((-ZOOM_PER_POINT * f64::from(scroll)).exp() / f64::from(pinch));
        }
        let meant = response.hovered() && ui.memory(|memory| memory.focused().is_none());
        let held = |input: &InputState| if meant { held(input) } else { Keys::default() };
        guide.hear(ui.input(|input| input.focused.then(|| held(input))));
        if self.grip.is_some() {
            ui.ctx().set_cursor_icon(CursorIcon::Grabbing);
        } else if !guide.is_handed_over()
            && let Some(pointer) = response.hover_pos()
            && NodeDrag::take(&self.camera, aspect, at(pointer), pose).is_some()
        {
            ui.ctx().set_cursor_icon(CursorIcon::Grab);
        }
    }
}

/// Returns the keys that are held: a pair for each joint, the second of which moves it forwards.
fn held(input: &InputState) -> Keys {
    use Key::{A, D, E, F, G, H, Q, R, S, T, W, Y};
    const PAIRS: [[Key; 2]; 6] = [[A, D], [S, W], [Q, E], [F, H], [G, T], [R, Y]];
    if input.modifiers.command {
        // Ctrl+S saves.
        return Keys::default();
    }
    let way = |[less, more]: [Key; 2]| f64::from(i8::from(input.key_down(more)) - i8::from(input.key_down(less)));
    Keys { speeds: PAIRS.map(way), home: input.key_down(Key::Home) }
}
