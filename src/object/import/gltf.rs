//! glTF 2.0 files, as text (`.gltf`) or in bytes (`.glb`) (Khronos, glTF 2.0 Specification).
//!
//! Read are the triangles of the scene, at the places of their nodes; materials, textures, animations and cameras are
//! left out. glTF's y points up; here z does, so that what Blender exports comes back as it was drawn.

use super::{
    Input, Mesh,
    cell::{fan, strip},
    elements::Elements,
    node_number,
    numbers::{Encoding, NumberType, Numbers},
    open,
};
use base64::{Engine as _, engine::general_purpose::STANDARD};
use glam::{DAffine3, DMat3, DMat4, DQuat, DVec3};
use serde::Deserialize;
use std::io::Read;

/// How a binary file and its parts begin.
const MAGIC: &[u8] = b"glTF";
const JSON: &[u8] = b"JSON";
const BIN: &[u8] = b"BIN\0";

/// Extensions that change no triangle. Others that a file requires are refused.
const HARMLESS: [&str; 5] = ["KHR_mesh_quantization", "KHR_materials", "KHR_texture", "EXT_texture", "KHR_lights"];

/// Modes of primitives that are triangles: each by itself, in strips, in fans.
const TRIANGLES: u32 = 4;
const STRIP: u32 = 5;
const FAN: u32 = 6;

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Document {
    #[serde(default)]
    extensions_required: Vec<String>,
    scene: Option<usize>,
    #[serde(default)]
    scenes: Vec<Scene>,
    #[serde(default)]
    nodes: Vec<Node>,
    #[serde(default)]
    meshes: Vec<Primitives>,
    #[serde(default)]
    accessors: Vec<Accessor>,
    #[serde(default)]
    buffer_views: Vec<View>,
    #[serde(default)]
    buffers: Vec<Buffer>,
}

#[derive(Deserialize)]
struct Scene {
    #[serde(default)]
    nodes: Vec<usize>,
}

#[derive(Deserialize)]
struct Node {
    mesh: Option<usize>,
    skin: Option<usize>,
    #[serde(default)]
    children: Vec<usize>,
    matrix: Option<[f64; 16]>,
    translation: Option<[f64; 3]>,
    rotation: Option<[f64; 4]>,
    scale: Option<[f64; 3]>,
}

impl Node {
    /// From the node's frame to its parent's.
    fn place(&self) -> DAffine3 {
        if let Some(matrix) = self.matrix {
            return DAffine3::from_mat4(DMat4::from_cols_array(&matrix));
        }
        let rotation = DQuat::from_array(self.rotation.unwrap_or([0.0, 0.0, 0.0, 1.0]));
        let rotation = if rotation.length() > 0.0 { rotation.normalize() } else { DQuat::IDENTITY };
        DAffine3::from_scale_rotation_translation(
            DVec3::from_array(self.scale.unwrap_or([1.0; 3])),
            rotation,
            DVec3::from_array(self.translation.unwrap_or_default()),
        )
    }
}

#[derive(Deserialize)]
struct Primitives {
    primitives: Vec<Primitive>,
}

#[derive(Deserialize)]
struct Primitive {
    attributes: Attributes,
    indices: Option<usize>,
    mode: Option<u32>,
}

