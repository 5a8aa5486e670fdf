//! The 3-D picture: the surface straight from the frame update's buffers, and [`Shape`]s, drawn into a texture of its
//! own with depth and several samples a pixel. The window shows the texture; a screenshot reads it.

use super::{
    links::{DrawnLinks, filled},
    pipelines::{self, DEPTH, FORMAT, View, bind, target},
    shapes::{Shape, unit_shape},
};
use crate::{
    draw::{camera::Camera, colour::ColourMap},
    gpu::{Context, GpuError},
    object::Object,
};
use glam::{DAffine3, DMat4, Mat4, Vec3};
use std::sync::Arc;

/// The surface to draw: buffers on the device.
pub struct Surface {
    /// Rest positions, state, forces, mesh.
    bindings: [wgpu::Buffer; 4],
    nodes: u32,
    triangles: u32,
}

/// Quantity that the surface's colour shows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Quantity {
    /// Size of the displacement (m).
    #[default]
    Displacement,
    /// Size of the contact force on a node (N).
    Force,
}

/// How the picture looks.
#[derive(Clone, Copy, Debug)]
pub struct Look {
    /// Gamma-encoded background, 0 to 1.
    pub background: [f32; 3],
    /// Quantity that the surface's colour shows.
    pub quantity: Quantity,
    /// Displacement (m) or force (N) at the top of the colour map.
    pub colour_top: f32,
    /// Width of the triangles' edges (pixels); 0 for none.
    pub edge_width: f32,
    /// From where the object is to where it is being moved.
    pub object: DAffine3,
    /// Height of the ground, on which everything casts its shadow straight down (m), and the shadow's colour, 0 to 1.
    pub ground: (f32, [f32; 3]),
}

/// Pipelines and targets.
pub struct ViewRenderer {
    context: Arc<Context>,
    surface: wgpu::RenderPipeline,
    links: wgpu::RenderPipeline,
    shapes: wgpu::RenderPipeline,
    /// For the picture and for the shadow in it.
    views: [wgpu::Buffer; 2],
    unit: wgpu::Buffer,
    unit_vertices: u32,
    /// Stands for the state where there is no object.
    no_state: wgpu::Buffer,
    /// Samples a pixel.
    samples: u32,
    targets: Option<Targets>,
}

struct Targets {
    size: [u32; 2],
    /// Where there are several a pixel.
    samples: Option<wgpu::TextureView>,
    depth: wgpu::TextureView,
    picture: wgpu::Texture,
}

/// Largest side of the picture (pixels): what every device has.
const LARGEST_SIDE: u32 = 8192;

impl Surface {
    /// `object`, its nodes' displacements (m) and the contact forces on them (N) in the buffers `moved`, four numbers a
    /// node.
    ///
    /// # Errors
    /// When the device refuses the buffers.
    pub fn new(context: &Context, object: &Object, moved: [&wgpu::Buffer; 2]) -> Result<Self, GpuError> {
        let rest: Vec<[f32; 4]> = object.rest.iter().map(|point| point.as_vec3().extend(0.0).to_array()).collect();
        let topology = &object.topology;
        let mut mesh: Vec<u32> = object.triangles.as_flattened().to_vec();
        mesh.extend(&topology.around_offsets);
        mesh.extend(&topology.around);
        let storage = |label, contents: &[u8]| {
            context.scoped(|device| filled(device, &context.queue, label, contents, wgpu::BufferUsages::STORAGE))
        };
        let rest = storage("drawn rest positions", bytemuck::cast_slice(&rest))?;
        let mesh = storage("drawn mesh", bytemuck::cast_slice(&mesh))?;
        let nodes = topology.around_offsets.len().saturating_sub(1) as u32;
        let [state, forces] = moved.map(Clone::clone);
        let bindings = [rest, state, forces, mesh];
        Ok(Self { bindings, nodes, triangles: object.triangles.len() as u32 })
    }
}

