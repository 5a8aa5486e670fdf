//! The panel with the 3-D scene: the object as the GPU moves it, the proxy, forces, the device's ghost.

use super::{
    ViewError, aspect,
    background::Following,
    body::Body,
    feel::Feel,
    film::Still,
    in_picture,
    links::Links,
    loaded::Loaded,
    on_screen, overlay,
    palette::{self, Palette, figure_colour},
    pixels,
    placing::{Edit, ObjectPlace, tip_gap},
    probe::pick,
    readout::Readout,
    shapes::Shape,
    steering::Steering,
    theme::{FINE_GAP, GROUP_GAP},
    view_renderer::{Look, Quantity, ViewRenderer},
};
use crate::{
    Error,
    draw::{
        camera::Camera,
        solid::{self, Cone},
    },
    gpu::{Context, GpuError},
    proxy::{Chain, Pose, tip},
    render::{session::Latest, trace::Tick},
    scene::GraphicsEffects,
};
use eframe::{
    egui::{self, Color32, Rect, Sense, Ui, UiBuilder, Visuals, pos2, vec2},
    egui_wgpu::RenderState,
};
use glam::{DAffine3, DVec3};
use std::sync::Arc;

/// The parts of the scene that the user wants to see.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shown {
    /// The triangles' edges.
    pub edges: bool,
    /// Arrows of the contact forces.
    pub forces: bool,
    /// Where the device is, as a translucent proxy.
    pub ghost: bool,
    /// Quantity that the surface's colour shows.
    pub quantity: Quantity,
}

/// The scene's panel.
pub struct SceneView {
    context: Arc<Context>,
    render: RenderState,
    stage: ViewRenderer,
    texture: Option<(egui::TextureId, [usize; 2])>,
    /// Whence it is seen.
    pub steering: Steering,
    body: Option<Body>,
    /// Shapes of the arm's links, where it has any.
    links: Option<Links>,
    /// The object with the effects that the controls have, set up in the background.
    redrawing: Following<GraphicsEffects, Result<Option<Body>, Error>>,
    pose: Pose,
    ghost: Pose,
    /// Where the object is to be moved, if it can be.
    pub placement: Option<ObjectPlace>,
    /// The vertex that was clicked.
    probed: Option<usize>,
    /// The parts that are shown.
    pub shown: Shown,
    /// Extent of the scene (m).
    extent: f64,
    /// Height of the lowest point of the object at rest, or else of the arm (m).
    ground: f64,
}

// Sizes of the proxy: a link's radius over the extent of the scene; all others over that radius [1].
const LINK: f64 = 0.012;
const CONTACT_BALL: f64 = 1.3;
const HELD_BALL: f64 = 2.0;
const PROBED_BALL: f64 = 1.5;
const GHOST: f64 = 0.45;
const ARROW: f64 = 0.55;

/// Length of the arrow of the dataset's greatest force over the extent of the scene (1).
const LONGEST_ARROW: f64 = 0.5;

/// How far the ground is below the object over the extent of the scene (1).
const GROUND: f64 = 2e-3;

/// Radius of what is seen at first over the extent of the scene (1): a little less than all, whose corners are empty.
const SEEN: f64 = 0.98;

/// Extent of a scene with nothing in it (m).
const NO_EXTENT: f64 = 0.1;

impl SceneView {
    /// An empty scene, drawn with `samples` a pixel.
    ///
    /// # Errors
    /// When the device refuses the drawing shaders.
    pub fn new(context: Arc<Context>, render: RenderState, samples: u32) -> Result<Self, ViewError> {
        Ok(Self {
            stage: ViewRenderer::new(Arc::clone(&context), samples)?,
            context,
            render,
            texture: None,
            steering: Steering::new(Camera::looking_at(DVec3::ZERO, NO_EXTENT)),
            body: None,
            links: None,
            redrawing: Following::new(None),
            pose: Pose::default(),
            ghost: Pose::default(),
            shown: Shown { edges: true, forces: true, ghost: true, quantity: Quantity::Displacement },
            placement: None,
            probed: None,
            extent: NO_EXTENT,
            ground: 0.0,
        })
    }

