//! Files that are read.

use std::{
    fs::File,
    io::{self, Read, Seek},
    path::Path,
};

/// Greatest number in SI units that a device or a dataset may give for a position (rad or m), a torque (N m) or an
/// energy (J). Nothing that is haptized comes near it, and its square times any gain is still far from overflow, so
/// that no account or torque of the haptic loop can become infinite.
pub(crate) const GREATEST_INPUT: f64 = 1e9;

/// What to do with a text in two bytes a character.
const UTF_16: &str = "it is text in UTF-16, not UTF-8: convert it by `iconv -f UTF-16 -t UTF-8 FILE`";

/// How files begin that are never what is asked for, and what to do with each.
const FOREIGN: [(&[u8], &str); 7] = [
    (
        b"version https://git-lfs.github.com/spec/",
        "this is a pointer of Git LFS, not the file itself: run `git lfs pull` in its repository",
    ),
    (b"\x28\xb5\x2f\xfd", "it is compressed by zstd: decompress it first, by `zstd -d FILE`"),
    (b"\x1f\x8b", "it is compressed by gzip: decompress it first, by `gunzip FILE`"),
    (
        b"SQLite format 3\0",
        "it is a database of SQLite, as ROS 2 records in .db3 files: write it as MCAP by `ros2 bag convert`",
    ),
    (b"\xff\xfe", UTF_16),
    (b"\xfe\xff", UTF_16),
    (b"#ROSBAG V2.0", "it is a bag of ROS 1: write it as MCAP by `rosbags-convert --src FILE.bag --dst FOLDER`"),
];

/// Opens the file at `path`. A folder holds no bytes, a pipe would be waited for, and a device may have no end.
///
/// # Errors
/// When it is one of these, with the remedy, or the system's.
pub(crate) fn open(path: &Path) -> io::Result<File> {
    let found = std::fs::metadata(path)?;
    if found.is_file() {
        let mut file = File::open(path)?;
        let mut head = Vec::new();
        let longest = FOREIGN.iter().map(|(start, _)| start.len()).max().unwrap_or(0);
        file.by_ref().take(longest as u64).read_to_end(&mut head)?;
        file.rewind()?;
        return match FOREIGN.iter().find(|(start, _)| head.starts_with(start)) {
            Some((_, what)) => Err(io::Error::new(io::ErrorKind::InvalidInput, *what)),
            None => Ok(file),
        };
    }
    let what = if found.is_dir() {
        "this is a folder: give a file in it"
    } else {
        "this is a pipe or a device: save what it gives in a file, and give that"
    };
    Err(io::Error::new(io::ErrorKind::InvalidInput, what))
}

/// Says why a file cannot be read, and what to do: what [`open`] refuses has its remedy already.
pub(crate) fn remedied(error: &io::Error) -> String {
    let remedy = if error.kind() == io::ErrorKind::InvalidInput { "" } else { "; check the path and its permissions" };
    format!("{error}{remedy}")
}

/// Whether the file at `path` begins with `start`.
pub(crate) fn begins(path: &Path, start: &[u8]) -> bool {
    let mut head = vec![0; start.len()];
    open(path).and_then(|mut file| file.read_exact(&mut head)).is_ok() && head == start
}
