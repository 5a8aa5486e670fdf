//! A compute pipeline as the device has compiled it, with the bindings that its shader declares.

use super::{
    error::GpuError,
    shaders::{self, Shader},
};

/// A compiled entry point of a shader.
#[derive(Clone)]
pub struct Compiled {
    /// What runs.
    pub pipeline: wgpu::ComputePipeline,
    /// Layout of group 0, which holds all bindings.
    pub layout: wgpu::BindGroupLayout,
    /// Those that the entry point uses.
    pub bindings: Vec<Binding>,
}

/// A binding of a kernel, as the shader declares it.
#[derive(Clone, Debug)]
pub struct Binding {
    /// Number within the group.
    pub number: u32,
    /// Name in the shader.
    pub name: String,
    ty: wgpu::BufferBindingType,
    /// Least size of the buffer: that of the struct, or of one element (B).
    least: u64,
}

impl Binding {
    /// Those that the entry point of `shader` uses.
    pub fn of(shader: &Shader) -> Result<Vec<Self>, GpuError> {
        let module = shaders::parse(shader).map_err(GpuError::Refused)?;
        let info = shaders::validate(shader, &module).map_err(GpuError::Refused)?;
        let entry = module.entry_points.iter().position(|point| point.name == shader.entry);
        let entry = entry.ok_or_else(|| GpuError::Refused(format!("{} has no {}", shader.name, shader.entry)))?;
        let used = info.get_entry_point(entry);
        let binding = |(handle, global): (naga::Handle<naga::GlobalVariable>, &naga::GlobalVariable)| {
            let number = global.binding.as_ref().filter(|_| !used[handle].is_empty())?.binding;
            let ty = match global.space {
                naga::AddressSpace::Storage { access } => {
                    let read_only = !access.contains(naga::StorageAccess::STORE);
                    wgpu::BufferBindingType::Storage { read_only }
                }
                _ => wgpu::BufferBindingType::Uniform,
            };
            let least = module.types[global.ty].inner.size(module.to_ctx()).into();
            Some(Self { number, name: global.name.clone().unwrap_or_default(), ty, least })
        };
        Ok(module.global_variables.iter().filter_map(binding).collect())
    }

    /// Its entry in the layout of the group.
    pub fn layout(&self) -> wgpu::BindGroupLayoutEntry {
        let min_binding_size = std::num::NonZeroU64::new(self.least);
        wgpu::BindGroupLayoutEntry {
            binding: self.number,
            visibility: wgpu::ShaderStages::COMPUTE,
            ty: wgpu::BindingType::Buffer { ty: self.ty, has_dynamic_offset: false, min_binding_size },
            count: None,
        }
    }
}
