//! The window's picture without a window: the same panels, laid out and painted by egui into a texture that is read
//! back.

use super::{
    Start, TickSource, ViewError, Viewer, dress,
    film::{Film, PERIOD},
    pipelines::{FORMAT, target},
    pixels, theme,
};
use crate::{
    Error,
    dataset::replace_file,
    draw::canvas::encode_png,
    gpu::{AdapterChoice, Context, GpuError},
};
use eframe::{
    egui::{self, Pos2, Rect, Theme, vec2},
    egui_wgpu::{RenderState, Renderer, RendererOptions, ScreenDescriptor},
};
use std::{
    io,
    path::{Path, PathBuf},
    sync::Arc,
};

/// A picture of the window.
#[derive(Clone, Debug)]
pub struct Picture {
    /// Points across and down.
    pub size: [f32; 2],
    /// Pixels a point.
    pub scale: f32,
    /// Dark colours.
    pub dark: bool,
    /// Name of the motion that is played; by default the press, where there is one.
    pub motion: Option<String>,
    /// When the picture is taken, since the motion began (s).
    pub time: f64,
}

impl Default for Picture {
    fn default() -> Self {
        Self { size: theme::WINDOW, scale: 1.5, dark: false, motion: None, time: 2.2 }
    }
}

/// Time between two frames of the picture's past (s).
const FRAME: f64 = 0.05;

/// Frames of the last instant: egui lays out what it has measured in the frame before.
const SETTLING: usize = 3;

/// A renderer of egui on the device of `context`, without a window.
///
/// # Errors
/// When the device refuses it.
pub fn render_state(context: &Context) -> Result<RenderState, ViewError> {
    let (instance, adapter, device, queue) = context.shared();
    let target_format = FORMAT;
    let renderer = context.scoped(|device| Renderer::new(device, target_format, RendererOptions::PREDICTABLE))?;
    Ok(RenderState {
        available_adapters: vec![adapter.clone()],
        instance,
        adapter,
        device,
        queue,
        target_format,
        renderer: Arc::new(egui::mutex::RwLock::new(renderer)),
    })
}

/// A viewer without a window, that is drawn as `picture` says.
struct Stage {
    context: Arc<Context>,
    render: RenderState,
    egui: egui::Context,
    viewer: Viewer,
}

impl Stage {
    /// Opens `start` and begins the motion.
    fn new(start: &Start, picture: &Picture) -> Result<Self, ViewError> {
        let context = Arc::new(Context::open(AdapterChoice::Any)?);
        let render = render_state(&context)?;
        let egui = egui::Context::default();
        egui.set_theme(if picture.dark { Theme::Dark } else { Theme::Light });
        dress(&egui);
        let mut viewer = Viewer::new(Arc::clone(&context), render.clone(), TickSource::Steps, PathBuf::from("."))?;
        viewer.start(start, &egui);
        viewer.wait();
        if let Some(error) = viewer.error() {
            return Err(error.to_owned().into());
        }
        viewer.begin_motion(picture.motion.as_deref())?;
        Ok(Self { context, render, egui, viewer })
    }
}

/// Opens `start`, plays its motion, and writes the 3-D picture over time to `path`: a GIF where the name ends so, else a
/// folder of PNG files. Returns how many stills there are.
///
/// # Errors
/// When there is no device, `start` cannot be opened or has no motion, or the film not be written.
pub fn video(start: &Start, picture: &Picture, path: &Path) -> Result<usize, ViewError> {
    let Stage { egui, mut viewer, .. } = Stage::new(start, picture)?;
    let none = || Error::from("there is no motion to show: give the scene one, or take a picture");
    let (_, duration) = viewer.time_in_motion().ok_or_else(none)?;
    let mut film = Film::begin(path.to_owned(), || ())?;
    let stills = (duration / PERIOD).round() as usize;
    for _ in 0..stills {
        viewer.advance(PERIOD, &egui);
        let size = picture.size.map(|side| side as u32);
        film.take(viewer.picture(size, &egui.style_of(egui.theme()).visuals)?);
    }
    film.end().wait()??;
    Ok(stills)
}

