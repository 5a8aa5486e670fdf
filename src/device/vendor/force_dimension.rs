//! Force Dimension omega, delta, sigma, lambda, and other devices of its library: Cartesian, positions (m) and forces
//! (N).
//!
//! The maker's library `libdrd` is opened at run time. Return codes: 0; -1 an error, which `dhdErrorGetLast` numbers; 1
//! from a reading, that it came too soon after the last and is old (the time guard); 2 from a command, that the motors
//! are saturated and the force was scaled down. The device's watchdog is set to [`WATCHDOG`]: it lets go when no
//! command has come for that long. Its own thresholds, of speed above all, are left as they are, and so is its
//! compensation of gravity.
//!
//! Source: the function signatures and constants that public bindings of the SDK from 3.16 on name. Not tried on
//! hardware.

use super::{LibraryFiles, files, functions};
use crate::{
    JointVector,
    device::{Command, Coordinates, Halt, Hardware, Limits, Measurement, Watchdog},
};
use std::{
    env,
    ffi::CStr,
    os::raw::{c_char, c_int, c_uchar},
    path::PathBuf,
};

functions! {
    /// The functions of `libdrd` that are used.
    struct Functions {
        dhdOpen: fn() -> c_int;
        dhdClose: fn(c_char) -> c_int;
        dhdGetSystemName: fn(c_char) -> *const c_char;
        dhdErrorGetLast: fn() -> c_int;
        dhdErrorGetLastStr: fn() -> *const c_char;
        dhdGetPosition: fn(*mut f64, *mut f64, *mut f64, c_char) -> c_int;
        dhdEnableForce: fn(c_uchar, c_char) -> c_int;
        dhdSetForceAndTorqueAndGripperForce: fn(f64, f64, f64, f64, f64, f64, f64, c_char) -> c_int;
        dhdSetMaxForce: fn(f64, c_char) -> c_int;
        dhdSetWatchdog: fn(c_uchar, c_char) -> c_int;
        dhdGetStatus: fn(*mut c_int, c_char) -> c_int;
        dhdStop: fn(c_char) -> c_int;
    }
}

/// Maximum force (N): below that of every device of the library, of which the Falcon's is the least.
const MOST_FORCE: f64 = 8.0;

/// Time after the last command at which the device lets go (s).
pub const WATCHDOG: f64 = 0.01;

/// The watchdog counts in these (s).
const WATCHDOG_UNIT: f64 = 125e-6;

/// Return codes.
const TIME_GUARD: c_int = 1;
const SATURATED: c_int = 2;

/// Error of a connection that is gone, and of a device that is not there.
const ERROR_COMMUNICATION: c_int = 2;
const ERROR_NO_DEVICE: c_int = 5;

/// Numbers of a status, with room for those of newer versions, and the one that says whether forces are on.
const STATUS: usize = 32;
const STATUS_FORCE: usize = 5;

/// Ticks between two looks at the status.
const STATUS_TICKS: u32 = 10;

/// An open device.
pub struct ForceDimension {
    functions: Functions,
    id: c_char,
    name: String,
    watchdog: Watchdog,
    enabled: bool,
    latest: Measurement,
    ticks: u32,
}

impl ForceDimension {
    /// Returns where the library may be.
    #[must_use]
    pub fn library() -> LibraryFiles {
        let mut folders: Vec<PathBuf> = Vec::new();
        if let Some(sdk) = env::var_os("FDSDK") {
            let sdk = PathBuf::from(sdk);
            folders.push(sdk.join(format!("lib/release/lin-{}-gcc", env::consts::ARCH)));
            folders.push(sdk.join("bin"));
        }
        if let Some(home) = env::var_os("HOME") {
            folders.push(PathBuf::from(home).join(".local/lib"));
        }
        folders.push("/usr/local/lib".into());
        let name = if cfg!(windows) {
            "drd64.dll"
        } else if cfg!(target_os = "macos") {
            "libdrd.dylib"
        } else {
            "libdrd.so"
        };
        let remedy = "the library libdrd is not found: install the Force Dimension SDK (3.16 or newer) and set FDSDK \
                      to its folder, or name the library as in force-dimension:/PATH/libdrd.so.3";
        LibraryFiles { candidates: files(&folders, name), remedy }
    }