impl ViewRenderer {
    /// Compiles the drawing shaders, for one or four `samples` a pixel.
    ///
    /// # Errors
    /// When the device refuses them.
    pub fn new(context: Arc<Context>, samples: u32) -> Result<Self, GpuError> {
        let unit_shape = unit_shape();
        let (surface, links, shapes, views, unit, no_state) = context.scoped(|device| {
            let view = wgpu::BufferDescriptor {
                label: Some("view"),
                size: size_of::<View>() as u64,
                usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            };
            let filled = |label, contents: &[u8], usage| filled(device, &context.queue, label, contents, usage);
            (
                pipelines::surface(device, samples),
                pipelines::links(device, samples),
                pipelines::shapes(device, samples),
                [(); 2].map(|()| device.create_buffer(&view)),
                filled("unit shape", bytemuck::cast_slice(&unit_shape), wgpu::BufferUsages::VERTEX),
                filled("no state", &[0; 16], wgpu::BufferUsages::STORAGE),
            )
        })?;
        let unit_vertices = unit_shape.len() as u32;
        Ok(Self { context, surface, links, shapes, views, unit, unit_vertices, no_state, samples, targets: None })
    }

    /// The picture that was drawn last.
    #[must_use]
    pub fn picture(&self) -> Option<&wgpu::Texture> {
        self.targets.as_ref().map(|targets| &targets.picture)
    }

    /// Draws one picture of `size` pixels and returns its texture; the texture is the same one until the size changes.
    /// Of the shapes, the first `casting` cast a shadow.
    ///
    /// # Errors
    /// When the device fails.
    pub fn draw(
        &mut self,
        size: [u32; 2],
        camera: &Camera,
        look: &Look,
        surface: Option<&Surface>,
        links: Option<&DrawnLinks<'_>>,
        (shapes, casting): (&[Shape], usize),
    ) -> Result<&wgpu::Texture, GpuError> {
        let size = size.map(|pixels| pixels.clamp(1, LARGEST_SIDE));
        let targets = match self.targets.take().filter(|targets| targets.size == size) {
            Some(targets) => targets,
            None => Targets::new(&self.context, size, self.samples)?,
        };
        let targets = self.targets.insert(targets);
        let view = view(size, camera, look, surface);
        let shadow = cast(view, look.ground);
        for (buffer, view) in self.views.iter().zip([view, shadow]) {
            self.context.queue.write_buffer(buffer, 0, bytemuck::bytes_of(&view));
        }
        // From below, the ground does not hide what stands on it.
        let counts = [shapes.len(), casting];
        let drawn = if camera.eye().z > f64::from(look.ground.0) { 2 } else { 1 };
        let commands = self.context.scoped(|device| {
            let mut encoder = device.create_command_encoder(&Default::default());
            let mut pass = targets.begin(&mut encoder, look.background);
            let buffer = |label, contents: &[u8], usage| filled(device, &self.context.queue, label, contents, usage);
            let links = links.map(|DrawnLinks { links, frames, colour }| {
                let frames = buffer("frames", bytemuck::cast_slice(frames), wgpu::BufferUsages::STORAGE);
                let [red, green, blue] = colour.channels();
                let colour = [red, green, blue, 1.0];
                (links, frames, buffer("colour of links", bytemuck::cast_slice(&colour), wgpu::BufferUsages::VERTEX))
            });
            let instances = (!shapes.is_empty())
                .then(|| buffer("shapes", bytemuck::cast_slice(shapes), wgpu::BufferUsages::VERTEX));
            for (view, count) in self.views.iter().zip(counts).take(drawn) {
                if let Some(surface) = surface {
                    let [rest, state, forces, mesh] = &surface.bindings;
                    let bound = bind(device, &self.surface, &[view, rest, state, forces, mesh]);
                    pass.set_pipeline(&self.surface);
                    pass.set_bind_group(0, &bound, &[]);
                    pass.draw(0..3 * surface.triangles, 0..1);
                }
                if let Some((links, frames, colour)) = &links {
                    let bound = bind(device, &self.links, &[view, frames]);
                    pass.set_pipeline(&self.links);
                    pass.set_bind_group(0, &bound, &[]);
                    pass.set_vertex_buffer(0, links.corners.slice(..));
                    pass.set_vertex_buffer(1, colour.slice(..));
                    pass.draw(0..links.count, 0..1);
                }
                if let Some(instances) = &instances {
                    let state = surface.map_or(&self.no_state, |surface| &surface.bindings[1]);
                    let bound = bind(device, &self.shapes, &[view, state]);
                    pass.set_pipeline(&self.shapes);
                    pass.set_bind_group(0, &bound, &[]);
                    pass.set_vertex_buffer(0, instances.slice(..));
                    pass.set_vertex_buffer(1, self.unit.slice(..));
                    pass.draw(0..self.unit_vertices, 0..count as u32);
                }
            }
            drop(pass);
            encoder.finish()
        })?;
        self.context.queue.submit([commands]);
        Ok(&targets.picture)
    }
}

