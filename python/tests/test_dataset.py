"""Bakes, files, and views into them."""

import gc
import re
import signal
import subprocess
import sys
import threading

import haptize
import numpy as np
import pytest
from conftest import SCENE


def test_views_are_the_dataset(dataset, file):
    opened = haptize.Dataset.open(file)
    for data in (dataset, opened, haptize.Dataset.load(file)):
        assert data.shape == (7, 9)
        assert data.torque.shape == (7, 9, 2) and data.torque.dtype == np.float64
        assert data.status.shape == data.energy.shape == data.gap.shape == (7, 9)
        assert np.array_equal(data.torque, dataset.torque)
        assert not data.torque.flags.writeable and not data.torque.flags.owndata
    assert {0, 1} == set(np.unique(dataset.status))
    assert [axis["name"] for axis in dataset.axes] == ["turn", "slide"]
    assert [axis["unit"] for axis in dataset.axes] == ["rad", "m"]
    assert np.allclose(dataset.lines[0], -0.3 + 0.1 * np.arange(7))
    offsets, nodes, forces = dataset.contacts
    assert offsets.shape == (64,) and nodes.shape == (offsets[-1],) and forces.shape == (offsets[-1], 3)
    nodes, triangles = dataset.surface
    assert nodes.shape[1] == triangles.shape[1] == 3 and triangles.max() < len(nodes)
    assert dataset.provenance["backend"] == "cpu"
    assert dataset.report["points"] == 63 and opened.report is None
    assert dataset.summary()["points"] == 63


def test_a_refined_dataset_has_its_nodes_as_arrays(scene, dataset, tmp_path):
    assert dataset.nodes is None
    (tmp_path / "small.toml").write_text(scene.text)
    refined = tmp_path / "small.haptize"
    haptize.run("bake", tmp_path / "small.toml", max_error="0.01%", refine=2, backend="cpu", output=refined)
    data = haptize.Dataset.open(refined)
    nodes = data.nodes
    count = len(nodes["level"])
    assert np.bincount(nodes["level"]).tolist() == data.summary()["refinement"]["nodes"] and set(nodes["level"]) == {0, 1}
    assert {name: column.shape[1:] for name, column in nodes.items()} == {
        "level": (), "q": (2,), "torque": (2,), "energy": (), "gap": (), "status": ()
    }
    assert all(len(column) == count for column in nodes.values())
    # The field is exact at nodes, whose numbers are f32.
    field = haptize.Field(data)
    greatest = np.abs(nodes["torque"]).max(0)
    assert (np.abs(field.torque(nodes["q"]) - nodes["torque"]) <= 1e-5 * greatest).all() and (greatest > 0.1).any()
    assert np.allclose(field.energy(nodes["q"]), nodes["energy"], rtol=0, atol=1e-5 * nodes["energy"].max())
    assert np.array_equal(field.status(nodes["q"]), nodes["status"]) and set(nodes["status"]) == {0, 1}
    assert np.array_equal(nodes["gap"] < 0, nodes["status"] == 1)
    base = np.stack(np.meshgrid(*data.lines, indexing="ij"), -1).reshape(-1, 2)
    coarse = nodes["q"][nodes["level"] == 0]
    assert np.array_equal(base[np.lexsort(base.T)], coarse[np.lexsort(coarse.T)])


def test_a_view_is_read_only_and_outlives_its_dataset(file):
    torque = haptize.Dataset.open(file).torque
    with pytest.raises(ValueError):
        torque[0, 0, 0] = 1.0
    with pytest.raises(ValueError):
        torque.flags.writeable = True
    copy = np.array(haptize.Dataset.load(file).torque)
    gc.collect()
    assert np.array_equal(torque, copy)


def test_an_opened_file_takes_the_memory_of_what_is_looked_at(tmp_path):
    """A dataset of 100 MB: its check reads all of it, and gives it back."""

    def resident():
        with open("/proc/self/statm") as statm:
            return 4096 * int(statm.read().split()[1])

    try:
        resident()
    except OSError:
        pytest.skip("this system does not tell the memory of a process")
    q = np.array([[a, b] for a in (0.0, 1.0) for b in (0.0, 1.0)] + [[0.5, 0.5]])
    haptize.gridize(q, q - 0.5, 1 / 2000).save(tmp_path / "large.haptize")
    gc.collect()
    before = resident()
    large = haptize.Dataset.open(tmp_path / "large.haptize")
    size = (tmp_path / "large.haptize").stat().st_size
    opened = resident() - before
    assert size > 60e6 and opened < 0.1 * size, (size, opened)
    large.torque[:20].sum()
    assert resident() - before < 0.2 * size
    large.torque.sum()
    assert resident() - before > 0.8 * size


