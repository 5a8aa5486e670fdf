"""Look-ups, one or many, and what cannot be looked up."""

import os
import signal
import sys
import threading
import time

import haptize
import numpy as np
import pytest
from conftest import PRESSED


def test_grid_points_give_what_is_stored_where_nothing_is_held_back(dataset):
    # The potential is the energy interpolated: at grid points it has their torque.
    field = haptize.Field(dataset, "potential")
    q = np.stack(np.meshgrid(*dataset.lines, indexing="ij"), axis=-1)
    assert q.shape == (7, 9, 2)
    assert np.allclose(field.energy(q), dataset.energy, atol=1e-6)
    assert np.allclose(field.gap(q), dataset.gap, atol=1e-6)
    assert np.abs(field.torque(q) - dataset.torque).max() < 1e-6 * np.abs(dataset.torque).max()


def test_one_and_many_give_the_same(field):
    random = np.random.default_rng(1)
    q = random.uniform((-0.3, 0.01), (0.3, 0.042), (10_000, 2))
    many = field.torque(q)
    assert many.shape == q.shape and np.abs(many).max() > 0
    for k in range(0, len(q), 500):
        one = field.torque(q[k])
        assert one.shape == (2,) and np.array_equal(one, many[k])
    assert np.array_equal(field.torque(q.reshape(100, 100, 2)), many.reshape(100, 100, 2))
    assert field.torque(np.empty((0, 2))).shape == (0, 2)
    status = field.status(q)
    assert status.dtype == np.uint8 and set(np.unique(status)) <= {0, 1}
    assert field.energy(q).shape == field.gap(q).shape == status.shape == (10_000,)


@pytest.mark.skipif(sys.platform == "win32", reason="os.kill ends a process there")
@pytest.mark.parametrize("look_up", ["torque", "gradient", "status"])
def test_ctrl_c_ends_a_batch(field, look_up):
    # What is started in the background of a script is made to ignore it.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    # Seconds of work.
    q = np.tile(PRESSED, (10_000_000, 1))
    begun = time.monotonic()
    threading.Timer(0.3, lambda: os.kill(os.getpid(), signal.SIGINT)).start()
    with pytest.raises(KeyboardInterrupt):
        getattr(field, look_up)(q)
    assert time.monotonic() - begun < 1.3


def test_a_refused_configuration_is_counted_from_the_beginning(dataset):
    bounded = haptize.Field(dataset, bounds_error=True)
    q = np.tile(PRESSED, (100_000, 1))
    q[98_765] = [9.0, 0.0]
    with pytest.raises(ValueError, match="configuration 98765 is outside"):
        bounded.torque(q)
    q[98_766] = np.nan
    with pytest.raises(ValueError, match="configuration 98766 is not a finite number"):
        bounded.torque(q)


def test_lists_integers_and_strided_arrays_are_taken(field):
    expected = field.torque(np.array(PRESSED))
    assert np.array_equal(field.torque(list(PRESSED)), expected)
    assert np.array_equal(field.torque([0, 0]), field.torque([0.0, 0.0]))
    wide = np.zeros((5, 6))
    wide[:, ::3] = PRESSED
    assert np.array_equal(field.torque(wide[:, ::3])[4], expected)
    turned = np.asfortranarray(np.tile(PRESSED, (5, 1)) + np.arange(5)[:, None] * 1e-4)
    assert np.array_equal(field.torque(turned), field.torque(np.ascontiguousarray(turned)))
    shifted = np.frombuffer(b"." + np.array(PRESSED).tobytes(), dtype=np.float64, offset=1)
    assert not shifted.flags.aligned and np.array_equal(field.torque(shifted), expected)
    swapped = np.array(PRESSED, dtype=">f8")
    assert np.array_equal(field.torque(swapped), expected)
    read_only = np.array(PRESSED)
    read_only.flags.writeable = False
    assert np.array_equal(field.torque(read_only), expected)


