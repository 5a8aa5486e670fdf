"""The look-up in array operations against the compiled one, and its derivatives against differences; in PyTorch and JAX where they are there."""

import haptize
import numpy as np
import pytest
from haptize._array_field import ArrayField, tables_of

# Some hundred operations round a result, relative to the greatest of its kind.
ROUNDING = 1e-12


class NumpyField(ArrayField):
    """In NumPy, which is always there."""

    xp = np

    def __init__(self, field):
        vars(self).update(tables_of(field))

    @staticmethod
    def _integers(x):
        return x.astype(np.int64)


def _numpy(field):
    return NumpyField(field), np.asarray, np.asarray


def _torch(field):
    torch = pytest.importorskip("torch")
    from haptize.torch import Field

    return Field(field), torch.tensor, lambda x: x.numpy()


def _jax(field):
    jax = pytest.importorskip("jax")
    jax.config.update("jax_enable_x64", True)
    from haptize.jax import Field

    return Field(field), jax.numpy.asarray, np.asarray


def places(field, count=3000):
    """Configurations in and around the grid, some on its lines and beyond its ends."""
    random = np.random.default_rng(3)
    lines = field.dataset.lines
    least, greatest = np.array([(line[0], line[-1]) for line in lines]).T
    q = random.uniform(least - 0.2 * (greatest - least), greatest + 0.2 * (greatest - least), (count, len(lines)))
    q[: count // 10] = np.stack([random.choice(line, count // 10) for line in lines], -1)
    return q


@pytest.fixture(scope="module", params=["linear", "potential"])
def looked_up(request, dataset):
    return haptize.Field(dataset, request.param)


@pytest.mark.parametrize("made", [_numpy, _torch, _jax])
def test_arrays_give_what_the_compiled_look_up_gives(looked_up, made):
    field, of_numpy, to_numpy = made(looked_up)
    q = places(looked_up)
    torque = looked_up.torque(q)
    assert np.abs(to_numpy(field.torque(of_numpy(q))) - torque).max() < ROUNDING * np.abs(torque).max()
    energy = looked_up.energy(q)
    assert np.abs(to_numpy(field.energy(of_numpy(q))) - energy).max() < ROUNDING * np.abs(energy).max()
    gap, expected = to_numpy(field.gap(of_numpy(q))), looked_up.gap(q)
    assert np.array_equal(np.isnan(gap), np.isnan(expected)) and np.isnan(gap).any()
    assert np.nanmax(np.abs(gap - expected)) < ROUNDING * np.nanmax(np.abs(expected))
    # Outside the grid the status says nothing of contact.
    inside = looked_up.status(q) != 4
    contact = to_numpy(field.contact(of_numpy(q)))
    assert contact[inside].any() and np.array_equal(contact[inside], looked_up.status(q)[inside] == 1)
    assert field.torque(of_numpy(q.reshape(30, 100, 2))).shape == (30, 100, 2)
    assert np.isnan(to_numpy(field.torque(of_numpy(np.array([np.nan, 0.02]))))).all()


@pytest.mark.parametrize("joints", range(1, 7))
def test_any_number_of_joints_is_looked_up(joints):
    # A quadratic energy beyond a plane, as measurements and the energy that the interpolation needs.
    count = 4 if joints > 3 else 7
    axis = {"start": -0.3, "step": 0.2, "count": count}
    lines = np.meshgrid(*[axis["start"] + axis["step"] * np.arange(count)] * joints, indexing="ij")
    q = np.stack([line.reshape(-1) for line in lines], -1)
    normal = np.arange(1, joints + 1) / np.linalg.norm(np.arange(1, joints + 1))
    measured = haptize.gridize(q, -3.0 * np.maximum(q @ normal, 0.0)[:, None] * normal, step=0.2)
    field = haptize.Field(measured)
    q = places(field, 500)
    torque = field.torque(q)
    assert np.abs(torque).max() > 0.1
    assert np.abs(NumpyField(field).torque(q) - torque).max() < ROUNDING * np.abs(torque).max()


def inside_a_cell(field, count):
    """Configurations in contact at least a hundredth of a cell away from its faces, where the torque may have kinks."""
    q = places(field, 20_000)
    lines = field.dataset.lines
    parts = np.stack([(q[:, a] - line[0]) / (line[1] - line[0]) % 1 for a, line in enumerate(lines)], -1)
    away = ((parts > 0.01) & (parts < 0.99)).all(-1) & (field.status(q) == 1) & (field.energy(q) > 1e-6)
    assert away.sum() > count
    return q[away][:count]


# Differences over a hundred-thousandth of a cell keep ten digits of the torque; a kink of the boundary layer within one is rare.
SLOPE = 1e-6


def close(slopes, field, q):
    expected = field.gradient(q)
    error = np.abs(slopes - expected).max(axis=(-2, -1)) / np.abs(expected).max()
    return np.median(error) < SLOPE and (error < SLOPE).mean() > 0.99


def test_derivatives_of_torch_are_those_of_the_torque(looked_up):
    torch = pytest.importorskip("torch")
    field, _, _ = _torch(looked_up)
    q = inside_a_cell(looked_up, 200)
    slopes = torch.func.vmap(torch.func.jacfwd(field.torque))(torch.tensor(q))
    assert close(slopes.numpy(), looked_up, q)
    backward = torch.func.vmap(torch.func.jacrev(field))(torch.tensor(q))
    assert torch.allclose(backward, slopes, rtol=ROUNDING, atol=ROUNDING * float(slopes.abs().max()))
    some = torch.tensor(q[:20], requires_grad=True)
    assert torch.autograd.gradcheck(field.torque, some) and torch.autograd.gradcheck(field.energy, some)
    if looked_up.tables()["compliance"] is None:
        (slope,) = torch.autograd.grad(field.energy(some).sum(), some)
        torque = field.torque(some.detach())
        assert torch.allclose(-slope, torque, rtol=0, atol=ROUNDING * 1e3 * float(torque.abs().max()))
    single = haptize.torch.Field(looked_up, torch.float32)
    error = (single.torque(torch.tensor(q, dtype=torch.float32)).double() - field.torque(torch.tensor(q))).abs().max()
    assert error < 1e-4 * field.torque(torch.tensor(q)).abs().max()


def test_derivatives_of_jax_are_those_of_the_torque(looked_up):
    jax = pytest.importorskip("jax")
    field, _, _ = _jax(looked_up)
    q = inside_a_cell(looked_up, 200)
    slopes = jax.vmap(jax.jacfwd(field.torque))(q)
    assert close(np.asarray(slopes), looked_up, q)
    assert np.allclose(jax.vmap(jax.jacrev(field.torque))(q), slopes, rtol=ROUNDING, atol=ROUNDING * np.abs(slopes).max())
    compiled = jax.jit(lambda field, q: field.torque(q))
    assert np.allclose(compiled(field, q), looked_up.torque(q), rtol=0, atol=ROUNDING)
    assert np.allclose(jax.jit(jax.vmap(field.energy))(q), looked_up.energy(q), rtol=0, atol=ROUNDING)
    if looked_up.tables()["compliance"] is None:
        slope = jax.vmap(jax.grad(field.energy))(q)
        assert np.allclose(-slope, looked_up.torque(q), rtol=0, atol=1e3 * ROUNDING)


def _slopes_by_torch(field, q):
    torch = pytest.importorskip("torch")
    return torch.func.vmap(torch.func.jacfwd(_torch(field)[0].torque))(torch.tensor(q)).numpy()


def _slopes_by_jax(field, q):
    jax = pytest.importorskip("jax")
    field = _jax(field)[0]
    return np.asarray(jax.jit(jax.vmap(jax.jacfwd(field.torque)))(q))


def one_sided(field, q, steps):
    """Differences of the second order on the lower and on the upper side of q, by the compiled torque: two arrays (..., d, d)."""
    two_lower, lower, here, upper, two_upper = (field.torque(q[..., None, :] + k * np.diag(steps)) for k in (-2, -1, 0, 1, 2))
    sides = 3 * here - 4 * lower + two_lower, 4 * upper - 3 * here - two_upper
    return [np.swapaxes(side / (2 * steps[:, None]), -1, -2) for side in sides]


# Of a ten-thousandth of a cell: the third derivative that they leave out is below a millionth, rounding far below.
ONE_SIDED = 1e-5


@pytest.mark.parametrize("slopes_of", [_slopes_by_torch, _slopes_by_jax])
@pytest.mark.parametrize("axis, last, outward", [(0, 0, -1), (0, -1, 1), (1, -1, 1)])
def test_derivatives_at_a_limit_are_those_within_and_outside_those_of_the_fade(looked_up, slopes_of, axis, last, outward):
    lines = looked_up.dataset.lines
    steps = np.array([line[1] - line[0] for line in lines])
    # Well inside cells in contact, which are those of the last two slides; then moved to the limit, and beyond it.
    random = np.random.default_rng(7)
    corners = np.stack([random.choice(lines[0][:-1], 60), random.choice(lines[1][-3:-1], 60)], -1)
    q = corners + steps * random.uniform(0.1, 0.9, (60, 2))
    for beyond in (0.0, 0.4):
        q[:, axis] = lines[axis][last] + outward * beyond * steps[axis]
        lower, upper = one_sided(looked_up, q, 1e-4 * steps)
        expected = (lower + upper) / 2
        if beyond == 0:
            expected[..., axis] = (lower if outward > 0 else upper)[..., axis]
        scale = np.abs(expected).max()
        smooth = np.abs(expected - (lower if outward > 0 else upper)).max((-2, -1)) < ONE_SIDED * scale
        assert scale > 1 and smooth.mean() > 0.9
        assert np.abs(slopes_of(looked_up, q) - expected)[smooth].max() < ONE_SIDED * scale
    # Free, and more than a cell outside.
    assert not slopes_of(looked_up, np.array([[0.05, 0.012], [5.0, 5.0], [0.05, lines[1][-1] + 1.5 * steps[1]]])).any()


def test_a_refined_dataset_has_no_tables(scene, tmp_path):
    (tmp_path / "small.toml").write_text(scene.text)
    refined = tmp_path / "small.haptize"
    haptize.run("bake", tmp_path / "small.toml", max_error="5%", refine=1, backend="cpu", output=refined)
    with pytest.raises(haptize.DatasetError, match="refine"):
        NumpyField(haptize.Field.open(refined))
