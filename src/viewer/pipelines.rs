//! The drawing pipelines: the object's surface, pulled from the frame update's buffers, shapes of links, and instances
//! of one rounded cone. All share view and light (`shaders/draw_common.wgsl`), samples a pixel, and a depth buffer.

use super::{links::Corner, shapes::Shape};
use crate::gpu::GPU_LEAST_DIVISOR;
use bytemuck::{Pod, Zeroable};

/// Gamma-encoded, as the window takes textures.
pub const FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8Unorm;
/// Format of the depth buffer.
pub const DEPTH: wgpu::TextureFormat = wgpu::TextureFormat::Depth32Float;
const COMMON: &str = include_str!("../../shaders/draw_common.wgsl");
const SURFACE: &str = include_str!("../../shaders/draw_surface.wgsl");
const LINKS: &str = include_str!("../../shaders/draw_links.wgsl");
const SHAPES: &str = include_str!("../../shaders/draw_shapes.wgsl");

/// `View` of `shaders/draw_common.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
pub struct View {
    pub clip: [[f32; 4]; 4],
    pub object: [[f32; 4]; 4],
    pub eye: [f32; 4],
    pub light: [f32; 4],
    pub stops: [[f32; 4]; 5],
    pub colour_top: f32,
    pub edge_width: f32,
    pub nodes: u32,
    pub triangles: u32,
    pub quantity: u32,
    pub padding: [u32; 3],
    pub shade: [f32; 4],
}

/// The pipeline of the surface; its buffers are rest positions, state, forces, mesh.
pub fn surface(device: &wgpu::Device, samples: u32) -> wgpu::RenderPipeline {
    pipeline(device, samples, "draw_surface", SURFACE, 4, &[])
}

/// The pipeline of the shapes; its buffer is the state. Instances lie in the first vertex buffer, the unit shape in the
/// second.
pub fn shapes(device: &wgpu::Device, samples: u32) -> wgpu::RenderPipeline {
    let instances = wgpu::VertexBufferLayout {
        array_stride: size_of::<Shape>() as u64,
        step_mode: wgpu::VertexStepMode::Instance,
        attributes: &wgpu::vertex_attr_array![0 => Float32x4, 1 => Float32x4, 2 => Float32x4, 4 => Uint32],
    };
    let unit = wgpu::VertexBufferLayout {
        array_stride: size_of::<[f32; 4]>() as u64,
        step_mode: wgpu::VertexStepMode::Vertex,
        attributes: &wgpu::vertex_attr_array![3 => Float32x4],
    };
    pipeline(device, samples, "draw_shapes", SHAPES, 1, &[Some(instances), Some(unit)])
}

/// The pipeline of the links; its buffer holds their frames. Corners lie in the first vertex buffer, the colour in the
/// second.
pub fn links(device: &wgpu::Device, samples: u32) -> wgpu::RenderPipeline {
    let corners = wgpu::VertexBufferLayout {
        array_stride: size_of::<Corner>() as u64,
        step_mode: wgpu::VertexStepMode::Vertex,
        attributes: &wgpu::vertex_attr_array![0 => Float32x3, 1 => Float32x3, 2 => Uint32],
    };
    let colour = wgpu::VertexBufferLayout {
        array_stride: size_of::<[f32; 4]>() as u64,
        step_mode: wgpu::VertexStepMode::Instance,
        attributes: &wgpu::vertex_attr_array![3 => Float32x3],
    };
    pipeline(device, samples, "draw_links", LINKS, 1, &[Some(corners), Some(colour)])
}

/// Source of a drawing stage: generated constants, what is shared, and the stage itself.
fn source(stage: &str) -> String {
    format!("const LEAST_DIVISOR: f32 = {GPU_LEAST_DIVISOR:e};\n{COMMON}\n{stage}")
}

