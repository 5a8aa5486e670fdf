"""The peer of benches/sweep.rs: the paper's iteration (section 2.1, equation (2)) in vectorised NumPy and SciPy.

usage: sweep_numpy.py PROBLEM.json PROCESSES TURNS
Kinematics run for all configurations at once, detection for all proxy nodes of a configuration at once (rays against all
triangles), step 2 is one dense solve on the tied nodes. The compliance is inverted before the clock starts, as it is for
haptize, and the configurations are shared among PROCESSES processes. Prints one line of JSON: the seconds of the fastest of
TURNS sweeps, and for each configuration whether it is free (0), converged (1) or not (2), and its torque.
"""

import json
import os
import sys
import time

os.environ.setdefault("OMP_NUM_THREADS", "1")  # one process a core; small systems gain nothing from threads

from multiprocessing import Pool

import numpy as np
from scipy.sparse import coo_matrix

# A direction that meets no edge of a regular mesh.
RAY = np.array([0.8017837, 0.2672612, 0.5345225])


def rotations(axis, angle):
    """Rodrigues: one matrix for each angle."""
    x, y, z = axis
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    sin, cos = np.sin(angle)[:, None, None], np.cos(angle)[:, None, None]
    return np.eye(3) + sin * k + (1 - cos) * (k @ k)


