"""Reference values for the gridization: SciPy's LinearNDInterpolator on points in general position.

Writes gridize_scipy.csv beside this script. Run once, with any SciPy:
    python3 -m venv venv && venv/bin/pip install numpy scipy && venv/bin/python gridize_scipy.py

Lines: `case,NAME,JOINTS,STEP`, then `sample,q...,tau` in any order, then `grid,tau` for every grid point with the last
joint fastest, `nan` outside the convex hull. Grid lines lie at multiples of STEP within the range of the samples.
tau is the torque of joint 0; the test gives joint k the torque (k + 1) tau.
"""

import math
import pathlib

import numpy as np
import scipy
from scipy.interpolate import LinearNDInterpolator

CASES = [("line", 1, 40, 0.02), ("plane", 2, 120, 0.07), ("space", 3, 150, 0.11), ("four", 4, 90, 0.19), ("five", 5, 70, 0.26)]


def torque(q):
    phase = sum((k + 1) * q[:, k] for k in range(q.shape[1]))
    return np.sin(1.7 * phase) + 0.3 * np.square(q).sum(axis=1)


def main():
    generator = np.random.default_rng(20240607)
    lines = [f"# SciPy {scipy.__version__}, NumPy {np.__version__}; made by gridize_scipy.py"]
    for name, joints, count, step in CASES:
        q = generator.uniform(-0.4, 0.6, size=(count, joints))
        tau = torque(q)
        axes = [step * np.arange(math.ceil(c.min() / step), math.floor(c.max() / step) + 1) for c in q.T]
        points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, joints)
        if joints == 1:
            order = np.argsort(q[:, 0])
            values = np.interp(points[:, 0], q[order, 0], tau[order], left=np.nan, right=np.nan)
        else:
            values = LinearNDInterpolator(q, tau)(points)
        lines.append(f"case,{name},{joints},{step}")
        lines += ["sample," + ",".join(repr(float(x)) for x in row) for row in np.column_stack([q, tau])]
        lines += [f"grid,{float(value)!r}" for value in values.reshape(-1)]
    pathlib.Path(__file__).with_suffix(".csv").write_text("\n".join(lines) + "\n")


main()
