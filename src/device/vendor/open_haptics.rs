//! 3D Systems Touch and Phantom devices: three joints, angles (rad) and torques (N m) here, (mN m) in the library.
//!
//! The maker's library `libHD` (OpenHaptics) is opened at run time. **Its scheduler owns the thread** in which a device
//! may be read and driven: the loop runs as a callback of it ([`Scheduler`]), a frame a tick, which reading opens and
//! writing ends. Outside of a session, single readings and commands are handed to the scheduler one by one, and waited
//! for.
//!
//! Errors are a stack; it is emptied at every tick, and the newest one counts. Warm motors are an error of their own.
//! The third angle is measured against the ground (a parallelogram). The library ramps forces up and checks their
//! limits, too.
//!
//! Source: values and signatures of the public interface of version 3. Not tried on hardware.

use super::{LibraryFiles, files, functions};
use crate::{
    JointVector,
    device::{Command, Coordinates, Halt, Hardware, Limits, Measurement, Scheduler, Watchdog},
};
use std::{
    any::Any,
    cell::Cell,
    ffi::CString,
    os::raw::{c_char, c_uint, c_ulong, c_void},
    panic::{AssertUnwindSafe, catch_unwind, resume_unwind},
    path::PathBuf,
    ptr,
    sync::{
        Arc,
        atomic::{AtomicBool, AtomicU64, Ordering},
    },
    thread::{self, Thread},
    time::{Duration, Instant},
};

/// An error, returned by value: twelve bytes.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
struct ErrorInfo {
    code: c_uint,
    internal: i32,
    device: c_uint,
}

const _: () = assert!(size_of::<ErrorInfo>() == 12);

type Callback = unsafe extern "C" fn(*mut c_void) -> c_uint;

functions! {
    /// The functions of `libHD` that are used.
    struct Functions {
        hdInitDevice: fn(*const c_char) -> c_uint;
        hdDisableDevice: fn(c_uint);
        hdMakeCurrentDevice: fn(c_uint);
        hdBeginFrame: fn(c_uint);
        hdEndFrame: fn(c_uint);
        hdGetError: fn() -> ErrorInfo;
        hdEnable: fn(c_uint);
        hdDisable: fn(c_uint);
        hdGetDoublev: fn(c_uint, *mut f64);
        hdSetDoublev: fn(c_uint, *const f64);
        hdCheckCalibration: fn() -> c_uint;
        hdUpdateCalibration: fn(c_uint);
        hdGetIntegerv: fn(c_uint, *mut i32);
        hdSetSchedulerRate: fn(c_ulong);
        hdStartScheduler: fn();
        hdStopScheduler: fn();
        hdScheduleAsynchronous: fn(Callback, *mut c_void, u16) -> c_ulong;
        hdScheduleSynchronous: fn(Callback, *mut c_void, u16);
        hdUnschedule: fn(c_ulong);
    }
}

const INVALID_HANDLE: c_uint = 0xffff_ffff;
const JOINT_ANGLES: c_uint = 0x2100;
const CALIBRATION_STYLE: c_uint = 0x2555;
const JOINT_TORQUE: c_uint = 0x2703;
const FORCE_OUTPUT: c_uint = 0x4000;
const CALIBRATION_OK: c_uint = 0x5000;
const CALIBRATION_NEEDS_UPDATE: c_uint = 0x5001;
const WARM_MOTORS: c_uint = 0x0200;
const COMMUNICATION: [c_uint; 2] = [0x0302, 0x0303];
const CALLBACK_DONE: c_uint = 0;
const CALLBACK_CONTINUE: c_uint = 1;
const HIGHEST_PRIORITY: u16 = 65_535;

/// Rate of the scheduler (Hz).
const RATE: c_ulong = 1000;

/// Maximum torque of each joint (N m): what the maker's own samples clamp to, of the smallest device.
const MOST_TORQUE: [f64; 3] = [0.200, 0.350, 0.200];

/// Most errors that are taken from the stack at once: a library that never empties it must not hold the loop.
const MOST_ERRORS: usize = 16;