/// Opens `start`, plays until the picture's instant, and writes the window as it is then to the PNG file `path`.
///
/// # Errors
/// When there is no device, `start` cannot be opened, or the file not be written.
pub fn screenshot(start: &Start, picture: &Picture, path: &Path) -> Result<(), ViewError> {
    let Stage { context, render, egui, mut viewer } = Stage::new(start, picture)?;
    viewer.advance(FRAME, &egui);
    for _ in 0..(picture.time / FRAME).ceil() as usize {
        if viewer.time_in_motion().is_some_and(|(time, duration)| time < picture.time.min(duration) - 0.5 * FRAME) {
            viewer.advance(FRAME, &egui);
        }
    }
    // Only the last instant is seen: its past needs no layout.
    let mut output = egui::FullOutput::default();
    for frame in 0..SETTLING {
        let size = vec2(picture.size[0], picture.size[1]);
        let mut input = egui::RawInput {
            screen_rect: Some(Rect::from_min_size(Pos2::ZERO, size)),
            time: Some(frame as f64 * FRAME),
            ..Default::default()
        };
        input.viewports.entry(egui::ViewportId::ROOT).or_default().native_pixels_per_point = Some(picture.scale);
        output.append(egui.run_ui(input, |ui| viewer.ui(ui)));
    }
    let (size, bytes) = paint(&context, &render, &egui, output, picture)?;
    write_picture(path, size, &bytes)
}

/// Writes a picture of `size` pixels to the PNG file `path`: red, green, blue, opacity of each.
pub(super) fn write_picture(path: &Path, size: [u32; 2], bytes: &[u8]) -> Result<(), ViewError> {
    let written =
        replace_file(path, |file| encode_png(file, size, png::ColorType::Rgba, bytes).map_err(io::Error::other));
    let remedy = "choose another folder or free some space";
    written.map_err(|error| format!("cannot write {}: {error}; {remedy}", path.display()).into())
}

/// Paints a frame of egui and reads it back: size and bytes of red, green, blue, opacity.
fn paint(
    context: &Context,
    render: &RenderState,
    egui: &egui::Context,
    mut output: egui::FullOutput,
    picture: &Picture,
) -> Result<([u32; 2], Vec<u8>), GpuError> {
    let size = picture.size.map(|side| (side * picture.scale).round() as u32);
    let screen = ScreenDescriptor { size_in_pixels: size, pixels_per_point: output.pixels_per_point };
    let triangles = egui.tessellate(std::mem::take(&mut output.shapes), output.pixels_per_point);
    let mut renderer = render.renderer.write();
    let (texture, commands) = context.scoped(|device| {
        for (id, images) in output.textures_delta.set.drain() {
            for image in images {
                renderer.update_texture(device, &render.queue, id, &image);
            }
        }
        let texture = target(device, "window", size, render.target_format, 1, wgpu::TextureUsages::COPY_SRC);
        let view = texture.create_view(&Default::default());
        let mut encoder = device.create_command_encoder(&Default::default());
        let mut commands = renderer.update_buffers(device, &render.queue, &mut encoder, &triangles, &screen);
        let mut pass = encoder
            .begin_render_pass(&wgpu::RenderPassDescriptor {
                label: Some("window"),
                color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                    view: &view,
                    resolve_target: None,
                    ops: wgpu::Operations {
                        load: wgpu::LoadOp::Clear(wgpu::Color::BLACK),
                        store: wgpu::StoreOp::Store,
                    },
                    depth_slice: None,
                })],
                ..Default::default()
            })
            .forget_lifetime();
        renderer.render(&mut pass, &triangles, &screen);
        drop(pass);
        commands.push(encoder.finish());
        (texture, commands)
    })?;
    output.textures_delta.free.clear();
    context.queue.submit(commands);
    Ok((size, pixels::read(context, &texture)?))
}
