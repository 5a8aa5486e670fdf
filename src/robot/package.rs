//! Where a robot file's meshes are.
//!
//! A plain path is relative to the robot file. `package://name/path` is a path in the ROS package `name`: a folder of
//! that name, or whose package.xml has it, that holds the robot file or lies beside one that does, or is in the folder
//! that the user names. No program is asked for it.

use super::document::check_plain;
use roxmltree::Document;
use std::{
    fs::File,
    io::Read,
    path::{Path, PathBuf},
};

/// Returns the file that `name` means in the robot file `robot`.
///
/// # Errors
/// The reason and the remedy, if no such file is there.
pub(super) fn resolve(name: &str, robot: &Path, packages: Option<&Path>) -> Result<PathBuf, String> {
    check_plain(name)?;
    let folder = robot.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    if let Some(path) = name.strip_prefix("package://").or_else(|| name.strip_prefix("model://")) {
        let (package, inside) = path.split_once('/').unwrap_or((path, ""));
        if package.is_empty() || inside.is_empty() || path.split('/').any(|part| part == "..") {
            return Err(format!("{name:?} names no file of a package: it must be package://PACKAGE/FILE"));
        }
        let folder = folder.canonicalize().unwrap_or_else(|_| folder.to_owned());
        let of_user = packages.into_iter().flat_map(|own| [own.join(package), own.to_owned()]);
        let above = folder.ancestors().flat_map(|above| {
            let itself = (above.ends_with(package) || is_called(above, package)).then(|| above.to_owned());
            itself.into_iter().chain([above.join(package)])
        });
        return of_user.chain(above).map(|place| place.join(inside)).find(|file| file.is_file()).ok_or_else(|| {
            format!(
                "the package {package:?} with the file {inside:?} lies in no folder above this file: name the folder \
                 that holds the package with --package-path DIR"
            )
        });
    }
    let path = name.strip_prefix("file://").unwrap_or(name);
    if let Some((scheme, _)) = path.split_once("://") {
        return Err(format!("{scheme}:// is not opened: copy the mesh beside the robot file and name it by its path"));
    }
    let file = folder.join(path);
    if file.is_file() { Ok(file) } else { Err(format!("there is no file {}: correct the path", file.display())) }
}

/// Longest package.xml that is read (bytes).
const LONGEST: u64 = 1 << 16;

/// Whether the package.xml in `folder`, if there is one, names the package `package`.
fn is_called(folder: &Path, package: &str) -> bool {
    let mut text = String::new();
    let read = File::open(folder.join("package.xml")).and_then(|file| file.take(LONGEST).read_to_string(&mut text));
    let document = read.ok().and_then(|_| Document::parse(&text).ok());
    let name = document.as_ref().and_then(|document| {
        document.root_element().children().find(|child| child.has_tag_name("name")).and_then(|name| name.text())
    });
    name.is_some_and(|name| name.trim() == package)
}
