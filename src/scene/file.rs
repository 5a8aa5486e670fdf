//! The layout of a scene file: one struct per table, one field per key, values with their place in the text.
//!
//! Unknown keys are refused with the list of the known ones. Nothing is checked here beyond types; see
//! [`super::convert`].

use super::{ContactSurface, Cover, Interpolation, JointKind, ProxyInertia, SpringKind};
use serde::Deserialize;
use serde::de::{Deserializer, MapAccess, SeqAccess, Visitor, value::MapAccessDeserializer};
use toml::Spanned;

pub(super) type Number = Spanned<f64>;
pub(super) type Vector = Spanned<[f64; 3]>;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SceneTable {
    pub name: Option<Spanned<String>>,
    pub object: Option<Spanned<ObjectTable>>,
    pub proxy: ProxyTable,
    pub contact: Option<Spanned<ContactTable>>,
    pub grid: Option<Spanned<GridTable>>,
    pub scan: Option<Spanned<ScanTable>>,
    #[serde(default)]
    pub haptics: HapticsTable,
    pub graphics: Option<GraphicsEntry>,
    #[serde(default)]
    pub motion: MotionTable,
    #[serde(default)]
    pub device: DeviceTable,
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct DeviceTable {
    pub map: Option<Spanned<Vec<Vec<f64>>>>,
    pub offset: Option<Spanned<Vec<f64>>>,
    pub node: Option<Spanned<usize>>,
    pub stiffness: Option<Number>,
    pub damping: Option<Number>,
    pub effort_limit: Option<Spanned<Vec<f64>>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ObjectTable {
    pub sphere: Option<SphereTable>,
    pub mesh: Option<MeshTable>,
    pub tetrahedra: Option<MeshTable>,
    pub springs: Option<Spanned<SpringsTable>>,
    pub elasticity: Option<Spanned<ElasticityTable>>,
    pub skin: Option<Spanned<SkinTable>>,
    pub ground: Option<GroundTable>,
    pub node_mass: Option<Number>,
    pub node_damping: Option<Number>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SphereTable {
    pub centre: Option<Vector>,
    pub radius: Number,
    pub rings: Option<Spanned<usize>>,
    pub segments: Option<Spanned<usize>>,
    pub subdivisions: Option<Spanned<usize>>,
    pub edge: Option<Number>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct MeshTable {
    pub file: Spanned<String>,
    pub scale: Option<Number>,
    pub centre: Option<Vector>,
    pub refine: Option<Number>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SpringsTable {
    pub kind: SpringKind,
    pub stiffness: Number,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ElasticityTable {
    pub young: Number,
    pub poisson: Number,
    pub cell: Option<Number>,
    #[serde(default)]
    pub inclusion: Vec<Spanned<InclusionTable>>,
}

/// A part of the solid, by a sphere or by the number of a physical volume.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct InclusionTable {
    pub sphere: Option<InclusionSphereTable>,
    pub region: Option<Spanned<u32>>,
    pub young: Number,
    pub poisson: Option<Number>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct InclusionSphereTable {
    pub centre: Vector,
    pub radius: Number,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SkinTable {
    pub tension: Option<Number>,
    pub bending: Option<Number>,
    pub width: Option<Number>,
    pub thickness: Option<Number>,
    pub young: Option<Number>,
    pub poisson: Option<Number>,
    pub foundation: Option<Number>,
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
    #[serde(default)]
    pub shape: Vec<Spanned<ShapeTable>>,
}

/// One of four forms, drawn with the link of a joint.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ShapeTable {
    pub joint: Option<Spanned<String>>,
    #[serde(rename = "box")]
    pub block: Option<Vector>,
    pub cylinder: Option<CylinderTable>,
    pub sphere: Option<Number>,
    pub surface: Option<LinkSurfaceTable>,
    pub at: Option<Vector>,
    pub turn: Option<Vector>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct CylinderTable {
    pub radius: Number,
    pub length: Number,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct LinkSurfaceTable {
    pub from: Vector,
    pub to: Vector,
    pub data: Spanned<String>,
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
    pub inertia: Option<Spanned<Vec<f64>>>,
    pub rotor_inertia: Option<Number>,
    #[serde(default)]
    pub nodes: Vec<Spanned<NodesTable>>,
}

/// One node `at` a point, or nodes on the line `from` .. `to`, both ends included: `count` of them, or at most
/// `spacing` apart.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct NodesTable {
    pub at: Option<Vector>,
    pub from: Option<Vector>,
    pub to: Option<Vector>,
    pub count: Option<Spanned<usize>>,
    pub spacing: Option<Number>,
    pub radius: Option<Number>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ContactTable {
    pub stiffness: Option<Spanned<NumberOr<Rigid>>>,
    pub stiffness_per_length: Option<Number>,
    pub algorithm: Option<Spanned<String>>,
    pub tolerance: Option<Number>,
    pub max_iterations: Option<Spanned<u32>>,
    pub updates: Option<Spanned<u32>>,
    pub surface: Option<Spanned<ContactSurface>>,
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
    pub interpolation: Option<Interpolation>,
    pub boundary_slope: Option<Spanned<PerJoint>>,
    pub passivity_factor: Option<Number>,
    pub proxy_damping: Option<Spanned<PerJoint>>,
    pub proxy_inertia: Option<ProxyInertia>,
    pub coupling_stiffness: Option<Spanned<PerJoint>>,
    pub coupling_damping: Option<Spanned<PerJoint>>,
    pub device_damping: Option<Spanned<PerJoint>>,
    pub device_inertia: Option<Spanned<PerJoint>>,
    pub torque_limit: Option<Spanned<PerJoint>>,
    pub torque_rate_limit: Option<Spanned<PerJoint>>,
    pub speed_limit: Option<Spanned<PerJoint>>,
    pub encoder_step: Option<Spanned<PerJoint>>,
    pub device_friction: Option<Spanned<PerJoint>>,
    pub friction: Option<Spanned<FrictionTable>>,
    pub contact_damping: Option<Number>,
    pub four_channel: Option<FourChannelTable>,
    pub passivity_control: Option<bool>,
    #[serde(default)]
    pub hand: HandTable,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct FrictionTable {
    pub coefficient: Number,
    pub static_coefficient: Option<Number>,
    pub stiffness: Option<Number>,
    pub damping: Option<Number>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct FourChannelTable {
    pub channels: Option<Spanned<[f64; 4]>>,
    pub filter: Option<Number>,
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct HandTable {
    pub stiffness: Option<Spanned<PerJoint>>,
    pub damping: Option<Spanned<PerJoint>>,
    pub inertia: Option<Spanned<PerJoint>>,
}

/// The graphics loop, or `false` for none.
pub(super) enum GraphicsEntry {
    Off,
    Loop(Box<GraphicsTable>),
}

impl<'de> Deserialize<'de> for GraphicsEntry {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct FalseOrTable;

        impl<'de> Visitor<'de> for FalseOrTable {
            type Value = GraphicsEntry;

            fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str("the table [graphics], or false")
            }

            fn visit_bool<E: serde::de::Error>(self, value: bool) -> Result<GraphicsEntry, E> {
                if value {
                    return Err(E::invalid_value(serde::de::Unexpected::Bool(true), &self));
                }
                Ok(GraphicsEntry::Off)
            }

            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<GraphicsEntry, A::Error> {
                GraphicsTable::deserialize(MapAccessDeserializer::new(map))
                    .map(|table| GraphicsEntry::Loop(Box::new(table)))
            }
        }

        deserializer.deserialize_any(FalseOrTable)
    }
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct GraphicsTable {
    pub rate: Option<Number>,
    pub gravity: Option<Vector>,
    pub stiffening: Option<Spanned<StiffeningTable>>,
    pub smoothing: Option<Number>,
    pub quasi_static: Option<Spanned<bool>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct StiffeningTable {
    pub factor: Number,
    pub strain: Number,
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

/// Haptization of a real object.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ScanTable {
    pub workspace: Option<WorkspaceTable>,
    pub joints: Option<Spanned<GridTable>>,
    #[serde(default)]
    pub control: ControlTable,
    pub limits: LimitsTable,
    pub simulated: SimulatedTable,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct WorkspaceTable {
    pub node: Option<Spanned<usize>>,
    pub start: Vector,
    pub across: Spanned<Vec<PlanAxisTable>>,
    pub depth: PlanAxisTable,
    pub clearance: Option<Number>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct PlanAxisTable {
    pub direction: Vector,
    pub spacing: Number,
    pub count: Spanned<usize>,
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ControlTable {
    pub rate: Option<Number>,
    pub stiffness: Option<Spanned<PerJoint>>,
    pub damping: Option<Spanned<PerJoint>>,
    pub speed: Option<Number>,
    pub window: Option<Number>,
    pub still: Option<Number>,
    pub drift: Option<Number>,
    pub timeout: Option<Number>,
    pub average: Option<Number>,
    pub epsilon: Option<Number>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct LimitsTable {
    pub torque: Option<Spanned<PerJoint>>,
    pub speed: Option<Number>,
    pub workspace: Spanned<[[f64; 3]; 2]>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SimulatedTable {
    pub corner: Vector,
    pub size: Vector,
    pub cover: Option<Cover>,
    pub friction: Option<Number>,
    pub encoder: Option<Number>,
    pub noise: Option<Number>,
    pub joint_friction: Option<Number>,
}

/// A number, or one word instead.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum NumberOr<W> {
    Number(f64),
    Word(W),
}

/// A word that may stand instead of a number.
pub(super) trait Word: Default {
    const WORD: &'static str;
}

/// Contact as stiff as makes no difference.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Rigid;

impl Word for Rigid {
    const WORD: &'static str = "rigid";
}

impl<'de, W: Word> Deserialize<'de> for NumberOr<W> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Visit<W>(std::marker::PhantomData<W>);

        impl<W: Word> Visitor<'_> for Visit<W> {
            type Value = NumberOr<W>;

            fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                write!(f, "a number or {:?}", W::WORD)
            }

            fn visit_f64<E>(self, value: f64) -> Result<Self::Value, E> {
                Ok(NumberOr::Number(value))
            }

            fn visit_i64<E>(self, value: i64) -> Result<Self::Value, E> {
                Ok(NumberOr::Number(value as f64))
            }

            fn visit_str<E: serde::de::Error>(self, value: &str) -> Result<Self::Value, E> {
                if value == W::WORD {
                    return Ok(NumberOr::Word(W::default()));
                }
                Err(E::invalid_value(serde::de::Unexpected::Str(value), &self))
            }
        }

        deserializer.deserialize_any(Visit(std::marker::PhantomData))
    }
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
