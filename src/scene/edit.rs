//! Changes of a scene's text that leave its other lines, and their comments, as a person wrote them.

use super::check::Checker;
use crate::Error;
use glam::{DQuat, DVec3};
use std::path::Path;
use toml_edit::{DocumentMut, Item, TableLike, Value};

/// Text of a scene, to be changed.
pub struct SceneText<'a> {
    document: DocumentMut,
    path: &'a Path,
}

impl<'a> SceneText<'a> {
    /// The text of the scene at `path`.
    ///
    /// # Errors
    /// When it is no TOML; the message names the line.
    pub fn new(text: &str, path: &'a Path) -> Result<Self, Error> {
        let document = text.parse().map_err(|error: toml_edit::TomlError| {
            Checker { path, text }.error(error.span().unwrap_or(0..0), error.message())
        })?;
        Ok(Self { document, path })
    }

    /// Each table of `tables`, which are TOML, takes the place of the table of its name, or follows the others.
    ///
    /// # Errors
    /// When `tables` are no TOML.
    pub fn replace(&mut self, tables: &str) -> Result<(), Error> {
        let new = Self::new(tables, self.path)?.document;
        for (name, mut item) in new.into_table() {
            let old = self.document.remove(&name);
            if let Some(table) = item.as_table_mut() {
                let old = old.as_ref().and_then(Item::as_table);
                // Tables within it follow it.
                table.set_position(old.and_then(toml_edit::Table::position));
                set_positions(table);
                let heading = old.and_then(|old| old.decor().prefix()).and_then(|prefix| prefix.as_str());
                let own = table.decor().prefix().and_then(|prefix| prefix.as_str()).unwrap_or_default();
                if own.trim().is_empty() {
                    table.decor_mut().set_prefix(heading.unwrap_or("\n").to_owned());
                }
            }
            self.document.insert(&name, item);
        }
        Ok(())
    }

    /// Removes the table or the key at `path`, whose names are joined by points, if it is there.
    pub fn remove(&mut self, path: &str) {
        let mut table: &mut dyn TableLike = self.document.as_table_mut();
        let (tables, name) = path.rsplit_once('.').unwrap_or(("", path));
        for outer in tables.split_terminator('.') {
            let Some(inner) = table.get_mut(outer).and_then(Item::as_table_like_mut) else { return };
            table = inner;
        }
        table.remove(name);
    }

    /// Moves the object by `motion` (m): its centre, the height below which it is held, and its inclusions.
    pub fn move_object(&mut self, motion: DVec3) {
        let Some(object) = self.document.get_mut("object").and_then(Item::as_table_like_mut) else { return };
        move_held(object, motion.z);
        move_centres(object, |_| motion);
    }

    /// Turns the object by `turned` about the point `about` (m), whose angles about x, then y, then z are then `turn`
    /// (rad). The height below which it is held goes up by `raised` (m).
    pub fn turn_object(&mut self, turn: DVec3, turned: DQuat, about: DVec3, raised: f64) {
        let Some(object) = self.document.get_mut("object").and_then(Item::as_table_like_mut) else { return };
        move_held(object, raised);
        move_centres(object, |centre| about + turned * (centre - about) - centre);
        for shape in ["mesh", "tetrahedra"] {
            if let Some(shape) = object.get_mut(shape).and_then(Item::as_table_like_mut) {
                set_vector(shape, "turn", turn);
            }
        }
    }
}

/// Raises the height below which an object is held (m).
fn move_held(object: &mut dyn TableLike, raised: f64) {
    if let Some(below) = object.get_mut("ground").and_then(|ground| ground.get_mut("below"))
        && let Some(height) = number(below)
    {
        set(below, rounded(height + raised).into());
    }
}

/// Moves the centres of an object's shape and of its inclusions by the `motion` of each (m).
fn move_centres(object: &mut dyn TableLike, motion: impl Fn(DVec3) -> DVec3) {
    let moved = |table: Option<&mut Item>| {
        let Some(table) = table.and_then(Item::as_table_like_mut) else { return };
        // Left out, it is the origin.
        let old = table.get("centre").cloned().unwrap_or_default();
        let at = |k: usize| old.get(k).and_then(number).unwrap_or(0.0);
        let centre = DVec3::new(at(0), at(1), at(2));
        set_vector(table, "centre", centre + motion(centre));
    };
    for shape in ["sphere", "mesh", "tetrahedra"] {
        moved(object.get_mut(shape));
    }
    let Some(elasticity) = object.get_mut("elasticity") else { return };
    let Some(inclusions) = elasticity.get_mut("inclusion") else { return };
    let mut number = 0;
    while let Some(inclusion) = inclusions.get_mut(number) {
        moved(inclusion.get_mut("sphere"));
        number += 1;
    }
}

fn number(item: &Item) -> Option<f64> {
    item.as_float().or_else(|| item.as_integer().map(|whole| whole as f64))
}

/// Sets the key `name` of a table.
fn set_vector(table: &mut dyn TableLike, name: &str, vector: DVec3) {
    let value = Value::Array(vector.to_array().map(rounded).into_iter().collect());
    set(table.entry(name).or_insert(Item::None), value);
}

