//! The text of a scene file, read and checked; each failure names the place.

use super::value::KEY;
use super::{JointKind, JointSpec, ProxySpec, Scene};
use crate::{Error, ErrorKind, JointVector, names::counted};
use serde::de::DeserializeOwned;
use std::fmt::Display;
use std::ops::Range;
use std::path::Path;
use toml::{
    Spanned,
    de::{DeTable, DeValue},
};

/// What must be a table, `*` for each entry of a list: serde would take a list of its values as well, without a name.
const TABLES: &str = "object object.sphere object.mesh object.tetrahedra object.springs object.elasticity \
    object.elasticity.inclusion.* object.elasticity.inclusion.*.sphere object.skin object.ground \
    object.relaxation proxy proxy.joint.* \
    proxy.joint.*.nodes.* proxy.joint.*.follows proxy.shape.* proxy.shape.*.cylinder proxy.shape.*.surface contact grid grid.axes.* scan \
    scan.workspace scan.workspace.across.* scan.workspace.depth scan.joints scan.joints.axes.* scan.control \
    scan.history scan.limits scan.simulated haptics haptics.friction haptics.four_channel haptics.hand graphics.stiffening motion \
    motion.press.* motion.scrape.* device";

/// Keys that earlier versions read, and what to do without them.
const REMOVED: [(&str, &str); 2] = [
    (
        "haptics.contact_damping",
        "contact_damping was removed: leave it out, or give the coupling more coupling_damping",
    ),
    ("haptics.friction.damping", "friction has no damping of its own any more, the coupling's damps it: leave it out"),
];

/// The text that is being checked.
pub(crate) struct Checker<'a> {
    pub path: &'a Path,
    pub text: &'a str,
}

impl Checker<'_> {
    /// An error at `span`.
    pub fn error(&self, span: Range<usize>, message: impl Display) -> Error {
        Error::in_text(self.path, self.text, span, message).of(ErrorKind::Scene)
    }

    /// Reads the text.
    ///
    /// # Errors
    /// At the value that cannot be read.
    pub fn read<T: DeserializeOwned>(&self) -> Result<T, Error> {
        let root = DeTable::parse(self.text);
        if let Ok(root) = &root {
            let lists = |path: &str| list(root.get_ref(), path.split('.'));
            if let Some(place) = TABLES.split(' ').find_map(lists) {
                return Err(self.error(place, "this is a list of values, and it must be a table: name each value"));
            }
            if let Some((path, remedy)) = REMOVED.into_iter().find(|(path, _)| self.has(path)) {
                return Err(self.at(path, remedy));
            }
        }
        toml::from_str(self.text).map_err(|error| {
            let span = error.span().unwrap_or(0..0);
            let message = match (error.message().strip_prefix(KEY), root) {
                (Some(rest), Ok(root)) => {
                    format!("{} {rest}", key_at(root.get_ref(), span.start).unwrap_or("the value"))
                }
                (_, Err(_)) if self.path.extension().is_some() && !Scene::is_at(self.path) => {
                    "this is no scene, which is TOML: a scene names a mesh in [object.mesh], and `haptize import` makes one of a \
                     robot's file"
                        .to_owned()
                }
                _ => error.message().to_owned(),
            };
            self.error(span, message)
        })
    }

    /// An error at what `path` names, keys and numbers of entries with dots between, or at the table around it that the
    /// text has.
    pub fn at(&self, path: &str, message: impl Display) -> Error {
        self.error(find(self.text, path).0, message)
    }

    /// Whether the text names what `path` names.
    pub fn has(&self, path: &str) -> bool {
        find(self.text, path).1
    }

    /// Checks that the arm has a contact node of the number that stands at `path`.
    pub fn node(&self, path: &str, node: Option<usize>, proxy: &ProxySpec) -> Result<(), Error> {
        let nodes = proxy.contact_nodes();
        match node {
            Some(node) if node >= nodes => {
                Err(self
                    .at(path, format!("node is {node}: it must be less than {nodes}, the contact nodes of the arm")))
            }
            _ => Ok(()),
        }
    }

    /// Brings `list`, which stands at `path` in the text, to one number per joint: one number is that of all joints,
    /// and where the text has none, `default` tells it by the kind of joint. Where the chain mixes kinds of joint, a
    /// single number has no one unit and is refused.
    pub fn fit(
        &self,
        path: &str,
        list: &mut JointVector,
        joints: &[JointSpec],
        default: impl Fn(JointKind) -> f64,
    ) -> Result<(), Error> {
        let key = path.rsplit('.').next().unwrap_or(path);
        let (found, needed) = (list.len(), joints.len());
        let mut fitted = JointVector::zeros(needed);
        if found == 0 {
            fitted.iter_mut().zip(joints).for_each(|(entry, joint)| *entry = default(joint.kind));
        } else if found == needed {
            return Ok(());
        } else if found > 1 || self.text[find(self.text, path).0].starts_with('[') {
            return Err(self.at(
                path,
                format!(
                    "{key} lists {} for {}",
                    counted(found, ["number", "numbers"]),
                    counted(needed, ["joint", "joints"])
                ),
            ));
        } else if joints.iter().any(|joint| joint.kind != joints[0].kind) {
            let message = format!(
                "{key} needs a list of {needed} numbers, one per joint: its unit differs between revolute and \
                 prismatic joints"
            );
            return Err(self.at(path, message));
        } else {
            fitted.fill(list[0]);
        }
        *list = fitted;
        Ok(())
    }
}

/// The place of what `key` names in a TOML text, keys and numbers of entries with dots between; where there is no such
/// thing, that of the table around it, and false.
pub(crate) fn find(text: &str, key: &str) -> (Range<usize>, bool) {
    let Ok(root) = DeTable::parse(text) else { return (0..0, false) };
    let root = DeValue::Table(root.into_inner());
    let (mut place, mut value) = (0..0, &root);
    for part in key.split('.') {
        let inner = part.parse::<usize>().map_or_else(|_| value.get(part), |number| value.get(number));
        let Some(inner) = inner else { return (place, false) };
        (place, value) = (inner.span(), inner.get_ref());
    }
    (place, true)
}

/// The key in `table` of the value at a byte of the text.
fn key_at<'a>(table: &'a DeTable<'_>, at: usize) -> Option<&'a str> {
    table.iter().find_map(|(key, value)| {
        let inside = match value.get_ref() {
            DeValue::Table(inner) => return key_at(inner, at),
            DeValue::Array(list) => list.iter().find_map(|entry| key_at(entry.get_ref().as_table()?, at)),
            _ => None,
        };
        inside.or_else(|| value.span().contains(&at).then_some(key.get_ref().as_ref()))
    })
}

/// The place of the first list in `table` that stands where `path` names a table.
fn list<'p>(table: &DeTable<'_>, mut path: impl Iterator<Item = &'p str> + Clone) -> Option<Range<usize>> {
    let value = path.next().and_then(|key| table.get(key))?;
    let inner = |value: &Spanned<DeValue<'_>>, path: &_| match value.get_ref() {
        DeValue::Table(table) => list(table, Clone::clone(path)),
        DeValue::Array(_) => Some(value.span()),
        _ => None,
    };
    match (value.get_ref(), path.clone().next()) {
        (DeValue::Array(entries), Some("*")) => {
            path.next();
            entries.iter().find_map(|entry| inner(entry, &path))
        }
        _ => inner(value, &path),
    }
}
