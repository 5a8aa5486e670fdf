//! Files and requests that are refused, with the place and the remedy.

use super::{arm, file};
use haptize::robot::{Robot, sample};

/// The robot that the cases below alter.
const PLAIN: &str = r#"<robot name="plain">
<link name="base"/>
<link name="arm"><collision><geometry><box size="0.1 0.02 0.02"/></geometry></collision></link>
<link name="hand"/>
<joint name="turn" type="revolute">
<parent link="base"/><child link="arm"/><axis xyz="0 1 0"/><limit lower="-1" upper="1"/>
</joint>
<joint name="grip" type="fixed"><parent link="arm"/><child link="hand"/></joint>
</robot>"#;

/// Part of the plain robot, what stands there instead, the line that the message must name, and words that it must
/// have.
const CASES: &[(&str, &str, usize, &[&str])] = &[
    ("</robot>", "", 1, &["not well-formed XML"]),
    ("<robot name=\"plain\">", "name = \"plain\"", 1, &["no URDF and no MJCF file"]),
    (
        "<robot name=\"plain\">",
        "<!DOCTYPE r [<!ENTITY a \"&b;&b;\">]><robot name=\"plain\">",
        1,
        &["document type", "remove"],
    ),
    ("<robot name=\"plain\">", "<robot xmlns:xacro=\"http://www.ros.org/wiki/xacro\"><xacro:arg/>", 1, &["xacro FILE"]),
    ("<robot name=\"plain\">", "<robot><xacro:arg/>", 1, &["xacro FILE"]),
    ("lower=\"-1\"", "lower=\"${-pi/2}\"", 6, &["xacro"]),
    ("<box size=\"0.1 0.02 0.02\"/>", "<mesh filename=\"$(find arm)/hand.stl\"/>", 3, &["xacro FILE"]),
    ("<box size=\"0.1 0.02 0.02\"/>", "<mesh filename=\"package://${arm}/hand.stl\"/>", 3, &["xacro FILE"]),
    ("name=\"turn\"", "name=\"a&#10;b: sound\"", 5, &["\\u000a", "U+000A"]),
    ("lower=\"-1\"", "lower=\"one\"", 6, &["\"one\"", "no number"]),
    ("lower=\"-1\"", "lower=\"nan\"", 6, &["nan"]),
    ("upper=\"1\"", "upper=\"-2\"", 5, &["must be less"]),
    ("<limit lower=\"-1\" upper=\"1\"/>", "<limit effort=\"3\"/>", 5, &["no limits", "<limit"]),
    (
        "<limit lower=\"-1\" upper=\"1\"/>",
        "<limit lower=\"-1\" upper=\"1\"/><mimic joint=\"turn\"/>",
        5,
        &["follows itself", "<mimic>"],
    ),
    ("revolute", "floating", 5, &["floating", "fixed"]),
    ("revolute", "planar", 5, &["planar", "fixed"]),
    ("revolute", "ball", 5, &["\"ball\"", "revolute"]),
    ("xyz=\"0 1 0\"", "xyz=\"0 0 0\"", 5, &["axis zero"]),
    ("xyz=\"0 1 0\"", "xyz=\"0 1\"", 6, &["3 numbers"]),
    ("xyz=\"0 1 0\"", "xyz=\"0 1 0 0\"", 6, &["there are 4"]),
    ("<child link=\"arm\"/>", "<child link=\"leg\"/>", 6, &["no link \"leg\""]),
    ("<parent link=\"base\"/>", "", 5, &["<parent"]),
    ("<parent link=\"base\"/>", "<parent link=\"hand\"/>", 8, &["circle"]),
    ("<child link=\"hand\"/>", "<child link=\"arm\"/>", 8, &["child of the joint on line 5"]),
    ("<link name=\"hand\"/>", "<link name=\"arm\"/>", 4, &["two links", "\"arm\""]),
    ("name=\"grip\"", "name=\"turn\"", 8, &["two joints", "\"turn\""]),
    ("<link name=\"hand\"/>", "<link name=\"hand\"/><link name=\"tray\"/>", 4, &["\"base\" and \"tray\"", "one root"]),
    ("<link name=\"hand\"/>", "<link/>", 4, &["attribute name"]),
    ("<box size=\"0.1 0.02 0.02\"/>", "<box size=\"0.1 0 0.02\"/>", 3, &["positive"]),
    ("<box size=\"0.1 0.02 0.02\"/>", "<sphere radius=\"-1\"/>", 3, &["positive"]),
    ("<box size=\"0.1 0.02 0.02\"/>", "<capsule radius=\"1\"/>", 3, &["<capsule>", "cylinder"]),
    ("<box size=\"0.1 0.02 0.02\"/>", "", 3, &["<geometry>"]),
    ("<box size=\"0.1 0.02 0.02\"/>", "<mesh filename=\"meshes/arm.stl\"/>", 3, &["no file", "meshes/arm.stl"]),
    (
        "<box size=\"0.1 0.02 0.02\"/>",
        "<mesh filename=\"package://nowhere/a.stl\"/>",
        3,
        &["\"nowhere\"", "--package-path"],
    ),
    ("<box size=\"0.1 0.02 0.02\"/>", "<mesh filename=\"https://a.org/a.stl\"/>", 3, &["https", "copy"]),
    ("<box size=\"0.1 0.02 0.02\"/>", "<mesh filename=\"arm.urdf\"/>", 3, &[".obj, .stl, .ply"]),
    ("<box size=\"0.1 0.02 0.02\"/>", "<mesh filename=\"meshes/tip.obj\" scale=\"1 0 1\"/>", 3, &["scale"]),
    (
        "<link name=\"hand\"/>",
        "<link name=\"hand\"><inertial><mass value=\"1\"/><inertia ixx=\"1\" iyy=\"1\" izz=\"1\" ixy=\"2\"/>\
         </inertial></link>",
        4,
        &["negative eigenvalue"],
    ),
    ("<link name=\"hand\"/>", "<link name=\"hand\"><inertial><mass value=\"-1\"/></inertial></link>", 4, &["mass"]),
    ("<link name=\"hand\"/>", "<link name=\"hand\"><inertial/></link>", 4, &["<mass"]),
];

