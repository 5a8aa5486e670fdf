"""A small scene, baked once, in a folder of its own."""

from pathlib import Path

import haptize
import pytest

SCENE = (Path(__file__).resolve().parents[2] / "tests/scenes/small.toml").read_text()

# In contact.
PRESSED = (-0.18, 0.0415)


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
