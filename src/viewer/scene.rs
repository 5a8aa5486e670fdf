//! The panel with the 3-D scene: the object as the GPU moves it, the proxy, forces, the device's ghost; orbit, pan, zoom,
//! and a pointer that takes the proxy by a node and drags it.

use super::{
    ViewError,
    body::Body,
    camera::Camera,
    grip::Grip,
    guide::Guide,
    loaded::Loaded,
    palette::{self, Palette},
    shapes::Shape,
    stage::{Look, Quantity, Stage},
    theme::{self, AXIS_LINE, COLOUR_BAR, FINE_GAP, GAP, GROUP_GAP, TICK},
};
use crate::{
    JointVector,
    gpu::{Context, FrameError},
    proxy::Pose,
    render::session::Latest,
    report::colour::ColourMap,
    scene::GraphicsEffects,
};
use eframe::{
    egui::{self, Align2, Color32, PointerButton, Rect, Sense, Stroke, Ui, pos2, vec2},
    egui_wgpu::RenderState,
};
use glam::{Vec2, Vec3};
use std::{
    sync::{Arc, mpsc},
    thread,
};

/// What is shown of the scene, as the user wants it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shown {
    /// The triangles' edges.
    pub edges: bool,
    /// Arrows of the contact forces.
    pub forces: bool,
    /// Where the device is, as a translucent proxy.
    pub ghost: bool,
    /// What the surface's colour says.
    pub quantity: Quantity,
}

/// The scene's panel.
pub struct SceneView {
    context: Arc<Context>,
    render: RenderState,
    stage: Stage,
    texture: Option<(egui::TextureId, [usize; 2])>,
    camera: Camera,
    home: Camera,
    body: Option<Body>,
    /// The object with other effects, once it is set up.
    coming: Option<mpsc::Receiver<Result<Option<Body>, FrameError>>>,
    pose: Pose,
    ghost: Pose,
    grip: Option<Grip>,
    /// What is shown.
    pub shown: Shown,
    /// Extent of the scene [m].
    extent: f32,
}

/// Zoom for each point that the wheel turns, as a logarithm [1/point]: a notch, some 50 points, brings the eye nearer by a
/// tenth.
const ZOOM_PER_POINT: f32 = 0.002;

/// How far a key moves a joint in a second, as a share of its range [1/s]: all of it in four seconds, slowly enough to
/// press with care.
const KEY_SPEED: f64 = 0.25;

/// Longest time that a key held through one frame moves a joint for [s]: a window that stood still must not throw the arm.
const LONGEST_KEY: f32 = 0.1;

// Sizes of the proxy: a link's radius over the extent of the scene; all others over that radius [1].
const LINK: f32 = 0.012;
const JOINT_BALL: f32 = 1.7;
const NODE_BALL: f32 = 1.35;
const CONTACT_BALL: f32 = 1.3;
const HELD_BALL: f32 = 2.0;
const GHOST: f32 = 0.45;
const ARROW: f32 = 0.55;

/// Length of the arrow of the dataset's greatest force over the extent of the scene [1].
const LONGEST_ARROW: f32 = 0.5;

/// Radius of what is seen at first over the extent of the scene [1]: a little less than all, whose corners are empty.
const SEEN: f32 = 0.98;

/// Extent of a scene with nothing in it [m].
const NO_EXTENT: f32 = 0.1;

// On the picture, from its lower left corner [points]: axes, how long they are and where their names are over that [1], the
// scale and how long it is at most. From its lower right: the bar of colours.
const AXES_AT: egui::Vec2 = vec2(34.0, -34.0);
const AXES_LENGTH: f32 = 22.0;
const AXES_NAMES: f32 = 1.38;
const SCALE_AT: egui::Vec2 = vec2(78.0, -22.0);
const LONGEST_SCALE: f32 = 90.0;
const BAR_AT: egui::Vec2 = vec2(-156.0, -26.0);
const BAR_WIDTH: f32 = 136.0;

