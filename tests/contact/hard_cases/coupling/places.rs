//! Places where the dataset or the arm fails: cells absent or unconverged, configurations that are singular.

use super::{CaseResult, DESKTOP, Failure, Setting, Watch, noise, on_time, open, presses, seconds, way};
use haptize::{contact::Status, dataset::Dataset, fixtures::worlds::half_space, render::setup::Setup};

pub(super) fn bad_cells(setting: &Setting) -> Result<Vec<CaseResult>, Failure> {
    let seconds = seconds(setting, 2.0, 60.0);
    let setup = open(3, DESKTOP)?;
    let mut watch = Watch::new(&setup.scene.haptics);
    for share in [0.1, 0.5] {
        let setup = Setup::new(&spoilt(half_space(3, DESKTOP), share))?;
        on_time(&setup, &mut presses(&setup, seconds)?, seconds, &mut watch)?;
    }
    Ok(watch.outcomes(
        "bad cells under the proxy",
        "10 and 50 % of the points absent, as many unconverged and wrong by half",
    ))
}

/// `data` with `share` of its points in contact absent, and as many unconverged.
fn spoilt(data: Dataset, share: f64) -> Dataset {
    let joints = data.grid.joints();
    let (mut status, mut torque) = (data.status.to_vec(), data.torque.to_vec());
    for point in 0..data.grid.points() {
        if data.status(point) == Status::Contact && noise(point) < share {
            status[point] = Status::Outside as u8;
        } else if data.status(point) == Status::Contact && noise(3 * point) < share {
            status[point] = Status::Unconverged as u8;
            for (joint, tau) in torque[point * joints..(point + 1) * joints].iter_mut().enumerate() {
                *tau *= 0.5 + noise(7 * point + joint);
            }
        }
    }
    Dataset { status: status.into(), torque: torque.into(), ..data }
}

pub(super) fn singular(setting: &Setting) -> Result<Vec<CaseResult>, Failure> {
    let seconds = seconds(setting, 2.0, 60.0);
    let mut outcomes = Vec::new();
    for joints in [3, 6] {
        // Stretched out at q = 0, where all links are in line, and through it at several rad/s.
        let setup = open(joints, &format!("{DESKTOP}proxy_inertia = \"configuration\"\n"))?;
        let mut watch = Watch::new(&setup.scene.haptics);
        let places: Vec<(f64, f64)> =
            (0..=(4.0 * seconds) as usize).map(|k| (0.25 * k as f64, if k % 2 == 0 { -0.4 } else { 0.2 })).collect();
        on_time(&setup, &mut way(&setup, &places)?, seconds, &mut watch)?;
        let varied = format!("{joints} joints through the stretched arm, inertia of each configuration");
        outcomes.extend(watch.outcomes("singular arm", &varied));
    }
    Ok(outcomes)
}
