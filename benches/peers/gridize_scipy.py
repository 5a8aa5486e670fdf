"""The peer of benches/gridize.rs: SciPy's LinearNDInterpolator on the same samples and the same grid.

usage: gridize_scipy.py SAMPLES.f64 JOINTS STEP RESULT.f64
SAMPLES: rows of JOINTS positions and one torque, little-endian f64. RESULT: torque of every grid point, NaN outside.
Prints one line of JSON: seconds to build, seconds to evaluate, peak memory in MiB.
"""

import json
import resource
import sys
import time

import numpy as np
import scipy
from scipy.interpolate import LinearNDInterpolator


def main():
    samples, joints, step, result = sys.argv[1], int(sys.argv[2]), float(sys.argv[3]), sys.argv[4]
    rows = np.fromfile(samples, dtype="<f8").reshape(-1, joints + 1)
    q, tau = rows[:, :joints], rows[:, joints]
    axes = [step * np.arange(np.ceil(c.min() / step - 1e-9), np.floor(c.max() / step + 1e-9) + 1) for c in q.T]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, joints)
    start = time.perf_counter()
    interpolator = LinearNDInterpolator(q, tau)
    built = time.perf_counter()
    values = interpolator(points)
    done = time.perf_counter()
    values.astype("<f8").tofile(result)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(json.dumps({"scipy": scipy.__version__, "build": built - start, "evaluate": done - built, "peak_mib": peak}))


main()
