//! A body from a mesh file as the table of a scene, for a start: an elastic solid under a skin, lying on the ground.

use super::{
    import,
    mesh_summary::{enclosed, suggested},
    topology,
};
use crate::Error;
use crate::scene::Placement;
use crate::toml_text::{coarse, entry, number, quoted, significant, vector};
use glam::DVec3;
use std::fmt::Write;
use std::path::Path;

/// Density of a body: water's (kg/m^3).
const DENSITY: f64 = 1000.0;

/// Damping over mass (1/s): a free node comes to rest in some hundredths of a second.
const DAMPING: f64 = 100.0;

/// Width over which a skin rounds dents, in edges of the mesh (1): from three on the mesh is hardly felt
/// (docs/accuracy.md).
const SKIN_WIDTH: f64 = 3.0;

/// Poisson's ratio of soft tissue that may swell to the sides (1): nearer to 1/2 a body is stiffer, and takes smaller
/// elements.
const POISSON: f64 = 0.45;

/// Unit of length of a mesh file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum LengthUnit {
    /// Metres.
    M,
    /// Centimetres.
    Cm,
    /// Millimetres.
    Mm,
    /// Inches.
    In,
}

impl LengthUnit {
    /// Its name.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::M => "metres",
            Self::Cm => "centimetres",
            Self::Mm => "millimetres",
            Self::In => "inches",
        }
    }

    /// (m)
    #[must_use]
    pub fn metres(self) -> f64 {
        match self {
            Self::M => 1.0,
            Self::Cm => 0.01,
            Self::Mm => 0.001,
            Self::In => 0.0254,
        }
    }
}

/// A body as a scene has it.
#[derive(Clone, Debug)]
pub struct Draft {
    /// The table `[object]` with its parts; the box around the body is centred at the origin.
    pub tables: String,
    /// Unit of the file's coordinates, which was given or follows from the size of the body.
    pub unit: LengthUnit,
}

impl Draft {
    /// Height up to which a body is held, over its own (1): the part on which it lies.
    pub const HELD: f64 = 0.1;

    /// The surface in `file`, which the scene calls `name`, of Young's modulus `young` (Pa) under a skin of `width` (m),
    /// by default three edges of the mesh, turned about x, then y, then z (rad), and held up to the part `held` of its
    /// height.
    ///
    /// # Errors
    /// When the file cannot be read.
    pub fn new(
        (file, name): (&Path, &str),
        unit: Option<LengthUnit>,
        turn: DVec3,
        young: f64,
        (width, held): (Option<f64>, f64),
    ) -> Result<Self, Error> {
        let (nodes, triangles) = import::read(file, &Placement::METRES, &mut Vec::new())?;
        let [low, high] = import::corners(&nodes);
        let unit = unit.unwrap_or_else(|| suggested(high - low));
        let scale = unit.metres();
        let nodes = Placement { scale, turn, centre: DVec3::ZERO }.place(nodes);
        let [low, high] = import::corners(&nodes);
        let (middle, height) = (0.5 * (low + high), high.z - low.z);
        let volume = enclosed(&nodes, &triangles);
        let mass = DENSITY * volume / nodes.len().max(1) as f64;
        let width = width.unwrap_or_else(|| SKIN_WIDTH * topology::mean_edge(&nodes, &triangles));
        let water = format!("kg, of each node: the body has {} l, as heavy as water", coarse(1e3 * volume));
        let mut mesh = vec![
            ("file", quoted(name), "relative to this file"),
            ("scale", number(scale, 4), "to metres"),
            ("centre", vector(-middle, 6), "m, where the file's origin lies"),
        ];
        if turn != DVec3::ZERO {
            mesh.insert(2, ("turn", vector(turn, 6), "rad, about x, then y, then z"));
        }
        let mut tables = String::new();
        let mut table = |heading: &str, entries: &[(&str, String, &str)]| {
            // Writing to a string fails only where memory does.
            let _ = writeln!(tables, "{heading}");
            entries.iter().for_each(|(key, value, meaning)| _ = entry(&mut tables, key, value, meaning));
        };
        table(
            "[object]",
            &[
                ("node_mass", coarse(mass), &water),
                ("node_damping", coarse(DAMPING * mass), "N s/m, against the ground"),
            ],
        );
        table("\n[object.mesh]", &mesh);
        table("\n[object.elasticity]", &[("young", significant(young), "Pa"), ("poisson", number(POISSON, 3), "")]);
        table("\n[object.skin]", &[("width", number(width, 5), "m, over which the dent of a point is rounded")]);
        table(
            "\n[object.ground]",
            &[
                ("clamp", "true".into(), "the body lies on something"),
                ("below", number((held - 0.5) * height, 5), "m, height up to which it is held"),
            ],
        );
        Ok(Self { tables, unit })
    }
}
