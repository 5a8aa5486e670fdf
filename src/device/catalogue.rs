//! The kinds of devices, by the name that the command line gives them: `KIND` or `KIND:PLACE`.

use super::{
    Coordinates, Device, Guard, Hardware, Inverse3, JointDevice, Limits, LinearMap, Motion, Script, Simulated,
    SimulatedHand, TipDevice, Watchdog,
    serial::{TwoDiy, Version, WoodenHaptics, ports},
    vendor::{ForceDimension, LibraryFiles, OpenHaptics},
};
use crate::{
    Error, JointVector, error,
    names::counted,
    proxy::Chain,
    scene::{DeviceSpec, HandSpec, Rendering, Waypoint},
};
use serde::Serialize;
use std::{
    env, fmt,
    fs::{self, OpenOptions},
    io::ErrorKind,
    str::FromStr,
};

/// A kind of device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Haply 2DIY, third version.
    TwoDiy,
    /// Haply 2DIY, second version, of metal.
    TwoDiyV2,
    /// Haply Inverse3, through the maker's service.
    Inverse3,
    /// Force Dimension, through the maker's library.
    ForceDimension,
    /// 3D Systems Touch and Phantom, through the maker's library.
    Touch,
    /// WoodenHaptics with the firmware for Teensy 4.0.
    WoodenHaptics,
    /// A simulated one, which fails as its place says: `simulated:unplugged@1.5,silent@0.5-0.6`.
    Simulated,
}

/// Which device: its kind, and where it is if there may be several.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Address {
    /// Its kind.
    pub kind: Kind,
    /// A port, a library or an address; `None` for the first that is found.
    pub place: Option<String>,
}

/// Devices of a kind that this machine has.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Finding {
    /// Addresses that can be opened, as far as can be seen without opening them.
    pub places: Vec<String>,
    /// Missing parts, each with the remedy.
    pub missing: Vec<String>,
}

impl Kind {
    /// All of them.
    pub const ALL: [Self; 7] = [
        Self::TwoDiy,
        Self::TwoDiyV2,
        Self::WoodenHaptics,
        Self::Inverse3,
        Self::ForceDimension,
        Self::Touch,
        Self::Simulated,
    ];

    /// Its name on the command line, and what it is, for people.
    fn words(self) -> [&'static str; 2] {
        match self {
            Self::TwoDiy => ["2diy", "Haply 2DIY, third version, on a serial line"],
            Self::TwoDiyV2 => ["2diy-v2", "Haply 2DIY, second version (metal), on a serial line"],
            Self::WoodenHaptics => ["woodenhaptics", "WoodenHaptics on a serial line"],
            Self::Inverse3 => ["inverse3", "Haply Inverse3, through the service of Inverse SDK 3.5"],
            Self::ForceDimension => ["force-dimension", "Force Dimension omega, delta, sigma, lambda, through libdrd"],
            Self::Touch => ["touch", "3D Systems Touch, Phantom, through libHD (OpenHaptics)"],
            Self::Simulated => ["simulated", "a simulated device that can be told to fail; no motor turns"],
        }
    }

    /// Returns its name on the command line.
    #[must_use]
    pub fn name(self) -> &'static str {
        self.words()[0]
    }

    /// Returns what it is, for people.
    #[must_use]
    pub fn title(self) -> &'static str {
        self.words()[1]
    }

    /// Looks what this machine has of it, without opening a device.
    #[must_use]
    pub fn find(self) -> Finding {
        match self {
            Self::TwoDiy | Self::TwoDiyV2 | Self::WoodenHaptics => self.on_a_line(),
            Self::Inverse3 => service(),
            Self::ForceDimension => self.behind(&ForceDimension::library()),
            Self::Touch => self.behind(&OpenHaptics::library()),
            Self::Simulated => Finding { places: vec![self.name().into()], missing: Vec::new() },
        }
    }

    /// Looks for a maker's library: what is behind it shows when it is opened.
    fn behind(self, library: &LibraryFiles) -> Finding {
        match library.found() {
            Some(path) => {
                Finding { places: vec![format!("{}:{}", self.name(), path.display())], missing: self.surroundings() }
            }
            None => Finding { places: Vec::new(), missing: vec![library.remedy.to_owned()] },
        }
    }

    /// Looks for what a maker's library needs beside itself.
    fn surroundings(self) -> Vec<String> {
        let mut missing = Vec::new();
        if self == Self::ForceDimension && cfg!(target_os = "linux") && !has_udev_rule("1451") {
            let rule = r#"SUBSYSTEM=="usb", ATTR{idVendor}=="1451", MODE="0666""#;
            missing.push(format!(
                "no udev rule lets users open USB devices of vendor 1451: put {rule} into \
                 /etc/udev/rules.d/60-force-dimension.rules and plug the device in again"
            ));
        }
        if self == Self::Touch && cfg!(target_os = "linux") && env::var_os("GTDD_HOME").is_none() {
            missing.push(
                "GTDD_HOME is not set: set it as the guide of the Touch device driver says (/usr/share/3DSystems)"
                    .into(),
            );
        }
        missing
    }

    /// Looks for serial lines: a line does not tell what is behind it.
    fn on_a_line(self) -> Finding {
        let ports = ports();
        let mut missing = Vec::new();
        if ports.is_empty() {
            missing.push("no serial line of a USB device: plug it in, and switch its power on".to_owned());
        }
        for port in &ports {
            if OpenOptions::new()
                .read(true)
                .write(true)
                .open(port)
                .is_err_and(|error| error.kind() == ErrorKind::PermissionDenied)
            {
                missing.push(format!(
                    "{port} may not be opened: join its group (usermod -aG dialout $USER), log in again"
                ));
            }
        }
        Finding { places: ports.iter().map(|port| format!("{}:{port}", self.name())).collect(), missing }
    }
}

