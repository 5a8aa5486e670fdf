//! What a dataset stores: each array's name, numbers, axes, unit and meaning, said once. The writer, the reader, the
//! checks and the exports go through this table, and [docs/dataset.md](../../docs/dataset.md) is held against it.

use super::{Axis, Contacts, Dataset, Grid, Solid, Surface};
use crate::joint_matrix;
use safetensors::Dtype;

/// An array of a dataset, in the order of a file among those of numbers of the same size.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Stored {
    Torque,
    Energy,
    Tangent,
    NormalForce,
    SlipJacobian,
    Gap,
    Status,
    Residual,
    Iterations,
    ContactOffsets,
    ContactNodes,
    ContactForces,
    SurfaceNodes,
    SurfaceTriangles,
    InnerNodes,
    Tetrahedra,
    MidNodes,
    Regions,
}

use Stored::{
    ContactForces, ContactNodes, ContactOffsets, Energy, Gap, InnerNodes, Iterations, MidNodes, NormalForce, Regions,
    Residual, SlipJacobian, Status, SurfaceNodes, SurfaceTriangles, Tangent, Tetrahedra, Torque,
};

/// Arrays of the contact forces on the object: ends of the rows, nodes and forces.
pub(crate) const CONTACTS: [Stored; 3] = [ContactOffsets, ContactNodes, ContactForces];

/// What an array is.
pub(crate) struct Description {
    array: Stored,
    pub name: &'static str,
    pub dtype: Dtype,
    pub axes: Axes,
    pub unit: Unit,
    /// What a dataset without it lacks, in words, where that is worth saying.
    pub absent: Option<&'static str>,
}

/// The arrays that a sweep makes, point by point.
pub(crate) const RESULTS: [Stored; 12] = {
    let mut results = [Torque; 12];
    let mut k = 0;
    while k < results.len() {
        results[k] = DESCRIPTIONS[k].array;
        k += 1;
    }
    results
};

/// Axes of an array.
#[derive(Clone, Copy)]
pub(crate) enum Axes {
    /// Those of the grid, and one number a point.
    Grid,
    /// Those of the grid, and behind them one of this name with a number for each joint.
    Joints(&'static str),
    /// Those of the grid, and behind them one of this name with the entries of a symmetric matrix's lower triangle.
    Triangle(&'static str),
    /// Its own, by name, slowest first; the length of the first is free, those of the others are given.
    Own(&'static [(&'static str, usize)]),
}