impl SceneView {
    /// An empty scene.
    ///
    /// # Errors
    /// When the device refuses the drawing shaders.
    pub fn new(context: Arc<Context>, render: RenderState) -> Result<Self, ViewError> {
        let camera = Camera::looking_at(Vec3::ZERO, NO_EXTENT);
        Ok(Self {
            stage: Stage::new(Arc::clone(&context))?,
            context,
            render,
            texture: None,
            camera,
            home: camera,
            body: None,
            coming: None,
            pose: Pose::default(),
            ghost: Pose::default(),
            grip: None,
            shown: Shown { edges: true, forces: true, ghost: true, quantity: Quantity::Displacement },
            extent: NO_EXTENT,
        })
    }

    /// Takes the proxy of `loaded` and its object, `body`, and looks at them.
    pub fn open(&mut self, loaded: &Loaded, body: Option<Body>) {
        (self.body, self.coming) = (body, None);
        let chain = &loaded.setup.chain;
        (self.pose, self.ghost, self.grip) = (chain.new_pose(), chain.new_pose(), None);
        chain.pose(&loaded.start(), &mut self.pose);
        let object = loaded.setup.object.iter().flat_map(|object| &object.rest);
        let points: Vec<Vec3> =
            object.chain(&self.pose.nodes).chain(&self.pose.origins).map(|point| point.as_vec3()).collect();
        let least = points.iter().copied().reduce(Vec3::min).unwrap_or(Vec3::ZERO);
        let greatest = points.iter().copied().reduce(Vec3::max).unwrap_or(Vec3::ZERO);
        self.extent = 0.5 * least.distance(greatest);
        self.home = Camera::looking_at(0.5 * (least + greatest), SEEN * self.extent);
        self.camera = self.home;
    }

    /// Begins to set up the object of `loaded` with other `effects`; what is drawn stays until that is done. `wake` is
    /// called then.
    ///
    /// # Errors
    /// In words, when the system gives no thread.
    pub fn redraw(
        &mut self,
        loaded: &Loaded,
        effects: GraphicsEffects,
        wake: impl Fn() + Send + 'static,
    ) -> Result<(), String> {
        let (sender, coming) = mpsc::channel();
        let (context, loaded) = (Arc::clone(&self.context), loaded.clone());
        let work = move || {
            // A window that is gone needs no object.
            let _ = sender.send(Body::new(&context, &loaded, &effects));
            wake();
        };
        let spawned = thread::Builder::new().name("object".into()).spawn(work);
        spawned.map_err(|error| format!("the system gives no thread: {error}; close other programs"))?;
        self.coming = Some(coming);
        Ok(())
    }

    /// Waits until the object that is being set up is drawn; for tests.
    ///
    /// # Errors
    /// When the device refuses it.
    pub fn wait(&mut self) -> Result<(), ViewError> {
        if let Some(Ok(body)) = self.coming.take().map(|coming| coming.recv()) {
            self.body = body?;
        }
        Ok(())
    }

    /// Lets `elapsed` [s] go by with the loop at `latest`.
    ///
    /// # Errors
    /// When the device fails.
    pub fn advance(&mut self, loaded: &Loaded, latest: &Latest, elapsed: f64) -> Result<(), ViewError> {
        loaded.setup.chain.pose(&latest.proxy, &mut self.pose);
        loaded.setup.chain.pose(&latest.device, &mut self.ghost);
        if let Some(Ok(body)) = self.coming.as_ref().map(mpsc::Receiver::try_recv) {
            self.coming = None;
            self.body = body?;
        }
        if let Some(body) = &mut self.body {
            body.advance(latest, elapsed)?;
        }
        Ok(())
    }

    /// Where the proxy's last node is shown in `rect`.
    #[must_use]
    pub fn tip_in(&self, rect: Rect) -> Option<egui::Pos2> {
        let tip = self.pose.nodes.last()?.as_vec3();
        let shown = self.camera.clip(rect.width() / rect.height().max(1.0)).project_point3(tip);
        Some(rect.center() + 0.5 * vec2(shown.x * rect.width(), -shown.y * rect.height()))
    }