    /// Opens the first device, its forces off, through the library at `place` or where it is found.
    ///
    /// # Errors
    /// In words, with the remedy.
    pub fn open(place: Option<&str>) -> Result<Self, String> {
        let library = Self::library().open(place)?;
        // SAFETY: the signatures are those of the maker's SDK from 3.16 on.
        let functions = unsafe { Functions::load(library) }?;
        // SAFETY: the function takes nothing.
        let opened = unsafe { (functions.dhdOpen)() };
        let Some(id) = c_char::try_from(opened).ok().filter(|id| *id >= 0) else {
            // SAFETY: the text is the library's own and lives as long as it.
            let reason = unsafe { text((functions.dhdErrorGetLastStr)()) };
            return Err(format!(
                "no device opens ({reason}): plug it in, switch its power on, calibrate it with the maker's tool, and \
                 let users open its USB device (a udev rule for vendor 1451)"
            ));
        };
        // SAFETY: `id` is that of the device that was opened; the text lives as long as the library.
        let name = unsafe { text((functions.dhdGetSystemName)(id)) };
        let latest = Measurement::plain(JointVector::zeros(3), f64::INFINITY);
        let mut device =
            Self { functions, id, name, watchdog: Watchdog::After(WATCHDOG), enabled: false, latest, ticks: 0 };
        // SAFETY: the function takes numbers.
        if unsafe { (device.functions.dhdSetWatchdog)((WATCHDOG / WATCHDOG_UNIT) as c_uchar, id) } < 0 {
            device.watchdog = Watchdog::None;
        }
        Ok(device)
    }

    /// Returns the reason for the code -1.
    fn failure(&self) -> Halt {
        // SAFETY: the function takes nothing.
        match unsafe { (self.functions.dhdErrorGetLast)() } {
            ERROR_COMMUNICATION | ERROR_NO_DEVICE => Halt::Unplugged,
            other => Halt::DeviceError(other),
        }
    }
}

impl Hardware for ForceDimension {
    fn description(&self) -> String {
        format!("Force Dimension {}", self.name)
    }

    fn coordinates(&self) -> Coordinates {
        Coordinates::Tip
    }

    fn limits(&self) -> Limits {
        Limits { effort: JointVector::from_slice(&[MOST_FORCE; 3]), watchdog: self.watchdog }
    }

    fn enable(&mut self) -> Result<(), Halt> {
        // The limit is a second one, beside ours; devices that do not know it refuse.
        // SAFETY: these functions take numbers.
        unsafe { (self.functions.dhdSetMaxForce)(MOST_FORCE, self.id) };
        // SAFETY: as above.
        if unsafe { (self.functions.dhdEnableForce)(1, self.id) } < 0 {
            return Err(self.failure());
        }
        self.enabled = true;
        Ok(())
    }

    fn read(&mut self, elapsed: f64) -> Result<Measurement, Halt> {
        let [mut x, mut y, mut z] = [0.0; 3];
        // SAFETY: the three places are valid for writing.
        match unsafe { (self.functions.dhdGetPosition)(&raw mut x, &raw mut y, &raw mut z, self.id) } {
            TIME_GUARD => self.latest.age += elapsed,
            code if code < 0 => return Err(self.failure()),
            _ => self.latest = Measurement::plain(JointVector::from_slice(&[x, y, z]), 0.0),
        }
        self.ticks += 1;
        if self.enabled && self.ticks.is_multiple_of(STATUS_TICKS) {
            let mut status = [0; STATUS];
            // SAFETY: the library writes 17 numbers, newer ones some more; there is room for twice as many.
            let code = unsafe { (self.functions.dhdGetStatus)(status.as_mut_ptr(), self.id) };
            if code >= 0 && status[STATUS_FORCE] == 0 {
                return Err(Halt::ForcesOff);
            }
        }
        Ok(self.latest)
    }

    fn write(&mut self, effort: &JointVector) -> Result<Command, Halt> {
        let [x, y, z, ..] = effort.padded();
        // SAFETY: the function takes numbers.
        let code =
            unsafe { (self.functions.dhdSetForceAndTorqueAndGripperForce)(x, y, z, 0.0, 0.0, 0.0, 0.0, self.id) };
        match code {
            SATURATED => Ok(Command::Reduced),
            TIME_GUARD => Ok(Command::Kept),
            code if code < 0 => Err(self.failure()),
            _ => Ok(Command::Whole),
        }
    }

    fn release(&mut self) {
        // SAFETY: these functions take numbers; nothing is called after the last.
        unsafe {
            (self.functions.dhdEnableForce)(0, self.id);
            (self.functions.dhdStop)(self.id);
            (self.functions.dhdClose)(self.id);
        }
    }
}

/// Returns the text at `pointer`.
///
/// # Safety
/// It must be null or a string with a final zero.
unsafe fn text(pointer: *const c_char) -> String {
    if pointer.is_null() {
        return "unknown".into();
    }
    // SAFETY: the caller vouches for it.
    unsafe { CStr::from_ptr(pointer) }.to_string_lossy().into_owned()
}
