"""Compares arms that `haptize import` makes of public robot files with MuJoCo and yourdfpy: link poses, joint-space inertia, and
where the contact nodes lie.

Not part of the tests, since it needs packages and robots from elsewhere. Run it with any recent Python:
    python3 -m venv venv && venv/bin/pip install mujoco yourdfpy numpy example-robot-data
    cargo build && venv/bin/python tests/references/urdf_arms.py

Robots from the package example-robot-data are taken (UR5, Panda, UR10), and any others that are named:
    ... urdf_arms.py ROBOT.urdf TIP [JOINT=VALUE ...] [-- ROBOT.urdf TIP ...]

MuJoCo reads a URDF without its shapes, whose meshes it may not know; robots in MJCF are compared with MuJoCo alone. Per robot and
program: the largest distance between the tip's positions and the largest entry of the difference of its rotations, at 200 random
configurations within the limits; from MuJoCo the largest difference of the inertia over its largest entry, from yourdfpy the largest
distance of a contact node from the shapes that it places there, at the last of these. The scene's file has nine decimals of each
length, five of a contact node's place, and six digits of each inertia.
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
import trimesh
import yourdfpy

PROGRAM = pathlib.Path(__file__).parents[2] / "target" / "debug" / "haptize"
SPACING = "0.02"
CONFIGURATIONS = 200
# Half a step of the last decimal of three coordinates, for the nodes [m].
LIMITS = {"metres": 1e-7, "rotation": 1e-7, "inertia": 1e-4, "nodes": 1e-5}


def rotation(axis, angle):
    x = np.cross(np.eye(3), axis)
    return np.eye(3) + np.sin(angle) * x + (1 - np.cos(angle)) * (x @ x)


class Arm:
    """The chain of a scene, as datasets/README.md defines it."""

    def __init__(self, text):
        self.joints = tomllib.loads(text)["proxy"]["joint"]
        # Beside its name stand the links that a joint moves.
        named = [line for line in text.splitlines() if line.startswith("name = ") and "# moves " in line]
        links = [line.split("# moves ")[1].split(", ") for line in named]
        for joint, moved in zip(self.joints, links, strict=True):
            joint["axis"] = np.array(joint["axis"]) / np.linalg.norm(joint["axis"])
            joint["links"] = moved

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


class MuJoCo:
    """The file without shapes, every link a body of its own."""

    name = f"MuJoCo {mujoco.__version__}"

    def __init__(self, urdf, joints, held):
        self.model = bare(urdf)
        self.data = mujoco.MjData(self.model)
        self.joints, self.held = joints, held
        self.degrees = [self.model.joint(name).dofadr[0] for name in joints]

    def pose(self, link, q):
        self.data.qpos[:] = 0
        for name, value in [*self.held.items(), *zip(self.joints, q)]:
            self.data.qpos[self.model.joint(name).qposadr[0]] = value
        mujoco.mj_forward(self.model, self.data)
        body = self.data.body(link)
        return body.xmat.reshape(3, 3).copy(), body.xpos.copy()

    def inertia(self):
        """At the last pose; None where joints move beside the chain, which the scene leaves out."""
        if self.model.nv > len(self.joints) + len(self.held):
            return None
        full = np.zeros((self.model.nv, self.model.nv))
        mujoco.mj_fullM(self.model, self.data, full)
        full -= np.diag(self.model.dof_armature)
        return full[np.ix_(self.degrees, self.degrees)]


def is_mjcf(robot):
    return pathlib.Path(robot).suffix == ".xml"


def package(urdf):
    """Where the file's shapes are: beside it, or for `package://` in a folder above."""

    def resolve(file):
        place = file.removeprefix("package://")
        above = pathlib.Path(urdf).resolve().parents[: 1 if place == file else None]
        return str(next((folder / place for folder in above if (folder / place).is_file()), place))

    return resolve


