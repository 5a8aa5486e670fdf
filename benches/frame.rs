//! What one frame of the object in motion costs at 10,000 and 100,000 nodes, which the CPU moves: isotropic springs, which
//! are solved coordinate by coordinate, beside axial ones, which need the whole matrix, and of elastic solids; and the time
//! and memory of what is made once.
//! Before that, what substitution with the factor takes of it (`src/object/substitution.rs`), beside faer's own solve.
//!
//!     cargo bench --bench frame

#![allow(clippy::unwrap_used)] // A benchmark may stop.

use faer::{
    Conj, Mat, Par, Side,
    dyn_stack::{MemBuffer, MemStack},
    perm::PermRef,
    sparse::{
        SparseColMat, Triplet,
        linalg::cholesky::{LltRef, SymmetricOrdering, factorize_symbolic_cholesky},
    },
};
use glam::DVec3;
use haptize::{
    object::Object,
    render::object_motion::ObjectMotion,
    scene::{
        ElasticSpec, GraphicsEffects, GroundNodes, GroundSpec, GroundStiffness, Material, ObjectSpec, Shape,
        SpringKind, SpringSpec, StiffeningSpec,
    },
};
use std::time::Instant;

/// Frames a figure is taken from.
const FRAMES: usize = 40;

/// Rings and segments of the spheres: 10,002 and 99,858 nodes.
const RINGS: [usize; 2] = [100, 316];

/// Parts of each edge of the icosahedra whose balls are filled: surfaces of 1,002, 2,562 and 6,252 nodes.
const SOLIDS: [usize; 3] = [10, 16, 25];

/// A ball of gel on springs over all of its surface, of cubes that it gets by itself.
fn solid(divisions: usize) -> Object {
    let elastic = ElasticSpec { young: 1e4, poisson: 0.45, cell: None, inclusions: Vec::new() };
    Object::build(&ObjectSpec {
        shape: Shape::Icosphere { centre: DVec3::ZERO, radius: 0.05, divisions },
        material: Material::Elastic(elastic),
        skin: None,
        ground: Some(GroundSpec { stiffness: GroundStiffness::PerArea(1e6), nodes: GroundNodes::All }),
        node_mass: 1e-3,
        node_damping: 0.02,
    })
    .unwrap()
}

fn sphere(kind: SpringKind, rings: usize) -> Object {
    Object::build(&ObjectSpec {
        shape: Shape::Sphere { centre: DVec3::ZERO, radius: 0.05, rings, segments: rings },
        material: Material::Springs(SpringSpec { kind, stiffness: 300.0 }),
        skin: None,
        ground: Some(GroundSpec { stiffness: GroundStiffness::PerNode(90.0), nodes: GroundNodes::All }),
        node_mass: 1e-3,
        node_damping: 0.02,
    })
    .unwrap()
}

/// Time that `work` takes (s), and what it made.
fn timed<T>(work: impl FnOnce() -> T) -> (f64, T) {
    let start = Instant::now();
    let made = work();
    (start.elapsed().as_secs_f64(), made)
}

/// The vector whose coordinates are those numbers.
fn coordinates(of: impl Fn(usize) -> f64) -> DVec3 {
    DVec3::from_array([0, 1, 2].map(of))
}