fn refusal(text: &str) -> String {
    match arm(text, "hand", &[]) {
        Err(error) => error.to_string(),
        Ok((robot, arm)) => sample(&robot, &arm, Some(0.01), None).unwrap_err().to_string(),
    }
}

#[test]
fn what_no_scene_can_hold_is_refused_at_its_line() {
    arm(PLAIN, "hand", &[]).unwrap();
    for (from, to, line, words) in CASES {
        assert!(PLAIN.contains(from), "{from}");
        let message = refusal(&PLAIN.replacen(from, to, 1));
        let says = |word: &&str| message.contains(*word);
        assert!(message.contains(&format!("robot.urdf:{line}:")) && words.iter().all(says), "{to}: {message}");
    }
}

#[test]
fn other_files_are_told_apart() {
    let error = |text: &str| Robot::parse(text.into(), "model.xml").unwrap_err().to_string();
    assert!(error("<sdf version=\"1.9\"/>").contains("<sdf>"));
    assert!(error("<mujoco model=\"x\"/>").contains("no <worldbody>"));
    assert!(error("").contains("no URDF and no MJCF file") && error("<robot").contains("not well-formed"));
    let xacro = Robot::parse(PLAIN.into(), "plain.urdf.xacro").unwrap_err().to_string();
    assert!(xacro.contains("pip install xacro"), "{xacro}");
    let folder = Robot::load(file("")).unwrap_err().to_string();
    assert!(folder.contains("cannot read the robot"), "{folder}");
    // A declaration that nothing uses is harmless.
    arm(&PLAIN.replace("<robot ", "<robot xmlns:xacro=\"http://www.ros.org/wiki/xacro\" "), "hand", &[]).unwrap();
}

/// Deep nesting and long lists end in an answer, not in an overflow.
#[test]
fn hostile_xml_is_refused_soon() {
    let deep = format!("<robot>{}{}</robot>", "<a>".repeat(100_000), "</a>".repeat(100_000));
    assert!(refusal(&deep).contains("no link \"hand\"; the robot has no links at all"));
    let joint = |from: &str, to: &str| {
        format!("<joint name=\"{from}{to}\" type=\"fixed\"><parent link=\"{from}\"/><child link=\"{to}\"/></joint>")
    };
    let circle = format!("<robot><link name=\"a\"/><link name=\"b\"/>{}{}</robot>", joint("a", "b"), joint("b", "a"));
    assert!(refusal(&circle).contains("circle"), "{}", refusal(&circle));
    assert!(refusal(&format!("<robot>{}", "<a>".repeat(100_000))).contains("not well-formed"));
    assert!(refusal(&format!("<robot>{}</robot>", "<a/>".repeat(2 << 20))).contains("not well-formed"));
    // What the parser compares by pairs.
    let many = |attribute: &str| (0..100_000).map(|k| format!(" {attribute}{k} = \"\"")).collect::<String>();
    let began = std::time::Instant::now();
    for attributes in [many("a"), many("xmlns:n"), many("a").replace(" = \"\"", "='<'")] {
        let message = refusal(&format!("<robot>\n<link name=\"base\"{attributes}/></robot>"));
        assert!(message.contains(":2:"), "{message}");
    }
    let declared: String = (0..2000).map(|k| format!("<a xmlns:n{k}=\"u{k}\">")).collect();
    assert!(refusal(&format!("<robot>{declared}")).contains("namespaces"));
    // Each joint beside the chain is noted with its line.
    let beside: String = (0..30_000)
        .map(|k| {
            format!(
                "<link name=\"s{k}\"/>\n<joint name=\"b{k}\" type=\"continuous\"><parent link=\"arm\"/>\
                 <child link=\"s{k}\"/></joint>\n"
            )
        })
        .collect();
    let star = arm(&PLAIN.replace("</robot>", &format!("{beside}</robot>")), "hand", &[]).unwrap().1;
    assert!(star.notes.len() < 300 && star.notes.iter().any(|note| note.message.contains("more to note")));
    assert!(began.elapsed().as_secs() < 20, "{:?}", began.elapsed());
    let chain: String = (0..2000)
        .map(|k| format!("<link name=\"l{k}\"/>{}", joint(&format!("l{k}"), &format!("l{}", k + 1))))
        .collect();
    let long = format!("<robot>{chain}<link name=\"l2000\"/></robot>");
    assert!(arm(&long, "l2000", &[]).unwrap_err().to_string().contains("no joint moves"));
}

