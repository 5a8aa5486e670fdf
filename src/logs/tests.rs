//! Logs as they come: comma decimals, gaps, NaN, repeated stamps, wrong columns, and friction of a known size.

use super::*;

const TWO: &str = r#"
[time]
column = 1
[[joint]]
name = "a"
position = { column = 2 }
torque = { column = 3 }
"#;

fn read(mapping: &str, log: &str) -> Result<(Samples, ImportReport), crate::Error> {
    let mapping = Mapping::parse(mapping, Path::new("map.toml")).unwrap();
    let mut import = Import::new(&mapping);
    import.read(log.as_bytes(), "log.csv", &mut |_, _| {})?;
    import.finish(false).map(|imported| (imported.samples, imported.report))
}

fn refused(mapping: &str, log: &str) -> String {
    read(mapping, log).err().unwrap().to_string()
}

#[test]
fn a_time_that_hardly_ever_goes_on_is_refused() {
    let log: String = (0..100).map(|k| format!("{},{k},1\n", k / 50)).collect();
    let why = refused(TWO, &log);
    assert!(why.contains("98 of 100 rows have the time of the row before: take a column of finer time"), "{why}");
    // Each row twice is what some drivers send.
    let twice: String = (0..100).map(|k| format!("{},{k},1\n", k / 2)).collect();
    assert_eq!(read(TWO, &twice).unwrap().0.len(), 50);
    let forged = TWO
        .replace("column = 2", "column = \"a\\nb: all is well\"")
        .replace("[time]", "[table]\nheader = true\n[time]");
    let why = refused(&forged, "t,q,tau\n1,2,3\n");
    assert!(why.contains("no column is called `a\\u000ab: all is well`") && !why.contains('\n'), "{why}");
    for (separator, named) in [(";", "semicolons"), ("\t", "tabs"), ("|", "there are t|q|tau")] {
        let why = refused(&forged, &"t,q,tau\n1,2,3\n".replace(',', separator));
        assert!(why.contains(named) && (separator == "|" || why.contains("set `delimiter = ")), "{why}");
    }
}

#[test]
fn columns_are_scaled_and_named() {
    let mapping = r#"
        [table]
        header = true
        delimiter = ";"
        decimal = ","
        comment = "%"
        [time]
        column = "t"
        scale = 0.001
        [[joint]]
        name = "elbow"
        position = { column = "angle", scale = 0.5, offset = 1.0 }
        torque = { column = "load", scale = -2.0 }
    "#;
    let log = "\u{feff}% made by hand\r\n\"t\"; load ;angle\r\n0;1,5;2,0\r\n\r\n10;-1,5e0;4\r\n";
    let (samples, report) = read(mapping, log).unwrap();
    assert_eq!(samples.joints[0].name, "elbow");
    assert_eq!(samples.configurations, [2.0, 3.0]);
    assert_eq!(samples.torques, [-3.0, 3.0]);
    assert_eq!((report.rows, report.samples), (2, 2));
    let error = refused(&mapping.replace("\"load\"", "\"force\""), log);
    assert!(error.contains("log.csv:2") && error.contains("`force`") && error.contains("angle"), "{error}");
}

#[test]
fn bad_rows_are_refused_with_their_line_or_dropped_and_counted() {
    let rows = [
        "0,1,1",
        "1,2",
        "2,nan,1",
        "3,,1",
        "3.5,inf,1",
        "4,0x1,1",
        "5,1,1,1",
        "6,3,1",
        "6,4,1",
        "5.5,1,1",
        "7,5,1",
        "8,6,1",
        "9,7,1",
        "10,8,1",
    ];
    let log = rows.join("\n");
    for (bad, line, what) in
        [(1, 2, "2 columns where 3"), (2, 2, "`nan`"), (3, 2, "``"), (5, 2, "`0x1`"), (9, 2, "time goes back")]
    {
        let first = if bad == 9 { rows[7] } else { rows[0] };
        let error = refused(TWO, &[first, rows[bad]].join("\n"));
        assert!(error.contains(&format!("log.csv:{line}")) && error.contains(what), "{error}");
        assert!(error.contains("bad_rows"), "{error}");
    }
    assert!(refused(TWO, "0,\"1\",1\n1,1 5,1").contains("log.csv:2"));
    let dropping = format!("[table]\nbad_rows = \"drop\"\n{TWO}");
    let (samples, report) = read(&dropping, &log).unwrap();
    assert_eq!(samples.configurations, [1.0, 3.0, 5.0, 6.0, 7.0, 8.0]);
    let dropped: Vec<_> = report.dropped.iter().map(|d| (d.reason, d.rows, d.first.as_str())).collect();
    assert_eq!(
        dropped,
        [
            (Reason::Columns, 2, "log.csv:2"),
            (Reason::NotANumber, 4, "log.csv:3"),
            (Reason::RepeatedTime, 1, "log.csv:9"),
            (Reason::TimeGoesBack, 1, "log.csv:10")
        ]
    );
    assert_eq!(report.rows, 14);
    let error = refused(&dropping, &rows[..11].join("\n"));
    assert!(error.contains("7 of 11 rows cannot be used (2 rows have another number of columns, first at"), "{error}");
    // The clock is set back once: all that follows comes before the first row.
    let error = refused(&dropping, "1790000000,1,1\n0,1,1\n1,2,1\n2,3,1\n");
    assert!(error.contains("3 rows have a time before that of an earlier row, first at log.csv:2"), "{error}");
}