/// Returns whether a udev rule of this machine names USB devices of `vendor`.
fn has_udev_rule(vendor: &str) -> bool {
    let folders = ["/etc/udev/rules.d", "/lib/udev/rules.d", "/usr/lib/udev/rules.d"];
    let files = folders.iter().filter_map(|folder| fs::read_dir(folder).ok()).flatten().flatten();
    let names = |text: &str| text.contains("idVendor") && text.contains(vendor);
    files.filter_map(|file| fs::read_to_string(file.path()).ok()).any(|text| names(&text))
}

/// Looks for the service of the Inverse3.
fn service() -> Finding {
    let address = Inverse3::address();
    if Inverse3::is_there() {
        return Finding { places: vec![format!("inverse3:{address}")], missing: Vec::new() };
    }
    let missing = format!("no service at {address}: install and start the Haply Inverse service (Inverse SDK 3.5)");
    Finding { places: Vec::new(), missing: vec![missing] }
}

impl FromStr for Address {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        let (name, place) = text.split_once(':').map_or((text, None), |(name, place)| (name, Some(place)));
        let kind = Kind::ALL.into_iter().find(|kind| kind.name() == name);
        let kind = kind.ok_or_else(|| {
            let known = known();
            error!(
                "\"{text}\" is no device: give one of {known}, or KIND:PLACE; `haptize device list` shows what is there"
            )
        })?;
        Ok(Self { kind, place: place.filter(|place| !place.is_empty()).map(str::to_owned) })
    }
}

impl Address {
    /// Returns what its user should know before the motors of a device with `limits` go on.
    #[must_use]
    pub fn caution(&self, limits: &Limits) -> Option<&'static str> {
        (limits.watchdog == Watchdog::None && self.kind != Kind::Simulated).then_some(
            "this device has no watchdog: if haptize is killed the last torque stays on; keep its power switch at hand",
        )
    }
}

impl fmt::Display for Address {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.place {
            Some(place) => write!(f, "{}:{place}", self.kind.name()),
            None => write!(f, "{}", self.kind.name()),
        }
    }
}

fn known() -> String {
    Kind::ALL.map(Kind::name).join(", ")
}

/// Opens the device at `address`, its motors off. The simulated one is the arm of a scene with such a `[device]`, held
/// by the hand, or without a scene held at rest.
///
/// # Errors
/// Says what is missing and what to do.
pub fn open(address: &Address, held: Option<(SimulatedHand, &DeviceSpec)>) -> Result<Box<dyn Hardware>, Error> {
    let failed = |what: String| error!("the device {address} cannot be opened: {what}");
    let line = || match (&address.place, ports().as_slice()) {
        (Some(place), _) => Ok(place.clone()),
        (None, [port]) => Ok(port.clone()),
        (None, []) => Err(failed("no serial line of a USB device is there: plug it in and switch its power on".into())),
        (None, several) => {
            Err(failed(format!("name one of several lines, as in {}:{}", address.kind.name(), several[0])))
        }
    };
    match address.kind {
        Kind::TwoDiy => Ok(Box::new(TwoDiy::open(&line()?, Version::V3).map_err(failed)?)),
        Kind::TwoDiyV2 => Ok(Box::new(TwoDiy::open(&line()?, Version::V2).map_err(failed)?)),
        Kind::WoodenHaptics => Ok(Box::new(WoodenHaptics::open(&line()?).map_err(failed)?)),
        Kind::Inverse3 => Ok(Box::new(Inverse3::open(address.place.as_deref()).map_err(failed)?)),
        Kind::ForceDimension => Ok(Box::new(ForceDimension::open(address.place.as_deref()).map_err(failed)?)),
        Kind::Touch => Ok(Box::new(OpenHaptics::open(address.place.as_deref()).map_err(failed)?)),
        Kind::Simulated => {
            let place = address.place.as_deref().unwrap_or_default();
            let scripts: Result<Vec<Script>, String> =
                place.split(',').filter(|script| !script.is_empty()).map(str::parse).collect();
            let (hand, spec) = match held {
                Some((hand, spec)) => (hand, Some(spec)),
                None => (resting_hand()?, None),
            };
            let joints = hand.joints();
            let map = match spec {
                Some(spec) => map(spec, Coordinates::Joints(joints), address)?,
                None => LinearMap::identity(joints),
            };
            let effort = JointVector::from_slice(&vec![SIMULATED_TORQUE; joints]);
            let limits = Limits { effort, watchdog: Watchdog::None };
            let simulated = Simulated::new(hand, Coordinates::Joints(joints), limits, scripts.map_err(failed)?);
            Ok(Box::new(simulated.mapped(map)))
        }
    }
}