/// A pipeline of `samples` a pixel whose group 0 is the view and then `storage` read-only buffers.
fn pipeline(
    device: &wgpu::Device,
    samples: u32,
    label: &str,
    stage: &str,
    storage: u32,
    vertex_buffers: &[Option<wgpu::VertexBufferLayout<'_>>],
) -> wgpu::RenderPipeline {
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: Some(label),
        source: wgpu::ShaderSource::Wgsl(source(stage).into()),
    });
    let entry = |binding| wgpu::BindGroupLayoutEntry {
        binding,
        visibility: wgpu::ShaderStages::VERTEX_FRAGMENT,
        ty: wgpu::BindingType::Buffer {
            ty: if binding == 0 {
                wgpu::BufferBindingType::Uniform
            } else {
                wgpu::BufferBindingType::Storage { read_only: true }
            },
            has_dynamic_offset: false,
            min_binding_size: None,
        },
        count: None,
    };
    let entries: Vec<_> = (0..=storage).map(entry).collect();
    let layout =
        device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: Some(label), entries: &entries });
    let pipeline_layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: Some(label),
        bind_group_layouts: &[Some(&layout)],
        immediate_size: 0,
    });
    device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: Some(label),
        layout: Some(&pipeline_layout),
        vertex: wgpu::VertexState {
            module: &module,
            entry_point: Some("vertex"),
            compilation_options: Default::default(),
            buffers: vertex_buffers,
        },
        primitive: wgpu::PrimitiveState::default(),
        depth_stencil: Some(wgpu::DepthStencilState {
            format: DEPTH,
            depth_write_enabled: Some(true),
            depth_compare: Some(wgpu::CompareFunction::Less),
            stencil: Default::default(),
            bias: Default::default(),
        }),
        multisample: wgpu::MultisampleState { count: samples, ..Default::default() },
        fragment: Some(wgpu::FragmentState {
            module: &module,
            entry_point: Some("fragment"),
            compilation_options: Default::default(),
            targets: &[Some(FORMAT.into())],
        }),
        multiview_mask: None,
        cache: None,
    })
}

/// A texture of `size` pixels to draw into.
pub fn target(
    device: &wgpu::Device,
    label: &str,
    [width, height]: [u32; 2],
    format: wgpu::TextureFormat,
    sample_count: u32,
    usage: wgpu::TextureUsages,
) -> wgpu::Texture {
    device.create_texture(&wgpu::TextureDescriptor {
        label: Some(label),
        size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count,
        dimension: wgpu::TextureDimension::D2,
        format,
        usage: wgpu::TextureUsages::RENDER_ATTACHMENT | usage,
        view_formats: &[],
    })
}

/// The view, then `buffers`, bound for `pipeline`.
pub fn bind(device: &wgpu::Device, pipeline: &wgpu::RenderPipeline, buffers: &[&wgpu::Buffer]) -> wgpu::BindGroup {
    let entries: Vec<_> = (0u32..)
        .zip(buffers)
        .map(|(binding, buffer)| wgpu::BindGroupEntry { binding, resource: buffer.as_entire_binding() })
        .collect();
    device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: None,
        layout: &pipeline.get_bind_group_layout(0),
        entries: &entries,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn drawing_shaders_are_valid_and_their_view_is_laid_out_as_here() {
        for stage in [SURFACE, LINKS, SHAPES] {
            let module = naga::front::wgsl::parse_str(&source(stage)).unwrap();
            let mut validator =
                naga::valid::Validator::new(naga::valid::ValidationFlags::all(), naga::valid::Capabilities::empty());
            validator.validate(&module).unwrap();
            let (_, view) = module.types.iter().find(|(_, ty)| ty.name.as_deref() == Some("View")).unwrap();
            let naga::TypeInner::Struct { members, span } = &view.inner else { panic!("View is a struct") };
            assert_eq!(*span as usize, size_of::<View>());
            let offset = |name: &str| members.iter().find(|m| m.name.as_deref() == Some(name)).unwrap().offset as usize;
            assert_eq!(offset("stops"), std::mem::offset_of!(View, stops));
            assert_eq!(offset("colour_top"), std::mem::offset_of!(View, colour_top));
            assert_eq!(offset("quantity"), std::mem::offset_of!(View, quantity));
        }
    }
}
