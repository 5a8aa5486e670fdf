"""The loop, tick by tick, and direct equilibria."""

import haptize
import numpy as np
import pytest
from conftest import PRESSED


def press(loop, ticks=1000):
    loop.start([PRESSED[0], 0.0])
    for k in range(ticks):
        tau = loop.tick([PRESSED[0], PRESSED[1] * (k + 1) / ticks], loop.period)
    return tau


def test_the_loop_pushes_back(dataset):
    loop = haptize.Loop(dataset)
    assert loop.joints == 2 and loop.period == 1e-3
    assert loop.proxy is None and loop.fault is None and not loop.contact
    tau = press(loop)
    assert loop.contact and loop.fault is None
    assert tau.shape == (2,) and tau[1] < 0 and loop.contact_torque[1] < 0
    # The proxy stays behind the device, at the surface.
    assert loop.proxy[1] < PRESSED[1]
    out = np.zeros(2)
    assert loop.tick(PRESSED, loop.period, out=out) is out and out[1] < 0


def test_a_scene_is_felt_without_a_bake(scene, dataset):
    live, stored = haptize.Loop(scene), haptize.Loop(dataset)
    assert live.joints == 2 and live.period == stored.period
    felt, looked_up = press(live), press(stored)
    assert live.contact and live.fault is None and felt[1] < 0
    # The grid of the small scene is coarse.
    assert 0 < abs(felt[1] - looked_up[1]) < 0.2 * abs(felt[1])
    following = haptize.Scene(scene.text.replace("[contact]", '[contact]\nlaw = "following"'))
    assert any("before the surface at rest" in warning for warning in haptize.Loop(following).warnings)
    soft = haptize.Loop(scene, {"coupling_stiffness": np.array([1.0, 100.0])})
    assert abs(press(soft)[1]) < abs(felt[1])
    with pytest.raises(TypeError):
        haptize.Loop("small.haptize")


@pytest.mark.parametrize(
    "y, dt, age, words",
    [
        ([0.05, 5.0], 1e-3, 0.0, "leapt"),
        ([0.05, float("nan")], 1e-3, 0.0, "not a number"),
        (PRESSED, 1e-3, 1.0, "too old"),
        (PRESSED, float("nan"), 0.0, "time between two ticks"),
        (PRESSED, -1.0, 0.0, "time between two ticks"),
    ],
)
def test_the_loop_lets_go_and_begins_anew(dataset, y, dt, age, words):
    loop = haptize.Loop(dataset)
    press(loop)
    loop.tick(y, dt, age)
    assert words in loop.fault
    for _ in range(100):
        tau = loop.tick(PRESSED, loop.period)
    assert np.array_equal(tau, [0.0, 0.0]) and words in loop.fault
    loop.start([PRESSED[0], 0.0])
    assert loop.fault is None
    assert press(loop)[1] < 0


def test_gains_are_taken_and_bounds_told(dataset):
    stiff = haptize.Loop(dataset, {"coupling_stiffness": [300.0, 30000.0]})
    assert any("not passive" in warning for warning in stiff.warnings)
    soft = haptize.Loop(dataset, {"coupling_stiffness": np.array([1.0, 100.0]), "torque_limit": 0.5})
    assert abs(press(soft)[1]) < abs(press(haptize.Loop(dataset))[1])
    for wrong in ({"stiffness": 1.0}, {"torque_limit": -1.0}, {"torque_limit": [1.0, 2.0, 3.0]}, {"torque_limit": np.nan}):
        with pytest.raises(ValueError):
            haptize.Loop(dataset, wrong)


def test_what_a_loop_cannot_take_raises(dataset):
    loop = haptize.Loop(dataset)
    with pytest.raises(RuntimeError, match="start"):
        loop.tick(PRESSED, 1e-3)
    for wrong in ([0.0], [[0.0, 0.0]], [0.0, float("inf")]):
        with pytest.raises(ValueError):
            loop.start(wrong)
    loop.start(PRESSED)
    with pytest.raises(ValueError):
        loop.tick([0.0], 1e-3)
    for out in (np.zeros(3), np.zeros(4)[::2]):
        with pytest.raises(ValueError):
            loop.tick(PRESSED, 1e-3, out=out)
    y = np.array(PRESSED)
    loop.tick(y, 1e-3, out=y)


def test_an_equilibrium_is_balanced(scene, dataset):
    solver = haptize.Solver(scene)
    found = solver.solve(PRESSED)
    assert found.status == "contact" and found.energy > 0 and found.gap < 0 and found.residual < 1e-8
    assert found.forces.shape == found.displacement.shape == found.rest.shape
    assert found.arm.shape == found.arm_forces.shape == (3, 3)
    # Before the surface at rest the force on the arm has a part along the surface that does not act on the object;
    # before the deformed one action and reaction are equal.
    along = found.forces.sum(axis=0) + found.arm_forces.sum(axis=0)
    assert 0 < np.linalg.norm(along) < 0.02 * np.linalg.norm(found.arm_forces.sum(axis=0))
    following = haptize.Solver(haptize.Scene(scene.text.replace("[contact]", '[contact]\nlaw = "following"')))
    deformed = following.solve(PRESSED)
    assert np.allclose(deformed.forces.sum(axis=0), -deformed.arm_forces.sum(axis=0), atol=1e-12)
    # The torque is that of the forces on the arm (slide along -x: tau = -f_x).
    turned = np.array([-np.cos(PRESSED[0]), -np.sin(PRESSED[0]), 0.0])
    assert np.isclose(found.torque[1], found.arm_forces.sum(axis=0) @ turned)
    q = np.stack(np.meshgrid(*dataset.lines, indexing="ij"), axis=-1)
    torque = solver.torque(q)
    assert torque.shape == (7, 9, 2) and np.abs(torque - dataset.torque).max() < 1e-6
    for wrong in ([0.0], [0.0, float("nan")], [[0.0, 0.0]]):
        with pytest.raises(ValueError):
            solver.solve(wrong)


def test_an_object_that_cannot_be_built_says_why(scene):
    floating = haptize.Scene(scene.text.replace("ground = { stiffness = 100.0 }", "ground = { stiffness = 100.0, nodes = [999] }"))
    with pytest.raises(haptize.BakeError, match="999"):
        haptize.Solver(floating)