/// Unit of an array's numbers.
#[derive(Clone, Copy)]
pub(crate) enum Unit {
    /// As SI writes it; `1` for numbers without one.
    Of(&'static str),
    /// That of each joint's torque or force.
    Effort,
    /// That of each joint's stiffness.
    Stiffness,
    /// That of a slip over each joint's coordinate.
    Slip,
}

const ENTRY: &[(&str, usize)] = &[("contact", 0)];
const VECTOR: &[(&str, usize)] = &[("contact", 0), ("xyz", 3)];
const POINT: &[(&str, usize)] = &[("point", 0)];
const NODE: &[(&str, usize)] = &[("node", 0), ("xyz", 3)];

/// By [`Stored`].
const DESCRIPTIONS: [Description; 18] = [
    of(Torque, "torque", Dtype::F64, Axes::Joints("joint"), Unit::Effort),
    of(Energy, "energy", Dtype::F64, Axes::Grid, Unit::Of("J")).or_absent("stored energy"),
    of(Tangent, "tangent", Dtype::F32, Axes::Triangle("lower triangle"), Unit::Stiffness),
    of(NormalForce, "normal_force", Dtype::F32, Axes::Grid, Unit::Of("N")),
    of(SlipJacobian, "slip_jacobian", Dtype::F32, Axes::Triangle("lower triangle"), Unit::Slip),
    of(Gap, "gap", Dtype::F32, Axes::Grid, Unit::Of("m")).or_absent("gap"),
    of(Status, "status", Dtype::U8, Axes::Grid, Unit::Of("1")),
    of(Residual, "residual", Dtype::F32, Axes::Grid, Unit::Of("1")).or_absent("residuals"),
    of(Iterations, "iterations", Dtype::U32, Axes::Grid, Unit::Of("1")),
    of(ContactOffsets, "contact_offsets", Dtype::U64, Axes::Own(POINT), Unit::Of("1")).or_absent("contact forces"),
    of(ContactNodes, "contact_nodes", Dtype::U32, Axes::Own(ENTRY), Unit::Of("1")),
    of(ContactForces, "contact_forces", Dtype::F32, Axes::Own(VECTOR), Unit::Of("N")),
    of(SurfaceNodes, "surface_nodes", Dtype::F64, Axes::Own(NODE), Unit::Of("m")).or_absent("the object's surface"),
    of(SurfaceTriangles, "surface_triangles", Dtype::U32, Axes::Own(&[("triangle", 0), ("corner", 3)]), Unit::Of("1")),
    of(InnerNodes, "inner_nodes", Dtype::F64, Axes::Own(NODE), Unit::Of("m")),
    of(Tetrahedra, "tetrahedra", Dtype::U32, Axes::Own(&[("tetrahedron", 0), ("corner", 4)]), Unit::Of("1")),
    of(MidNodes, "mid_nodes", Dtype::U32, Axes::Own(&[("tetrahedron", 0), ("edge", 6)]), Unit::Of("1")),
    of(Regions, "regions", Dtype::U32, Axes::Own(&[("tetrahedron", 0)]), Unit::Of("1")),
];

const fn of(array: Stored, name: &'static str, dtype: Dtype, axes: Axes, unit: Unit) -> Description {
    Description { array, name, dtype, axes, unit, absent: None }
}

impl Description {
    const fn or_absent(self, absent: &'static str) -> Self {
        Self { absent: Some(absent), ..self }
    }
}

impl Stored {
    /// All of them, in the order of a file.
    pub fn all() -> impl Iterator<Item = Self> {
        DESCRIPTIONS.iter().map(|description| description.array)
    }

    /// Whether it has an entry for each contact, in rows that end at [`ContactOffsets`].
    pub fn is_of_contacts(self) -> bool {
        matches!(self, ContactNodes | ContactForces)
    }

    pub const fn description(self) -> &'static Description {
        &DESCRIPTIONS[self as usize]
    }

    pub const fn name(self) -> &'static str {
        self.description().name
    }

    /// Length along each axis in a dataset over `grid`; `None` where it is free.
    pub fn shape(self, grid: &Grid) -> Vec<Option<usize>> {
        let over_grid = |last: Option<usize>| grid.counts().into_iter().chain(last).map(Some).collect();
        match self.description().axes {
            Axes::Grid => over_grid(None),
            Axes::Joints(_) => over_grid(Some(grid.joints())),
            Axes::Triangle(_) => over_grid(Some(joint_matrix::entries(grid.joints()))),
            Axes::Own(axes) => axes.iter().enumerate().map(|(k, (_, length))| (k > 0).then_some(*length)).collect(),
        }
    }

    /// Names of its axes, and how many of them are the grid's.
    pub fn axes(self, grid: &Grid) -> (Vec<String>, usize) {
        let joints = grid.axes.iter().map(|axis| axis.name.as_str());
        let over_grid = |last: Option<&'static str>| (joints.chain(last).map(str::to_owned).collect(), grid.joints());
        match self.description().axes {
            Axes::Grid => over_grid(None),
            Axes::Joints(last) | Axes::Triangle(last) => over_grid(Some(last)),
            Axes::Own(axes) => (axes.iter().map(|(name, _)| (*name).to_owned()).collect(), 0),
        }
    }

    /// Unit of its numbers; where joints are of both kinds, one for each kind: `N m, N`.
    pub fn unit(self, grid: &Grid) -> String {
        match self.description().unit {
            Unit::Of(unit) => unit.to_owned(),
            Unit::Effort => units(grid, |axis| axis.effort_unit().into()),
            Unit::Slip => units(grid, |axis| if axis.unit == "m" { "1".into() } else { format!("m/{}", axis.unit) }),
            Unit::Stiffness => units(grid, |axis| format!("{}/{}", axis.effort_unit(), axis.unit)),
        }
    }
}