#[test]
fn a_header_names_each_column_once_in_utf_8() {
    let named = "[table]\nheader = true\nbad_rows = \"drop\"\n[time]\ncolumn = \"t\"\n[[joint]]\nname = \"a\"\n\
                 position = { column = \"x, y\" }\ntorque = { column = \"f\" }\n";
    let read = |log: &[u8]| {
        let mapping = Mapping::parse(named, Path::new("map.toml")).unwrap();
        let mut import = Import::new(&mapping);
        import.read(log, "log.csv", &mut |_, _| {})?;
        import.finish(false).map(|imported| imported.samples.configurations)
    };
    let refused = |log: &[u8]| read(log).err().unwrap().to_string();
    assert_eq!(read(b"t,\"x, y\",\"note, or none\",f\n0,1,\"a, b\",2\n1,3,,4\n").unwrap(), [1.0, 3.0]);
    assert!(refused(b"t,\"x, y\",f,f\n0,1,2,3\n").contains("log.csv:1: columns 3 and 4 are both called `f`"));
    assert!(refused(b"t,\"x, y\",f,\xb0\n0,1,2,3\n").contains("log.csv:1: the line is not UTF-8"));
    assert!(refused(b"t,\"x, y\",f\r0,1,2\r1,2,3\r").contains("carriage returns"));
    let many: Vec<String> = (0..3000).map(|column| format!("column {column}")).collect();
    let error = refused(many.join(",").as_bytes());
    assert!(error.contains("column 19 and 2980 more") && error.len() < 400, "{error}");
    // The same column may be left unnamed where it is not asked for.
    assert_eq!(read(b"t,\"x, y\",,,f\n0,1,9,9,2\n").unwrap(), [1.0]);
}

#[test]
fn comma_decimals_in_a_table_of_points_are_explained() {
    let spaced = TWO.replace("[time]", "[table]\ndelimiter = \" \"\n[time]");
    let error = refused(&spaced, "0 \t 1.5 2\n1 1,5 2");
    assert!(error.contains("log.csv:2") && error.contains("decimal = \",\""), "{error}");
    for log in ["0;1,5;2", "0;1;2", "0;1;2;3;4"] {
        let error = refused(TWO, log);
        assert!(error.contains("log.csv:1") && error.contains("delimiter = \";\""), "{error}");
    }
}

#[test]
fn binary_files_and_other_text_are_refused_in_small_memory() {
    let binary = vec![7_u8; 3 << 20];
    let mapping = Mapping::parse(TWO, Path::new("map.toml")).unwrap();
    let error = Import::new(&mapping).read(binary.as_slice(), "x.bin", &mut |_, _| {}).err().unwrap().to_string();
    assert!(error.contains("x.bin:1") && error.contains("not a table"), "{error}");
    assert!(refused(TWO, "only one column\n").contains("column 2"));
    assert!(refused(TWO, "").contains("no row was kept"));
    assert!(refused(&TWO.replacen("column = 2", "column = \"x\"", 1), "0,1,2\n").contains("`header = true`"));
}

