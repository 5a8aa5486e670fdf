//! Logs: those of scans, tables with their mappings, and joint states of robots.

use super::{Random, Target, mutate, outcome, shipped, write};
use haptize::{
    gridize::{GridizeOptions, Interpolation, Samples, WITHIN, gridize},
    logs::{Effort, Mapping, import},
    ros::{JointState, JointStateTable, Message, topics},
    scan::ScanLog,
};
use std::{collections::BTreeMap, path::Path};

pub const LOGS: Target = Target {
    name: "logs",
    extension: "csv",
    seeds: || (1..=3).map(log).collect(),
    mutate: mutate::text,
    run: |file, input| {
        write(file, input);
        match ScanLog::read(file) {
            Ok(log) => gridized(&log.samples()),
            Err(error) => error.to_string(),
        }
    },
    kinds: 15,
};

/// The log of a scan of `joints` joints.
fn log(joints: usize) -> Vec<u8> {
    let columns =
        |what: &str, unit: &str| (0..joints).map(|joint| format!(",{what} q{joint} [{unit}]")).collect::<String>();
    let mut text = format!(
        "# haptize scan log, version 1\n# kind: simulated\n# plan: the scene's\n# rig: a block\n#> name = \"small\"\n\
         point,time [s]{}{}{},ticks,status\n",
        columns("q", "rad"),
        columns("tau", "N m"),
        columns("std", "N m"),
    );
    let mut random = Random::new(joints as u64);
    for point in 0..24 {
        let mut numbers =
            || (0..joints).map(|_| format!(",{}", random.below(1000) as f64 / 1000.0)).collect::<String>();
        text += &format!(
            "{point},{}{}{}{},100,{}\n",
            f64::from(point) * 0.2,
            numbers(),
            numbers(),
            numbers(),
            if point % 7 == 3 { "unsteady" } else { "steady" }
        );
    }
    text.into_bytes()
}

/// The samples on a grid of about ten lines along each axis.
fn gridized(samples: &Samples) -> String {
    let joints = samples.joints.len();
    let extent = |joint: usize| {
        let values = || samples.configurations.iter().skip(joint).step_by(joints);
        values().copied().fold(f64::NEG_INFINITY, f64::max) - values().copied().fold(f64::INFINITY, f64::min)
    };
    let options = GridizeOptions {
        steps: (0..joints).map(|joint| extent(joint) / 10.0).collect(),
        epsilon: None,
        interpolation: if joints == 2 { Interpolation::Natural } else { Interpolation::Linear },
        smooth: true,
        within: WITHIN,
    };
    outcome(gridize(samples, &options))
}

/// Between mapping and table.
const SEPARATOR: &str = "\n%%%%\n";

pub const MAPPINGS: Target = Target {
    name: "mappings",
    extension: "csv",
    seeds: || {
        let table = |delimiter: &str, header: &str| {
            let rows = (0..30).map(|row| {
                let x = f64::from(row) * 0.01;
                [x, x * 2.0, 1.0 - x, (40.0 * x).sin(), x * x].map(|value| format!("{value}")).join(delimiter) + "\n"
            });
            header.to_owned() + &rows.collect::<String>()
        };
        let joint = |name: &str, position: &str, torque: &str| {
            format!(
                "[[joint]]\nname = \"{name}\"\nposition = {{ column = {position} }}\n\
                 torque = {{ column = {torque}, scale = -2.0, offset = 0.1 }}\n"
            )
        };
        [
            ("[time]\ncolumn = 1\ngap = 0.5\n".to_owned() + &joint("a", "2", "4"), table(",", "# a table\n")),
            (
                "[table]\ndelimiter = \" \"\nheader = true\nbad_rows = \"drop\"\n[time]\nperiod = 0.01\n\
                 [filter]\nspeed_rows = 2\noutliers = 5.0\ndecimate = 2\n\
                 [torque]\nkeep = \"average\"\nlead = \"b\"\nstill = 0.01\ncell = [0.05, 0.05]\n"
                    .to_owned()
                    + &joint("a", "\"x\"", "\"t\"")
                    + &joint("b", "\"y\"", "\"u\""),
                table(" ", "time x y t u\n"),
            ),
            (String::from_utf8(shipped("datasets/instrument.toml")).unwrap(), table(",", "")),
        ]
        .map(|(mapping, table)| (mapping + SEPARATOR + &table).into_bytes())
        .to_vec()
    },
    mutate: mutate::text,
    run: |file, input| {
        let text = String::from_utf8_lossy(input);
        let (mapping, _) = text.split_once(SEPARATOR).unwrap_or((&text, ""));
        let mapping = match Mapping::parse(mapping, file) {
            Ok(mapping) => mapping,
            Err(error) => return error.to_string(),
        };
        let separator = input.windows(SEPARATOR.len()).position(|window| window == SEPARATOR.as_bytes());
        write(file, separator.map_or(&[], |at| &input[at + SEPARATOR.len()..]));
        match import(&mapping, &[file.to_path_buf()], &mut |_| ()) {
            Ok(imported) => gridized(&imported.samples),
            Err(error) => error.to_string(),
        }
    },
    kinds: 50,
};