/// Silence of the scheduler after which a session is given up.
const LONGEST_SILENCE: Duration = Duration::from_millis(200);

thread_local! {
    /// Whether this thread is the scheduler's, in a callback.
    static IN_CALLBACK: Cell<bool> = const { Cell::new(false) };
}

/// An open device.
pub struct OpenHaptics {
    api: Arc<Api>,
    latest: Measurement,
    /// Whether reading has opened a frame that writing is to end.
    in_frame: bool,
}

/// Library and device, shared by the device and its scheduler.
struct Api {
    functions: Functions,
    device: c_uint,
    /// Whether the scheduler has stopped calling: nothing may be handed to it any more.
    stalled: AtomicBool,
}

impl OpenHaptics {
    /// Returns where the library may be.
    #[must_use]
    pub fn library() -> LibraryFiles {
        let folders = ["/usr/lib", "/usr/lib/x86_64-linux-gnu", "/usr/local/lib"].map(PathBuf::from);
        let name = if cfg!(windows) { "hd.dll" } else { "libHD.so" };
        let remedy = "the library libHD is not found: install OpenHaptics and the Touch device driver, set GTDD_HOME \
                      as their guide says, or name the library as in touch:/PATH/libHD.so";
        LibraryFiles { candidates: files(&folders, name), remedy }
    }

    /// Opens a device, its forces off. `place` is the library's path, the name of a configured device, or both as
    /// `PATH@NAME`.
    ///
    /// # Errors
    /// In words, with the remedy.
    pub fn open(place: Option<&str>) -> Result<Self, String> {
        let (path, name) = match place {
            Some(place) => match place.split_once('@') {
                Some((path, name)) => (Some(path), Some(name)),
                None if place.contains('/') => (Some(place), None),
                None => (None, Some(place)),
            },
            None => (None, None),
        };
        let library = Self::library().open(path)?;
        // SAFETY: the signatures are those of the library's public interface, version 3.
        let functions = unsafe { Functions::load(library) }?;
        let name = name.map(CString::new).transpose().map_err(|_| "a device's name holds no zero".to_owned())?;
        // SAFETY: the name is null, for the default device, or a string with a final zero that outlives the call.
        let device = unsafe { (functions.hdInitDevice)(name.as_ref().map_or(ptr::null(), |name| name.as_ptr())) };
        let api = Api { functions, device, stalled: AtomicBool::new(false) };
        let error = api.newest_error();
        if error.is_some() || device == INVALID_HANDLE {
            let error = error.unwrap_or(0);
            return Err(format!(
                "no device opens (error {error:#06x}): plug it in, switch its power on, join the group dialout, and \
                 configure it with the maker's setup tool"
            ));
        }
        // SAFETY: the device is open; the functions take numbers.
        unsafe {
            (api.functions.hdMakeCurrentDevice)(device);
            (api.functions.hdSetSchedulerRate)(RATE);
            (api.functions.hdStartScheduler)();
        }
        let opened = Self {
            api: Arc::new(api),
            latest: Measurement::plain(JointVector::zeros(3), f64::INFINITY),
            in_frame: false,
        };
        if let Some(error) = opened.api.newest_error() {
            return Err(format!(
                "its scheduler does not start (error {error:#06x}): end other programs that use the device"
            ));
        }
        opened.calibrate()?;
        Ok(opened)
    }

    fn calibrate(&self) -> Result<(), String> {
        let functions = &self.api.functions;
        // SAFETY: the functions take numbers, and a place for one number.
        let state = unsafe {
            if (functions.hdCheckCalibration)() == CALIBRATION_NEEDS_UPDATE {
                let mut style = 0;
                (functions.hdGetIntegerv)(CALIBRATION_STYLE, &raw mut style);
                (functions.hdUpdateCalibration)(style as c_uint);
            }
            (functions.hdCheckCalibration)()
        };
        self.api.newest_error();
        if state == CALIBRATION_OK {
            return Ok(());
        }
        Err("it is not calibrated: put its stylus into the inkwell, or run the maker's calibration tool".into())
    }
}