#[test]
fn mappings_that_cannot_be_are_refused_with_the_line_and_the_key() {
    let bad = |from: &str, to: &str, place: &str, expected: &str| {
        let error = Mapping::parse(&TWO.replacen(from, to, 1), Path::new("map.toml")).err().unwrap().to_string();
        assert!(error.starts_with(&format!("map.toml:{place}: ")) && error.contains(expected), "{to:?}: {error}");
    };
    bad("column = 2", "column = 0", "6:23", "from 1");
    bad("[time]", "[table]\ncolumns = 2\n[time]", "9:21", "column 3 is beyond table.columns");
    bad("column = 2", "column = 2, scale = 0.0", "6:34", "other than zero");
    bad("column = 2", "column = 2, offset = inf", "6:35", "offset");
    bad("column = 2", "column = 2, scael = 1.0", "6:26", "unknown field `scael`");
    bad("column = 1\n", "", "2:1", "[time]");
    bad("column = 1\n", "column = 1\nscale = nan\n", "4:9", "time.scale");
    bad("column = 1\n", "period = 0.0\n", "3:10", "time.period");
    bad("[time]", "[time]\ngap = -1.0", "3:7", "time.gap");
    bad("name = \"a\"", "name = \"\"", "5:8", "is blank");
    bad("name = \"a\"", "name = \"a\\nb: 7128 points, sound\"", "5:8", "a\\u000ab: 7128");
    bad("name = \"a\"", "name = \"a\\u202eb\"", "5:8", "U+202E");
    bad("name = \"a\"", "name = \"a\"\nunit = \"deg\"", "6:8", "unit = \"deg\" }");
    bad("column = 2", "column = 2, unit = \"N\"", "6:33", "which moves in rad: its column needs a unit of rad");
    bad("column = 2", "column = 2, unit = \"furlong\"", "6:33", "unknown variant `furlong`");
    bad("column = 3", "column = 3, unit = \"N\"", "7:31", "which moves in rad: its column needs a unit of N m");
    bad("column = 1\n", "column = 1\nunit = \"mm\"\n", "4:8", "time.unit");
    bad("[time]", "[torque]\nkeep = \"average\"\n[time]", "2:1", "torque.cell");
    bad("[time]", "[torque]\nlead = \"z\"\n[time]", "3:8", "`z`");
    bad("[time]", "[torque]\nstill = -1.0\n[time]", "3:9", "torque.still");
    bad("[time]", "[table]\ndecimal = \",\"\n[time]", "3:11", "same character");
    bad("[time]", "[filter]\ndecimate = 0\n[time]", "3:12", "decimate");
    bad("[time]", "[filter]\noutliers = -1.0\n[time]", "3:12", "outliers");
    assert!(Mapping::load(Path::new("no/such.toml")).err().unwrap().to_string().contains("no/such.toml"));
}

#[test]
fn columns_in_degrees_and_millimetres_are_the_same_as_columns_in_si() {
    let mapping = r#"
        time = { column = 1, unit = "ms" }
        torque = { effort = "motor" }
        [[joint]]
        name = "a"
        position = { column = 2, unit = "deg", offset = 0.1 }
        torque = { column = 3, unit = "N mm" }
        [[joint]]
        name = "b"
        position = { column = 4, unit = "mm", scale = 2.0 }
        torque = { column = 5, unit = "mN" }
    "#;
    let (samples, _) = read(mapping, "0,90,500,3,-7000\n1,-45,0,0,0\n").unwrap();
    let units: Vec<&str> = samples.joints.iter().map(|joint| joint.unit.as_str()).collect();
    assert_eq!(units, ["rad", "m"]);
    let expected = [std::f64::consts::FRAC_PI_2 + 0.1, 0.006, 0.1 - std::f64::consts::FRAC_PI_4, 0.0];
    assert!(samples.configurations.iter().zip(expected).all(|(q, expected)| (q - expected).abs() < 1e-15));
    // What the motors do balances the contact.
    let expected = [-0.5, 7.0, 0.0, 0.0];
    assert!(samples.torques.iter().zip(expected).all(|(tau, expected)| (tau - expected).abs() < 1e-15));
}

#[test]
fn decimation_averages_and_never_across_a_gap() {
    let mapping = TWO.replace("column = 1", "column = 1\ngap = 0.5") + "[filter]\ndecimate = 2\n";
    let (samples, report) = read(&mapping, "0,1,10\n0.1,3,30\n0.2,5,50\n9.0,7,70\n9.1,9,90\n").unwrap();
    assert_eq!(samples.configurations, [2.0, 5.0, 8.0]);
    assert_eq!(samples.torques, [20.0, 50.0, 80.0]);
    assert_eq!(report.gaps, 1);
}

