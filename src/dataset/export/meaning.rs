//! The meaning of an export's arrays: the unit of each, and its axes.

use super::super::{Axis, Grid};

/// Unit and axes of an array.
pub(super) struct Meaning {
    /// As SI writes it; `1` for numbers without a unit. Where joints are of both kinds, one unit for each kind:
    /// `N m, N`.
    pub(super) unit: String,
    /// The axes, slowest first. Those of the grid come first and are called as its joints.
    pub(super) axes: Vec<String>,
    /// How many of them are the grid's.
    pub(super) of_grid: usize,
}

/// Returns what the tensor `name` of a dataset over `grid` means, as [`super::super::file`] lists them; `q`, the
/// configurations.
pub(super) fn meaning(grid: &Grid, name: &str) -> Meaning {
    let over_grid = |unit: String, more: &[&str]| {
        let joints = grid.axes.iter().map(|axis| axis.name.as_str());
        let axes = joints.chain(more.iter().copied()).map(str::to_owned).collect();
        Meaning { unit, axes, of_grid: grid.joints() }
    };
    let own = |unit: &str, axes: &[&str]| Meaning {
        unit: unit.into(),
        axes: axes.iter().map(|axis| (*axis).to_owned()).collect(),
        of_grid: 0,
    };
    match name {
        "torque" => over_grid(units(grid, |axis| axis.effort_unit().into()), &["joint"]),
        "tangent" => {
            over_grid(units(grid, |axis| format!("{}/{}", axis.effort_unit(), axis.unit)), &["lower triangle"])
        }
        "q" => over_grid(units(grid, |axis| axis.unit.clone()), &["joint"]),
        "energy" => over_grid("J".into(), &[]),
        "gap" => over_grid("m".into(), &[]),
        "contact_forces" | "touch_forces" => own("N", &["contact", "xyz"]),
        "contact_nodes" | "touch_nodes" => own("1", &["contact"]),
        "contact_offsets" | "touch_offsets" => own("1", &["point"]),
        "surface_nodes" | "inner_nodes" => own("m", &["node", "xyz"]),
        "surface_triangles" => own("1", &["triangle", "corner"]),
        "tetrahedra" => own("1", &["tetrahedron", "corner"]),
        "regions" => own("1", &["tetrahedron"]),
        // Status, residual, iterations.
        _ => over_grid("1".into(), &[]),
    }
}

/// Name of the array with the grid lines of axis `k`.
pub(super) fn lines_name(k: usize) -> String {
    format!("q{}", k + 1)
}

/// Returns the coordinates of the grid lines of `axis`.
pub(super) fn lines(axis: &Axis) -> impl ExactSizeIterator<Item = f64> + '_ {
    (0..axis.count).map(|line| axis.coordinate(line))
}

/// The unit of each joint, those of neighbours that have the same one said once.
fn units(grid: &Grid, unit: impl Fn(&Axis) -> String) -> String {
    let mut units: Vec<String> = grid.axes.iter().map(unit).collect();
    units.dedup();
    units.join(", ")
}