def test_the_gradient_is_the_slope_of_the_torque(field):
    q = np.array(PRESSED)
    gradient = field.gradient(q)
    assert gradient.shape == (2, 2)
    step = 1e-6
    for joint in range(2):
        moved = [q + sign * step * np.eye(2)[joint] for sign in (1, -1)]
        difference = (field.torque(moved[0]) - field.torque(moved[1])) / (2 * step)
        assert np.allclose(gradient[:, joint], difference, rtol=1e-4, atol=1e-4 * np.abs(gradient).max())
    assert field.gradient(np.tile(q, (3, 1))).shape == (3, 2, 2)


def test_a_buffer_is_filled_in_place(field):
    out = np.full(2, 7.0)
    assert field.torque(PRESSED, out) is out
    assert np.array_equal(out, field.torque(PRESSED))
    out = np.full((100, 2), 7.0)
    field.torque(np.tile(PRESSED, (100, 1)), out=out)
    assert np.array_equal(out[99], field.torque(PRESSED))


def test_outside_the_grid_is_told(field):
    assert field.status([5.0, 0.02]) == 4
    assert np.isnan(field.gap([5.0, 0.02]))
    assert np.array_equal(field.torque([5.0, 5.0]), [0.0, 0.0])
    # Also where the step of a difference is below the rounding of the coordinates.
    assert np.array_equal(field.gradient([1e300, -1e300]), np.zeros((2, 2)))


def test_outside_the_grid_is_refused_or_filled_where_it_is_asked_for(dataset, field):
    strict = haptize.Field(dataset, bounds_error=True)
    filled = haptize.Field(dataset, fill_value=np.nan)
    beyond = np.array([PRESSED, [5.0, 0.02], [-0.3, 0.01], [0.0, 0.0099]])
    for name in ("torque", "energy", "gap", "gradient"):
        with pytest.raises(ValueError, match="configuration 1 is outside"):
            getattr(strict, name)(beyond)
        with pytest.raises(ValueError, match="configuration 0 is outside"):
            getattr(strict, name)(beyond[3])
        for row, inside in enumerate([True, False, True, False]):
            for found in (getattr(filled, name)(beyond)[row], getattr(filled, name)(beyond[row])):
                expected = getattr(field, name)(beyond[row])
                assert np.array_equal(found, expected) if inside else np.isnan(found).all(), (name, row)
        assert np.array_equal(getattr(strict, name)(beyond[::2]), getattr(field, name)(beyond[::2]))
    assert filled.torque(np.empty((0, 2))).shape == (0, 2)
    assert (strict.bounds_error, strict.fill_value, strict.interpolation) == (True, None, None)


def test_forces_and_shape_at_a_grid_point_are_those_of_the_equilibrium(scene, dataset):
    field = haptize.Field(dataset, "potential")
    # The deepest grid point.
    point = np.unravel_index(dataset.energy.argmax(), dataset.shape)
    q = np.array([line[k] for line, k in zip(dataset.lines, point)])
    found = haptize.solve(scene, q)
    forces, displacement = field.forces(q), field.displacement(q)
    # Stored forces have seven digits.
    assert forces.shape == found.forces.shape and np.abs(forces).max() > 0.1
    assert np.abs(forces - found.forces).max() < 1e-5 * np.abs(found.forces).max()
    assert np.abs(displacement - found.displacement).max() < 1e-5 * np.abs(found.displacement).max()
    many = field.forces(np.array([q, [0.0, 0.01]]))
    assert many.shape == (2, *forces.shape) and np.array_equal(many[0], forces) and not many[1].any()
    measured = haptize.Field(haptize.gridize(np.array([[0.0], [1.0]]), np.zeros((2, 1)), 0.5))
    with pytest.raises(haptize.Error):
        measured.forces([0.5])


@pytest.mark.parametrize(
    "q, error",
    [
        ([0.0], ValueError),
        (0.0, ValueError),
        ([[0.0, 0.0, 0.0]], ValueError),
        ([0.0, float("nan")], ValueError),
        ([[0.0, 0.0], [float("inf"), 0.0]], ValueError),
        ([[0.0, 0.0], [0.0]], ValueError),
        ([1j, 0.0], TypeError),
        (["a", "b"], TypeError),
        (None, (TypeError, ValueError)),
        ({"q": 1}, (TypeError, ValueError)),
        (np.array([object(), object()]), TypeError),
    ],
)
def test_what_is_no_configuration_is_refused(field, q, error):
    for look_up in (field.torque, field.energy, field.gap, field.gradient, field.status):
        with pytest.raises(error):
            look_up(q)


