//! Gridization beside SciPy's LinearNDInterpolator, in one run: time, memory, and whether the values agree.
//!
//! `bash benches/peers/setup.sh` once, then `cargo bench --bench gridize`. Without SciPy the peer is skipped, and said
//! so. Arrangements: random points, an exact grid (every cell cospherical), scan lines.

use haptize::{
    contact::Status,
    dataset::JointLabel,
    gridize::{GridizeOptions, Samples, gridize},
};
use std::{path::Path, process::Command, time::Instant};

const SAMPLES: usize = 100_000;
const STEP: f64 = 0.01;

fn main() {
    println!("{SAMPLES} samples, 3 joints, about 10^6 grid points\n");
    println!(
        "arrangement    haptize s   MiB    SciPy s (build + evaluate)   MiB   ratio   differ > 1e-9   outside differ"
    );
    for (name, point) in [("random", random as fn(usize) -> [f64; 3]), ("exact grid", lattice), ("scan lines", lines)] {
        compare(name, point);
    }
}

fn compare(name: &str, point: fn(usize) -> [f64; 3]) {
    let points: Vec<[f64; 3]> = (0..SAMPLES).map(point).collect();
    let tau: Vec<f64> = points.iter().map(|q| (5.0 * q[0]).sin() * (4.0 * q[1]).cos() + q[2] * q[2]).collect();
    let samples = Samples {
        joints: (0..3).map(|k| JointLabel { name: format!("q{k}"), unit: "rad".to_owned() }).collect(),
        configurations: points.concat(),
        torques: tau.iter().flat_map(|&tau| [tau; 3]).collect(),
        deviations: None,
    };
    let options = GridizeOptions { epsilon: Some(0.0), within: f64::INFINITY, ..GridizeOptions::new(vec![STEP]) };
    let start = Instant::now();
    let Ok((dataset, _)) = gridize(&samples, &options) else { return println!("{name}: refused") };
    let seconds = start.elapsed().as_secs_f64();
    let ours: Vec<f64> = (0..dataset.grid.points())
        .map(|p| if dataset.status(p) == Status::Outside { f64::NAN } else { dataset.torque(p)[0] })
        .collect();
    print!("{name:<13} {seconds:>9.2} {:>7.0}", peak_mib());
    match peer(&points, &tau) {
        Ok((theirs, report)) if theirs.len() == ours.len() => {
            let number = |key: &str| report[key].as_f64().unwrap_or(f64::NAN);
            let total = number("build") + number("evaluate");
            let differ = ours.iter().zip(&theirs).filter(|(a, b)| (*a - *b).abs() > 1e-9).count();
            let outside = ours.iter().zip(&theirs).filter(|(a, b)| a.is_nan() != b.is_nan()).count();
            println!(
                "    {total:>7.2} ({:.2} + {:.2}) {:>14.0} {:>7.1} {differ:>15} {outside:>16}",
                number("build"),
                number("evaluate"),
                number("peak_mib"),
                total / seconds
            );
        }
        Ok((theirs, _)) => println!("    SciPy's grid has {} points, ours {}", theirs.len(), ours.len()),
        Err(reason) => println!("    SciPy skipped: {reason} (bash benches/peers/setup.sh)"),
    }
}

/// SciPy's torques and its report.
fn peer(points: &[[f64; 3]], tau: &[f64]) -> Result<(Vec<f64>, serde_json::Value), String> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let folder = tempfile::tempdir().map_err(|e| e.to_string())?;
    let (input, result) = (folder.path().join("samples.f64"), folder.path().join("result.f64"));
    let rows: Vec<f64> = points.iter().zip(tau).flat_map(|(q, &tau)| [q[0], q[1], q[2], tau]).collect();
    std::fs::write(&input, bytemuck::cast_slice(&rows)).map_err(|e| e.to_string())?;
    let output = Command::new(root.join("target/peers/bin/python"))
        .arg(root.join("benches/peers/gridize_scipy.py"))
        .arg(&input)
        .args(["3", &STEP.to_string()])
        .arg(&result)
        .output()
        .map_err(|e| e.to_string())?;
    if !output.status.success() {
        return Err(String::from_utf8_lossy(&output.stderr).lines().last().unwrap_or_default().to_owned());
    }
    let report = serde_json::from_slice(&output.stdout).map_err(|e| e.to_string())?;
    let bytes = std::fs::read(&result).map_err(|e| e.to_string())?;
    Ok((bytes.chunks_exact(8).map(|b| f64::from_le_bytes(b.try_into().unwrap_or_default())).collect(), report))
}

/// Peak memory of this process so far (MiB); zero where the system does not tell.
fn peak_mib() -> f64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    line.and_then(|l| l.trim().trim_end_matches("kB").trim().parse::<f64>().ok()).unwrap_or(0.0) / 1024.0
}

fn random(i: usize) -> [f64; 3] {
    // Weyl sequence with a hash: equidistributed but in general position.
    let hash = |k: u64| {
        let mut z = (i as u64 * 3 + k).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    };
    [hash(0), hash(1), hash(2)]
}

fn lattice(i: usize) -> [f64; 3] {
    let side = 47;
    [i % side, i / side % side, i / side / side].map(|k| k as f64 / 46.0)
}

fn lines(i: usize) -> [f64; 3] {
    [(i % 1000) as f64 / 999.0, (i / 1000 % 10) as f64 / 9.0, (i / 10_000) as f64 / 9.0]
}