class Yourdfpy:
    """The file with its shapes, joints that follow others moved like the rest."""

    name = f"yourdfpy {yourdfpy.__version__}"

    def __init__(self, urdf, joints, held):
        with tempfile.NamedTemporaryFile(suffix=".urdf") as file:
            tree = ET.parse(urdf)
            for joint in tree.getroot().iter("joint"):
                for follows in joint.findall("mimic"):
                    joint.remove(follows)
            tree.write(file.name)
            self.robot = yourdfpy.URDF.load(file.name, filename_handler=package(urdf), load_meshes=False)
        self.joints, self.held, self.resolve = joints, held, package(urdf)

    def pose(self, link, q):
        self.robot.update_cfg({**self.held, **dict(zip(self.joints, q))})
        place = self.robot.get_transform(link)
        return place[:3, :3], place[:3, 3]

    def surface(self, links):
        """Triangles of the links' collision shapes, else visual ones, at the last pose [m]."""
        triangles = []
        for link in links:
            known = self.robot.link_map[link]
            for shape in known.collisions or known.visuals:
                mesh = mesh_of(shape.geometry, self.resolve)
                frame = self.robot.get_transform(link) @ (np.eye(4) if shape.origin is None else shape.origin)
                triangles.append(mesh.triangles @ frame[:3, :3].T + frame[:3, 3])
        return np.concatenate(triangles)


def mesh_of(geometry, resolve):
    if geometry.mesh is not None:
        mesh = trimesh.load(resolve(geometry.mesh.filename), force="mesh")
        return mesh.apply_scale(1.0 if geometry.mesh.scale is None else geometry.mesh.scale)
    if geometry.box is not None:
        return trimesh.creation.box(geometry.box.size)
    if geometry.cylinder is not None:
        return trimesh.creation.cylinder(geometry.cylinder.radius, geometry.cylinder.length, sections=512)
    return trimesh.creation.icosphere(5, geometry.sphere.radius)


def bare(urdf):
    if is_mjcf(urdf):
        return mujoco.MjModel.from_xml_path(str(urdf))
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
        report, arm = json.loads(done.stdout), Arm(scene.read_text())
    joints, held = report["joints"], dict((name, float(value)) for name, value in (lock.split("=") for lock in locks))
    random = np.random.default_rng(1)
    low, high = np.array([joint["limits"] for joint in arm.joints]).T
    configurations = [random.uniform(low, high) for _ in range(CONFIGURATIONS)]
    count, fits = sum(report["nodes"]), True
    print(f"{pathlib.Path(urdf).name} {tip}: {len(joints)} joints, {count} nodes")
    for program in (MuJoCo,) if is_mjcf(urdf) else (MuJoCo, Yourdfpy):
        peer = program(urdf, joints, held)
        worst = differences(arm, peer, tip, configurations)
        fits &= all(worst[key] <= LIMITS[key] for key in worst)
        told = ", ".join(f"{key} {value:.1e}" for key, value in worst.items())
        print(f"  {'good' if all(worst[key] <= LIMITS[key] for key in worst) else 'BAD '} {program.name:<18} {told}")
    return fits


def differences(arm, peer, tip, configurations):
    rest, origin = peer.pose(tip, 0 * configurations[0]), arm.frames(0 * configurations[0])[-1][1]
    worst = {"metres": 0.0, "rotation": 0.0}
    for q in configurations:
        r, p = peer.pose(tip, q)
        turned, carried = arm.frames(q)[-1]
        worst["metres"] = max(worst["metres"], np.linalg.norm(carried + turned @ (rest[1] - origin) - p))
        worst["rotation"] = max(worst["rotation"], np.abs(turned @ rest[0] - r).max())
        if isinstance(peer, MuJoCo) and (expected := peer.inertia()) is not None:
            expected = expected + np.diag([joint["rotor_inertia"] for joint in arm.joints])
            difference = np.abs(arm.inertia(q) - expected).max() / np.abs(expected).max()
            worst["inertia"] = max(worst.get("inertia", 0.0), difference)
    if isinstance(peer, Yourdfpy):
        worst["nodes"] = off_the_shapes(arm, peer, configurations[-1])
    return worst


def off_the_shapes(arm, peer, q):
    """Largest distance of a contact node from the shapes of the links that its joint moves [m]."""
    farthest = 0.0
    for joint, (r, p) in zip(arm.joints, arm.frames(q)):
        if joint.get("nodes"):
            surface = peer.surface(joint["links"])
            for node in joint["nodes"]:
                farthest = max(farthest, distance(p + r @ node["at"], surface))
    return farthest


def distance(x, triangles):
    nearest = trimesh.triangles.closest_point(triangles, np.broadcast_to(x, (len(triangles), 3)))
    return np.linalg.norm(nearest - x, axis=1).min()


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
    results = [compare(*robot) for robot in named or robots()]
    sys.exit(not all(results))


main()