@pytest.mark.parametrize("contents", [b"", b"x" * 9999])
def test_a_file_that_is_no_dataset_is_refused(tmp_path, contents):
    path = tmp_path / "wrong.haptize"
    path.write_bytes(contents)
    for open in (haptize.Dataset.open, haptize.Dataset.load, haptize.Field.open):
        with pytest.raises(haptize.DatasetError, match="not a haptize dataset") as raised:
            open(path)
        assert str(raised.value.path) == str(path)


def test_a_damaged_file_is_refused(file, tmp_path):
    data = bytearray(file.read_bytes())
    data[-10] ^= 1
    (tmp_path / "damaged.haptize").write_bytes(data)
    with pytest.raises(haptize.DatasetError, match="damaged"):
        haptize.Dataset.open(tmp_path / "damaged.haptize")


def test_progress_is_told_and_may_stop_a_bake(scene, tmp_path):
    told = []
    haptize.bake(scene, backend="cpu", measure_error=0, progress=lambda done, points: told.append((done, points)))
    assert told and all(points == 63 and 0 <= done <= 63 for done, points in told)

    def stop(done, points):
        raise RuntimeError("enough")

    with pytest.raises(RuntimeError, match="enough"):
        haptize.bake(scene, tmp_path / "stopped.haptize", backend="cpu", progress=stop)
    # What was solved is kept; nothing is written over it by mistake.
    if list(tmp_path.iterdir()):
        baked = haptize.bake(scene, tmp_path / "stopped.haptize", backend="cpu", resume=True)
        assert baked.report["points"] == 63


def test_ctrl_c_stops_a_bake(scene):
    # What is started in the background of a script is made to ignore it.
    signal.signal(signal.SIGINT, signal.default_int_handler)

    def interrupt(done, points):
        signal.raise_signal(signal.SIGINT)

    with pytest.raises(KeyboardInterrupt):
        haptize.bake(scene, backend="cpu", progress=interrupt)


INTERRUPTED = """
import haptize, os, signal, sys, threading, time
signal.signal(signal.SIGINT, signal.default_int_handler)
slow = haptize.Scene(sys.stdin.read())
threading.Timer(0.5, lambda: os.kill(os.getpid(), signal.SIGINT)).start()
try:
    {call}
except KeyboardInterrupt:
    before, patience = time.process_time(), time.monotonic() + 60
    while time.process_time() < before + 0.5 and time.monotonic() < patience:
        time.sleep(0.05)
    print("goes on" if time.process_time() > before + 0.5 else "has ended")
"""


@pytest.mark.skipif(sys.platform == "win32", reason="os.kill ends a process there")
@pytest.mark.parametrize("call", ["haptize.Solver(slow)", 'haptize.bake(slow, backend="cpu")'])
def test_ctrl_c_ends_a_call_and_does_not_wait_for_its_work(call, tmp_path):
    """The compliance of so many nodes takes many seconds, in which nothing looks at a signal."""
    object = "sphere = { radius = 0.05, edge = 0.002 }\nskin = { thickness = 0.002, young = 1e5, foundation = 1e6 }\n"
    scene = re.sub(r"(?s)sphere = .*?(?=\[contact\])", object, SCENE)
    command = [sys.executable, "-c", INTERRUPTED.format(call=call)]
    # From elsewhere, where this repository's sources are not taken for the package.
    ended = subprocess.run(command, input=scene, text=True, capture_output=True, cwd=tmp_path)
    assert (ended.returncode, ended.stdout) == (0, "goes on\n"), ended.stderr


def test_no_file_of_another_kind_is_replaced(scene, dataset, tmp_path):
    notes = tmp_path / "notes.toml"
    notes.write_text(scene.text)
    with pytest.raises(haptize.BakeError, match="not a dataset"):
        haptize.bake(scene, notes, backend="cpu")
    with pytest.raises(haptize.DatasetError, match="not a dataset"):
        dataset.save(notes)
    assert notes.read_text() == scene.text and list(tmp_path.iterdir()) == [notes]


def test_other_threads_run_while_a_scene_is_baked(scene):
    baked = []
    thread = threading.Thread(target=lambda: baked.append(haptize.bake(scene, backend="cpu")))
    thread.start()
    turns = 0
    while thread.is_alive():
        turns += 1
    thread.join()
    assert turns > 0 and len(baked) == 1