impl Api {
    /// Empties the stack of errors; returns the newest, which comes first.
    fn newest_error(&self) -> Option<c_uint> {
        let mut newest = None;
        for _ in 0..MOST_ERRORS {
            // SAFETY: the function takes nothing; its answer has the size that the library's has.
            let error = unsafe { (self.functions.hdGetError)() };
            if error.code == 0 {
                break;
            }
            newest = newest.or(Some(error.code));
        }
        newest
    }

    /// Opens a frame and reads the joints.
    fn begin(&self) -> [f64; 3] {
        let mut angles = [0.0; 3];
        // SAFETY: the place holds the three numbers that the library writes.
        unsafe {
            (self.functions.hdBeginFrame)(self.device);
            (self.functions.hdGetDoublev)(JOINT_ANGLES, angles.as_mut_ptr());
        }
        angles
    }

    /// Commands torques (N m), if any, and ends the frame.
    fn end(&self, torque: Option<[f64; 3]>) {
        // SAFETY: the library reads three numbers.
        unsafe {
            if let Some(torque) = torque.map(|torque| torque.map(|torque| 1000.0 * torque)) {
                (self.functions.hdSetDoublev)(JOINT_TORQUE, torque.as_ptr());
            }
            (self.functions.hdEndFrame)(self.device);
        }
    }

    /// Calls `job` in the scheduler's thread, and waits for it.
    fn in_scheduler<F: FnMut()>(&self, mut job: F) {
        unsafe extern "C" fn call<F: FnMut()>(job: *mut c_void) -> c_uint {
            // SAFETY: `job` is the closure below, which lives until the scheduler has called this.
            let job = unsafe { &mut *job.cast::<F>() };
            // A panic must not leave through the library; there is none in what is scheduled here.
            let _ = catch_unwind(AssertUnwindSafe(job));
            CALLBACK_DONE
        }
        // SAFETY: the call returns after the callback has, so that `job` outlives it.
        unsafe { (self.functions.hdScheduleSynchronous)(call::<F>, (&raw mut job).cast(), HIGHEST_PRIORITY) };
    }
}

/// Returns the reason for an error that is not of warm motors.
fn halt(error: c_uint) -> Halt {
    if COMMUNICATION.contains(&error) { Halt::Unplugged } else { Halt::DeviceError(error as i32) }
}

impl Hardware for OpenHaptics {
    fn description(&self) -> String {
        "3D Systems device (OpenHaptics)".into()
    }

    fn coordinates(&self) -> Coordinates {
        Coordinates::Joints(3)
    }

    fn limits(&self) -> Limits {
        // The scheduler stops calling when the process ends; the library then lets go, after a time that it does not
        // tell.
        Limits { effort: JointVector::from_slice(&MOST_TORQUE), watchdog: Watchdog::Unstated }
    }

    fn enable(&mut self) -> Result<(), Halt> {
        // SAFETY: the function takes a number.
        unsafe { (self.api.functions.hdEnable)(FORCE_OUTPUT) };
        self.api.newest_error().map_or(Ok(()), |error| Err(halt(error)))
    }

    fn read(&mut self, _: f64) -> Result<Measurement, Halt> {
        if self.api.stalled.load(Ordering::Acquire) {
            return Err(Halt::ForcesOff);
        }
        let angles = if IN_CALLBACK.get() {
            self.in_frame = true;
            self.api.begin()
        } else {
            let mut angles = [0.0; 3];
            self.api.in_scheduler(|| {
                angles = self.api.begin();
                self.api.end(None);
            });
            angles
        };
        let error = self.api.newest_error();
        if let Some(error) = error.filter(|error| *error != WARM_MOTORS) {
            return Err(halt(error));
        }
        let plain = Measurement::plain(JointVector::from_slice(&angles), 0.0);
        self.latest = Measurement { warm: error.is_some(), ..plain };
        Ok(self.latest)
    }

