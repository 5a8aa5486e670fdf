"""A small scene, baked once, in a folder of its own."""

import haptize
import pytest

SCENE = """
name = "small sphere"
[object]
sphere = { radius = 0.05, rings = 8, segments = 8 }
springs = { kind = "isotropic", stiffness = 300.0 }
ground = { stiffness = 100.0 }
[contact]
stiffness = 1000.0
[grid]
axes = [{ start = -0.3, step = 0.1, count = 7 }, { start = 0.01, step = 0.004, count = 9 }]
[[proxy.joint]]
name = "turn"
kind = "revolute"
axis = [0, 0, 1]
limits = [-1, 1]
[[proxy.joint]]
name = "slide"
kind = "prismatic"
axis = [-1, 0, 0]
limits = [0, 0.1]
nodes = [{ from = [0.08, -0.01, 0.002], to = [0.08, 0.01, 0.002], count = 3 }]
[graphics]
"""

PRESSED = (0.05, 0.0405)


@pytest.fixture(scope="session")
def scene():
    return haptize.Scene(SCENE, "small.toml")


@pytest.fixture(scope="session")
def dataset(scene):
    return haptize.bake(scene, backend="cpu", measure_error=0)


@pytest.fixture(scope="session")
def field(dataset):
    return haptize.Field(dataset)


@pytest.fixture(scope="session")
def file(dataset, tmp_path_factory):
    path = tmp_path_factory.mktemp("dataset") / "small.haptize"
    dataset.save(path)
    return path
