"""What one of 200,000 look-ups costs in haptize, SciPy, interpn and numba, on one thread, in one run; and how far the results are apart.

    bash benches/peers/setup.sh && target/peers/bin/pip install haptize-*.whl && target/peers/bin/python benches/peers/look_up.py sphere.haptize

Processor time, the least of seven turns. The peers interpolate three stored torques linearly. haptize also says whether there is contact, keeps
the torque within the boundary layer, and with `potential` interpolates the energy, whose gradient the torque is.
"""

import os
import sys
import time
from importlib.metadata import version
from typing import Callable

# Before the libraries begin their threads.
os.environ["RAYON_NUM_THREADS"] = os.environ["NUMBA_NUM_THREADS"] = "1"

import haptize  # noqa: E402
import interpn  # noqa: E402
import numba  # noqa: E402
import numpy as np  # noqa: E402
from scipy.interpolate import RegularGridInterpolator  # noqa: E402

COUNT, TURNS = 200_000, 7


@numba.njit
def trilinear(q, start, step, torque, out):
    """Torque `out` at each q, from a grid of three axes."""
    for row in range(len(q)):
        low, x = np.empty(3, np.int64), np.empty(3)
        for a in range(3):
            place = (q[row, a] - start[a]) / step[a]
            low[a] = min(max(int(place), 0), torque.shape[a] - 2)
            x[a] = place - low[a]
        out[row] = 0.0
        for corner in range(8):
            i, j, k = corner >> 2, corner >> 1 & 1, corner & 1
            weight = (x[0] if i else 1 - x[0]) * (x[1] if j else 1 - x[1]) * (x[2] if k else 1 - x[2])
            for a in range(3):
                out[row, a] += weight * torque[low[0] + i, low[1] + j, low[2] + k, a]


def main() -> None:
    dataset = haptize.Dataset.open(sys.argv[1])
    lines, torque = dataset.lines, np.ascontiguousarray(dataset.torque)
    if len(lines) != 3:
        sys.exit(f"{sys.argv[1]} has {len(lines)} joints: numba's look-up is written for three")
    start, step = np.array([line[0] for line in lines]), np.array([line[1] - line[0] for line in lines])
    q = np.random.default_rng(1).uniform(start, [line[-1] for line in lines], (COUNT, 3))
    columns = [np.ascontiguousarray(column) for column in q.T]
    each = [np.ascontiguousarray(torque[..., a]) for a in range(3)]
    out, of_scipy = np.empty_like(q), RegularGridInterpolator(lines, torque)
    linear, potential = haptize.Field(dataset, "linear"), haptize.Field(dataset, "potential")
    ways: dict[str, Callable[[], np.ndarray]] = {
        f"haptize {haptize.__version__}, linear": lambda: linear.torque(q, out),
        f"haptize {haptize.__version__}, potential": lambda: potential.torque(q, out),
        f"SciPy {version('scipy')}, RegularGridInterpolator": lambda: of_scipy(q),
        f"interpn {version('interpn')}, linear": lambda: np.stack(
            [interpn.interpn(columns, lines, one, grid_kind="regular", max_threads=1) for one in each], -1
        ),
        f"numba {version('numba')}, a loop": lambda: (trilinear(q, start, step, torque, out), out)[1],
    }
    expected = of_scipy(q)
    for name, way in ways.items():
        # The first turn compiles.
        apart = np.abs(way() - expected).max(1) / np.abs(expected).max()
        times = []
        for _ in range(TURNS):
            begin = time.process_time()
            way()
            times.append((time.process_time() - begin) / COUNT * 1e9)
        print(f"{name:42} {min(times):6.0f} ns, {(apart < 1e-12).mean():6.1%} of the torques are SciPy's to rounding")


if __name__ == "__main__":
    main()