/// Puts another value in the place of one; a comment behind it stays in its column, or a blank behind a value that
/// reaches that far.
fn set(item: &mut Item, mut value: Value) {
    if let Some(old) = item.as_value() {
        let width = |value: &Value| value.clone().decorated("", "").to_string().chars().count();
        let suffix = old.decor().suffix().and_then(|suffix| suffix.as_str()).unwrap_or_default();
        let comment = suffix.trim_start_matches(' ');
        let column = width(old) + suffix.len() - comment.len();
        let blanks = if comment.starts_with('#') { column.saturating_sub(width(&value)).max(1) } else { 0 };
        let prefix = old.decor().prefix().and_then(|prefix| prefix.as_str()).unwrap_or(" ").to_owned();
        value = value.decorated(prefix, format!("{:blanks$}{comment}", ""));
    }
    *item = Item::Value(value);
}

/// Returns a length to a nanometre, which hides the rounding of a sum (m).
fn rounded(length: f64) -> f64 {
    (length * 1e9).round() / 1e9
}

impl std::fmt::Display for SceneText<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        self.document.fmt(f)
    }
}

/// Lets the tables within `table` follow it in the order in which they are written.
fn set_positions(table: &mut toml_edit::Table) {
    for (_, item) in table.iter_mut() {
        if let Some(inner) = item.as_table_mut() {
            inner.set_position(None);
            set_positions(inner);
        }
        for inner in item.as_array_of_tables_mut().into_iter().flat_map(|array| array.iter_mut()) {
            inner.set_position(None);
            set_positions(inner);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "name = \"a\" # mine\n\n# ---- The body\n[object] # soft\nnode_mass = 1.0\n[object.sphere]\n\
        centre = [1.0, 2.0, 3.0] # m, here\nradius = 0.1\n\n# ---- The arm\n[proxy]\nbase = 1\n\n# ---- The grid\n\
        [grid]\naxes = []\n";

    fn edited(text: &str, tables: &str) -> String {
        let mut edit = SceneText::new(text, Path::new("a.toml")).unwrap();
        edit.replace(tables).unwrap();
        edit.to_string()
    }

    #[test]
    fn a_table_takes_the_place_of_its_like_under_the_heading_that_is_there() {
        let expected = TEXT.replace("axes = []", "axes = [1]");
        assert_eq!(edited(TEXT, "[grid]\naxes = [1]\n"), expected);
        let object = "[object]\nnode_mass = 2.0\n\n[object.mesh]\nfile = \"b.obj\"\n\n[object.skin]\nwidth = 1.0\n";
        let [begin, end] = ["[object]", "\n# ---- The arm"].map(|line| TEXT.find(line).unwrap());
        assert_eq!(edited(TEXT, object), format!("{}{object}{}", &TEXT[..begin], &TEXT[end..]));
        // One that is new follows the others, and values in one line are tables, too.
        assert_eq!(edited(TEXT, "[motion]\npress = []\n"), format!("{TEXT}\n[motion]\npress = []\n"));
        let inline = "grid = { axes = [] } # old\n[object]\nnode_mass = 1.0\n";
        assert_eq!(edited(inline, "[grid]\naxes = [1]\n"), "[object]\nnode_mass = 1.0\n\n[grid]\naxes = [1]\n");
    }

    #[test]
    fn an_object_moves_with_its_ground_and_its_inclusions_under_its_comments() {
        let text = TEXT.replace(
            "radius = 0.1\n",
            "radius = 0.1\n[object.ground]\nbelow = -1 # m\n[object.elasticity]\ninclusion = [{ sphere = { centre = \
             [0.0, 0.0, 0.1], radius = 1.0 } }]\n",
        );
        let mut edit = SceneText::new(&text, Path::new("a.toml")).unwrap();
        edit.move_object(DVec3::new(-0.1, 0.2, 0.3));
        let moved = text.replace("[1.0, 2.0, 3.0]", "[0.9, 2.2, 3.3]").replace("below = -1", "below = -0.7");
        assert_eq!(edit.to_string(), moved.replace("[0.0, 0.0, 0.1]", "[-0.1, 0.2, 0.4]"));
        // What is left out lies at the origin; a list of tables is one, too.
        let text = "[object.mesh]\nfile = \"a.obj\"\n[[object.elasticity.inclusion]]\nsphere.centre = [1, 0, 0]\n";
        let mut edit = SceneText::new(text, Path::new("a.toml")).unwrap();
        edit.move_object(DVec3::X);
        let moved = text.replace("obj\"\n", "obj\"\ncentre = [1.0, 0.0, 0.0]\n");
        assert_eq!(edit.to_string(), moved.replace("[1, 0, 0]", "[2.0, 0.0, 0.0]"));
    }

    #[test]
    fn comments_keep_their_column_and_a_blank() {
        let text = "[object.mesh]\ncentre = [1, 0, 0]    # m\n[object.ground]\nbelow = -0.05         # m, height\nclamp = true # a\n";
        let mut edit = SceneText::new(text, Path::new("a.toml")).unwrap();
        edit.move_object(DVec3::new(0.125, 0.25, 0.012_345_678));
        edit.remove("object.ground.clamp");
        edit.remove("object.absent.clamp");
        let moved = "[object.mesh]\ncentre = [1.125, 0.25, 0.012345678] # m\n[object.ground]\nbelow = -0.037654322  # m, height\n";
        assert_eq!(edit.to_string(), moved);
    }

    #[test]
    fn what_is_no_toml_is_refused_with_its_line() {
        let error = SceneText::new("name = \"a\"\n[object\n", Path::new("a.toml")).err().unwrap().to_string();
        assert!(error.starts_with("a.toml:2:"), "{error}");
    }
}
