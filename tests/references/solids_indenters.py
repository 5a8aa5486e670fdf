"""Forces of rigid, frictionless indenters on the clamped block of solids.csv: what solids_indenters.csv holds.

    pip install numpy scipy
    python tests/references/solids_indenters.py

A quarter of the block of 100 x 100 x 50 mm, its Young's modulus 1e5 Pa, fixed below. Hexahedra of order p, graded towards
the edge of contact, pressure discontinuous and of order p - 1 (condensed in each element); unilateral contact at the
nodes of the top. On standard error: by how much elements of order 2 on the same mesh differ.
"""

import itertools
import sys

import numpy as np
import scipy.sparse as sparse
import scipy.sparse.linalg as linalg

YOUNG = 1e5
MM = 1e-3


def lagrange(p, x):
    """Values and slopes of the polynomials of order p on equidistant nodes of [0, 1] at x."""
    nodes = np.linspace(0, 1, p + 1)
    polynomials = []
    for i in range(p + 1):
        q = np.poly1d([1.0])
        for j in range(p + 1):
            if j != i:
                q *= np.poly1d([1, -nodes[j]]) / (nodes[i] - nodes[j])
        polynomials.append(q)
    return np.array([q(x) for q in polynomials]), np.array([q.deriv()(x) for q in polynomials])


def element(p, h, lam, mu):
    """Stiffness of a box of sides h."""
    x, w = np.polynomial.legendre.leggauss(p + 1)
    x, w = 0.5 * (x + 1), 0.5 * w
    value, slope = lagrange(p, x)
    n = (p + 1) ** 3
    axes = lambda a, b, c: np.einsum("iu,jv,kw->ijkuvw", a, b, c).reshape(n, -1)
    g = np.stack([axes(slope, value, value) / h[0], axes(value, slope, value) / h[1], axes(value, value, slope) / h[2]], 1)
    weight = np.einsum("u,v,w->uvw", w, w, w).ravel() * np.prod(h)
    at = np.stack(np.meshgrid(x, x, x, indexing="ij"), 0).reshape(3, -1) - 0.5
    powers = [e for e in itertools.product(range(p), repeat=3) if sum(e) < p]
    phi = np.array([at[0] ** a * at[1] ** b * at[2] ** c for a, b, c in powers])
    shear = np.einsum("aiq,bjq,q->aibj", g, g, weight)
    k = shear.transpose(0, 3, 2, 1).copy()
    trace = np.einsum("aibi->ab", shear)
    for i in range(3):
        k[:, i, :, i] += trace
    k = mu * k.reshape(3 * n, 3 * n)
    dilatation = np.einsum("mq,aiq,q->mai", phi, g, weight).reshape(len(phi), -1)
    gram = np.einsum("mq,lq,q->ml", phi, phi, weight)
    return k + lam * dilatation.T @ np.linalg.solve(gram, dilatation)


def indentation(p, axes, poisson, height, depth):
    """Force (N) of the indenter of `height` above its lowest point (m), by (x, y)."""
    lam = YOUNG * poisson / ((1 + poisson) * (1 - 2 * poisson))
    mu = YOUNG / (2 * (1 + poisson))
    axes = [np.array(axis) * MM for axis in axes]
    counts = [p * (len(axis) - 1) + 1 for axis in axes]
    number = np.arange(np.prod(counts)).reshape(counts)
    rows, columns, values, known = [], [], [], {}
    for cell in itertools.product(*(range(len(axis) - 1) for axis in axes)):
        h = tuple(round(axes[k][cell[k] + 1] - axes[k][cell[k]], 12) for k in range(3))
        if h not in known:
            known[h] = element(p, h, lam, mu)
        nodes = number[tuple(slice(p * c, p * c + p + 1) for c in cell)].ravel()
        dofs = (3 * nodes[:, None] + np.arange(3)).ravel()
        rows.append(np.repeat(dofs, len(dofs)))
        columns.append(np.tile(dofs, len(dofs)))
        values.append(known[h].ravel())
    size = 3 * number.size
    k = sparse.csc_matrix((np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))), (size, size))
    fixed = np.zeros(size, bool)
    fixed[3 * number[0, :, :].ravel()] = True
    fixed[3 * number[:, 0, :].ravel() + 1] = True
    fixed[(3 * number[:, :, 0].ravel()[:, None] + np.arange(3)).ravel()] = True
    free = np.flatnonzero(~fixed)
    place = np.full(size, -1)
    place[free] = np.arange(len(free))
    factor = linalg.splu(
        k[free][:, free].tocsc(), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}
    )
    fine = [np.interp(np.arange(n) / p, np.arange(len(axis)), axis) for n, axis in zip(counts, axes)]
    x, y = np.meshgrid(fine[0], fine[1], indexing="ij")
    gap = np.vectorize(height)(x, y)
    near = np.argwhere(gap < depth)
    dofs = place[[3 * number[i, j, -1] + 2 for i, j in near]]
    wanted = np.array([depth - gap[i, j] for i, j in near])
    c = np.empty((len(dofs), len(dofs)))
    for m, dof in enumerate(dofs):
        right = np.zeros(len(free))
        right[dof] = 1.0
        c[:, m] = factor.solve(right)[dofs]
    active = np.ones(len(dofs), bool)
    for _ in range(100):
        force = np.zeros(len(dofs))
        force[active] = np.linalg.solve(c[np.ix_(active, active)], wanted[active])
        changed = np.where(active, force > 0, c @ force < wanted - 1e-15)
        if (changed == active).all():
            break
        active = changed
    return 4 * force.sum()


def ball(x, y):
    return (x * x + y * y) / (2 * 30 * MM)


def capsule(x, y):
    return (x * x + max(y - 10 * MM, 0.0) ** 2) / (2 * 30 * MM)


def punch(x, y):
    return 0.0 if max(x, y) < 8.7501 * MM else np.inf


DOWN = [0, 25, 38, 45, 48.5, 50]
ROUND = [0, 3, 5, 6.5, 8, 11, 16, 26, 50]
LONG = [0, 6, 11, 14, 16, 18, 22, 31, 50]
EDGED = [0, 5, 7.5, 8.45, 8.75, 9.05, 10, 13, 24, 50]
EDGED_DOWN = [0, 25, 38, 46, 49.3, 50]


def halved(axis):
    return sorted(axis + [0.5 * (a + b) for a, b in zip(axis, axis[1:])])


if __name__ == "__main__":
    cases = [
        ("ball", ball, 2 * MM, [ROUND, ROUND, DOWN]),
        ("capsule", capsule, 2 * MM, [ROUND, LONG, DOWN]),
        ("punch", punch, 1 * MM, [EDGED, EDGED, EDGED_DOWN]),
    ]
    print("indenter,poisson,force")
    for name, height, depth, axes in cases:
        for poisson in [0.3, 0.45, 0.49, 0.499]:
            forces = [indentation(p, axes, poisson, height, depth) for p in (3, 2)]
            print(f"{name},{poisson},{forces[0]:.4f}", flush=True)
            print(f"  order 2: {forces[1] / forces[0] - 1:+.2%}", file=sys.stderr, flush=True)