/// Times of a solve with the factor of the object's stiffness, least of some (ms): this crate's on all cores and on
/// one, and faer's on one, with the same order of elimination.
fn solves(object: &Object, is_isotropic: bool) -> [f64; 3] {
    let (nodes, rows) = (object.rest.len(), if is_isotropic { 1 } else { 3 });
    let entries = (0..nodes).flat_map(|node| {
        object.mechanics().unwrap().stiffness.row(node).filter(move |(other, _)| *other >= node).flat_map(
            move |(other, block)| {
                let at = (0..rows * rows).map(|k| (k / rows, k % rows));
                at.map(move |(a, b)| Triplet::new(rows * other + a, rows * node + b, block.row(b)[a]))
                    .filter(|entry| entry.row >= entry.col)
                    .collect::<Vec<_>>()
            },
        )
    });
    let matrix = SparseColMat::try_new_from_triplets(rows * nodes, rows * nodes, &entries.collect::<Vec<_>>()).unwrap();
    let of_node = |&node: &u32| (0..rows).map(move |a| rows * node as usize + a);
    let order: Vec<usize> = object.mechanics().unwrap().stiffness.ordering.iter().flat_map(of_node).collect();
    let mut rank = vec![0; order.len()];
    order.iter().enumerate().for_each(|(k, &row)| rank[row] = k);
    let ordering = SymmetricOrdering::Custom(PermRef::new_checked(&order, &rank, order.len()));
    let symbolic = factorize_symbolic_cholesky(matrix.symbolic(), Side::Lower, ordering, Default::default()).unwrap();
    let mut values = vec![0.0; symbolic.len_val()];
    let scratch = symbolic.factorize_numeric_llt_scratch::<f64>(Par::Seq, Default::default());
    symbolic
        .factorize_numeric_llt(
            &mut values,
            matrix.as_ref(),
            Side::Lower,
            Default::default(),
            Par::Seq,
            MemStack::new(&mut MemBuffer::new(scratch)),
            Default::default(),
        )
        .unwrap();
    let factor = LltRef::new(&symbolic, &values);
    let alone = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    let mut least = [f64::INFINITY; 3];
    for _ in 0..FRAMES {
        let mut vectors: Vec<DVec3> = (0..nodes).map(|k| DVec3::new(1e-4, 0.0, -1e-3 * (k % 7) as f64)).collect();
        let right = Mat::from_fn(rows * nodes, 3 / rows, |row, column| vectors[row / rows][row % rows + column]);
        let mut again = vectors.clone();
        least[0] = least[0].min(timed(|| object.mechanics().unwrap().factor.solve(&mut vectors)).0);
        least[1] = least[1].min(alone.install(|| timed(|| object.mechanics().unwrap().factor.solve(&mut again)).0));
        let mut solved = right.clone();
        let mut scratch = MemBuffer::new(symbolic.solve_in_place_scratch::<f64>(solved.ncols(), Par::Seq));
        let solve = || {
            factor.solve_in_place_with_conj(Conj::No, solved.as_mut(), Par::Seq, MemStack::new(&mut scratch));
        };
        least[2] = least[2].min(timed(solve).0);
        let error = |k: usize| (coordinates(|a| solved[(rows * k + a % rows, a / rows)]) - vectors[k]).length();
        let greatest = vectors.iter().map(|u| u.length()).fold(0.0, f64::max);
        assert!((0..nodes).all(|k| error(k) < 1e-9 * greatest), "the two solve different problems");
    }
    least.map(|time| 1e3 * time)
}

fn main() {
    println!("  nodes  springs    a solve [ms]: this crate's  on one thread  faer's on one thread");
    for rings in RINGS {
        for kind in [SpringKind::Isotropic, SpringKind::Axial] {
            let object = sphere(kind, rings);
            let [all, one, faer] = solves(&object, kind == SpringKind::Isotropic);
            let (nodes, kind) = (object.rest.len(), format!("{kind:?}"));
            println!("{nodes:7}  {kind:9}  {all:27.2}  {one:13.2}  {faer:20.2}");
        }
    }
    let effects = [
        ("dynamics", GraphicsEffects::default()),
        (
            "stiffening",
            GraphicsEffects { stiffening: Some(StiffeningSpec { factor: 4.0, strain: 0.05 }), ..Default::default() },
        ),
        ("quasi-static", GraphicsEffects { quasi_static: true, ..Default::default() }),
    ];
    println!(
        "body              nodes of K  effects       built [s]  set up [s]  factor [MB]  frame: least, median, 95 % [ms]"
    );
    let springs = RINGS.into_iter().flat_map(|rings| {
        [SpringKind::Isotropic, SpringKind::Axial]
            .map(|kind| (format!("{kind:?} springs"), timed(|| sphere(kind, rings))))
    });
    let solids = SOLIDS.into_iter().map(|divisions| ("elastic solid".to_owned(), timed(|| solid(divisions))));
    for (name, (built, object)) in springs.chain(solids) {
        let mechanics = object.mechanics().unwrap();
        let forces: Vec<DVec3> =
            (0..object.rest.len()).map(|k| DVec3::new(1e-4, 0.0, -1e-3 * (k % 7) as f64)).collect();
        let is_solid = !mechanics.attachment.is_identity();
        for (effect, effects) in effects.iter().filter(|(_, effects)| !is_solid || effects.stiffening.is_none()) {
            let (set_up, motion) = timed(|| ObjectMotion::new(&object, 1.0 / 60.0, effects));
            let mut motion = motion.unwrap();
            let step = |_| {
                let (cost, _) = timed(|| {
                    motion.step(&forces);
                    // What is drawn.
                    motion.nodes().map(|node| node.z).sum::<f64>()
                });
                1e3 * cost
            };
            let mut costs: Vec<f64> = (0..FRAMES).map(step).collect();
            costs.sort_by(f64::total_cmp);
            let (frame, median, late) = (costs[0], costs[FRAMES / 2], costs[FRAMES * 95 / 100]);
            let (nodes, megabytes) = (mechanics.moved.len(), mechanics.factor.bytes() as f64 * 1e-6);
            println!(
                "{name:17} {nodes:10}  {effect:12}  {built:9.2}  {set_up:10.2}  {megabytes:11.1}  {frame:12.2}, {median:6.1}, \
                 {late:7.1}"
            );
        }
    }
}
