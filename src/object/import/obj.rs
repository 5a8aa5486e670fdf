//! Surfaces from Wavefront OBJ files: lines `v x y z` and `f a b c ..`. All other lines are read past.
//!
//! A corner of a face is the number of a vertex, from 1, or counted back from the last one so far, from -1. What
//! follows it behind a slash (texture and normal) has no meaning here.

use super::{Surface, node_number};
use glam::DVec3;
use std::io::BufRead;

/// Nodes in the order in which faces first name them, and triangles; errors begin with the number of the line.
pub(super) fn read(stream: &mut impl BufRead) -> Result<Surface, String> {
    let (mut positions, mut triangles) = (Vec::new(), Vec::new());
    let (mut bytes, mut corners, mut line) = (Vec::new(), Vec::new(), 0);
    loop {
        bytes.clear();
        line += 1;
        if stream.read_until(b'\n', &mut bytes).map_err(|error| error.to_string())? == 0 {
            break;
        }
        let text = String::from_utf8_lossy(&bytes);
        let bad = |what: &str| format!("line {line}: {what}: {:?}", text.trim().chars().take(60).collect::<String>());
        let mut words = text.split_ascii_whitespace();
        match words.next() {
            Some("v") => {
                let mut position = [0.0; 3];
                for coordinate in &mut position {
                    let word = words.next().and_then(|word| word.parse().ok());
                    *coordinate = word.ok_or_else(|| bad("a vertex has three coordinates"))?;
                }
                positions.push(DVec3::from_array(position));
                node_number(positions.len())?;
            }
            Some("f") => {
                corners.clear();
                for word in words {
                    let number = corner(word, positions.len()).ok_or_else(|| bad("a face has numbers of vertices"))?;
                    corners.push(number);
                }
                if corners.len() < 3 {
                    return Err(bad("a face has at least three corners"));
                }
                triangles.extend((2..corners.len()).map(|k| [corners[0], corners[k - 1], corners[k]]));
            }
            _ => (),
        }
    }
    let mut numbers = vec![None; positions.len()];
    let mut nodes = Vec::new();
    for corner in triangles.as_flattened_mut() {
        let known = numbers.get_mut(*corner as usize);
        let known = known.ok_or_else(|| format!("a face names vertex {}, of {}", *corner + 1, positions.len()))?;
        *corner = *known.get_or_insert_with(|| {
            nodes.push(positions[*corner as usize]);
            nodes.len() as u32 - 1
        });
    }
    Ok((nodes, triangles))
}

/// Number of the vertex that `word` names, from 0, behind `before` vertices.
fn corner(word: &str, before: usize) -> Option<u32> {
    let number: i64 = word.split('/').next()?.parse().ok()?;
    let number = if number < 0 { number.checked_add(i64::try_from(before).ok()?)? } else { number.checked_sub(1)? };
    // One is left, so that messages can count from 1.
    u32::try_from(number).ok().filter(|&number| number < u32::MAX)
}
