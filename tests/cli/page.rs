//! Pages for a browser: their numbers are those of the session, and nothing in them ends where it should not or asks for
//! another file. `docs/site/browser.py` opens them.

use crate::report::{arm, counts, dataset, recording, sphere};
use base64::{Engine, prelude::BASE64_STANDARD};
use bytemuck::pod_collect_to_vec;
use flate2::read::ZlibDecoder;
use glam::DVec3;
use haptize::{
    contact::Status,
    report::page::{OPENING, Page},
};
use serde_json::Value;
use std::io::Read;

/// The text of the element that begins with `tag`.
fn within<'a>(html: &'a str, tag: &str) -> &'a str {
    let (_, rest) = html.split_once(tag).unwrap();
    rest.split_once("</script>").unwrap().0
}

/// The numbers of a page: what its script reads.
struct Numbers {
    scene: Value,
    bytes: Vec<u8>,
}

impl Numbers {
    fn new(html: &str) -> Self {
        let scene = serde_json::from_str(within(html, r#"<script type="application/json" id="scene">"#)).unwrap();
        let data = within(html, r#"<script type="application/octet-stream;base64" id="data">"#);
        let deflated = BASE64_STANDARD.decode(data).unwrap();
        let mut bytes = Vec::new();
        ZlibDecoder::new(&deflated[..]).read_to_end(&mut bytes).unwrap();
        Self { scene, bytes }
    }

    fn array<T: bytemuck::Pod>(&self, span: &Value, name: &str) -> Vec<T> {
        assert_eq!(span["type"], name);
        let [at, length] = ["at", "length"].map(|key| span[key].as_u64().unwrap() as usize);
        pod_collect_to_vec(&self.bytes[at..at + length * size_of::<T>()])
    }

    fn floats(&self, span: &Value) -> Vec<f32> {
        self.array(span, "f32")
    }
}

#[test]
fn a_page_holds_the_numbers_of_the_session() {
    let (chain, object) = (arm(3), sphere());
    let (dataset, trace) = (dataset(&chain, &object, counts(3)), recording(&chain, &object, 3000));
    let html = Page::session("press".into(), &dataset, &chain, &trace, None).unwrap().html().unwrap();
    let page = Numbers::new(&html);
    let (body, rows, plane) = (&page.scene["body"], &page.scene["rows"], &page.scene["plane"]);

    // Ticks: one of two, and none of the larger torques is left out.
    let (times, torques) = (page.floats(&rows["time"]), page.floats(&rows["torque"]));
    let (q, contact) = (page.floats(&rows["q"]), page.array::<u8>(&rows["contact"], "u8"));
    assert_eq!((times.len(), torques.len(), contact.len()), (1500, 4500, 1500));
    for (row, pair) in trace.ticks.chunks(2).enumerate() {
        let tick = pair.iter().find(|tick| tick.time as f32 == times[row]).unwrap();
        assert!(pair.iter().all(|other| other.sample.torque.norm() <= tick.sample.torque.norm()));
        for joint in 0..3 {
            assert_eq!(torques[3 * row + joint], tick.sample.torque[joint] as f32);
            assert_eq!(q[3 * row + joint], tick.proxy[joint] as f32);
        }
        assert_eq!(contact[row] == 1, tick.sample.contact);
    }

    // Frames: positions to half a step, a two-thousandth of the greatest displacement.
    let (unit, frames) = (body["unit"].as_f64().unwrap(), body["times"].as_array().unwrap());
    let (rest, moves) = (page.floats(&body["rest"]), page.array::<i16>(&body["moves"], "i16"));
    assert_eq!((frames.len(), moves.len()), (trace.frames.len(), trace.frames.len() * rest.len()));
    let mut moved = vec![0_i32; rest.len()];
    let (mut worst, mut largest) = (0.0_f64, 0.0_f64);
    for (frame, moves) in trace.frames.iter().zip(moves.chunks(rest.len())) {
        moved.iter_mut().zip(moves).for_each(|(sum, moved)| *sum += i32::from(*moved));
        for (node, n) in frame.nodes.iter().enumerate() {
            let at = DVec3::from_array(
                [0, 1, 2].map(|k| f64::from(rest[3 * node + k]) + unit * f64::from(moved[3 * node + k])),
            );
            worst = worst.max((at - *n).abs().max_element());
            largest = largest.max(n.distance(object.rest[node]));
        }
    }
    assert!((largest / unit - 1000.0).abs() < 1e-9 && worst < 0.51 * unit, "{worst} m, steps of {unit} m");

    // Forces: their sum at each frame is what the contact there makes.
    let forces = page.floats(&body["forces"]);
    let counts: Vec<usize> =
        body["counts"].as_array().unwrap().iter().map(|count| count.as_u64().unwrap() as usize).collect();
    assert_eq!((counts.iter().sum::<usize>(), counts.len()), (forces.len() / 4, frames.len()));
    assert!(counts.iter().any(|count| *count > 0) && counts[0] == 0);

    // The plane: torque of the grid points, zero where they are free.
    let index = |key: &str, side: usize| plane[key][side].as_u64().unwrap() as usize;
    let cells = index("count", 0) * index("count", 1);
    let torque = page.floats(&plane["torque"]);
    assert_eq!(torque.len(), 3 * cells);
    let grid = &dataset.grid;
    let mut in_contact = 0;
    for cell in 0..cells {
        let at = [cell % index("count", 0), cell / index("count", 0)];
        let matching = (0..grid.points()).filter(|point| {
            let q = grid.configuration(*point);
            [0, 1].iter().all(|&side| {
                let wanted =
                    plane["start"][side].as_f64().unwrap() + at[side] as f64 * plane["step"][side].as_f64().unwrap();
                (q[index("axes", side)] - wanted).abs() < 1e-9
            })
        });
        let equals = |point: usize| {
            let zero = dataset.status(point) == Status::Free;
            (0..3).all(|joint| {
                torque[joint * cells + cell] == if zero { 0.0 } else { dataset.torque(point)[joint] as f32 }
            })
        };
        assert!(matching.into_iter().any(equals), "cell {cell}");
        in_contact += usize::from(torque[cells + cell] != 0.0);
    }
    assert!(in_contact > 5 && in_contact < cells, "{in_contact} of {cells}");
}

/// Checks that every element that is opened is closed, in order, and returns the names of all.
fn elements(html: &str) -> Vec<String> {
    let is_empty = |name: &str| ["!doctype", "meta", "input"].contains(&name);
    let (mut open, mut all, mut rest) = (Vec::new(), Vec::new(), html);
    while let Some((_, after)) = rest.split_once('<') {
        let (tag, after) = after.split_once('>').unwrap();
        let name = tag.split([' ', '\n']).next().unwrap();
        rest = after;
        if let Some(name) = name.strip_prefix('/') {
            assert_eq!(open.pop().as_deref(), Some(name), "{tag}");
        } else if !is_empty(name) && !tag.ends_with('/') {
            open.push(name.to_owned());
            all.push(name.to_owned());
            if ["script", "style"].contains(&name) {
                rest = &rest[rest.find(&format!("</{name}>")).unwrap()..];
            }
        }
    }
    assert_eq!(open, [""; 0]);
    all
}

#[test]
fn a_page_is_well_formed_and_asks_for_no_other_file_whatever_things_are_called() {
    let (mut chain, object) = (arm(3), sphere());
    let hostile = r#"</script><script>{data} & "'--><title>"#;
    let mut trace = recording(&chain, &object, 900);
    let plain = {
        let dataset = dataset(&chain, &object, counts(3));
        Page::session("press".into(), &dataset, &chain, &trace, None).unwrap().html().unwrap()
    };
    hostile.clone_into(&mut chain.joints[1].name);
    hostile.clone_into(&mut trace.joints[1].name);
    let dataset = dataset(&chain, &object, counts(3));
    let html = Page::session(hostile.into(), &dataset, &chain, &trace, None).unwrap().html().unwrap();
    assert!(html.starts_with(OPENING));
    assert_eq!(elements(&html), elements(&plain));
    assert_eq!(Numbers::new(&html).scene["joints"][1]["name"], hostile);
    // Nothing may be loaded, by the page's own word to the browser.
    assert!(html.contains(r#"content="default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'""#));
    let code: String =
        html.split("<script type=").map(|part| part.split_once("</script>").map_or(part, |(_, rest)| rest)).collect();
    for address in ["http:", "https:", "src=", "href=", "url(", "@import", "import("] {
        assert!(!code.contains(address), "{address}");
    }
    // Without frames and over one joint there is less to see, and still a page.
    trace.frames.clear();
    let (one, line) = (arm(1), recording(&arm(1), &object, 50));
    let html = Page::session("one".into(), &crate::report::dataset(&one, &object, counts(1)), &one, &line, None);
    let page = Numbers::new(&html.unwrap().html().unwrap());
    assert!(page.scene["plane"].is_null() && !page.scene["body"].is_null());
    let page = Numbers::new(&Page::session("still".into(), &dataset, &chain, &trace, None).unwrap().html().unwrap());
    assert!(page.scene["body"].is_null() && !page.scene["plane"].is_null());
}