/// Whence the light comes, to the right of the eye, above and behind it, in any unit: over its right shoulder. It goes
/// with the eye.
const LIGHT: [f32; 3] = [0.45, 0.75, 0.65];

fn view(size: [u32; 2], camera: &Camera, look: &Look, surface: Option<&Surface>) -> View {
    let [right, up, towards] = camera.axes().map(|axis| axis.as_vec3());
    let [across, above, behind] = LIGHT;
    let light = (across * right + above * up + behind * towards).normalize_or_zero();
    let map = ColourMap::Pale { low: 0.0, high: 1.0 };
    let stop = |number: usize| {
        let [red, green, blue] = map.colour(number as f64 / 4.0).channels();
        [red, green, blue, 1.0]
    };
    View {
        clip: camera.clip(f64::from(size[0]) / f64::from(size[1])).to_cols_array_2d(),
        object: DMat4::from(look.object).as_mat4().to_cols_array_2d(),
        eye: camera.eye().as_vec3().extend(1.0).to_array(),
        light: light.extend(0.0).to_array(),
        stops: std::array::from_fn(stop),
        colour_top: look.colour_top,
        edge_width: look.edge_width,
        nodes: surface.map_or(0, |surface| surface.nodes),
        triangles: surface.map_or(0, |surface| surface.triangles),
        quantity: u32::from(look.quantity == Quantity::Force),
        padding: [0; 3],
        shade: [0.0; 4],
    }
}

/// `view` of everything laid flat on the ground, in the shadow's colour.
fn cast(view: View, (height, [red, green, blue]): (f32, [f32; 3])) -> View {
    let flat = Mat4::from_translation(Vec3::new(0.0, 0.0, height)) * Mat4::from_scale(Vec3::new(1.0, 1.0, 0.0));
    let clip = Mat4::from_cols_array_2d(&view.clip) * flat;
    View { clip: clip.to_cols_array_2d(), edge_width: 0.0, shade: [red, green, blue, 1.0], ..view }
}

impl Targets {
    fn new(context: &Context, size: [u32; 2], samples: u32) -> Result<Self, GpuError> {
        context.scoped(|device| {
            let texture = |label, format, samples, usage| target(device, label, size, format, samples, usage);
            let none = wgpu::TextureUsages::empty();
            let shown = wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_SRC;
            Self {
                size,
                samples: (samples > 1)
                    .then(|| texture("scene samples", FORMAT, samples, none).create_view(&Default::default())),
                depth: texture("scene depth", DEPTH, samples, none).create_view(&Default::default()),
                picture: texture("scene picture", FORMAT, 1, shown),
            }
        })
    }

    fn begin<'encoder>(
        &self,
        encoder: &'encoder mut wgpu::CommandEncoder,
        background: [f32; 3],
    ) -> wgpu::RenderPass<'encoder> {
        let picture = self.picture.create_view(&Default::default());
        let [r, g, b] = background.map(f64::from);
        let store = if self.samples.is_some() { wgpu::StoreOp::Discard } else { wgpu::StoreOp::Store };
        encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("scene"),
            color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                view: self.samples.as_ref().unwrap_or(&picture),
                resolve_target: self.samples.as_ref().map(|_| &picture),
                ops: wgpu::Operations { load: wgpu::LoadOp::Clear(wgpu::Color { r, g, b, a: 1.0 }), store },
                depth_slice: None,
            })],
            depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                view: &self.depth,
                depth_ops: Some(wgpu::Operations { load: wgpu::LoadOp::Clear(1.0), store: wgpu::StoreOp::Discard }),
                stencil_ops: None,
            }),
            ..Default::default()
        })
    }
}
