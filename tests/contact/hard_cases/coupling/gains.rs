//! Gains at their bounds and far beyond, with and without what takes the energy that they create.

use super::{Bound, CaseResult, DESKTOP, Failure, Setting, Watch, on_time, open, presses, seconds, way};
use haptize::{
    fixtures::worlds::block,
    render::{
        haptic::GREATEST_GIVEN_ENERGY,
        passivity::{greatest_slope, greatest_stiffness},
        setup::Setup,
    },
};

/// The half space felt with Ks and Kvc at `factor` times their bounds, and with what `others` name.
fn tuned(factor: f64, others: &str) -> Result<Setup, Failure> {
    let bound = open(3, DESKTOP)?.scene.haptics;
    let (slope, stiffness) = (factor * greatest_slope(&bound, 0), factor * greatest_stiffness(&bound, 0));
    open(
        3,
        &format!(
            "[haptics]
boundary_slope = {slope}
proxy_damping = 0.02
coupling_stiffness = {stiffness}
coupling_damping = 0.01
device_damping = 0.02
{others}
"
        ),
    )
}

/// A tenth of the bounds, the bounds, and far beyond.
const FACTORS: [(f64, &str); 3] =
    [(0.1, "a tenth of Ks and Kvc"), (1.0, "Ks and Kvc at the bound"), (10.0, "ten times Ks and Kvc")];

pub(super) fn about_their_bound(setting: &Setting) -> Result<Vec<CaseResult>, Failure> {
    let seconds = seconds(setting, 2.0, 60.0);
    let mut outcomes = Vec::new();
    for (factor, varied) in FACTORS {
        let mut watch = Watch::new(&open(3, DESKTOP)?.scene.haptics);
        for others in ["", "passivity_control = true"] {
            let setup = tuned(factor, others)?;
            on_time(&setup, &mut presses(&setup, seconds)?, seconds, &mut watch)?;
        }
        outcomes.extend(watch.outcomes("gains about their bound", &format!("{varied}, with and without control")));
    }
    Ok(outcomes)
}

/// The controller feeds from the leak, which a torque that is exactly a gradient has from sampling only.
pub(super) fn control_over_a_potential(setting: &Setting) -> Result<Vec<CaseResult>, Failure> {
    let seconds = seconds(setting, 2.0, 60.0);
    let potential = "interpolation = \"potential\"\npassivity_control = true\n";
    let mut outcomes = Vec::new();
    let mut judge = |watch: &Watch, varied: &str| {
        outcomes.extend(watch.outcomes("control over a potential", varied));
        outcomes.push(CaseResult {
            measure: "energy created at the object's port and not taken by the controller [J]".into(),
            worst: watch.created,
            bound: Bound::AtMost(GREATEST_GIVEN_ENERGY),
            ..outcomes[outcomes.len() - 1].clone()
        });
    };
    for (factor, varied) in FACTORS {
        let setup = tuned(factor, potential)?;
        let mut watch = Watch::new(&setup.scene.haptics);
        on_time(&setup, &mut presses(&setup, seconds)?, seconds, &mut watch)?;
        judge(&watch, varied);
    }
    let effects = "[haptics]\nfriction = { coefficient = 0.4 }\nfour_channel = {}\n";
    let setup = Setup::new(&block(&format!("{effects}{potential}")))?;
    let mut watch = Watch::new(&setup.scene.haptics);
    let places: Vec<(f64, f64)> =
        (0..=(2.0 * seconds) as usize).map(|k| (0.5 * k as f64, if k % 2 == 0 { -0.005 } else { 0.015 })).collect();
    on_time(&setup, &mut way(&setup, &places)?, seconds, &mut watch)?;
    judge(&watch, "with friction and four channels, sliding and pressing");
    Ok(outcomes)
}
