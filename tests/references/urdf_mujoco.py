"""Compares arms that `haptize import` makes of public robot files with MuJoCo: link poses and joint-space inertia.

Not part of the tests, since it needs packages and robots from elsewhere. Run it with any recent Python:
    python3 -m venv venv && venv/bin/pip install mujoco numpy example-robot-data
    cargo build && venv/bin/python tests/references/urdf_mujoco.py

Robots from the package example-robot-data are taken (UR5, Panda, UR10), and any others that are named:
    ... urdf_mujoco.py ROBOT.urdf TIP [JOINT=VALUE ...] [-- ROBOT.urdf TIP ...]

MuJoCo reads the same file without its shapes, whose meshes it may not know. Per robot: the largest distance between the tip's
positions, the largest entry of the difference of its rotations, and the largest difference of the inertia over its largest entry,
at 200 random configurations within the limits. The scene's file has nine decimals of each length and six digits of each inertia.
"""

import json
import pathlib
import subprocess
import sys
import tempfile
import tomllib
import xml.etree.ElementTree as ET

import mujoco
import numpy as np

PROGRAM = pathlib.Path(__file__).parents[2] / "target" / "debug" / "haptize"
SPACING = "0.02"
CONFIGURATIONS = 200
LIMITS = {"metres": 1e-7, "rotation": 1e-7, "inertia": 1e-4}


def rotation(axis, angle):
    x = np.cross(np.eye(3), axis)
    return np.eye(3) + np.sin(angle) * x + (1 - np.cos(angle)) * (x @ x)


class Arm:
    """The chain of a scene, as datasets/README.md defines it."""

    def __init__(self, scene):
        self.joints = scene["proxy"]["joint"]
        for joint in self.joints:
            joint["axis"] = np.array(joint["axis"]) / np.linalg.norm(joint["axis"])

    def frames(self, q):
        r, p, frames = np.eye(3), np.zeros(3), []
        for joint, x in zip(self.joints, q):
            p = p + r @ joint.get("origin", [0, 0, 0])
            if joint["kind"] == "revolute":
                r = r @ rotation(joint["axis"], x)
            else:
                p = p + x * (r @ joint["axis"])
            frames.append((r, p))
        return frames

    def inertia(self, q):
        frames, count = self.frames(q), len(self.joints)
        matrix = np.diag([joint["rotor_inertia"] for joint in self.joints])
        for k, joint in enumerate(self.joints):
            if "mass" not in joint:
                continue
            r, p = frames[k]
            centre = p + r @ joint["centre_of_mass"]
            six = joint.get("inertia", [0, 0, 0])
            xx, yy, zz, xy, xz, yz = six if len(six) == 6 else [*six, 0, 0, 0]
            moments = r @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ r.T
            linear, angular = np.zeros((3, count)), np.zeros((3, count))
            for j in range(k + 1):
                axis = frames[j][0] @ self.joints[j]["axis"]
                if self.joints[j]["kind"] == "revolute":
                    linear[:, j], angular[:, j] = np.cross(axis, centre - frames[j][1]), axis
                else:
                    linear[:, j] = axis
            matrix += joint["mass"] * linear.T @ linear + angular.T @ moments @ angular
        return matrix


def reference(urdf):
    """MuJoCo's model of the file without shapes, every link a body of its own."""
    tree = ET.parse(urdf)
    root = tree.getroot()
    for link in root.iter("link"):
        for shape in link.findall("visual") + link.findall("collision"):
            link.remove(shape)
    for name in ("gazebo", "transmission", "mujoco"):
        for element in root.findall(name):
            root.remove(element)
    options = ET.SubElement(ET.SubElement(root, "mujoco"), "compiler")
    # Links without inertia get a negligible one, which MuJoCo asks for.
    options.attrib.update(fusestatic="false", balanceinertia="false", boundmass="1e-9", boundinertia="1e-12")
    with tempfile.NamedTemporaryFile(suffix=".urdf") as file:
        tree.write(file.name)
        return mujoco.MjModel.from_xml_path(file.name)


