//! What a dataset stores: each array's name, numbers, axes, unit and meaning, said once. The writer, the reader, the
//! checks and the exports go through this table, and [docs/dataset.md](../../docs/dataset.md) is held against it.

use super::{Axis, Column, Contacts, Dataset, Grid, SlipColumns, Solid, Surface, file::Element};
use crate::joint_matrix;
use safetensors::Dtype;
use serde::{Deserialize, Serialize};

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

/// What an array is.
pub(crate) struct Description {
    array: Stored,
    pub name: &'static str,
    pub dtype: Dtype,
    pub axes: Axes,
    pub unit: Unit,
    /// Whether a sweep stores it.
    stores: fn(Extras) -> bool,
    /// What a dataset without it lacks, in words, where that is worth saying.
    pub absent: Option<&'static str>,
}

/// What a sweep stores some arrays for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Extras {
    /// Interpolation by tangents.
    pub tangent: bool,
    /// Friction.
    pub slip: bool,
    /// Contact forces on the object's nodes.
    pub forces: bool,
}

impl Extras {
    /// Whether an array is stored.
    pub fn store(self, array: Stored) -> bool {
        (array.description().stores)(self)
    }
}

const TANGENT: fn(Extras) -> bool = |extras| extras.tangent;
const SLIP: fn(Extras) -> bool = |extras| extras.slip;
const FORCES: fn(Extras) -> bool = |extras| extras.forces;

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
    of(Tangent, "tangent", Dtype::F32, Axes::Triangle("lower triangle"), Unit::Stiffness).with(TANGENT),
    of(NormalForce, "normal_force", Dtype::F32, Axes::Grid, Unit::Of("N")).with(SLIP),
    of(SlipJacobian, "slip_jacobian", Dtype::F32, Axes::Triangle("lower triangle"), Unit::Slip).with(SLIP),
    of(Gap, "gap", Dtype::F32, Axes::Grid, Unit::Of("m")).or_absent("gap"),
    of(Status, "status", Dtype::U8, Axes::Grid, Unit::Of("1")),
    of(Residual, "residual", Dtype::F32, Axes::Grid, Unit::Of("1")).or_absent("residuals"),
    of(Iterations, "iterations", Dtype::U32, Axes::Grid, Unit::Of("1")),
    of(ContactOffsets, "contact_offsets", Dtype::U64, Axes::Own(POINT), Unit::Of("1"))
        .with(FORCES)
        .or_absent("contact forces"),
    of(ContactNodes, "contact_nodes", Dtype::U32, Axes::Own(ENTRY), Unit::Of("1")).with(FORCES),
    of(ContactForces, "contact_forces", Dtype::F32, Axes::Own(VECTOR), Unit::Of("N")).with(FORCES),
    of(SurfaceNodes, "surface_nodes", Dtype::F64, Axes::Own(NODE), Unit::Of("m")).or_absent("the object's surface"),
    of(SurfaceTriangles, "surface_triangles", Dtype::U32, Axes::Own(&[("triangle", 0), ("corner", 3)]), Unit::Of("1")),
    of(InnerNodes, "inner_nodes", Dtype::F64, Axes::Own(&[("inner node", 0), ("xyz", 3)]), Unit::Of("m")),
    of(Tetrahedra, "tetrahedra", Dtype::U32, Axes::Own(&[("tetrahedron", 0), ("vertex", 4)]), Unit::Of("1")),
    of(MidNodes, "mid_nodes", Dtype::U32, Axes::Own(&[("tetrahedron", 0), ("edge", 6)]), Unit::Of("1")),
    of(Regions, "regions", Dtype::U32, Axes::Own(&[("tetrahedron", 0)]), Unit::Of("1")),
];

const fn of(array: Stored, name: &'static str, dtype: Dtype, axes: Axes, unit: Unit) -> Description {
    Description { array, name, dtype, axes, unit, stores: |_| true, absent: None }
}

impl Description {
    const fn with(self, stores: fn(Extras) -> bool) -> Self {
        Self { stores, ..self }
    }

    const fn or_absent(self, absent: &'static str) -> Self {
        Self { absent: Some(absent), ..self }
    }
}

impl Stored {
    /// All of them, in the order of a file.
    pub fn all() -> impl Iterator<Item = Self> {
        DESCRIPTIONS.iter().map(|description| description.array)
    }

    /// Numbers of an entry, of a point or of a row along its first axis, over so many joints.
    pub fn numbers(self, joints: usize) -> usize {
        match self.description().axes {
            Axes::Grid => 1,
            Axes::Joints(_) => joints,
            Axes::Triangle(_) => joint_matrix::entries(joints),
            Axes::Own(axes) => axes.iter().skip(1).map(|(_, length)| length).product(),
        }
    }