/// The unit of each joint, those of neighbours that have the same one said once.
pub(super) fn units(grid: &Grid, unit: impl Fn(&Axis) -> String) -> String {
    let mut units: Vec<String> = grid.axes.iter().map(unit).collect();
    units.dedup();
    units.join(", ")
}

impl Dataset {
    /// The numbers of an array as bytes; `None` where it is absent.
    pub(super) fn stored(&self, array: Stored) -> Option<&[u8]> {
        match array {
            Torque => Some(bytemuck::cast_slice(&self.torque)),
            Energy => self.energy.as_deref().map(bytemuck::cast_slice),
            Tangent => self.tangent.as_deref().map(bytemuck::cast_slice),
            NormalForce => Some(bytemuck::cast_slice(&self.slip.as_ref()?.normal_force)),
            SlipJacobian => Some(bytemuck::cast_slice(&self.slip.as_ref()?.jacobian)),
            Gap => self.gap.as_deref().map(bytemuck::cast_slice),
            Status => Some(&self.status),
            Residual => self.residual.as_deref().map(bytemuck::cast_slice),
            Iterations => self.iterations.as_deref().map(bytemuck::cast_slice),
            ContactOffsets | ContactNodes | ContactForces => self.contacts.as_ref()?.stored(array),
            SurfaceNodes | SurfaceTriangles | InnerNodes | Tetrahedra | MidNodes | Regions => {
                self.surface.as_ref()?.stored(array)
            }
        }
    }

    /// Returns the quantities that the dataset does not hold, in words. A measured one holds none of these: a device
    /// feels torque alone.
    #[must_use]
    pub fn absent(&self) -> Vec<&'static str> {
        let absent = Stored::all().filter(|array| self.stored(*array).is_none());
        absent.filter_map(|array| array.description().absent).collect()
    }
}

impl Contacts {
    fn stored(&self, array: Stored) -> Option<&[u8]> {
        match array {
            ContactOffsets => Some(bytemuck::cast_slice(&self.offsets)),
            ContactNodes => Some(bytemuck::cast_slice(&self.nodes)),
            ContactForces => Some(bytemuck::cast_slice(&self.forces)),
            _ => None,
        }
    }
}

impl Surface {
    /// As [`Dataset::stored`].
    pub(super) fn stored(&self, array: Stored) -> Option<&[u8]> {
        let solid = self.solid.as_ref();
        match array {
            SurfaceNodes => Some(bytemuck::cast_slice(&self.nodes)),
            SurfaceTriangles => Some(bytemuck::cast_slice(&self.triangles)),
            InnerNodes => solid.map(|Solid { inner_nodes, .. }| bytemuck::cast_slice(inner_nodes)),
            Tetrahedra => solid.map(|Solid { tetrahedra, .. }| bytemuck::cast_slice(tetrahedra)),
            MidNodes => {
                solid.filter(|solid| !solid.mid_nodes.is_empty()).map(|solid| bytemuck::cast_slice(&solid.mid_nodes))
            }
            Regions => {
                solid.filter(|solid| !solid.regions.is_empty()).map(|solid| bytemuck::cast_slice(&solid.regions))
            }
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_page_on_datasets_names_every_array_and_no_other() {
        let page = include_str!("../../docs/dataset.md");
        let rows = page.lines().skip_while(|line| !line.starts_with("| array |")).skip(2);
        let first = rows.take_while(|line| line.starts_with('|')).map(|line| line.split('|').nth(1).unwrap());
        let told: Vec<&str> =
            first.flat_map(|cell| cell.split(',')).map(|name| name.trim().trim_matches('`')).collect();
        let mut stored: Vec<&str> = Stored::all().map(|array| array.name()).collect();
        assert!(told.iter().all(|name| stored.contains(name)), "{told:?}");
        stored.retain(|name| !told.contains(name));
        assert!(stored.is_empty(), "docs/dataset.md lacks {stored:?}");
    }

    #[test]
    fn descriptions_stand_at_the_place_of_their_array() {
        assert!(Stored::all().all(|array| array.description().array == array));
        assert_eq!(Stored::all().last(), Some(Regions));
    }
}
