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

/// Software Vulkan found twice: two adapters that differ in nothing but their number.
#[cfg(target_os = "linux")]
mod twice {
    use crate::common::program::command;
    use haptize::dataset::Dataset;
    use std::{
        path::{Path, PathBuf},
        process::Output,
    };

    /// The file by which the Vulkan loader finds lavapipe.
    fn lavapipe() -> PathBuf {
        let named = std::env::var_os("VK_DRIVER_FILES").map(PathBuf::from);
        let folders = ["/usr/share", "/usr/local/share", "/etc"].map(|folder| Path::new(folder).join("vulkan/icd.d"));
        let found = folders.iter().filter_map(|folder| folder.read_dir().ok()).flatten().flatten().map(|it| it.path());
        let is_lavapipe =
            |path: &PathBuf| path.file_name().is_some_and(|name| name.to_string_lossy().starts_with("lvp_icd"));
        let place = named.into_iter().chain(found).find(is_lavapipe);
        place.unwrap_or_else(|| panic!("lavapipe is missing: apt-get install mesa-vulkan-drivers"))
    }

    /// The program in `folder`, for which there are two adapters, of which the environment names some.
    fn program(folder: &Path, named: &str, arguments: &[&str]) -> Output {
        let files = ["one.json", "two.json"].map(|name| folder.join(name));
        files.iter().for_each(|file| assert!(std::fs::copy(lavapipe(), file).unwrap() > 0));
        let mut command = command(folder, arguments);
        command.env("WGPU_ADAPTER_NAME", named);
        for variable in ["VK_DRIVER_FILES", "VK_ICD_FILENAMES"] {
            command.env(variable, std::env::join_paths(&files).unwrap());
        }
        command.output().unwrap()
    }

    fn json(output: &Output) -> serde_json::Value {
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        serde_json::from_slice(&output.stdout).unwrap()
    }

    #[test]
    fn doctor_tells_equal_adapters_apart() {
        let folder = tempfile::tempdir().unwrap();
        let addresses = |named| -> Vec<String> {
            let report = json(&program(folder.path(), named, &["doctor", "--json"]));
            let adapters = report["adapters"].as_array().unwrap();
            assert!(adapters.iter().all(|adapter| adapter["solves"] == true));
            adapters.iter().map(|adapter| adapter["address"].as_str().unwrap().to_owned()).collect()
        };
        assert_eq!(addresses(""), ["#1", "#2"]);
        assert_eq!(addresses("#2"), ["#2"]);
        assert_eq!(addresses("#2, #1"), ["#1", "#2"]);
        let said = program(folder.path(), "", &["doctor"]).stdout;
        let said = String::from_utf8(said).unwrap();
        assert!(said.contains(" at #2") && said.contains("all solve"), "{said}");
    }

    #[test]
    fn a_bake_on_two_adapters_has_the_bits_of_one() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("small.toml"), include_str!("../../scenes/small.toml")).unwrap();
        let bake = |named, file: &str| {
            let arguments = [
                "bake",
                "small.toml",
                "--backend",
                "gpu",
                "--law",
                "rest",
                "--measure-error",
                "0",
                "--json",
                "-o",
                file,
            ];
            let report = json(&program(folder.path(), named, &arguments));
            let dataset = Dataset::open(&folder.path().join(file)).unwrap();
            assert!(report["contact_points"].as_u64().unwrap() > 0);
            assert_eq!(report["adapter"], dataset.provenance.adapter.as_str());
            dataset
        };
        let (both, one) = (bake("", "both.haptize"), bake("#2", "one.haptize"));
        assert_eq!(both.provenance.adapter, format!("2 x {}", one.provenance.adapter));
        let bits = |dataset: &Dataset| -> Vec<Vec<u8>> {
            let contacts = dataset.contacts.as_ref().unwrap();
            vec![
                bytemuck::cast_slice(&dataset.torque).to_vec(),
                bytemuck::cast_slice(dataset.energy.as_ref().unwrap()).to_vec(),
                bytemuck::cast_slice(dataset.gap.as_ref().unwrap()).to_vec(),
                dataset.status.to_vec(),
                bytemuck::cast_slice(&contacts.nodes).to_vec(),
                bytemuck::cast_slice(&contacts.forces).to_vec(),
            ]
        };
        assert!(bits(&both) == bits(&one));
    }

    #[test]
    fn one_name_in_vain_is_an_error_beside_one_that_is_there() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("small.toml"), include_str!("../../scenes/small.toml")).unwrap();
        for backend in ["auto", "gpu"] {
            let output =
                program(folder.path(), "#1,#3", &["bake", "small.toml", "--law", "rest", "--backend", backend]);
            let said = String::from_utf8(output.stderr).unwrap();
            assert!(!output.status.success() && said.contains("\"#3\"") && !said.contains("\"#1\""), "{said}");
        }
        let said = String::from_utf8(program(folder.path(), "#1,#3", &["doctor"]).stdout).unwrap();
        assert!(said.contains("none is called \"#3\"") && said.contains(" at #1"), "{said}");
        assert!(said.contains("haptize bake takes   none\n"), "{said}");
    }
}
