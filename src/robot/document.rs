//! XML of a robot file: elements, their attributes as numbers, and errors at their place.

use crate::Error;
use crate::{names, scene, xml};
use glam::DVec3;
use roxmltree::{Document, Node};
use std::{ops::Range, path::Path};

/// Largest size of any number [m, rad, kg, kg m^2, N m]: beyond every robot in SI units.
const LARGEST: f64 = 1e6;

/// How to get plain URDF from xacro.
const XACRO: &str =
    "this is xacro, which is a program, not a robot: run `xacro FILE > ROBOT.urdf` (pip install xacro) and import that";

/// Refuses an expression of xacro.
pub(super) fn check_plain(text: &str) -> Result<(), String> {
    let is_expression = text.contains("${") || text.contains("$(");
    if is_expression { Err(format!("{text:?} is an expression of xacro: {XACRO}")) } else { Ok(()) }
}

/// Text of a robot file.
pub(super) struct Source<'a> {
    pub path: &'a Path,
    pub text: &'a str,
}

/// Reads the file's text.
pub(super) fn read_text(path: &Path) -> Result<String, Error> {
    scene::text::read(path).map_err(|reason| Error::at(path, format_args!("cannot read the robot: {reason}")))
}

impl<'a> Source<'a> {
    /// Returns an error at `span`.
    pub fn error(&self, span: Range<usize>, message: impl Into<String>) -> Error {
        Error::in_text(self.path, self.text, span, message.into())
    }

    /// Returns the line of the byte at `offset`, from 1.
    pub fn line(&self, offset: usize) -> usize {
        xml::line(self.text, offset)
    }

    /// Parses the text as XML without a document type, in which entities may be defined that grow without bound.
    pub fn parse(&self) -> Result<Document<'a>, Error> {
        if self.path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("xacro")) {
            return Err(self.error(0..0, XACRO));
        }
        let document = xml::parse(self.text).map_err(|error| {
            let reason = match error.prefix.as_deref() {
                Some("xacro") => XACRO.to_owned(),
                _ if !self.text.trim_start().starts_with('<') => "this is no URDF and no MJCF file".to_owned(),
                _ => error.reason,
            };
            self.error(error.span, reason)
        })?;
        let is_xacro = |node: &Node<'_, '_>| node.tag_name().namespace().is_some_and(|uri| uri.contains("xacro"));
        match document.descendants().find(is_xacro) {
            Some(node) => Err(self.error(node.range(), XACRO)),
            None => Ok(document),
        }
    }

    /// Returns the text of an attribute that must be there.
    pub fn required<'n>(&self, node: Node<'n, '_>, name: &str) -> Result<&'n str, Error> {
        let text = node.attribute(name).map(str::trim).filter(|text| !text.is_empty()).ok_or_else(|| {
            let message = format!("<{}> needs the attribute {name}", node.tag_name().name());
            self.error(node.range(), message)
        })?;
        names::check(text).map_err(|problem| self.error(node.range(), problem))?;
        Ok(text)
    }

    /// Returns an attribute as numbers, `None` if it is missing.
    pub fn list(&self, node: Node<'_, '_>, name: &str) -> Result<Option<Vec<f64>>, Error> {
        let Some(attribute) = node.attribute_node(name) else { return Ok(None) };
        let text = attribute.value();
        let bad = |message: String| self.error(attribute.range(), message);
        check_plain(text).map_err(bad)?;
        let number = |word: &str| {
            let number: f64 = word.parse().map_err(|_| bad(format!("{name} has {word:?}, which is no number")))?;
            let in_range = number.abs() <= LARGEST;
            if in_range {
                return Ok(number);
            }
            Err(bad(format!("{name} has {word}: a robot in SI units has no number above {LARGEST:.0e}")))
        };
        text.split_ascii_whitespace().map(number).collect::<Result<_, _>>().map(Some)
    }

    /// Returns an attribute as N numbers, `None` if it is missing.
    pub fn numbers<const N: usize>(&self, node: Node<'_, '_>, name: &str) -> Result<Option<[f64; N]>, Error> {
        let Some(list) = self.list(node, name)? else { return Ok(None) };
        let place = node.attribute_node(name).map_or(node.range(), |attribute| attribute.range());
        let count = list.len();
        list.try_into().map(Some).map_err(|_| {
            self.error(place, format!("{name} must be {N} numbers separated by blanks, and there are {count}"))
        })
    }

    /// Returns an attribute as a number, `None` if it is missing.
    pub fn number(&self, node: Node<'_, '_>, name: &str) -> Result<Option<f64>, Error> {
        Ok(self.numbers::<1>(node, name)?.map(|[number]| number))
    }

    /// Returns an attribute as a number that must be there and positive.
    pub fn positive(&self, node: Node<'_, '_>, name: &str) -> Result<f64, Error> {
        self.required(node, name)?;
        let number = self.number(node, name)?.unwrap_or(0.0);
        if number > 0.0 {
            return Ok(number);
        }
        Err(self.error(node.range(), format!("{name} is {number}: it must be positive")))
    }

    /// Returns an attribute as a vector, `None` if it is missing.
    pub fn vector(&self, node: Node<'_, '_>, name: &str) -> Result<Option<DVec3>, Error> {
        Ok(self.numbers::<3>(node, name)?.map(DVec3::from_array))
    }
}

/// Returns the first child element of that name.
pub(super) fn child<'a, 'i>(node: Node<'a, 'i>, name: &str) -> Option<Node<'a, 'i>> {
    node.children().find(|child| child.is_element() && child.tag_name().name() == name)
}