    fn write(&mut self, effort: &JointVector) -> Result<Command, Halt> {
        if self.api.stalled.load(Ordering::Acquire) {
            return Err(Halt::ForcesOff);
        }
        let [a, b, c, ..] = effort.padded();
        if IN_CALLBACK.get() {
            if !std::mem::take(&mut self.in_frame) {
                self.api.begin();
            }
            self.api.end(Some([a, b, c]));
        } else {
            self.api.in_scheduler(|| {
                self.api.begin();
                self.api.end(Some([a, b, c]));
            });
        }
        match self.api.newest_error() {
            None => Ok(Command::Whole),
            Some(WARM_MOTORS) => Ok(Command::Reduced),
            Some(error) => Err(halt(error)),
        }
    }

    fn release(&mut self) {
        let functions = &self.api.functions;
        // SAFETY: the functions take numbers; no callback is scheduled any more.
        unsafe {
            (functions.hdDisable)(FORCE_OUTPUT);
            (functions.hdStopScheduler)();
            (functions.hdDisableDevice)(self.api.device);
        }
    }

    fn scheduler(&self) -> Option<Arc<dyn Scheduler>> {
        Some(Arc::<Api>::clone(&self.api))
    }
}

/// A session in the scheduler's thread.
struct Session<'a> {
    tick: &'a mut (dyn FnMut() -> bool + Send),
    calls: AtomicU64,
    over: AtomicBool,
    panic: Option<Box<dyn Any + Send>>,
    /// The thread that waits for the end.
    waiting: Thread,
}

unsafe extern "C" fn called(session: *mut c_void) -> c_uint {
    let session = session.cast::<Session<'_>>();
    // SAFETY: `session` is that of `run`, which lives until `over` is set below. `run` looks at `calls` and `over`
    // alone meanwhile, which are atomic; each field is borrowed by itself.
    unsafe {
        (*session).calls.fetch_add(1, Ordering::Relaxed);
        IN_CALLBACK.set(true);
        let tick = &mut *(*session).tick;
        let goes_on = catch_unwind(AssertUnwindSafe(tick));
        IN_CALLBACK.set(false);
        match goes_on {
            Ok(true) => return CALLBACK_CONTINUE,
            Ok(false) => {}
            Err(panic) => (*session).panic = Some(panic),
        }
        let waiting = (*session).waiting.clone();
        (*session).over.store(true, Ordering::Release);
        waiting.unpark();
    }
    CALLBACK_DONE
}

impl Scheduler for Api {
    fn rate(&self) -> f64 {
        RATE as f64
    }

    fn run(&self, tick: &mut (dyn FnMut() -> bool + Send)) -> Result<(), Halt> {
        let (calls, over, waiting) = (AtomicU64::new(0), AtomicBool::new(false), thread::current());
        let mut session = Session { tick, calls, over, panic: None, waiting };
        let place = &raw mut session;
        // SAFETY: the session outlives the callback: this returns once `over` is set, which is the callback's last act,
        // or after the scheduler, and with it the callback, has been stopped.
        let handle = unsafe { (self.functions.hdScheduleAsynchronous)(called, place.cast(), HIGHEST_PRIORITY) };
        let mut seen = 0;
        // SAFETY: both fields are atomic.
        let (calls, over) = unsafe { (&(*place).calls, &(*place).over) };
        while !over.load(Ordering::Acquire) {
            let begin = Instant::now();
            while !over.load(Ordering::Acquire)
                && let Some(rest) = LONGEST_SILENCE.checked_sub(begin.elapsed())
            {
                thread::park_timeout(rest);
            }
            let now = calls.load(Ordering::Relaxed);
            if now == seen && !over.load(Ordering::Acquire) {
                // SAFETY: the functions take numbers. Stopping joins the scheduler's thread.
                unsafe {
                    (self.functions.hdUnschedule)(handle);
                    (self.functions.hdDisable)(FORCE_OUTPUT);
                    (self.functions.hdStopScheduler)();
                }
                self.stalled.store(true, Ordering::Release);
                return Err(Halt::Stale);
            }
            seen = now;
        }
        // SAFETY: the callback is over.
        match unsafe { (*place).panic.take() } {
            Some(panic) => resume_unwind(panic),
            None => Ok(()),
        }
    }
}