/// A hand that holds a device of three joints where it is.
fn resting_hand() -> Result<SimulatedHand, Error> {
    let all = |x: f64| JointVector::from_slice(&[x; SIMULATED_JOINTS]);
    let motion = Motion::through(&[Waypoint { time: 0.0, q: all(0.0) }], SIMULATED_JOINTS);
    let hand = HandSpec { stiffness: all(20.0), damping: all(0.4), inertia: all(2e-3) };
    let held = motion.map(|motion| SimulatedHand::holding(&hand, &all(1e-3), &all(0.03), motion));
    held?
}

/// Joints of the simulated device where no scene says how many.
const SIMULATED_JOINTS: usize = 3;

/// Maximum torque of each joint of the simulated device (N m): that of a desktop device.
const SIMULATED_TORQUE: f64 = 1.5;

/// Makes of the device behind `guard` one in the joints of `chain`, as `[device]` in the scene says, and switches its
/// motors on.
///
/// # Errors
/// When device and scene do not fit, or the device refuses.
pub fn attach(guard: Guard, address: &Address, chain: Chain, scene: &Rendering) -> Result<Box<dyn Device>, Error> {
    if guard.coordinates() != Coordinates::Tip {
        return Ok(Box::new(attach_joints(guard, address, chain.degrees_of_freedom(), &scene.device)?));
    }
    if chain.nodes.is_empty() {
        return Err("the scene's arm has no contact node that the device's tip could lead: give it one".into());
    }
    let (guard, map) = mapped(guard, address, &scene.device)?;
    Ok(Box::new(TipDevice::new(guard, map, chain, &scene.device, &scene.haptics)))
}

/// Makes of the joint-true device behind `guard` one of `joints` joints, as `spec` says, and switches its motors on.
///
/// # Errors
/// When the device is Cartesian, does not fit, or refuses.
pub fn attach_joints(guard: Guard, address: &Address, joints: usize, spec: &DeviceSpec) -> Result<JointDevice, Error> {
    match guard.coordinates() {
        Coordinates::Tip => {
            Err("the device measures where its tip is, not its joints: a scan needs a joint-true one".into())
        }
        Coordinates::Joints(device) if device != joints => Err(error!(
            "the device has {} and the scene's arm {joints}: take the device that the scene is for",
            counted(device, ["joint", "joints"])
        )),
        Coordinates::Joints(_) => mapped(guard, address, spec).map(|(guard, map)| JointDevice::new(guard, map)),
    }
}

/// The map from the `coordinates` of the device at `address` to the scene's, as `spec` says.
fn map(spec: &DeviceSpec, coordinates: Coordinates, address: &Address) -> Result<LinearMap, Error> {
    let count = coordinates.count();
    let offset = spec.offset.unwrap_or(JointVector::zeros(count));
    let of_scene = |error: Error| error.within("[device] in the scene");
    Ok(match &spec.map {
        Some(rows) => LinearMap::new(rows, &offset, count).map_err(of_scene)?,
        None if coordinates != Coordinates::Tip && address.kind != Kind::Simulated => {
            return Err(error!(
                "the scene does not say how the joints of {address} drive its arm: give [device] a map, q = map * \
                 (coordinates of the device), with one row for each joint of the scene, or take a scene that has one"
            ));
        }
        None => LinearMap::identity(count).moved(&offset).map_err(of_scene)?,
    })
}

/// Limits the device as `spec` says, and switches its motors on; with the map to the scene's coordinates.
fn mapped(mut guard: Guard, address: &Address, spec: &DeviceSpec) -> Result<(Guard, LinearMap), Error> {
    if let Some(limit) = &spec.effort_limit {
        guard.limit_each(limit)?;
    }
    let map = map(spec, guard.coordinates(), address)?;
    guard.enable().map_err(|halt| error!("the device {address} cannot be used: {halt}"))?;
    Ok((guard, map))
}