    /// Takes the proxy of `loaded` and its object, `body`, and looks at them.
    pub fn open(&mut self, loaded: &Loaded, body: Option<Body>) {
        (self.body, self.redrawing) = (body, Following::new(Some(loaded.tuning().graphics)));
        self.placement = ObjectPlace::new(loaded);
        self.look_at(loaded);
    }

    /// As [`SceneView::open`], but one goes on looking from where one looks.
    pub fn change(&mut self, loaded: &Loaded, body: Option<Body>) {
        let camera = self.steering.camera;
        self.open(loaded, body);
        self.steering.camera = camera;
    }

    /// Takes the proxy of `loaded` and looks at it. Where there was nothing before, its object follows.
    pub fn look_at(&mut self, loaded: &Loaded) {
        let chain = &loaded.setup.chain;
        (self.pose, self.ghost) = (chain.new_pose(), chain.new_pose());
        chain.pose(&loaded.start(), &mut self.pose);
        // Without memory for them on the device, the arm is drawn from joint to joint.
        self.links = Links::new(&self.context, &loaded.setup.scene.shapes, chain.links.len()).unwrap_or_default();
        let object = loaded.setup.object.iter().flat_map(|object| &object.rest);
        let points: Vec<DVec3> = object.chain(&self.pose.nodes).chain(&self.pose.origins).copied().collect();
        let least = points.iter().copied().reduce(DVec3::min).unwrap_or(DVec3::ZERO);
        let greatest = points.iter().copied().reduce(DVec3::max).unwrap_or(DVec3::ZERO);
        self.extent = 0.5 * least.distance(greatest);
        let body = loaded.setup.object.iter().flat_map(|object| &object.rest).map(|place| place.z).reduce(f64::min);
        // Below what stands on it, so that depths tell the two apart.
        self.ground = body.unwrap_or(least.z) - GROUND * self.extent;
        self.probed = None;
        self.steering = Steering::new(Camera::looking_at(0.5 * (least + greatest), SEEN * self.extent));
    }

    /// Lets the object of `loaded` follow `effects`. It is set up in the background; what is drawn stays until then.
    /// `wake` is called when there is news.
    ///
    /// # Errors
    /// When there is no thread or the device refuses it; the last one goes on.
    pub fn follow(
        &mut self,
        loaded: &Loaded,
        effects: &GraphicsEffects,
        wake: impl FnOnce() + Send + 'static,
    ) -> Result<(), ViewError> {
        let (context, loaded) = (Arc::clone(&self.context), loaded.clone());
        let set_up = move |effects: &GraphicsEffects| Body::new(&context, &loaded, effects);
        if let Some(body) = self.redrawing.follow(effects, "object", set_up, wake)? {
            self.body = body?;
        }
        Ok(())
    }

    /// Whether the object is being set up with other effects.
    #[must_use]
    pub fn is_redrawing(&self) -> bool {
        self.redrawing.is_busy()
    }

    /// Lets `elapsed` (s) go by with the loop at `latest`.
    ///
    /// # Errors
    /// When the device fails.
    pub fn advance(&mut self, loaded: &Loaded, latest: &Latest, elapsed: f64) -> Result<(), ViewError> {
        loaded.setup.chain.pose(&latest.proxy, &mut self.pose);
        loaded.setup.chain.pose(&latest.device, &mut self.ghost);
        if let Some(body) = &mut self.body {
            body.advance(latest, elapsed)?;
        }
        Ok(())
    }

    /// Returns where `place` (m) is shown in `rect`.
    #[must_use]
    pub fn shown_at(&self, place: DVec3, rect: Rect) -> Option<egui::Pos2> {
        Some(on_screen(rect, self.steering.camera.project(place, aspect(rect))?.at))
    }

    /// Where the tip of the arm is (m).
    #[must_use]
    pub fn tip(&self, chain: &Chain) -> Option<DVec3> {
        tip(chain).map(|node| self.pose.nodes[node])
    }

    /// Vertices in contact, and the sum of the forces of the object on the arm (N); none where they are not known.
    #[must_use]
    pub fn touched(&self) -> Option<(usize, DVec3)> {
        let body = self.body.as_ref()?;
        Some(body.contacts().fold((0, DVec3::ZERO), |(count, sum), (_, force)| (count + 1, sum - force)))
    }

