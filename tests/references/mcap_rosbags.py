"""MCAP against another program, both ways: joint states that haptize wrote are read by rosbags, and the other way round.

    pip install rosbags
    python tests/references/mcap_rosbags.py target/debug/haptize

rosbags is a pure Python implementation of ROS bags; no ROS takes part.
"""

import json
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

TYPE = "sensor_msgs/msg/JointState"
STORE = get_typestore(Stores.ROS2_HUMBLE)


def run(program: Path, folder: Path, *arguments: str) -> dict:
    done = subprocess.run([program, *arguments, "--json"], cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def read(path: Path) -> list:
    """Topic and message of every joint state in a file."""
    with AnyReader([path], default_typestore=STORE) as reader:
        return [
            (connection.topic, reader.deserialize(raw, connection.msgtype))
            for connection, _, raw in reader.messages()
            if connection.msgtype == TYPE
        ]


def plan_is_read(program: Path, folder: Path) -> None:
    scene = Path(__file__).parents[2] / "datasets" / "sponge.toml"
    told = run(program, folder, "scan", str(scene), "--plan-out", "plan.mcap")
    run(program, folder, "scan", str(scene), "--plan-out", "plan.csv")
    table = np.loadtxt(folder / "plan.csv", delimiter=",", skiprows=2)
    states = read(folder / "plan.mcap")
    assert len(states) == told["rows"] == len(table), (len(states), told)
    for (topic, state), row in zip(states, table):
        assert topic == "/plan" and list(state.name) == ["yaw", "shoulder", "elbow"]
        assert np.array_equal(state.position, row[1:])
        stamp = state.header.stamp
        assert abs(stamp.sec + 1e-9 * stamp.nanosec - row[0]) < 2e-9
    print(f"plan: {len(states)} messages of haptize read by rosbags, equal to the last bit")


def log_is_gridized(program: Path, folder: Path) -> None:
    """A plane of stiffness 3 N m/rad, its joints named in turn in either order, with drop-outs."""
    message, header, time = (STORE.types[name] for name in (TYPE, "std_msgs/msg/Header", "builtin_interfaces/msg/Time"))
    random = np.random.default_rng(1)
    q = random.uniform(0.0, 0.5, (2000, 2))
    torque = np.outer(np.maximum(q.sum(axis=1) - 0.4, 0.0), [-3.0, -3.0])
    bag = folder / "bag"
    with Writer(bag, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connection = writer.add_connection("/joint_states", TYPE, typestore=STORE)
        for k, (position, effort) in enumerate(zip(q, torque)):
            order = [0, 1] if k % 2 == 0 else [1, 0]
            lost = k % 100 == 7
            state = message(
                header=header(stamp=time(sec=k // 1000, nanosec=(k % 1000) * 1_000_000), frame_id="base"),
                name=[["a", "b"][joint] for joint in order],
                position=position[order],
                velocity=np.zeros(0),
                # The motors balance the contact.
                effort=np.zeros(0) if lost else -effort[order],
            )
            writer.write(connection, k * 1_000_000, STORE.serialize_cdr(state, TYPE))
    (file,) = bag.glob("*.mcap")
    told = run(program, folder, "gridize", str(file), "--step", "0.05", "-o", "plane.haptize")
    dropped = sum(dropped["rows"] for dropped in told["import"]["dropped"])
    assert told["import"]["rows"] == 2000 and dropped == 20, told["import"]
    again = run(program, folder, "gridize", str(file), "--topic", "/joint_states", "--step", "0.05", "--held-out", "0.1", "-o", "h.haptize")
    worst = max(again["held_out"]["rms"])
    assert worst < 0.02, again["held_out"]
    print(f"log: 2000 messages of rosbags read by haptize, 20 drop-outs counted, torque predicted to {worst:.1e} N m rms")


def main() -> None:
    program = Path(sys.argv[1]).resolve()
    with tempfile.TemporaryDirectory() as folder:
        plan_is_read(program, Path(folder))
        log_is_gridized(program, Path(folder))


if __name__ == "__main__":
    main()