pub const MCAP: Target = Target {
    name: "mcap",
    extension: "mcap",
    seeds: || {
        let plain = [(1, false), (2, false), (3, true)].map(|(joints, chunked)| states(joints, chunked));
        let [lz4, zstd] = COMPRESSIONS.map(|compression| compressed(&plain[2], compression));
        [plain.to_vec(), vec![lz4, zstd]].concat()
    },
    mutate: mutate::binary,
    run: |file, input| {
        write(file, input);
        match imported(file) {
            Ok(samples) => gridized(&samples),
            Err(error) => error,
        }
    },
    kinds: 12,
};

/// Name of a compression, and what it makes of bytes.
type Compression = (&'static str, fn(&[u8]) -> Vec<u8>);

const COMPRESSIONS: [Compression; 2] = [
    ("lz4", |bytes| {
        let mut encoder = lz4_flex::frame::FrameEncoder::new(Vec::new());
        std::io::Write::write_all(&mut encoder, bytes).unwrap();
        encoder.finish().unwrap()
    }),
    ("zstd", |bytes| ruzstd::encoding::compress_to_vec(bytes, ruzstd::encoding::CompressionLevel::Fastest)),
];

/// The MCAP file `plain` with compressed chunks.
fn compressed(plain: &[u8], (name, compress): Compression) -> Vec<u8> {
    /// Operation code of a chunk, and bytes of its times, size and checksum, then of the empty name and the length.
    const CHUNK: u8 = 6;
    const HEAD: usize = 28;
    const RECORDS: usize = 40;
    let (magic, mut rest) = plain.split_at(mcap::MAGIC.len());
    let mut file = magic.to_vec();
    while rest.len() > magic.len() {
        let length = u64::from_le_bytes(rest[1..9].try_into().unwrap()) as usize;
        let (code, content) = (rest[0], &rest[9..9 + length]);
        rest = &rest[9 + length..];
        let content = if code == CHUNK {
            let records = compress(&content[RECORDS..]);
            let mut chunk = content[..HEAD].to_vec();
            chunk.extend((name.len() as u32).to_le_bytes());
            chunk.extend(name.as_bytes());
            chunk.extend((records.len() as u64).to_le_bytes());
            chunk.extend(records);
            chunk
        } else {
            content.to_vec()
        };
        file.push(code);
        file.extend((content.len() as u64).to_le_bytes());
        file.extend(content);
    }
    file.extend(magic);
    file
}

/// The joint states of the file's first topic as samples of all its joints.
fn imported(file: &Path) -> Result<Samples, String> {
    let topics = topics(file).map_err(|error| error.to_string())?;
    let topic = topics.first().ok_or("no topic")?.name.clone();
    let table = JointStateTable::open(file, Some(&topic)).map_err(|error| error.to_string())?;
    let joints: Vec<String> = table.joints().iter().take(3).cloned().collect();
    let mapping = Mapping::of_joint_states(&joints, &topic, Effort::Motor);
    let imported = import(&mapping, &[file.to_path_buf()], &mut |_| ()).map_err(|error| error.to_string())?;
    Ok(imported.samples)
}

/// A file of the states of `joints` joints. Checksums of records are left out, so that what is mutated is read.
fn states(joints: usize, chunked: bool) -> Vec<u8> {
    let options = mcap::WriteOptions::new()
        .compression(None)
        .use_chunks(chunked)
        .calculate_chunk_crcs(false)
        .calculate_data_section_crc(false)
        .calculate_summary_section_crc(false)
        .disable_seeking(true);
    let mut file = std::io::Cursor::new(Vec::new());
    let mut writer = options.create(&mut file).unwrap();
    let schema = writer.add_schema("sensor_msgs/msg/JointState", "ros2msg", b"string[] name").unwrap();
    let channels = ["/joint_states", "/other"].map(|topic| writer.add_channel(schema, topic, "cdr", &BTreeMap::new()));
    let channels = channels.map(Result::unwrap);
    let mut random = Random::new(joints as u64);
    for number in 0..20_u32 {
        let mut numbers = || (0..joints).map(|_| random.below(1000) as f64 / 1000.0).collect::<Vec<f64>>();
        let state = JointState {
            stamp: u64::from(number) * 10_000_000,
            frame: "base".into(),
            names: (0..joints).map(|joint| format!("q{joint}")).collect(),
            position: numbers(),
            velocity: if number % 5 == 4 { Vec::new() } else { numbers() },
            effort: numbers(),
        };
        let header = mcap::records::MessageHeader {
            channel_id: channels[usize::from(number % 7 == 3)],
            sequence: number,
            log_time: state.stamp,
            publish_time: state.stamp,
        };
        writer.write_to_known_channel(&header, &state.encode()).unwrap();
    }
    writer.finish().unwrap();
    drop(writer);
    file.into_inner()
}