    /// Shows the scene in all of `ui`, and lets the pointer lead `guide`.
    ///
    /// # Errors
    /// When the device fails.
    pub fn show(&mut self, ui: &mut Ui, loaded: &Loaded, guide: &mut Guide) -> Result<(), ViewError> {
        let (rect, response) = ui.allocate_exact_size(ui.available_size(), Sense::click_and_drag());
        response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Canvas, true, "3-D scene"));
        let aspect = rect.width() / rect.height().max(1.0);
        self.steer(ui, &response, rect, aspect, loaded, guide);
        let palette = palette::of(ui.visuals());
        let texture = self.draw(rect, ui.ctx().pixels_per_point(), &palette)?;
        let whole = Rect::from_min_max(pos2(0.0, 0.0), pos2(1.0, 1.0));
        ui.painter().image(texture, rect, whole, Color32::WHITE);
        self.overlay(ui, rect, &palette);
        Ok(())
    }

    fn steer(
        &mut self,
        ui: &Ui,
        response: &egui::Response,
        rect: Rect,
        aspect: f32,
        loaded: &Loaded,
        guide: &mut Guide,
    ) {
        let at = |p: egui::Pos2| {
            let from_centre = p - rect.center();
            Vec2::new(2.0 * from_centre.x / rect.width(), -2.0 * from_centre.y / rect.height())
        };
        let pressed = ui.input(|input| input.pointer.press_origin());
        if response.drag_started_by(PointerButton::Primary)
            && let Some(origin) = pressed
        {
            self.grip = Grip::take(&self.camera, aspect, at(origin), &self.pose);
        }
        if response.drag_stopped() {
            self.grip = None;
        }
        let moved = response.drag_delta() / rect.height().max(1.0);
        let moved = Vec2::new(moved.x, moved.y);
        match (self.grip, response.interact_pointer_pos()) {
            (Some(grip), Some(pointer)) if response.dragged() => {
                let from = guide.goal();
                if let Some(goal) = grip.lead(&self.camera, aspect, at(pointer), &loaded.setup.chain, &from) {
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
            self.reset_view();
        }
        if response.contains_pointer() {
            let (scroll, pinch) = ui.input(|input| (input.smooth_scroll_delta().y, input.zoom_delta()));
            self.camera.zoom((-ZOOM_PER_POINT * scroll).exp() / pinch);
        }
        if response.hovered() && ui.memory(|memory| memory.focused().is_none()) {
            nudge(ui, loaded, guide);
        }
        if self.grip.is_some() {
            ui.ctx().set_cursor_icon(egui::CursorIcon::Grabbing);
        } else if let Some(pointer) = response.hover_pos()
            && Grip::take(&self.camera, aspect, at(pointer), &self.pose).is_some()
        {
            ui.ctx().set_cursor_icon(egui::CursorIcon::Grab);
        }
    }

    /// Looks from where one looked first.
    pub fn reset_view(&mut self) {
        self.camera = self.home;
    }

    fn draw(&mut self, rect: Rect, pixels_per_point: f32, palette: &Palette) -> Result<egui::TextureId, ViewError> {
        let size = [rect.width(), rect.height()].map(|side| (side * pixels_per_point).round().max(1.0) as u32);
        let extremes = self.body.as_ref().map_or([0.0; 2], |body| body.extremes);
        let top = match self.shown.quantity {
            Quantity::Displacement => extremes[0],
            Quantity::Force => extremes[1],
        };
        let look = Look {
            background: channels(palette.stage),
            quantity: self.shown.quantity,
            colour_top: top as f32,
            edge_width: if self.shown.edges { pixels_per_point } else { 0.0 },
        };
        let shapes = self.shapes(palette);
        let surface = self.body.as_ref().map(|body| &body.surface);
        let picture = self.stage.draw(size, &self.camera, &look, surface, &shapes)?;
        let actual = [picture.width() as usize, picture.height() as usize];
        let texture = match self.texture {
            Some((id, known)) if known == actual => id,
            known => {
                let view = picture.create_view(&Default::default());
                let mut renderer = self.render.renderer.write();
                let filter = wgpu::FilterMode::Linear;
                let id = match known {
                    Some((id, _)) => {
                        renderer.update_egui_texture_from_wgpu_texture(&self.render.device, &view, filter, id);
                        id
                    }
                    None => renderer.register_native_texture(&self.render.device, &view, filter),
                };
                self.texture = Some((id, actual));
                id
            }
        };
        Ok(texture)
    }

    /// Everything that is drawn besides the surface.
    fn shapes(&self, palette: &Palette) -> Vec<Shape> {
        let unit = LINK * self.extent;
        let mut shapes = arm(&self.pose, unit, channels(palette.link), channels(palette.node));
        if self.shown.ghost && self.ghost.nodes != self.pose.nodes {
            let ghost = channels(palette.ghost);
            shapes.extend(arm(&self.ghost, GHOST * unit, ghost, ghost).into_iter().map(Shape::unlit));
        }
        if let Some(grip) = &self.grip {
            let held = self.pose.nodes[grip.node].as_vec3();
            shapes.push(Shape::ball(held, HELD_BALL * unit, channels(palette.ghost)));
        }
        if let Some(body) = &self.body {
            let longest = body.extremes[1].max(f64::MIN_POSITIVE);
            for (node, force) in body.contacts() {
                // The shapes' own places are those of the node at rest: the GPU moves them with it.
                let rest = body.rest(node);
                let colour = channels(palette.force);
                shapes.push(Shape::ball(rest, CONTACT_BALL * unit, colour).anchored(node));
                if self.shown.forces {
                    // On the proxy, against the force on the object: the arrow stands out of the surface.
                    let span = (-force * (f64::from(LONGEST_ARROW * self.extent) / longest)).as_vec3();
                    let arrow = Shape::arrow(rest, span, ARROW * unit, colour);
                    shapes.extend(arrow.into_iter().map(|shape| shape.anchored(node)));
                }
            }
        }
        shapes
    }

    /// Axes, scale and colour bar, on top of the picture.
    fn overlay(&self, ui: &Ui, rect: Rect, palette: &Palette) {
        let painter = ui.painter_at(rect);
        let small = theme::small();
        let text = ui.visuals().text_color();
        // Axes, turned as the scene is.
        let [right, up] = self.camera.right_and_up();
        let origin = rect.left_bottom() + AXES_AT;
        for (axis, name) in [(Vec3::X, "x"), (Vec3::Y, "y"), (Vec3::Z, "z")] {
            let end = vec2(axis.dot(right), -axis.dot(up)) * AXES_LENGTH;
            painter.line_segment([origin, origin + end], Stroke::new(AXIS_LINE, palette.axis));
            painter.text(origin + end * AXES_NAMES, Align2::CENTER_CENTER, name, small.clone(), text);
        }
        // A round length at the distance of what is looked at.
        let height = self.camera.height_at_target();
        let points_per_metre = rect.height() / height;
        let length = round_length(f64::from(LONGEST_SCALE / points_per_metre));
        let width = length as f32 * points_per_metre;
        let left = rect.left_bottom() + SCALE_AT;
        let stroke = Stroke::new(AXIS_LINE, palette.axis);
        painter.line_segment([left, left + vec2(width, 0.0)], stroke);
        for end in [left, left + vec2(width, 0.0)] {
            painter.line_segment([end - vec2(0.0, TICK), end + vec2(0.0, TICK)], stroke);
        }
        let label = format!("{} mm", super::number(1e3 * length));
        painter.text(left + vec2(0.5 * width, -GAP), Align2::CENTER_BOTTOM, label, small.clone(), text);
        if let Some(body) = &self.body {
            let (title, top) = match self.shown.quantity {
                Quantity::Displacement => ("displacement [mm]", 1e3 * body.extremes[0]),
                Quantity::Force => ("contact force [N]", body.extremes[1]),
            };
            let most = body.contacts().map(|(_, force)| force.length()).fold(0.0, f64::max);
            if most > 0.0 && self.shown.forces {
                let note = format!("arrows: forces on the proxy, longest {} N", super::number(most));
                painter.text(rect.left_top() + vec2(GROUP_GAP, GROUP_GAP), Align2::LEFT_TOP, note, small.clone(), text);
            }
            let bar = Rect::from_min_size(rect.right_bottom() + BAR_AT, vec2(BAR_WIDTH, COLOUR_BAR));
            super::slices::gradient(&painter, bar, ColourMap::Pale { low: 0.0, high: 1.0 }, false);
            painter.text(bar.center_top() - vec2(0.0, FINE_GAP), Align2::CENTER_BOTTOM, title, small.clone(), text);
            painter.text(bar.left_bottom() + vec2(0.0, FINE_GAP), Align2::CENTER_TOP, "0", small.clone(), text);
            painter.text(bar.right_bottom() + vec2(0.0, FINE_GAP), Align2::CENTER_TOP, super::number(top), small, text);
        }
    }
}

/// Links and nodes of a proxy: `unit` is the radius of a link.
fn arm(pose: &Pose, unit: f32, link: [f32; 3], node: [f32; 3]) -> Vec<Shape> {
    let mut shapes = Vec::new();
    let joints = pose.origins.iter().map(|origin| origin.as_vec3());
    let tip = pose.nodes.last().map(|tip| tip.as_vec3());
    let stops: Vec<Vec3> = joints.chain(tip).collect();
    for ends in stops.windows(2) {
        shapes.push(Shape::capsule(ends[0], ends[1], unit, link));
    }
    for origin in &pose.origins {
        shapes.push(Shape::ball(origin.as_vec3(), JOINT_BALL * unit, link));
    }
    for place in &pose.nodes {
        shapes.push(Shape::ball(place.as_vec3(), NODE_BALL * unit, node));
    }
    shapes
}

fn channels(colour: Color32) -> [f32; 3] {
    [colour.r(), colour.g(), colour.b()].map(|channel| f32::from(channel) / 255.0)
}

/// The largest of 1, 2, 5 times a power of ten that is not longer than `limit` [m].
fn round_length(limit: f64) -> f64 {
    let decade = 10.0_f64.powf(limit.max(f64::MIN_POSITIVE).log10().floor());
    [5.0, 2.0, 1.0].into_iter().map(|digit| digit * decade).find(|length| *length <= limit).unwrap_or(decade)
}

/// Keys move joints: A and D the first, W and S the second, Q and E the third.
fn nudge(ui: &Ui, loaded: &Loaded, guide: &mut Guide) {
    use egui::Key::{A, D, E, Q, S, W};
    let (pressed, elapsed) = ui.input(|input| {
        let way = |less, more| f64::from(i8::from(input.key_down(more)) - i8::from(input.key_down(less)));
        ([way(A, D), way(S, W), way(Q, E)], f64::from(input.stable_dt.min(LONGEST_KEY)))
    });
    if pressed == [0.0; 3] {
        return;
    }
    let mut goal: JointVector = guide.goal();
    for ((goal, way), joint) in goal.iter_mut().zip(pressed).zip(&loaded.setup.chain.joints) {
        *goal += way * KEY_SPEED * (joint.limits[1] - joint.limits[0]) * elapsed;
    }
    guide.point(goal);
    ui.ctx().request_repaint();
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    #[test]
    fn scale_bars_are_round_and_fit() {
        for (limit, length) in [(0.0231, 0.02), (0.0999, 0.05), (1.0, 1.0), (0.0019, 0.001)] {
            assert!((round_length(limit) - length).abs() < 1e-12, "{limit}");
        }
    }

    #[test]
    fn an_arm_has_a_rod_a_link_and_a_ball_a_node() {
        let pose = Pose { origins: vec![DVec3::ZERO, DVec3::X], nodes: vec![DVec3::Y; 3], ..Pose::default() };
        assert_eq!(arm(&pose, 0.1, [0.0; 3], [1.0; 3]).len(), 2 + 2 + 3);
    }
}
