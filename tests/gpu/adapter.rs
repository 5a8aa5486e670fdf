//! Which adapter is opened, and what is said where there is none such.

use haptize::gpu::{AdapterChoice, Context, GpuError, adapters};

#[test]
fn asking_for_hardware_names_what_was_found_instead() {
    let hardware = adapters().iter().any(|adapter| adapter.hardware);
    match Context::open(AdapterChoice::Hardware) {
        Ok(context) => assert!(hardware && context.adapter().hardware),
        Err(GpuError::NoAdapter { found, .. }) => {
            assert!(!hardware);
            assert!(adapters().iter().all(|adapter| found.contains(&adapter.name)), "{found}");
        }
        Err(other) => panic!("{other}"),
    }
}