def compare(urdf, tip, locks):
    with tempfile.TemporaryDirectory() as folder:
        scene = pathlib.Path(folder) / "scene.toml"
        command = [PROGRAM, "import", urdf, "--tip", tip, "--spacing", SPACING, "-o", scene, "--json"]
        command += [f"--lock={lock}" for lock in locks]
        done = subprocess.run(command, capture_output=True, text=True)
        if done.returncode:
            sys.exit(done.stderr)
        report, arm = json.loads(done.stdout), Arm(tomllib.loads(scene.read_text()))
    model = reference(urdf)
    data = mujoco.MjData(model)
    address = [model.joint(name).qposadr[0] for name in report["joints"]]
    held = {model.joint(lock.split("=")[0]).qposadr[0]: float(lock.split("=")[1]) for lock in locks}

    def pose(q):
        data.qpos[:] = 0
        for place, value in held.items():
            data.qpos[place] = value
        data.qpos[address] = q
        mujoco.mj_forward(model, data)
        body = data.body(tip)
        return body.xmat.reshape(3, 3).copy(), body.xpos.copy()

    def inertia():
        full = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, data, full)
        return full[np.ix_(degrees, degrees)]

    degrees = [model.joint(name).dofadr[0] for name in report["joints"]]
    # What moves beside the chain is left out of the scene, and is in MuJoCo's inertia.
    beside = model.nv > len(degrees) + len(held)
    random = np.random.default_rng(1)
    low, high = np.array([joint["limits"] for joint in arm.joints]).T
    rest = pose(np.zeros(len(address)))
    origin = arm.frames(np.zeros(len(address)))[-1][1]
    worst = dict.fromkeys(LIMITS, 0.0)
    for _ in range(CONFIGURATIONS):
        q = random.uniform(low, high)
        r, p = pose(q)
        turned, carried = arm.frames(q)[-1]
        worst["metres"] = max(worst["metres"], np.linalg.norm(carried + turned @ (rest[1] - origin) - p))
        worst["rotation"] = max(worst["rotation"], np.abs(turned @ rest[0] - r).max())
        if not beside:
            expected = inertia() + np.diag([joint["rotor_inertia"] for joint in arm.joints])
            difference = np.abs(arm.inertia(q) - expected).max() / np.abs(expected).max()
            worst["inertia"] = max(worst["inertia"], difference)
    fits = all(worst[key] <= limit for key, limit in LIMITS.items())
    moment = "not compared: other joints move beside the chain" if beside else f"{worst['inertia']:.1e}"
    print(
        f"{'good' if fits else 'BAD '} {pathlib.Path(urdf).name:<24} {tip:<18} {len(address)} joints, {sum(report['nodes']):>5} nodes: "
        f"{worst['metres']:.1e} m, rotation {worst['rotation']:.1e}, inertia {moment}"
    )
    return fits


def robots():
    folder = pathlib.Path(np.__file__).parents[1] / "cmeel.prefix/share/example-robot-data/robots"
    if not folder.is_dir():
        sys.exit("no robots: pip install example-robot-data, or name robot files")
    return [
        (folder / "ur_description/urdf/ur5_robot.urdf", "tool0", []),
        (
            folder / "panda_description/urdf/panda.urdf",
            "panda_link8",
            ["panda_joint7=0.785", "panda_finger_joint1=0.01", "panda_finger_joint2=0.01"],
        ),
        (folder / "ur_description/urdf/ur10_robot.urdf", "tool0", []),
    ]


def main():
    named, group = [], []
    for word in [*sys.argv[1:], "--"]:
        if word != "--":
            group.append(word)
        elif group:
            named.append((pathlib.Path(group[0]), group[1], group[2:]))
            group = []
    print(f"MuJoCo {mujoco.__version__}")
    results = [compare(*robot) for robot in named or robots()]
    sys.exit(not all(results))


main()