#[derive(Deserialize)]
struct Attributes {
    #[serde(rename = "POSITION")]
    position: Option<usize>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Accessor {
    buffer_view: Option<usize>,
    #[serde(default)]
    byte_offset: usize,
    component_type: u32,
    #[serde(default)]
    normalized: bool,
    count: usize,
    r#type: String,
    sparse: Option<serde::de::IgnoredAny>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct View {
    buffer: usize,
    #[serde(default)]
    byte_offset: usize,
    byte_length: usize,
    byte_stride: Option<usize>,
}

#[derive(Deserialize)]
struct Buffer {
    uri: Option<String>,
}

/// Reads a file, and the files of bytes beside it that it names.
pub(super) fn read(input: &mut Input<'_>) -> Result<Mesh, String> {
    let bytes = input.bytes()?;
    let (text, own) = if bytes.starts_with(MAGIC) { chunks(&bytes)? } else { (&bytes[..], None) };
    let document: Document = serde_json::from_slice(text.strip_prefix(b"\xef\xbb\xbf").unwrap_or(text))
        .map_err(|error| format!("it is no glTF 2.0: {error}"))?;
    let is_harmless = |name: &String| HARMLESS.iter().any(|start| name.starts_with(start));
    if let Some(name) = document.extensions_required.iter().find(|name| !is_harmless(name)) {
        return Err(format!("it requires {name:?}, which is not read: export it without compression and extensions"));
    }
    let buffers: Result<Vec<Vec<u8>>, String> =
        document.buffers.iter().map(|buffer| content(buffer, own, input)).collect();
    let buffers = buffers?;
    let most = bytes.len() + buffers.iter().map(Vec::len).sum::<usize>();
    let mut scene = Reader { document: &document, buffers: &buffers, most, elements: Elements::new(&[]) };
    // Without a scene all nodes that are no one's children are there.
    let roots = match document.scenes.get(document.scene.unwrap_or(0)) {
        Some(scene) => scene.nodes.clone(),
        None => {
            let mut is_child = vec![false; document.nodes.len()];
            document.nodes.iter().flat_map(|node| &node.children).for_each(|&child| {
                is_child.get_mut(child).into_iter().for_each(|is_child| *is_child = true);
            });
            (0..is_child.len()).filter(|&node| !is_child[node]).collect()
        }
    };
    let upright = DAffine3::from_mat3(DMat3::from_cols(DVec3::X, DVec3::Z, -DVec3::Y));
    scene.walk(&roots, upright)?;
    if scene.elements.corners_of_faces() == 0 {
        return Err("it has no triangles in its scene: export the mesh again".to_owned());
    }
    scene.elements.mesh()
}

/// The text of a binary file, and its bytes: parts of a length, a kind and as many bytes.
fn chunks(bytes: &[u8]) -> Result<(&[u8], Option<&[u8]>), String> {
    let mut file = Numbers::binary(bytes, Encoding::Little);
    file.take(MAGIC.len())?;
    let version = file.integer(NumberType::U32)?;
    if version != 2 {
        return Err(format!("it is glTF {version}, and glTF 2 is read: export the mesh again"));
    }
    file.integer(NumberType::U32)?;
    let mut chunk = |kind: &[u8]| -> Result<&[u8], String> {
        let length = file.integer(NumberType::U32)? as usize;
        if file.take(kind.len())? != kind {
            return Err(file.error("another part of a glTF file belongs here: export the mesh again"));
        }
        file.take(length)
    };
    Ok((chunk(JSON)?, chunk(BIN).ok()))
}

/// The bytes of a buffer: `own` of a binary file, base64, or another file's.
fn content(buffer: &Buffer, own: Option<&[u8]>, input: &Input<'_>) -> Result<Vec<u8>, String> {
    let Some(uri) = &buffer.uri else {
        return own
            .map(<[u8]>::to_vec)
            .ok_or_else(|| "its bytes are missing: it was cut off; export the mesh again".into());
    };
    if let Some(data) = uri.strip_prefix("data:") {
        let text = data.split_once(";base64,").map(|(_, text)| text);
        let bytes = text.and_then(|text| STANDARD.decode(text).ok());
        return bytes.ok_or_else(|| "the bytes in it are no base64: export the mesh again".into());
    }
    if uri.contains("://") || uri.split(['/', '\\']).any(|part| part == "..") || uri.starts_with(['/', '\\']) {
        return Err(format!("its bytes are in {uri:?}: put that file into the same folder, or export as .glb"));
    }
    let path = input.path.with_file_name(uri.replace("%20", " "));
    let mut bytes = Vec::new();
    open(&path).map_err(|error| error.to_string())?.read_to_end(&mut bytes).map_err(|error| error.to_string())?;
    Ok(bytes)
}

/// Triangles of a scene as they are found.
struct Reader<'a> {
    document: &'a Document,
    buffers: &'a [Vec<u8>],
    /// Most corners of triangles: the bytes of all files.
    most: usize,
    elements: Elements<'a>,
}

impl Reader<'_> {
    /// Adds the meshes of `roots` and of all below them, whose parent is at `place`.
    fn walk(&mut self, roots: &[usize], place: DAffine3) -> Result<(), String> {
        let mut is_known = vec![false; self.document.nodes.len()];
        let mut open: Vec<(usize, DAffine3)> = roots.iter().rev().map(|&root| (root, place)).collect();
        while let Some((number, place)) = open.pop() {
            let node = self.document.nodes.get(number);
            let node = node.ok_or_else(|| format!("there is no node {number}: export the mesh again"))?;
            if std::mem::replace(&mut is_known[number], true) {
                return Err(format!("node {number} has two parents: export the mesh again"));
            }
            let place = place * node.place();
            if let Some(mesh) = node.mesh {
                if node.skin.is_some() {
                    return Err(format!("a skeleton bends the mesh of node {number}: apply it before the export"));
                }
                let primitives = self.document.meshes.get(mesh);
                let mesh = primitives.ok_or_else(|| format!("there is no mesh {mesh}: export it again"))?;
                for primitive in &mesh.primitives {
                    self.add(primitive, place).map_err(|reason| format!("node {number}: {reason}"))?;
                }
            }
            open.extend(node.children.iter().rev().map(|&child| (child, place)));
        }
        Ok(())
    }