    /// Bytes of an entry, as [`Stored::numbers`].
    pub fn bytes(self, joints: usize) -> usize {
        self.numbers(joints) * self.description().dtype.bitsize() / 8
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
            Axes::Joints(_) | Axes::Triangle(_) => over_grid(Some(self.numbers(grid.joints()))),
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

/// Where the arrays of a dataset come from.
pub(crate) trait Source {
    /// Takes an array; `None` where it is absent. `Err` says what is wrong.
    fn take<T: Element>(&mut self, array: Stored) -> Result<Option<Column<T>>, String>;

    /// Takes an array that has to be there.
    fn required<T: Element>(&mut self, array: Stored) -> Result<Column<T>, String> {
        self.take(array)?.ok_or_else(|| format!("tensor {} is missing", array.name()))
    }
}

impl Dataset {
    /// The dataset over `grid` that `source` has the arrays of. `Err` says what is wrong.
    pub(crate) fn of(source: &mut impl Source, grid: Grid) -> Result<Self, String> {
        let contacts = source.take(ContactOffsets)?.map(|offsets| -> Result<_, String> {
            Ok(Contacts { offsets, nodes: source.required(ContactNodes)?, forces: source.required(ContactForces)? })
        });
        let contacts = contacts.transpose()?;
        let slip = source.take(NormalForce)?.map(|normal_force| -> Result<_, String> {
            Ok(SlipColumns { normal_force, jacobian: source.required(SlipJacobian)? })
        });
        Ok(Self {
            slip: slip.transpose()?,
            contacts,
            energy: source.take(Energy)?,
            tangent: source.take(Tangent)?,
            gap: source.take(Gap)?,
            residual: source.take(Residual)?,
            iterations: source.take(Iterations)?,
            surface: Surface::of_arrays(source)?,
            ..Self::bare(grid, source.required(Torque)?, source.required(Status)?)
        })
    }

    /// The numbers of an array as bytes; `None` where it is absent.
    pub(super) fn stored(&self, array: Stored) -> Option<&[u8]> {
        let (contacts, slip) = (self.contacts.as_ref(), self.slip.as_ref());
        match array {
            Torque => Some(self.torque.bytes()),
            Energy => self.energy.as_ref().map(Column::bytes),
            Tangent => self.tangent.as_ref().map(Column::bytes),
            NormalForce => slip.map(|slip| slip.normal_force.bytes()),
            SlipJacobian => slip.map(|slip| slip.jacobian.bytes()),
            Gap => self.gap.as_ref().map(Column::bytes),
            Status => Some(self.status.bytes()),
            Residual => self.residual.as_ref().map(Column::bytes),
            Iterations => self.iterations.as_ref().map(Column::bytes),
            ContactOffsets => contacts.map(|contacts| contacts.offsets.bytes()),
            ContactNodes => contacts.map(|contacts| contacts.nodes.bytes()),
            ContactForces => contacts.map(|contacts| contacts.forces.bytes()),
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

impl Surface {
    /// The geometry that `source` has the arrays of; `None` where it is absent. `Err` says what is wrong.
    pub(super) fn of_arrays(source: &mut impl Source) -> Result<Option<Self>, String> {
        let Some(nodes) = source.take(SurfaceNodes)? else { return Ok(None) };
        let triangles = source.required(SurfaceTriangles)?;
        let solid = source.take(Tetrahedra)?.map(|tetrahedra| -> Result<_, String> {
            Ok(Solid {
                inner_nodes: source.required(InnerNodes)?,
                tetrahedra,
                mid_nodes: source.take(MidNodes)?.unwrap_or_else(|| Vec::new().into()),
                regions: source.take(Regions)?.unwrap_or_else(|| Vec::new().into()),
            })
        });
        Ok(Some(Self { nodes, triangles, solid: solid.transpose()? }))
    }

    /// As [`Dataset::stored`].
    pub(super) fn stored(&self, array: Stored) -> Option<&[u8]> {
        let solid = self.solid.as_ref();
        match array {
            SurfaceNodes => Some(self.nodes.bytes()),
            SurfaceTriangles => Some(self.triangles.bytes()),
            InnerNodes => solid.map(|solid| solid.inner_nodes.bytes()),
            Tetrahedra => solid.map(|solid| solid.tetrahedra.bytes()),
            MidNodes => solid.map(|solid| solid.mid_nodes.bytes()).filter(|bytes| !bytes.is_empty()),
            Regions => solid.map(|solid| solid.regions.bytes()).filter(|bytes| !bytes.is_empty()),
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
