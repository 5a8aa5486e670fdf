"""A forked process, as multiprocessing makes on Linux up to Python 3.13: threads that the parent had begun are not there."""

import multiprocessing
import sys
import warnings

import haptize
import numpy as np
import pytest
from conftest import PRESSED

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="only there is it safe to fork with threads")

# Far more than one thread takes.
ROWS = 5000

# Longest time for what takes a second at most (s).
PATIENCE = 60


@pytest.fixture(scope="module")
def solver(scene):
    return haptize.Solver(scene)


@pytest.fixture(scope="module")
def many(dataset):
    lines = dataset.lines
    spread = np.random.default_rng(1).random((ROWS, len(lines)))
    return np.array([line[0] for line in lines]) + spread * np.array([line[-1] - line[0] for line in lines])


def in_child(work):
    """What `work` returns in a process that is forked for it."""
    context = multiprocessing.get_context("fork")
    receiver, sender = context.Pipe(duplex=False)
    child = context.Process(target=lambda: sender.send(work()))
    with warnings.catch_warnings():
        # Python 3.12 and later warn of exactly this.
        warnings.simplefilter("ignore", DeprecationWarning)
        child.start()
    sender.close()
    try:
        assert receiver.poll(PATIENCE), "the child hangs"
        return receiver.recv()
    finally:
        child.kill()
        child.join()


def works(scene, dataset, field, solver, many, folder):
    """Everything that shares work out among threads, by name."""
    file = folder / "kept.haptize"
    torque = field.torque(many[:50])

    def baked():
        return haptize.bake(scene, backend="cpu", measure_error=5).torque.copy()

    def baked_to_a_file():
        told, file = [], folder / "baked.haptize"
        haptize.bake(scene, file, backend="cpu", measure_error=0, progress=lambda *done: told.append(done))
        assert told
        return haptize.Dataset.load(file).torque.copy()

    def figures():
        return len(dataset.figures(folder))

    def gridized():
        return haptize.gridize(many[:50], torque, [axis["step"] for axis in dataset.axes]).torque.copy()

    def felt():
        loop = haptize.Loop(dataset)
        loop.start(PRESSED)
        return loop.tick(PRESSED, loop.period)

    def kept():
        dataset.save(file)
        dataset.export(folder / "kept.npz", "npz")
        return haptize.Field(haptize.Dataset.open(file), "potential").torque(many)

    return {
        "torque": lambda: field.torque(many),
        "energy": lambda: field.energy(many),
        "gradient": lambda: field.gradient(many),
        "status": lambda: field.status(many),
        "solve": lambda: solver.solve(PRESSED).torque,
        "solve many": lambda: solver.torque(many[:31]),
        "solver": lambda: haptize.Solver(scene).solve(PRESSED).torque,
        "bake": baked,
        "bake to a file": baked_to_a_file,
        "figures": figures,
        "gridize": gridized,
        "loop": felt,
        "files": kept,
    }


def test_a_forked_process_does_all_that_its_parent_does(scene, dataset, field, solver, many, tmp_path):
    for name, work in works(scene, dataset, field, solver, many, tmp_path).items():
        # The parent's threads are there before the fork.
        expected = work()
        np.testing.assert_array_equal(in_child(work), expected, err_msg=name)
        np.testing.assert_array_equal(work(), expected, err_msg=name)


def test_a_process_that_a_forked_one_forks_works_as_well(field, many):
    expected = field.torque(many)

    def forked():
        # A pool of its own, which the grandchild has not.
        mine = field.torque(many)
        context = multiprocessing.get_context("fork")
        receiver, sender = context.Pipe(duplex=False)
        grandchild = context.Process(target=lambda: sender.send(field.torque(many)), daemon=True)
        grandchild.start()
        theirs = receiver.recv() if receiver.poll(PATIENCE) else None
        grandchild.kill()
        return mine, theirs

    for found in in_child(forked):
        np.testing.assert_array_equal(found, expected)


def test_a_pool_of_forked_processes_shares_a_field(field, many):
    expected = field.torque(many)
    shared["field"] = field
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)
        with multiprocessing.get_context("fork").Pool(2) as pool:
            found = pool.map_async(torque_of, np.split(many, 4)).get(PATIENCE)
    np.testing.assert_array_equal(np.concatenate(found), expected)


# What the processes of a pool find by its name, as a DataLoader's workers do.
shared = {}


def torque_of(rows):
    return shared["field"].torque(rows)
