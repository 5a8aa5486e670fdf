//! The layout of a scene file: one struct per table, one field per key, values with their place in the text.
//!
//! Unknown keys are refused with the list of the known ones. Nothing is checked here beyond types; see [`super::convert`].

use super::{Algorithm, JointKind, SpringKind};
use serde::Deserialize;
use serde::de::{Deserializer, SeqAccess, Visitor};
use toml::Spanned;

pub(super) type Number = Spanned<f64>;
pub(super) type Vector = Spanned<[f64; 3]>;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SceneTable {
    pub name: Option<String>,
    pub object: Spanned<ObjectTable>,
    pub proxy: ProxyTable,
    pub contact: ContactTable,
    pub grid: Spanned<GridTable>,
    #[serde(default)]
    pub haptics: HapticsTable,
    pub graphics: Option<GraphicsTable>,
    #[serde(default)]
    pub motion: MotionTable,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ObjectTable {
    pub sphere: Option<SphereTable>,
    pub mesh: Option<MeshTable>,
    pub springs: SpringsTable,
    pub ground: GroundTable,
    pub node_mass: Option<Number>,
    pub node_damping: Option<Number>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SphereTable {
    pub centre: Option<Vector>,
    pub radius: Number,
    pub rings: Spanned<usize>,
    pub segments: Spanned<usize>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct MeshTable {
    pub file: Spanned<String>,
    pub scale: Option<Number>,
    pub centre: Option<Vector>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SpringsTable {
    pub kind: SpringKind,
    pub stiffness: Number,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct GroundTable {
    pub stiffness: Number,
    pub nodes: Option<Spanned<Vec<u32>>>,
    pub below: Option<Number>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ProxyTable {
    pub joint: Spanned<Vec<JointTable>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct JointTable {
    pub name: Option<Spanned<String>>,
    pub kind: JointKind,
    pub origin: Option<Vector>,
    pub axis: Vector,
    pub limits: Spanned<[f64; 2]>,
    pub mass: Option<Number>,
    pub centre_of_mass: Option<Vector>,
    pub inertia: Option<Vector>,
    pub rotor_inertia: Option<Number>,
    #[serde(default)]
    pub nodes: Vec<Spanned<NodesTable>>,
}

/// One node `at` a point, or `count` nodes on the line `from` .. `to`, both ends included.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct NodesTable {
    pub at: Option<Vector>,
    pub from: Option<Vector>,
    pub to: Option<Vector>,
    pub count: Option<Spanned<usize>>,
    pub radius: Option<Number>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ContactTable {
    pub stiffness: Number,
    pub algorithm: Option<Algorithm>,
    pub tolerance: Option<Number>,
    pub max_iterations: Option<Spanned<u32>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct GridTable {
    pub spacing: Option<Number>,
    pub axes: Option<Spanned<Vec<Spanned<AxisTable>>>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct AxisTable {
    pub start: Option<Number>,
    pub stop: Option<Number>,
    pub step: Option<Number>,
    pub count: Option<Spanned<usize>>,
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct HapticsTable {
    pub rate: Option<Number>,
    pub threshold: Option<Number>,
    pub boundary_slope: Option<Spanned<PerJoint>>,
    pub passivity_factor: Option<Number>,
    pub proxy_damping: Option<Spanned<PerJoint>>,
    pub coupling_stiffness: Option<Spanned<PerJoint>>,
    pub coupling_damping: Option<Spanned<PerJoint>>,
    pub device_damping: Option<Spanned<PerJoint>>,
    pub device_inertia: Option<Spanned<PerJoint>>,
    pub torque_limit: Option<Spanned<PerJoint>>,
    pub torque_rate_limit: Option<Spanned<PerJoint>>,
    #[serde(default)]
    pub hand: HandTable,
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct HandTable {
    pub stiffness: Option<Spanned<PerJoint>>,
    pub damping: Option<Spanned<PerJoint>>,
    pub inertia: Option<Spanned<PerJoint>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct GraphicsTable {
    pub rate: Option<Number>,
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct MotionTable {
    pub press: Option<Spanned<Vec<WaypointTable>>>,
    pub scrape: Option<Spanned<Vec<WaypointTable>>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct WaypointTable {
    pub time: Number,
    pub q: Spanned<Vec<f64>>,
}

/// One number for all joints, or a list with one for each.
#[derive(Debug, PartialEq)]
pub(super) enum PerJoint {
    Same(f64),
    Each(Vec<f64>),
}

impl<'de> Deserialize<'de> for PerJoint {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct NumberOrList;

        impl<'de> Visitor<'de> for NumberOrList {
            type Value = PerJoint;

            fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str("a number, or a list of one number per joint")
            }

            fn visit_f64<E>(self, value: f64) -> Result<PerJoint, E> {
                Ok(PerJoint::Same(value))
            }

            fn visit_i64<E>(self, value: i64) -> Result<PerJoint, E> {
                Ok(PerJoint::Same(value as f64))
            }

            fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<PerJoint, A::Error> {
                let mut values = Vec::new();
                while let Some(value) = list.next_element()? {
                    values.push(value);
                }
                Ok(PerJoint::Each(values))
            }
        }

        deserializer.deserialize_any(NumberOrList)
    }
}
