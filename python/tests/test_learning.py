"""The environment of docs/learning.md in Gymnasium, and the page's examples, where the libraries are there."""

import doctest
import importlib.util
import shutil
import warnings
from pathlib import Path

import haptize
import numpy as np
import pytest

REPOSITORY = Path(__file__).resolve().parents[2]


def palpate():
    place = importlib.util.spec_from_file_location("palpate", REPOSITORY / "python/examples/palpate.py")
    module = importlib.util.module_from_spec(place)
    place.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def tissue():
    """A field over the finger's joints, whose pitch is pressed back harder over a nodule at a yaw of 0.1 rad."""
    lines = np.linspace(-0.25, 0.25, 21), np.linspace(0.0, 0.07, 8), np.linspace(-0.016, 0.016, 2)
    q = np.stack(np.meshgrid(*lines, indexing="ij"), -1).reshape(-1, 3)
    torque = np.zeros_like(q)
    torque[:, 1] = -4.0 * q[:, 1] * (1 + 0.1 * np.exp(-(((q[:, 0] - 0.1) / 0.05) ** 2)))
    return haptize.Field(haptize.gridize(q, torque, step=[line[1] - line[0] for line in lines]))


def test_the_environment_is_one_of_gymnasium(tissue):
    pytest.importorskip("gymnasium")
    from gymnasium.utils.env_checker import check_env

    with warnings.catch_warnings():
        # That the example is not registered, and its spaces are not bounded.
        warnings.simplefilter("ignore")
        check_env(palpate().Palpation(tissue), skip_render_check=True)


def test_environments_in_processes_that_were_spawned_do_what_one_does(tissue):
    gymnasium = pytest.importorskip("gymnasium")
    module = palpate()
    actions = np.array([[[0.5, 1.0], [-0.5, 1.0]]] * 10, dtype=np.float32)
    alone = [module.Palpation(tissue) for _ in range(2)]
    expected = [[world.reset(seed=number)[0]] for number, world in enumerate(alone)]
    for step in actions:
        for world, action, seen in zip(alone, step, expected):
            seen.append(world.step(action)[0])
    worlds = gymnasium.vector.AsyncVectorEnv([lambda: palpate().Palpation(tissue)] * 2, context="spawn")
    try:
        seen = [worlds.reset(seed=[0, 1])[0], *(worlds.step(step)[0] for step in actions)]
    finally:
        worlds.close()
    assert np.array_equal(np.stack(seen, 1), expected)


def test_a_nodule_is_felt_and_training_gives_a_policy(tissue):
    pytest.importorskip("gymnasium")
    module = palpate()
    module.DISPLACED = 0.0
    parameters, curve = module.train(tissue, generations=5, pairs=4, episodes=4)
    assert len(curve) == 5 and np.isfinite(curve).all() and parameters.shape == (module.Policy.COUNT,)
    world = module.Palpation(tissue, (100,))
    world.reset(seed=0)
    # Over the nodule at full depth the torque is a tenth greater than beside it.
    world.yaw, world.pitch, world.side = np.full(100, 0.1), np.full(100, 0.06), np.ones(100)
    over = world._observe()[:, 2].mean()
    world.yaw = np.full(100, -0.1)
    assert over / world._observe()[:, 2].mean() == pytest.approx(1.1, rel=0.02)


@pytest.mark.parametrize("section, library", [("PyTorch", "torch"), ("JAX", "jax")])
def test_the_examples_of_the_page_are_right(section, library, tmp_path, monkeypatch):
    pytest.importorskip(library)
    shutil.copy(REPOSITORY / "datasets/sphere.toml", tmp_path)
    monkeypatch.chdir(tmp_path)
    haptize.bake(haptize.Scene.load("sphere.toml"), "sphere.haptize", backend="cpu", measure_error=0)
    sections = dict(part.split("\n", 1) for part in (REPOSITORY / "docs/learning.md").read_text().split("\n## "))
    examples = doctest.DocTestParser().get_doctest(sections[section], {}, section, "docs/learning.md", None)
    result = doctest.DocTestRunner().run(examples)
    assert result.attempted > 5 and result.failed == 0
