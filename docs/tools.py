#!/usr/bin/env python3
"""Has other programs open what haptize writes, and prints a row for each (docs/tools.md).

    pip install numpy h5py xarray h5netcdf netCDF4 meshio vtk mcap mcap-ros2-support rosbags rerun-sdk
    python docs/tools.py [PROGRAM]          by default `haptize` on the path

A tool that is not installed is left out; one that opens something else than what was written ends the script.
"""

import csv
import importlib.metadata
import os
import pathlib
import subprocess
import sys
import tempfile
import xml.etree.ElementTree as xml

PROGRAM = str(pathlib.Path(sys.argv[1]).resolve()) if len(sys.argv) > 1 else "haptize"
# An arm of two joints over a small sphere; one has to be felt for a moment.
SCENE = pathlib.Path(__file__).resolve().parents[1] / "tests/scenes/small.toml"
TOPICS = ["/command", "/contact", "/device", "/hand", "/object", "/proxy", "/robot_description", "/tf"]


def haptize(*arguments):
    subprocess.run([PROGRAM, *arguments], check=True, capture_output=True)


def numpy():
    import numpy as np

    torque = np.load("small.npz")["torque"]
    assert torque.shape[-1] == 2 and abs(torque).max() > 0
    return f"`export --format npz`: torque {torque.shape}"


def h5py():
    import h5py

    with h5py.File("small.h5") as file:
        return f"`export --format hdf5`: torque {file['torque'].shape}"


def xarray():
    import numpy as np
    import xarray

    for engine in ["h5netcdf", "netcdf4"]:
        with xarray.open_dataset("small.h5", engine=engine) as data:
            assert np.array_equal(data["torque"], np.load("small.npz")["torque"])
            return f"`export --format hdf5`: torque over {', '.join(map(str, data['torque'].dims))}"


def vtk():
    import numpy as np
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkIOXML import vtkXMLImageDataReader, vtkXMLUnstructuredGridReader

    frames = {}
    for row in csv.reader(open("played/frames.csv")):
        if row[0] != "time [s]":
            frames.setdefault(float(row[0]), []).append([float(x) for x in row[2:]])
    entries = [entry.attrib for entry in xml.parse("series/session.pvd").iter("DataSet")]
    for entry in entries:
        reader = vtkXMLUnstructuredGridReader()
        reader.SetFileName(f"series/{entry['file']}")
        reader.Update()
        grid = reader.GetOutput()
        if entry["part"] == "0":
            points = vtk_to_numpy(grid.GetPoints().GetData())
            wanted = frames[float(entry["timestep"])][: len(points)]
            assert np.array_equal(points, wanted)
            assert grid.GetPointData().GetArray("contact force [N]").GetNumberOfComponents() == 3
        assert grid.GetNumberOfCells() > 0
    reader = vtkXMLImageDataReader()
    reader.SetFileName("small.vti")
    reader.Update()
    image = reader.GetOutput()
    torque = vtk_to_numpy(image.GetPointData().GetArray("torque")).reshape(*image.GetDimensions()[1::-1], 2)
    assert np.array_equal(np.moveaxis(torque, 0, 1), np.load("small.npz")["torque"])
    return f"`play --vtu`: {len(entries)} grids; `export --format vti`: {image.GetDimensions()}"


def meshio():
    import meshio

    object, arm = (meshio.read(f"series/{name}_0030.vtu") for name in ["object", "arm"])
    assert set(object.point_data) == {"displacement [m]", "contact force [N]"}
    return f"`play --vtu`: {len(object.points)} points, {object.cells[0].type}; arm of {', '.join(cell.type for cell in arm.cells[:2])}"


def mcap_ros2():
    from mcap_ros2.reader import read_ros2_messages

    seen = {}
    for message in read_ros2_messages("session.mcap"):
        seen.setdefault(message.channel.topic, []).append(message.ros_msg)
    assert sorted(seen) == TOPICS
    marker = seen["/object"][0].markers[0]
    assert marker.type == 11 and len(marker.points) % 3 == 0 and seen["/tf"][0].transforms[0].header.frame_id == "world"
    robot = xml.fromstring(seen["/robot_description"][0].data)
    return f"`--record FILE.mcap`: {len(seen)} topics, {len(marker.points) // 3} triangles, a robot of {len(robot.findall('joint'))} joints"


def rosbags():
    from rosbags.highlevel import AnyReader

    with AnyReader([pathlib.Path("session.mcap")]) as reader:
        messages = [reader.deserialize(raw, connection.msgtype) for connection, _, raw in reader.messages()]
        return f"`--record FILE.mcap`: {len(messages)} messages, with the types that the file defines"


def rerun():
    command = [sys.executable, "-m", "rerun"]
    subprocess.run([*command, "mcap", "convert", "session.mcap", "-o", "session.rrd"], check=True, capture_output=True)
    shown = subprocess.run([*command, "rrd", "print", "-v", "session.rrd"], check=True, capture_output=True, text=True).stdout
    found = [kind for kind in ["Transform3D", "Mesh3D", "Arrows3D", "Scalars", "TextDocument"] if kind in shown]
    return f"`--record FILE.mcap`: {', '.join(found)}"


TOOLS = {numpy: "numpy", h5py: "h5py", xarray: "xarray", vtk: "vtk", meshio: "meshio", mcap_ros2: "mcap-ros2-support", rosbags: "rosbags", rerun: "rerun-sdk"}


def main():
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        pathlib.Path("small.toml").write_text(SCENE.read_text())
        haptize("bake", "small.toml", "--backend", "cpu", "--measure-error", "0")
        for kind in ["npz", "hdf5", "vti"]:
            haptize("export", "small.haptize", "--format", kind)
        haptize("play", "small.haptize", "-o", "played", "--vtu", "series", "--record", "session.mcap")
        print("| tool | version | opened |\n|---|---|---|")
        for check, package in TOOLS.items():
            try:
                version = importlib.metadata.version(package)
            except importlib.metadata.PackageNotFoundError:
                continue
            print(f"| {package} | {version} | {check()} |", flush=True)
        os.chdir("/")


if __name__ == "__main__":
    main()