#[test]
fn spikes_are_dropped_and_steps_of_the_encoder_are_not() {
    let mut log = String::new();
    for i in 0..400 {
        let torque = if i == 200 { 90.0 } else { f64::from(i / 7) };
        log += &format!("{},{},{torque}\n", f64::from(i) * 0.001, i / 3);
    }
    let (samples, report) = read(&format!("{TWO}[filter]\noutliers = 6.0\n"), &log).unwrap();
    assert_eq!(samples.len(), 399);
    assert_eq!(report.dropped.len(), 1);
    assert_eq!((report.dropped[0].reason, report.dropped[0].first.as_str()), (Reason::Outlier, "log.csv:201"));
}

/// A swing of `cycles` with stiffness 2, dry friction 0.3 and a small disturbance from cycle to cycle.
fn swing(cycles: usize) -> String {
    let mut log = String::new();
    for i in 0..cycles * 2000 {
        let phase = std::f64::consts::TAU * i as f64 / 2000.0;
        let disturbance = if i / 2000 % 2 == 0 { 0.02 } else { -0.02 };
        let torque = -2.0 * phase.sin() - 0.3 * phase.cos().signum() + disturbance;
        log += &format!("{},{},{torque}\n", i as f64 * 0.001, phase.sin());
    }
    log
}

#[test]
fn both_directions_averaged_cancel_dry_friction_and_the_report_tells_its_size() {
    let keep = |keep: &str| format!("{TWO}[torque]\nkeep = \"{keep}\"\nstill = 0.2\ncell = [0.02]\n");
    let (samples, report) = read(&keep("average"), &swing(6)).unwrap();
    let cells = report.cells.unwrap();
    assert!((cells.hysteresis[0] - 0.3).abs() < 1e-2, "{cells:?}");
    // Disturbances of +-0.02, three visits each: standard deviation 0.02 sqrt(6/5).
    assert!((cells.repeatability[0] - 0.02 * (6.0_f64 / 5.0).sqrt()).abs() < 2e-3, "{cells:?}");
    for (q, torque) in samples.configurations.iter().zip(&samples.torques) {
        assert!((torque + 2.0 * q).abs() < 1e-2, "{q} {torque}");
    }
    for (name, friction) in [("forward", -0.3), ("backward", 0.3)] {
        let (samples, _) = read(&keep(name), &swing(6)).unwrap();
        for (q, torque) in samples.configurations.iter().zip(&samples.torques) {
            assert!((torque + 2.0 * q - friction).abs() < 1e-2, "{name} {q} {torque}");
        }
    }
}

#[test]
fn static_torque_is_that_of_the_rows_at_rest() {
    let mut log = String::new();
    for i in 0..6000 {
        let (step, within) = (i / 1000, i % 1000);
        let q = f64::from(step) + (f64::from(within) / 500.0).min(1.0);
        let torque = if within < 520 { 99.0 } else { 7.0 * q };
        log += &format!("{},{q},{torque}\n", f64::from(i) * 0.001);
    }
    let mapping = format!("{TWO}[filter]\nspeed_rows = 30\n[torque]\nkeep = \"static\"\nstill = 0.001\ncell = [0.1]\n");
    let (samples, _) = read(&mapping, &log).unwrap();
    assert_eq!(samples.len(), 6);
    for (q, torque) in samples.configurations.iter().zip(&samples.torques) {
        assert!((torque - 7.0 * q).abs() < 1e-9, "{q} {torque}");
    }
}

#[test]
fn samples_and_cells_are_bounded() {
    let tiny = format!("{TWO}[torque]\nkeep = \"forward\"\ncell = [1e-12]\n");
    let mut log = String::new();
    for i in 0..50 {
        log += &format!("{i},{},0\n", f64::from(i) * 0.1);
    }
    assert_eq!(read(&tiny, &log).unwrap().1.cells.unwrap().cells, 50);
    let far = format!("{TWO}[torque]\nkeep = \"forward\"\ncell = [1e-300]\n");
    assert!(read(&far, &log).is_ok());
}
