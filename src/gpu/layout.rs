//! Structs shared with WGSL. A test compares every offset and size with naga's reflection of `shaders/`.

use super::precision::Precision;
use bytemuck::{Pod, Zeroable};
use std::mem::offset_of;

/// `Parameters` of `shaders/types.wgsl`: what the stages need that place the proxy and test it for contact (uniform).
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
    pub gap_band: f32,
    pub known_to: f32,
}

/// `SearchParameters` of `shaders/search_types.wgsl` in f64 (uniform).
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[expect(missing_docs, reason = "documented where the shader reads them")]
pub struct SearchParameters {
    pub configurations: u32,
    pub first: u32,
    pub joints: u32,
    pub proxy_nodes: u32,
    pub surface_nodes: u32,
    pub triangles: u32,
    pub leaves: u32,
    pub covered: u32,
    pub contacts: u32,
    pub support: u32,
    pub carriers: u32,
    pub max_iterations: u32,
    pub reals: u32,
    pub words: u32,
    pub room: u32,
    pub at_net: u32,
    pub at_masks: u32,
    pub at_order: u32,
    pub at_carriers: u32,
    pub at_shapes: u32,
    pub at_covered: u32,
    pub at_links: u32,
    pub gap_band: f64,
    pub known_to: f64,
    pub first_kc: f64,
    pub kc: f64,
    pub tolerance: f64,
    pub mobility: f64,
    pub bulge_mobility: f64,
    pub bulge: f64,
    pub least_scale: f64,
    pub least_distance: f64,
}

impl SearchParameters {
    /// As the device wants them: whole numbers, then the others in `precision`.
    #[must_use]
    pub fn encode(&self, precision: Precision) -> Vec<u8> {
        let (counts, numbers) = bytemuck::bytes_of(self).split_at(offset_of!(Self, gap_band));
        [counts, &precision.encode(&bytemuck::pod_collect_to_vec(numbers))].concat()
    }
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
    use std::collections::HashMap;

    /// Names and offsets of the members of a struct.
    type Members = Vec<(String, u32)>;

    /// The members of each struct and its size, as WGSL lays it out.
    type Reflected = HashMap<String, (Members, u32)>;

    fn reflect(precision: Precision) -> Reflected {
        let mut structs = Reflected::new();
        for shader in ALL.iter().copied().flatten().filter(|shader| shader.precision == precision) {
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
        let expected = [
            layout!(Parameters: configurations, joints, proxy_nodes, surface_nodes, triangles, leaves, gap_band,
                known_to),
            layout!(FrameParameters: nodes, period, odd, groups),
        ];
        compare(&expected, &reflect(Precision::Single));
        compare(&expected[..1], &reflect(Precision::Double));
        let (name, mut members, size) = layout!(
            SearchParameters: configurations, first, joints, proxy_nodes, surface_nodes, triangles, leaves,
            covered, contacts, support, carriers, max_iterations, reals, words, room,
            at_net, at_masks, at_order, at_carriers, at_shapes, at_covered, at_links,
            gap_band, known_to, first_kc, kc, tolerance, mobility, bulge_mobility, bulge, least_scale, least_distance
        );
        compare(&[(name, members.clone(), size)], &reflect(Precision::Double));
        let first = offset_of!(SearchParameters, gap_band) as u32;
        members.iter_mut().for_each(|(_, offset)| *offset = (*offset).min(first + offset.saturating_sub(first) / 2));
        let size = SearchParameters::zeroed().encode(Precision::Single).len() as u32;
        compare(&[(name, members, size)], &reflect(Precision::Single));
    }

    fn compare(expected: &[(&str, Members, u32)], reflected: &Reflected) {
        for (name, members, size) in expected {
            let (wgsl_members, wgsl_size) = reflected.get(*name).unwrap_or_else(|| panic!("{name} is in no shader"));
            assert_eq!(members, wgsl_members, "{name}");
            assert_eq!(size, wgsl_size, "size of {name}");
        }
    }
}