def test_a_wrong_buffer_is_refused_and_left_alone(field):
    q = np.tile(PRESSED, (4, 1))
    wrong = [np.full((4, 3), 7.0), np.full(8, 7.0), np.full((4, 4), 7.0)[:, ::2], np.full((2, 4), 7.0).T]
    for out in wrong:
        with pytest.raises(ValueError):
            field.torque(q, out)
        assert (out == 7.0).all()
    for out in (np.full((4, 2), 7.0, dtype=np.float32), [[0.0, 0.0]] * 4, "out"):
        with pytest.raises(TypeError, match="must be an array of float64"):
            field.torque(q, out)
        with pytest.raises(TypeError, match="must be an array of float64"):
            field.torque(PRESSED, out)
    out = np.full((4, 2), 7.0)
    out.flags.writeable = False
    with pytest.raises(ValueError):
        field.torque(q, out)
    shifted = np.frombuffer(bytearray(65), dtype=np.float64, offset=1).reshape(4, 2)
    with pytest.raises(ValueError, match="aligned"):
        field.torque(q, shifted)
    # Into itself, and into a part of itself.
    with pytest.raises(ValueError):
        field.torque(q, q)
    both = np.tile(PRESSED, (5, 1))
    with pytest.raises(ValueError):
        field.torque(both[:4], both[1:])
    assert np.array_equal(q, np.tile(PRESSED, (4, 1)))


def test_threads_share_a_field(field):
    q = np.tile(PRESSED, (1000, 1))
    expected = field.torque(q)
    results = []

    def work():
        results.append(all(np.array_equal(field.torque(q), expected) for _ in range(20)))

    threads = [threading.Thread(target=work) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert results == [True] * 4


def test_a_field_outlives_file_and_dataset(file, tmp_path, field):
    path = tmp_path / "copy.haptize"
    path.write_bytes(file.read_bytes())
    opened = haptize.Field.open(path)
    path.unlink()
    assert np.array_equal(opened.torque(PRESSED), field.torque(PRESSED))
    with pytest.raises(ValueError, match="no interpolation"):
        haptize.Field.open(file, "spline")


def test_samples_become_a_field():
    random = np.random.default_rng(2)
    q = np.vstack([random.uniform(-1, 1, (400, 2)), [[x, y] for x in (-1, 1) for y in (-1, 1)]])
    tau = np.column_stack([2 * q[:, 0] - q[:, 1], q[:, 1]])
    dataset = haptize.gridize(q, tau, 0.1, names=["a", "b"], units=["rad", "m"], epsilon=0.0)
    assert dataset.report["samples"] == 404 and dataset.shape == (21, 21) and dataset.scene == ""
    # Linear on simplices is exact for what is linear.
    lines = np.stack(np.meshgrid(*dataset.lines, indexing="ij"), axis=-1)
    expected = np.stack([2 * lines[..., 0] - lines[..., 1], lines[..., 1]], axis=-1)
    inside = dataset.status != 4
    assert np.abs(dataset.torque - expected)[inside].max() < 1e-8 and inside.mean() > 0.8
    assert haptize.Field(dataset).torque([0.3, 0.2]).shape == (2,)
    with pytest.raises(haptize.DatasetError, match="no scene"):
        haptize.Loop(dataset)
    for wrong in ((q[:, :1], tau, 0.1), (q, tau[:10], 0.1), (q[0], tau[0], 0.1)):
        with pytest.raises(ValueError):
            haptize.gridize(*wrong)
    for wrong in ((q, tau, -0.1), (q * np.nan, tau, 0.1), (q[:2], tau[:2], 0.1), (q, tau, [0.1, 0.1, 0.1])):
        with pytest.raises(haptize.GridizeError):
            haptize.gridize(*wrong)
    with pytest.raises(haptize.GridizeError, match="U\\+000A"):
        haptize.gridize(q, tau, 0.1, names=["a\nb: sound", "c"])
