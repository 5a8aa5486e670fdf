//! Devices behind a maker's library, which is opened at run time: haptize builds and runs without it.

mod force_dimension;
mod open_haptics;

pub use force_dimension::ForceDimension;
pub use open_haptics::OpenHaptics;

use libloading::Library;
use std::path::PathBuf;

/// A maker's library: where it may be, and what to do if it is nowhere.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LibraryFiles {
    /// Paths, and names that the system's loader searches for, in order.
    pub candidates: Vec<PathBuf>,
    /// Instructions to install it.
    pub remedy: &'static str,
}

impl LibraryFiles {
    /// Opens the library at `place`, or the first of the candidates that can be opened.
    ///
    /// # Errors
    /// In words, with the remedy.
    fn open(&self, place: Option<&str>) -> Result<Library, String> {
        let candidates = place.map_or_else(|| self.candidates.clone(), |place| vec![place.into()]);
        let mut reasons = Vec::new();
        for candidate in &candidates {
            // SAFETY: opening a library runs its initialisers. This is the maker's library for the device that the user
            // named, as any program for it would open it.
            match unsafe { Library::new(candidate) } {
                Ok(library) => return Ok(library),
                Err(error) => reasons.push(error.to_string()),
            }
        }
        Err(format!("{}; tried: {}", self.remedy, reasons.join("; ")))
    }

    /// Returns the first candidate that is a file, if there is one.
    #[must_use]
    pub fn found(&self) -> Option<PathBuf> {
        self.candidates.iter().find(|candidate| candidate.is_file()).cloned()
    }
}

/// Files `name*` in the folders `folders`, then the plain `name` for the system's loader.
fn files(folders: &[PathBuf], name: &str) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for folder in folders {
        let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
        let mut here: Vec<PathBuf> = entries
            .filter(|entry| entry.file_name().to_string_lossy().starts_with(name))
            .map(|entry| entry.path())
            .collect();
        // The newest version last in the alphabet.
        here.sort();
        found.extend(here.into_iter().rev());
    }
    found.push(name.into());
    found
}

/// Declares a table of a library's functions, and how it is filled.
macro_rules! functions {
    ($(#[$doc:meta])* struct $table:ident { $($name:ident: fn($($argument:ty),*) $(-> $answer:ty)?;)* }) => {
        $(#[$doc])*
        #[allow(non_snake_case)]
        struct $table {
            $($name: unsafe extern "C" fn($($argument),*) $(-> $answer)?,)*
            /// Keeps the functions where they are.
            _library: libloading::Library,
        }

        impl $table {
            /// Looks all functions up.
            ///
            /// # Safety
            /// The library's functions of these names must have these signatures.
            unsafe fn load(library: libloading::Library) -> Result<Self, String> {
                $(
                    // SAFETY: the caller vouches for the signature.
                    #[allow(non_snake_case)]
                    let $name = unsafe { library.get(concat!(stringify!($name), "\0").as_bytes()) }
                        .map(|symbol| *symbol)
                        .map_err(|error| {
                            format!("the library has no {}: {error}; install a newer one", stringify!($name))
                        })?;
                )*
                Ok(Self { $($name,)* _library: library })
            }
        }
    };
}
use functions;