class Model:
    def __init__(self, problem):
        self.rest = np.array(problem["nodes"]).reshape(-1, 3)
        self.triangles = np.array(problem["triangles"]).reshape(-1, 3)
        order = self.rest.size
        k = coo_matrix((problem["values"], (problem["rows"], problem["columns"])), shape=(order, order))
        self.compliance = np.linalg.inv(k.toarray())
        around = np.repeat(np.arange(len(self.triangles)), 3)
        ones = np.ones(around.size)
        self.incidence = coo_matrix((ones, (self.triangles.ravel(), around))).tocsr()
        self.joints, self.proxy = problem["joints"], problem["proxy"]
        self.links = np.array([node["link"] for node in self.proxy])
        self.stiffness, self.tolerance = problem["stiffness"], problem["tolerance"]
        self.passes = problem["max_iterations"]

    def kinematics(self, q):
        """Node positions (c, m, 3), joint axes and origins (c, d, 3) of all configurations."""
        count = len(q)
        origin, rotation = np.zeros((count, 3)), np.broadcast_to(np.eye(3), (count, 3, 3))
        origins, axes, frames = [], [], []
        for j, joint in enumerate(self.joints):
            axis = rotation @ np.array(joint["axis"])
            origin = origin + rotation @ np.array(joint["origin"])
            if joint["prismatic"]:
                origin = origin + q[:, j, None] * axis
            else:
                rotation = rotation @ rotations(joint["axis"], q[:, j])
            origins.append(origin)
            axes.append(axis)
            frames.append(rotation)
        nodes = [origins[n["link"]] + frames[n["link"]] @ np.array(n["position"]) for n in self.proxy]
        return np.stack(nodes, 1), np.stack(axes, 1), np.stack(origins, 1)

    def inside(self, x, positions):
        """Which points lie inside the surface: rays cross it an odd number of times."""
        centre = positions.mean(0)
        radius2 = ((positions - centre) ** 2).sum(1).max()
        near = np.flatnonzero(((x - centre) ** 2).sum(1) <= radius2)
        result = np.zeros(len(x), bool)
        if near.size:
            a, b, c = positions[self.triangles].transpose(1, 0, 2)
            ab, ac = b - a, c - a
            normal = np.cross(RAY, ac)
            scale = 1.0 / (ab * normal).sum(1)
            from_a = x[near, None] - a
            u = (from_a * normal).sum(2) * scale
            across = np.cross(from_a, ab)
            v = (across @ RAY) * scale
            along = (across * ac).sum(2) * scale
            result[near] = ((u >= 0) & (v >= 0) & (u + v <= 1) & (along > 0)).sum(1) % 2 == 1
        return result

    def solve(self, x, axes, origins):
        rest, compliance = self.rest, self.compliance
        positions, before, marked = rest, None, None
        for number in range(1, self.passes + 1):
            touching = np.flatnonzero(self.inside(x, positions))  # step 1
            if touching.size == 0:
                return (0 if number == 1 else 2), np.zeros(len(self.joints))
            targets = x[touching]
            square = ((targets[:, None] - positions) ** 2).sum(2)
            ties = np.sort(np.argpartition(square, 3, axis=1)[:, :3], axis=1)
            nodes, slots = np.unique(ties, return_inverse=True)
            slots = slots.reshape(ties.shape)
            count = np.bincount(slots.ravel(), minlength=nodes.size)
            wanted = np.zeros((nodes.size, 3))
            np.add.at(wanted, slots, targets[:, None])
            wanted = wanted / count[:, None] - rest[nodes]
            rows = (3 * nodes[:, None] + np.arange(3)).ravel()
            local = compliance[np.ix_(rows, rows)]
            stiff = local + np.diag(np.repeat(1.0 / (self.stiffness * count), 3))
            tied = np.linalg.solve(stiff, wanted.ravel())  # step 2
            positions = rest + (compliance[:, rows] @ tied).reshape(-1, 3)
            a, b, c = positions[self.triangles].transpose(1, 0, 2)  # step 3
            normals = self.incidence[nodes] @ np.cross(b - a, c - a)
            normals /= np.linalg.norm(normals, axis=1)[:, None]
            pull = (targets[:, None] - positions[ties]) * self.stiffness
            normal = normals[slots]
            forces = normal * np.minimum((pull * normal).sum(2), 0.0)[:, :, None]
            total = np.zeros((nodes.size, 3))
            np.add.at(total, slots, forces)
            total = total.ravel()
            if not total.any():
                return 2, np.zeros(len(self.joints))
            positions = rest + (compliance[:, rows] @ total).reshape(-1, 3)  # step 4
            this = (touching, ties, total)
            if before and np.array_equal(before[0], touching) and np.array_equal(before[1], ties):
                change = total - before[2]
                if change @ local @ change <= self.tolerance**2 * (total @ local @ total):
                    return 1, self.torque(touching, forces, x, axes, origins)
            if marked and all(map(np.array_equal, marked, this)):
                return 2, np.zeros(len(self.joints))  # a cycle
            if number & (number - 1) == 0:
                marked = this
            before = this
        return 2, np.zeros(len(self.joints))

    def torque(self, touching, forces, x, axes, origins):
        tau = np.zeros(len(self.joints))
        for i, force in zip(touching, -forces.sum(1)):
            for j in range(self.links[i] + 1):
                prismatic = self.joints[j]["prismatic"]
                column = axes[j] if prismatic else np.cross(axes[j], x[i] - origins[j])
                tau[j] += column @ force
        return tau


def sweep(q):
    model = Model.shared
    x, axes, origins = model.kinematics(q)
    return [model.solve(*pose) for pose in zip(x, axes, origins)]


def main():
    with open(sys.argv[1]) as file:
        problem = json.load(file)
    Model.shared = Model(problem)
    q = np.array(problem["configurations"])
    processes = int(sys.argv[2])
    with Pool(processes) as pool:
        pool.map(sweep, [q[:1]] * processes)  # warm
        seconds = np.inf
        for _ in range(int(sys.argv[3])):
            start = time.perf_counter()
            shares = pool.map(sweep, np.array_split(q, 8 * processes), chunksize=1)
            seconds = min(seconds, time.perf_counter() - start)
    results = [result for share in shares for result in share]
    status, torque = [r[0] for r in results], [list(r[1]) for r in results]
    print(json.dumps({"numpy": np.__version__, "seconds": seconds, "status": status, "torque": torque}))


main()
