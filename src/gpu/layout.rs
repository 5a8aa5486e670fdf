//! Structs shared with WGSL. A test compares every offset and size with naga's reflection of `shaders/`.

use bytemuck::{Pod, Zeroable};

/// `Parameters` of `shaders/rest_types.wgsl` (uniform).
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[expect(missing_docs, reason = "documented where the shader reads them")]
pub struct Parameters {
    pub configurations: u32,
    pub joints: u32,
    pub proxy_nodes: u32,
    pub surface_nodes: u32,
    pub triangles: u32,
    pub leaves: u32,
    pub covered: u32,
    pub carriers: u32,
    pub at_controls: u32,
    pub at_masks: u32,
    pub at_cubes: u32,
    pub at_order: u32,
    pub at_carriers: u32,
    pub at_shapes: u32,
    pub at_near: u32,
    pub cubes_x: u32,
    pub cubes_y: u32,
    pub cubes_z: u32,
    pub low_x: f32,
    pub low_y: f32,
    pub low_z: f32,
    pub inverse_side: f32,
    pub bulge: f32,
    pub band: f32,
    pub softness: f32,
    pub mobility: f32,
    pub least_distance: f32,
    pub step: f32,
    pub rounds: u32,
}

/// `FrameParameters` of `shaders/frame.wgsl` (uniform).
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[expect(missing_docs, reason = "documented where the shader reads them")]
pub struct FrameParameters {
    pub nodes: u32,
    pub period: f32,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::shaders::{ALL, parse};
    use std::{collections::HashMap, mem::offset_of};

    /// Names and offsets of the members of a struct.
    type Members = Vec<(String, u32)>;

    /// The members of each struct and its size, as WGSL lays it out.
    type Reflected = HashMap<String, (Members, u32)>;

    fn reflect() -> Reflected {
        let mut structs = Reflected::new();
        for shader in ALL {
            for (_, ty) in parse(shader).expect("shader parses").types.iter() {
                if let (Some(name), naga::TypeInner::Struct { members, span }) = (&ty.name, &ty.inner) {
                    let members = members.iter().map(|m| (m.name.clone().unwrap_or_default(), m.offset)).collect();
                    structs.insert(name.clone(), (members, *span));
                }
            }
        }
        structs
    }

    /// The same for a Rust struct.
    macro_rules! layout {
        ($name:ident: $($field:ident),+) => {
            (stringify!($name), vec![$((stringify!($field).to_owned(), offset_of!($name, $field) as u32)),+],
                size_of::<$name>() as u32)
        };
    }

    #[test]
    fn every_shared_struct_is_laid_out_as_in_wgsl() {
        let expected: [(&str, Members, u32); 2] = [
            layout!(Parameters: configurations, joints, proxy_nodes, surface_nodes, triangles, leaves, covered, carriers, at_controls, at_masks, at_cubes, at_order, at_carriers, at_shapes, at_near, cubes_x, cubes_y, cubes_z, low_x, low_y, low_z, inverse_side, bulge, band, softness, mobility, least_distance, step, rounds),
            layout!(FrameParameters: nodes, period),
        ];
        let reflected = reflect();
        for (name, members, size) in expected {
            let (wgsl_members, wgsl_size) = reflected.get(name).unwrap_or_else(|| panic!("{name} is in no shader"));
            assert_eq!(&members, wgsl_members, "{name}");
            assert_eq!(&size, wgsl_size, "size of {name}");
        }
    }
}
