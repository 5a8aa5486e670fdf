//! The arm of a scene: its joints, those that follow others, and its contact nodes.

use crate::scene::{LEAST, parse, refused};
use haptize::{MAX_AXES, MAX_JOINTS};

#[test]
fn a_follower_narrows_the_range_of_the_joint_that_it_follows_and_follows_no_follower() {
    let with = |follows: &str| {
        let joint = "[[proxy.joint]]\nkind = \"prismatic\"\naxis = [1, 0, 0]\nlimits = [0, 0.1]";
        LEAST.replace("[contact]", &format!("{joint}\nfollows = {{ {follows} }}\n[contact]"))
    };
    let proxy = parse(&with("joint = \"q1\", multiplier = -0.25, offset = 0.05")).unwrap().proxy;
    assert_eq!((proxy.joints.len(), proxy.joints[0].limits), (1, [-0.2, 0.2]));
    let [follower] = &proxy.followers[..] else { panic!("{proxy:?}") };
    assert_eq!((follower.leader, follower.link, follower.spec.rotor_inertia), (0, 1, 0.0));
    for (follows, words) in [
        ("joint = \"q9\"", "no joint \"q9\" that moves independently: name one of q1"),
        ("joint = \"q2\"", "no joint \"q2\" that moves independently"),
        ("joint = \"q1\", multiplier = 0", "multiplier is 0"),
        ("joint = \"q1\", multiplier = inf", "finite"),
        ("joint = \"q1\", offset = 3", "widen limits"),
        ("joint = \"q1\", factor = 3", "unknown field `factor`"),
        ("multiplier = 2", "missing field `joint`"),
    ] {
        let text = with(follows);
        let (error, (line, _)) = refused(&text);
        assert!(text.lines().nth(line - 1).unwrap().starts_with("follows"), "{error}");
        assert!(error.to_string().contains(words), "{follows}: {error}");
    }
    let alone = LEAST.replace("limits = [-1, 1]", "limits = [-1, 1]\nfollows = { joint = \"q1\" }");
    assert!(refused(&alone).0.to_string().contains("let one joint follow none"));
}

#[test]
fn lines_of_nodes_include_both_ends() {
    let text =
        LEAST.replace("{ at = [0.1, 0, 0] }", "{ from = [0, 0, 0], to = [0, 0, 0.3], count = 4, radius = 0.01 }");
    let nodes = parse(&text).unwrap().proxy.joints[0].nodes.clone();
    let heights: Vec<f64> = nodes.iter().map(|node| node.position.z).collect();
    assert!(heights.iter().zip([0.0, 0.1, 0.2, 0.3]).all(|(a, b)| (a - b).abs() < 1e-15) && heights.len() == 4);
    assert!(nodes.iter().all(|node| node.radius == 0.01));
}

#[test]
fn the_number_of_joints_is_one_to_twelve_and_six_with_a_grid() {
    let joint = "[[proxy.joint]]\nkind = \"revolute\"\naxis = [0, 0, 1]\nlimits = [0, 0.5]\n";
    let arm = |extra: usize| LEAST.replace("[contact]", &format!("{}[contact]", joint.repeat(extra)));
    assert_eq!(parse(&arm(5)).unwrap().proxy.joints.len(), MAX_AXES);
    let refused = parse(&arm(6)).unwrap_err().to_string();
    assert!(
        refused.contains("at most 6 axes, and the arm has 7 joints") && refused.contains("haptize play"),
        "{refused}"
    );
    let free = |extra: usize| parse(&arm(extra).replace("[grid]\nspacing = 0.1", ""));
    assert_eq!(free(11).unwrap().proxy.joints.len(), MAX_JOINTS);
    assert!(free(12).unwrap_err().to_string().contains("13 joints: it must have 1 to 12"));
    let none = LEAST.replace("[[proxy.joint]]", "[proxy]\njoint = []\n[unused]");
    assert!(parse(&none).is_err());
    let empty = "[proxy]\njoint = []\n".to_owned();
    let (start, end) = (LEAST.find("[[proxy").unwrap(), LEAST.find("[contact]").unwrap());
    let none = format!("{}{empty}{}", &LEAST[..start], &LEAST[end..]);
    assert!(parse(&none).unwrap_err().to_string().contains("0 joints"));
}

#[test]
fn joints_of_the_same_name_are_refused() {
    let joint = "[[proxy.joint]]\nname = \"q1\"\nkind = \"revolute\"\naxis = [0, 0, 1]\nlimits = [0, 0.5]\n";
    let error = parse(&LEAST.replace("[contact]", &format!("{joint}[contact]"))).unwrap_err().to_string();
    assert!(error.contains("two joints are called \"q1\""), "{error}");
}