    /// Adds the triangles of `primitive`, if it has some.
    fn add(&mut self, primitive: &Primitive, place: DAffine3) -> Result<(), String> {
        let mode = primitive.mode.unwrap_or(TRIANGLES);
        let (Some(position), TRIANGLES | STRIP | FAN) = (primitive.attributes.position, mode) else { return Ok(()) };
        let positions = self.numbers(position, "VEC3")?;
        let count = node_number(positions.len() / 3)?;
        let first = node_number(self.elements.nodes.len())?;
        let corners: Vec<u32> = match primitive.indices {
            Some(indices) => self.numbers(indices, "SCALAR")?.into_iter().map(|number| number as u32).collect(),
            None => (0..count).collect(),
        };
        if let Some(corner) = corners.iter().find(|corner| **corner >= count) {
            return Err(format!("a triangle names node {corner}, counted from 0, of {count}: export the mesh again"));
        }
        if self.elements.corners_of_faces() + self.elements.nodes.len() + corners.len() > self.most {
            let reason = "its parts are repeated so often that they have more corners than the file has bytes: join them \
                          into one mesh";
            return Err(reason.to_owned());
        }
        let place_of = |at: &[f64]| place.transform_point3(DVec3::from_slice(at));
        self.elements.nodes.extend(positions.chunks_exact(3).map(place_of));
        let faces = match mode {
            TRIANGLES => corners.chunks_exact(3).map(<[u32]>::to_vec).collect(),
            STRIP => strip(&corners),
            _ => fan(&corners),
        };
        // A mirrored part is turned inside out again.
        let is_mirrored = place.matrix3.determinant() < 0.0;
        faces.into_iter().try_for_each(|mut face| {
            face.iter_mut().for_each(|corner| *corner += first);
            if is_mirrored {
                face.reverse();
            }
            self.elements.add_face(&face)
        })
    }

    /// The numbers of an accessor, whose elements are of the type `of`.
    fn numbers(&self, accessor: usize, of: &str) -> Result<Vec<f64>, String> {
        use NumberType as N;
        let missing = |what: &str| format!("{what}: export the mesh again");
        let accessor = self.document.accessors.get(accessor).ok_or_else(|| missing("an accessor is missing"))?;
        if accessor.r#type != of {
            return Err(missing(&format!("{} are there where {of} belong", accessor.r#type)));
        }
        let view = accessor.buffer_view.and_then(|view| self.document.buffer_views.get(view));
        let Some(view) = view.filter(|_| accessor.sparse.is_none()) else {
            return Err("it has numbers in sparse form: export the mesh without them".to_owned());
        };
        let (of_component, greatest) = match accessor.component_type {
            5120 => (N::I8, f64::from(i8::MAX)),
            5121 => (N::U8, f64::from(u8::MAX)),
            5122 => (N::I16, f64::from(i16::MAX)),
            5123 => (N::U16, f64::from(u16::MAX)),
            5125 => (N::U32, f64::from(u32::MAX)),
            5126 => (N::F32, 1.0),
            _ => return Err(missing("an accessor has no known type of numbers")),
        };
        let components = if of == "VEC3" { 3 } else { 1 };
        let stride = view.byte_stride.unwrap_or(components * of_component.size()).max(components * of_component.size());
        let bytes = self
            .buffers
            .get(view.buffer)
            .and_then(|bytes| bytes.get(view.byte_offset..)?.get(..view.byte_length)?.get(accessor.byte_offset..));
        let bytes = bytes.ok_or_else(|| missing("a view is beyond its buffer"))?;
        let mut all = Vec::new();
        for k in 0..accessor.count {
            let start = k.checked_mul(stride).filter(|start| *start <= bytes.len());
            let start = start.ok_or_else(|| missing("an accessor is beyond its view"))?;
            let mut numbers = Numbers::binary(&bytes[start..], Encoding::Little);
            for _ in 0..components {
                let number = numbers.real(of_component).map_err(|_| missing("an accessor is beyond its view"))?;
                all.push(if accessor.normalized { (number / greatest).max(-1.0) } else { number });
            }
        }
        Ok(all)
    }
}