#[test]
fn requests_that_do_not_fit_the_robot_name_what_does() {
    let text = std::fs::read_to_string(file("arm.urdf")).unwrap();
    let refused = |tip: &str, locks: &[(&str, f64)]| arm(&text, tip, locks).unwrap_err().to_string();
    for (tip, locks, words) in [
        ("none", &[][..], &["no link \"none\"", "probe"][..]),
        ("base", &[], &["no joint moves"]),
        ("probe", &[("nod", 0.0)], &["no joint \"nod\"", "bend"]),
        ("probe", &[("bend", 2.0)], &["-1.2", "1.5"]),
        ("probe", &[("bend", 0.2), ("bend", 0.3)], &["twice"]),
        ("probe", &[("flange", 0.0)], &["fixed already"]),
    ] {
        let message = refused(tip, locks);
        words.iter().for_each(|word| assert!(message.contains(word), "{message}"));
    }
    let joint = |k: usize| {
        let kind = "type=\"revolute\"><limit lower=\"-1\" upper=\"1\"/>";
        format!(
            "<link name=\"l{k}\"/><joint name=\"j{k}\" {kind}<parent link=\"l{k}\"/><child link=\"l{}\"/></joint>",
            k + 1
        )
    };
    let long = format!("<robot>{}<link name=\"l13\"/></robot>", (0..13).map(joint).collect::<String>());
    let message = arm(&long, "l13", &[]).unwrap_err().to_string();
    assert!(message.contains("13 moving joints") && message.contains("--lock"), "{message}");
    assert_eq!(arm(&long, "l13", &[("j3", 0.5)]).unwrap().1.joints.len(), 12);
    // No shapes, no contact.
    let (robot, bare) = arm(&long, "l13", &[("j3", 0.5)]).unwrap();
    assert!(sample(&robot, &bare, Some(0.01), None).unwrap_err().to_string().contains("<collision>"));
}

#[test]
fn a_mesh_in_millimetres_is_told_with_its_length_and_scale() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("plate.obj"), "v 0 0 0\nv 100 0 0\nv 0 80 0\nf 1 2 3\n").unwrap();
    let text = PLAIN.replace("<box size=\"0.1 0.02 0.02\"/>", "<mesh filename=\"plate.obj\"/>");
    let told = |text: &str, spacing: f64| {
        let robot = Robot::parse(text.to_owned(), folder.path().join("robot.urdf")).unwrap();
        let arm = haptize::robot::Arm::new(&robot, "hand", &[]).unwrap();
        let notes = haptize::robot::drawn_shapes(&robot, &arm, None).1;
        (sample(&robot, &arm, Some(spacing), None).map(|nodes| nodes.spacing).map_err(|error| error.to_string()), notes)
    };
    let (refused, notes) = told(&text, 0.005);
    let refused = refused.unwrap_err();
    assert!(refused.contains("100 m long") && refused.contains("scale=\"0.001 0.001 0.001\""), "{refused}");
    assert!(notes.len() == 1 && notes[0].line == 3 && notes[0].message.contains("100 m long"), "{notes:?}");
    let (taken, notes) = told(&text.replace("<mesh ", "<mesh scale=\"0.001 0.001 0.001\" "), 0.005);
    assert!(taken.is_ok() && notes.is_empty(), "{taken:?} {notes:?}");
}

#[test]
fn a_spacing_that_makes_too_many_nodes_is_refused_with_one_that_does_not() {
    let (robot, arm) = arm(PLAIN, "hand", &[]).unwrap();
    for spacing in [1e-4, 5e-4, 1e-3] {
        let message = sample(&robot, &arm, Some(spacing), None).unwrap_err().to_string();
        let wider: f64 = message.split("--spacing ").nth(1).unwrap().split(' ').next().unwrap().parse().unwrap();
        assert!(sample(&robot, &arm, Some(wider), None).is_ok(), "{message}");
    }
    for spacing in [0.0, -1.0, 1e-5, f64::NAN, f64::INFINITY] {
        assert!(sample(&robot, &arm, Some(spacing), None).unwrap_err().to_string().contains("at least"));
    }
}
