//! Structs shared with WGSL. A test compares every offset and size with naga's reflection of `shaders/`.

use bytemuck::{Pod, Zeroable};

/// `Parameters` of `shaders/types.wgsl`: what all stages of a batch need (uniform).
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[expect(missing_docs, reason = "documented where the shader reads them")]
pub struct Parameters {
    pub configurations: u32,
    pub first: u32,
    pub joints: u32,
    pub proxy_nodes: u32,
    pub surface_nodes: u32,
    pub triangles: u32,
    pub max_iterations: u32,
    pub stiffness: f32,
    pub kc: f32,
    pub tolerance: f32,
    pub softest: f32,
    pub least_distance: f32,
    pub depth_rounding: f32,
    pub covered: u32,
    pub clusters: u32,
    pub mobility: f32,
}

/// `DoubleParameters` of `shaders/double_types.wgsl`: the same for the stages in f64 (uniform).
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[expect(missing_docs, reason = "documented where the shader reads them")]
pub struct DoubleParameters {
    pub configurations: u32,
    pub joints: u32,
    pub proxy_nodes: u32,
    pub surface_nodes: u32,
    pub triangles: u32,
    pub clusters: u32,
    pub groups: u32,
    pub padding: u32,
    pub gap_band: f64,
}

/// `SearchParameters` of `shaders/search_types.wgsl` (uniform).
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[expect(missing_docs, reason = "documented where the shader reads them")]
pub struct SearchParameters {
    pub configurations: u32,
    pub joints: u32,
    pub proxy_nodes: u32,
    pub surface_nodes: u32,
    pub triangles: u32,
    pub clusters: u32,
    pub groups: u32,
    pub covered: u32,
    pub contacts: u32,
    pub support: u32,
    pub carriers: u32,
    pub max_iterations: u32,
    pub reals: u32,
    pub words: u32,
    pub room: u32,
    pub with_tangent: u32,
    pub at_rest: u32,
    pub at_offsets: u32,
    pub at_masks: u32,
    pub at_spheres: u32,
    pub at_order: u32,
    pub at_carriers: u32,
    pub at_shapes: u32,
    pub at_covered: u32,
    pub at_places: u32,
    pub at_links: u32,
    pub gap_band: f64,
    pub first_kc: f64,
    pub kc: f64,
    pub tolerance: f64,
    pub mobility: f64,
    pub bulge_mobility: f64,
    pub bulge: f64,
    pub least_scale: f64,
}

/// `SearchTouch` of `shaders/search_types.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[expect(missing_docs, reason = "documented where the shader writes them")]
pub struct SearchTouch {
    pub proxy_node: u32,
    pub facet: u32,
    pub feature: u32,
    pub padding: u32,
    pub weights: [f64; 3],
    pub force: [f64; 3],
}

/// `Joint` of `shaders/types.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[expect(missing_docs, reason = "documented where the shader reads them")]
pub struct Joint {
    pub origin: [f32; 3],
    pub kind: u32,
    pub axis: [f32; 3],
    pub padding: u32,
}

/// `ProxyNode` of `shaders/types.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[expect(missing_docs, reason = "documented where the shader reads them")]
pub struct ProxyNode {
    pub position: [f32; 3],
    pub link: u32,
}

/// `SolverResult` of `shaders/types.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[expect(missing_docs, reason = "documented where the shader writes them")]
pub struct SolverResult {
    pub status: u32,
    pub iterations: u32,
    pub residual: f32,
    pub elastic: f32,
    pub touches: u32,
    pub padding_0: u32,
    pub padding_1: u32,
    pub padding_2: u32,
}

/// `Touch` of `shaders/types.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[expect(missing_docs, reason = "documented where the shader writes them")]
pub struct Touch {
    pub nodes: [u32; 3],
    pub proxy_node: u32,
    pub force_0: [f32; 3],
    pub padding_0: u32,
    pub force_1: [f32; 3],
    pub padding_1: u32,
    pub force_2: [f32; 3],
    pub padding_2: u32,
}

/// `FrameParameters` of `shaders/frame_common.wgsl` (uniform).
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[expect(missing_docs, reason = "documented where the shader reads them")]
pub struct FrameParameters {
    pub nodes: u32,
    pub period: f32,
    pub odd: u32,
    pub groups: u32,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::shaders::{ALL, parse};
    use std::{collections::HashMap, mem::offset_of};

    /// Name, offset of each member, and the struct's size, as WGSL lays it out.
    type Reflected = HashMap<String, (Vec<(String, u32)>, u32)>;

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
        let reflected = reflect();
        let expected = [
            layout!(Parameters: configurations, first, joints, proxy_nodes, surface_nodes, triangles, max_iterations, stiffness, kc, tolerance, softest, least_distance, depth_rounding, covered, clusters, mobility),
            layout!(DoubleParameters: configurations, joints, proxy_nodes, surface_nodes, triangles, clusters, groups, padding, gap_band),
            layout!(SearchParameters: configurations, joints, proxy_nodes, surface_nodes, triangles, clusters, groups, covered, contacts, support, carriers, max_iterations, reals, words, room, with_tangent, at_rest, at_offsets, at_masks, at_spheres, at_order, at_carriers, at_shapes, at_covered, at_places, at_links, gap_band, first_kc, kc, tolerance, mobility, bulge_mobility, bulge, least_scale),
            layout!(SearchTouch: proxy_node, facet, feature, padding, weights, force),
            layout!(Joint: origin, kind, axis, padding),
            layout!(ProxyNode: position, link),
            layout!(SolverResult: status, iterations, residual, elastic, touches, padding_0, padding_1, padding_2),
            layout!(Touch: nodes, proxy_node, force_0, padding_0, force_1, padding_1, force_2, padding_2),
            layout!(FrameParameters: nodes, period, odd, groups),
        ];
        for (name, members, size) in expected {
            let (wgsl_members, wgsl_size) = reflected.get(name).unwrap_or_else(|| panic!("{name} is in no shader"));
            assert_eq!(&members, wgsl_members, "{name}");
            assert_eq!(size, *wgsl_size, "size of {name}");
        }
    }
}
