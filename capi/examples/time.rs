//! The cost of one look-up and of many from Rust, at the same configurations as time.c and time.py: see
//! `benches/bindings.sh`.
//!
//!     cargo run -p haptize-capi --profile dist --example time -- DATASET

use haptize::{dataset::Dataset, render::setup};
use std::{error::Error, hint::black_box, path::Path, time::Instant};

const PLACES: usize = 4096;
const BLOCKS: usize = 500;
const MANY: usize = 1_000_000;

fn main() -> Result<(), Box<dyn Error>> {
    let path = std::env::args().nth(1).ok_or("name a dataset")?;
    let dataset = Dataset::open(Path::new(&path))?;
    let field = setup::field(&dataset, None)?;
    let joints = field.joints();
    // The generator of C and POSIX's example, so that all languages draw the same places.
    let mut state = 1_u32;
    let mut draw = || {
        state = state.wrapping_mul(1_103_515_245).wrapping_add(12_345);
        f64::from(state >> 16 & 0x7fff) / 32_768.0
    };
    let mut q = Vec::with_capacity(MANY * joints);
    for _ in 0..MANY {
        for axis in &dataset.grid.axes {
            let (least, greatest) = (axis.coordinate(0), axis.coordinate(axis.count - 1));
            q.push(least + (greatest - least) * draw());
        }
    }
    let mut blocks: Vec<f64> = (0..BLOCKS)
        .map(|_| {
            let start = Instant::now();
            q[..PLACES * joints].chunks_exact(joints).for_each(|q| {
                black_box(field.sample(black_box(q)));
            });
            start.elapsed().as_nanos() as f64 / PLACES as f64
        })
        .collect();
    blocks.sort_by(f64::total_cmp);
    let mut tau = vec![0.0; q.len()];
    field.torques(&q, &mut tau, None)?;
    let start = Instant::now();
    field.torques(&q, &mut tau, None)?;
    let rate = MANY as f64 / start.elapsed().as_secs_f64();
    println!("Rust    {:6.0} ns a look-up, {:6.2} million a second in a batch", blocks[BLOCKS / 2], rate / 1e6);
    Ok(())
}