    /// Shows the scene in all of `ui`, with the numbers of `tick`, and lets pointer and keys lead the hand of `feel`.
    /// Answers with a change that the pointer made of the scene.
    ///
    /// # Errors
    /// When the device fails.
    pub fn show(
        &mut self,
        ui: &mut Ui,
        loaded: &Loaded,
        feel: &Feel,
        tick: Option<&Tick>,
    ) -> Result<Option<Edit>, ViewError> {
        let (rect, response) = ui.allocate_exact_size(ui.available_size(), Sense::click_and_drag());
        response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Canvas, true, "3-D scene"));
        // Not longer than that: the hand's thread waits for its guide, and to draw takes long.
        let mut guide = feel.guide();
        guide.shown_in(ui.ctx());
        let placement = self.placement.as_mut().map(|placement| &mut placement.motion);
        let arm = (&loaded.setup.chain, &self.pose);
        self.steering.steer(ui, &response, rect, arm, &mut guide, placement);
        drop(guide);
        if response.clicked()
            && let (Some(pointer), Some(body), Some(object)) =
                (response.interact_pointer_pos(), &self.body, &loaded.setup.object)
        {
            let ray = self.steering.camera.ray(in_picture(rect, pointer), aspect(rect));
            self.probed = pick(&ray, &body.places()?, &object.triangles);
        }
        let palette = palette::of(ui.visuals());
        let texture = self.draw(rect, ui.ctx().pixels_per_point(), &palette, &loaded.setup.chain)?;
        let whole = Rect::from_min_max(pos2(0.0, 0.0), pos2(1.0, 1.0));
        ui.painter().image(texture, rect, whole, Color32::WHITE);
        let Shown { quantity, forces, .. } = self.shown;
        overlay::show(ui, rect, &palette, &self.steering.camera, self.body.as_ref(), quantity);
        let probe = match (self.probed, &self.body) {
            (Some(vertex), Some(body)) => body.probe(vertex)?,
            _ => None,
        };
        let builder = UiBuilder::new().max_rect(rect.shrink(GROUP_GAP));
        ui.scope_builder(builder, |ui| {
            ui.spacing_mut().item_spacing.y = FINE_GAP;
            // The picture under them is dragged and clicked.
            ui.style_mut().interaction.selectable_labels = false;
            if let Some(tick) = tick {
                let (axes, chain) = (&loaded.dataset.grid.axes, &loaded.setup.chain);
                let (tip, force) = (self.tip(chain), self.touched().map(|(_, force)| force));
                let gap = tip.and_then(|tip| tip_gap(loaded, tip, self.frame()));
                Readout { axes, tick, tip, gap, force, probe }.show(ui);
            }
            overlay::keys(ui, &palette, self.body.as_ref(), forces, self.shows_ghost());
        });
        let moved = self.placement.filter(|_| response.drag_stopped());
        Ok(moved.and_then(|placement| placement.edit()))
    }

    /// From where the object is to where it is being moved.
    fn frame(&self) -> DAffine3 {
        self.placement.as_ref().map_or(DAffine3::IDENTITY, ObjectPlace::frame)
    }

    /// Sees the object of `loaded` and the tip of the arm whole, and no more.
    pub fn fit(&mut self, loaded: &Loaded) {
        let object = loaded.setup.object.iter().flat_map(|object| &object.rest).copied();
        let places = || object.clone().map(|place| self.frame().transform_point3(place));
        let places = || places().chain(self.tip(&loaded.setup.chain));
        if let (Some(low), Some(high)) = (places().reduce(DVec3::min), places().reduce(DVec3::max)) {
            self.steering.fit(low.midpoint(high), 0.5 * low.distance(high));
        }
    }

    /// Size of the picture as it was drawn last (pixels).
    #[must_use]
    pub fn size(&self) -> Option<[u32; 2]> {
        self.stage.picture().map(|picture| [picture.width(), picture.height()])
    }

    /// The picture as it was drawn last. Waits for the device.
    ///
    /// # Errors
    /// When the device fails.
    pub fn still(&self) -> Result<Option<Still>, GpuError> {
        let read =
            |picture: &wgpu::Texture| Ok(([picture.width(), picture.height()], pixels::read(&self.context, picture)?));
        self.stage.picture().map(read).transpose()
    }

    /// Draws a picture of `size` pixels for itself, without anything on top. Waits for the device.
    ///
    /// # Errors
    /// When the device fails.
    pub fn picture(&mut self, size: [u32; 2], loaded: &Loaded, visuals: &Visuals) -> Result<Option<Still>, GpuError> {
        let rect = Rect::from_min_size(pos2(0.0, 0.0), vec2(size[0] as f32, size[1] as f32));
        self.draw(rect, 1.0, &palette::of(visuals), &loaded.setup.chain)?;
        self.still()
    }

    fn draw(
        &mut self,
        rect: Rect,
        pixels_per_point: f32,
        palette: &Palette,
        chain: &Chain,
    ) -> Result<egui::TextureId, GpuError> {
        let size = [rect.width(), rect.height()].map(|side| (side * pixels_per_point).round().max(1.0) as u32);
        let top = self.body.as_ref().map_or(0.0, |body| body.most(self.shown.quantity));
        let look = Look {
            background: figure_colour(palette.stage).channels(),
            quantity: self.shown.quantity,
            colour_top: top as f32,
            edge_width: if self.shown.edges { pixels_per_point } else { 0.0 },
            object: self.frame(),
            ground: (self.ground as f32, figure_colour(palette.shadow).channels()),
        };
        let (shapes, casting) = self.shapes(palette, chain);
        let surface = self.body.as_ref().map(|body| &body.surface);
        let links = self.links.as_ref().map(|links| links.at(&self.pose, figure_colour(palette.link)));
        let picture =
            self.stage.draw(size, &self.steering.camera, &look, surface, links.as_ref(), (&shapes, casting))?;
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

    /// Whether the ghost is drawn.
    fn shows_ghost(&self) -> bool {
        self.shown.ghost && self.ghost.nodes != self.pose.nodes
    }

    /// Everything that is drawn besides the surface; the first so many of it cast a shadow.
    fn shapes(&self, palette: &Palette, chain: &Chain) -> (Vec<Shape>, usize) {
        let unit = LINK * self.extent;
        let plain = |link: usize| !self.links.as_ref().is_some_and(|links| links.is_shaped(link));
        let mut cones = solid::links(chain, &self.pose, plain, unit, figure_colour(palette.link));
        cones.extend(solid::nodes(chain, &self.pose, plain, unit, figure_colour(palette.node)));
        let ghost = figure_colour(palette.ghost);
        if let Some(grip) = &self.steering.grip {
            cones.push(Cone::ball(self.pose.nodes[grip.node], HELD_BALL * unit, ghost));
        }
        let mut shapes: Vec<Shape> = cones.iter().map(Shape::from).collect();
        let casting = shapes.len();
        if let (Some(vertex), Some(body)) = (self.probed, &self.body) {
            let ball = Cone::ball(body.rest(vertex).as_dvec3(), PROBED_BALL * unit, figure_colour(palette.here));
            shapes.push(Shape::from(&ball).unlit().anchored(vertex));
        }
        if self.shows_ghost() {
            let bare = solid::links(chain, &self.ghost, |_| true, GHOST * unit, ghost);
            shapes.extend(bare.iter().map(|cone| Shape::from(cone).unlit()));
        }
        if let Some(body) = &self.body {
            let (longest, colour) = (body.most(Quantity::Force).max(f64::MIN_POSITIVE), figure_colour(palette.force));
            for (node, force) in body.contacts() {
                // The shapes' own places are those of the node at rest: the GPU moves them with it.
                let rest = body.rest(node).as_dvec3();
                let mut cones = vec![Cone::ball(rest, CONTACT_BALL * unit, colour)];
                if self.shown.forces {
                    // On the proxy, against the force on the object: the arrow stands out of the surface.
                    cones.extend(Cone::arrow(
                        rest,
                        -force * (LONGEST_ARROW * self.extent / longest),
                        ARROW * unit,
                        colour,
                    ));
                }
                shapes.extend(cones.iter().map(|cone| Shape::from(cone).anchored(node)));
            }
        }
        (shapes, casting)
    }
}