def test_what_cannot_be_baked_says_why(scene, tmp_path):
    with pytest.raises(ValueError, match="no backend"):
        haptize.bake(scene, backend="abacus")
    with pytest.raises(haptize.BakeError, match="none"):
        haptize.bake(scene, tmp_path / "none" / "a.haptize", backend="cpu")
    with pytest.raises(TypeError):
        haptize.bake("scene.toml")


def test_exports_are_read_by_numpy(dataset, tmp_path):
    (path,) = dataset.export(tmp_path / "small.npz", "npz")
    with np.load(path) as archive:
        assert np.array_equal(archive["torque"], dataset.torque)
        units, axes = dict(archive["units"]), dict(archive["axes"])
        assert (units["torque"], units["energy"], units["q2"], units["contact_forces"]) == ("N m, N", "J", "m", "N")
        assert (axes["torque"], axes["status"], axes["q1"]) == ("turn, slide, joint", "turn, slide", "turn")
        numbers = {name for name in archive if archive[name].dtype.kind != "U"}
        assert numbers == set(units) == set(axes)
    with pytest.raises(ValueError):
        dataset.export(tmp_path / "small.xls", "xls")


def test_hdf5_is_read_by_h5py_with_units_and_axes(dataset, tmp_path):
    h5py = pytest.importorskip("h5py")
    (path,) = dataset.export(tmp_path / "small.h5", "hdf5")
    with h5py.File(path) as file:
        for name in ("torque", "energy", "gap", "status", "residual", "iterations"):
            column = getattr(dataset, name)
            assert np.array_equal(file[name], column) and file[name].dtype == column.dtype, name
            assert [file[name].dims[axis].label for axis in (0, 1)] == ["turn", "slide"]
            for axis, line in enumerate(dataset.lines):
                assert np.array_equal(file[name].dims[axis][0], line)
        for name, column in zip(("contact_offsets", "contact_nodes", "contact_forces"), dataset.contacts):
            assert np.array_equal(file[name], column)
        units = {name: file[name].attrs["units"] for name in file if "units" in file[name].attrs}
        assert {np.bytes_(b"N m, N"), np.bytes_(b"J"), np.bytes_(b"m"), np.bytes_(b"rad")} <= set(map(np.bytes_, units.values()))
        assert file["torque"].dims[2].label == "joint" and list(file["torque"].dims[2][0]) == [0, 1]
        for array in (array for array in file.values() if array.ndim and "DIMENSION_LIST" in array.attrs):
            assert [len(scale[0]) for scale in array.dims] == list(array.shape), array.name
        assert file["scene"].asstr()[()] == dataset.scene
        assert list(file["joint_names"].asstr()) == ["turn", "slide"]
        assert file["q2"].is_scale and file["q2"].attrs["NAME"] in ("slide", b"slide")
    q = np.random.default_rng(3).uniform(-1, 1, (50, 2))
    (path,) = haptize.gridize(q, q, 0.1).export(tmp_path / "measured.h5", "hdf5")
    with h5py.File(path) as file:
        assert "energy" not in file and file["torque"].ndim == 3


@pytest.mark.parametrize("engine", ["h5netcdf", "netcdf4"])
def test_hdf5_is_opened_by_xarray(dataset, tmp_path, engine):
    xarray = pytest.importorskip("xarray")
    pytest.importorskip({"netcdf4": "netCDF4"}.get(engine, engine))
    (path,) = dataset.export(tmp_path / "small.h5", "hdf5")
    with xarray.open_dataset(path, engine=engine) as opened:
        assert opened.torque.dims == ("q1", "q2", "joint") and np.array_equal(opened.torque, dataset.torque)
        assert np.array_equal(opened.energy.sel(q1=dataset.lines[0][3], method="nearest"), dataset.energy[3])
        assert opened.contact_forces.dims == ("contact", "xyz") and np.array_equal(opened.contact_forces, dataset.contacts[2])


def test_figures_are_written(dataset, tmp_path):
    files = dataset.figures(tmp_path)
    assert files and all(file.stat().st_size > 1000 for file in map(type(tmp_path), files))
    pyplot = pytest.importorskip("matplotlib.pyplot")
    pyplot.switch_backend("agg")
    ax = haptize.plot(dataset, joint=1)
    assert ax.get_xlabel() == "turn [rad]" and ax.get_ylabel() == "slide [m]"
    with pytest.raises(ValueError):
        haptize.plot(dataset, "colour")
