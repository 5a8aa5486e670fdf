//! Surfaces from Wavefront OBJ files: lines `v x y z` and `f a b c ..`, in small letters or capitals, which a backslash at the end joins with the
//! next one. What stands behind a `#` and all other lines are read past.
//!
//! A corner of a face is the number of a vertex, from 1, or counted back from the last one so far, from -1. What
//! follows it behind a slash (texture and normal) has no meaning here.

use super::{Surface, check_coordinates, node_number, polygon, text};
use glam::DVec3;
use std::io::Read;

/// Nodes in the order in which faces first name them, and triangles; errors begin with the number of the line.
pub(super) fn read(stream: &mut impl Read) -> Result<Surface, String> {
    let text = text::read(stream)?;
    let (mut positions, mut faces) = (Vec::new(), Vec::new());
    let mut lines = text::lines(&text);
    while let Some((line, text)) = lines.next() {
        let statement = statement(text);
        if !matches!(statement.split_ascii_whitespace().next(), Some("v" | "V" | "f" | "F")) {
            continue;
        }
        let mut statement = statement.to_owned();
        while statement.ends_with('\\') {
            statement.pop();
            statement.push(' ');
            statement.push_str(lines.next().map_or("", |(_, text)| self::statement(text)));
        }
        let bad = |what: &str| format!("line {line}: {what}: {:?}", statement.chars().take(60).collect::<String>());
        let mut words = statement.split_ascii_whitespace();
        if matches!(words.next(), Some("v" | "V")) {
            let mut position = [0.0; 3];
            for coordinate in &mut position {
                let word = words.next().and_then(|word| word.parse().ok());
                *coordinate = word.ok_or_else(|| bad("a vertex has three coordinates"))?;
            }
            positions.push(DVec3::from_array(position));
            node_number(positions.len())?;
        } else {
            let corners: Option<Vec<u32>> = words.map(|word| corner(word, positions.len())).collect();
            let corners = corners.ok_or_else(|| bad("a face has numbers of vertices, counted from 1"))?;
            if corners.len() < 3 {
                return Err(bad("a face has at least three corners"));
            }
            faces.push((line, corners));
        }
    }
    if positions.is_empty() && faces.is_empty() {
        return Err("it has no `v` and no `f` lines: it is not an OBJ text; export the mesh again".to_owned());
    }
    check_coordinates(&positions)?;
    let mut triangles = Vec::new();
    for (line, face) in faces {
        if let Some(corner) = face.iter().find(|corner| **corner as usize >= positions.len()) {
            let number = u64::from(*corner) + 1;
            return Err(format!(
                "line {line}: a face names vertex {number}, of {}: export the mesh again",
                positions.len()
            ));
        }
        triangles.extend(polygon::cut(&face, &positions).map_err(|reason| format!("line {line}: {reason}"))?);
    }
    let mut numbers = vec![None; positions.len()];
    let mut nodes = Vec::new();
    for corner in triangles.as_flattened_mut() {
        *corner = *numbers[*corner as usize].get_or_insert_with(|| {
            nodes.push(positions[*corner as usize]);
            nodes.len() as u32 - 1
        });
    }
    Ok((nodes, triangles))
}

/// The line without a remark.
fn statement(line: &str) -> &str {
    line.split('#').next().unwrap_or_default().trim()
}

/// Number of the vertex that `word` names, from 0, behind `before` vertices.
fn corner(word: &str, before: usize) -> Option<u32> {
    let number: i64 = word.split('/').next()?.parse().ok()?;
    let number = if number < 0 { number.checked_add(i64::try_from(before).ok()?)? } else { number.checked_sub(1)? };
    // One is left, so that messages can count from 1.
    u32::try_from(number).ok().filter(|&number| number < u32::MAX)
}
