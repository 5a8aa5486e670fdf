"""The look-up of a field in array operations that NumPy, PyTorch and JAX share, many configurations at once.

It reads the numbers that the compiled look-up reads (`Field.tables`) and gives the same results to rounding. All steps but the choice of the
cell are smooth functions of q, so that the derivatives that PyTorch and JAX take are those of the interpolated torque. In a potential they
contain the tangent d tau/d q that the dataset stores at its grid points.
"""

from __future__ import annotations

import math
from functools import reduce
from typing import Any

import numpy as np

from ._haptize import Field


def _width(joints: int) -> int:
    """Numbers of a grid point that belong to the first axes: w, its gradient, its mixed second derivatives."""
    return 1 + joints * (joints + 1) // 2


def tables_of(field: Field) -> dict[str, Any]:
    """What a look-up reads: NumPy arrays, or None and numbers. DatasetError where the dataset is refined."""
    tables = field.tables()
    if tables["compliance"] is None:
        # A last number of each grid point is zero: what has no derivative along an axis.
        tables["records"] = np.pad(tables["records"], [(0, 0), (0, 1)])
    gap = field.dataset.gap
    tables["gaps"] = None if gap is None else gap.reshape(-1)
    tables["last"] = tables["start"] + (tables["count"] - 1) * tables["step"]
    return tables


class ArrayField:
    """Torque, energy, gap and contact of a field at arrays of configurations (..., d), in the operations of one library.

    A subclass names the library as `xp`, says how it makes integers, and holds each entry of `tables_of` as an attribute.
    """

    xp: Any
    start: Any
    step: Any
    last: Any
    count: Any
    records: Any
    gaps: Any
    compliance: Any
    free_energy: float

    @staticmethod
    def _integers(x: Any) -> Any:
        raise NotImplementedError

    def _cell(self, q: Any) -> tuple[Any, Any, Any]:
        """Grid points (..., 2^d) at the corners of the cell around q, fractions of that cell (..., d), and the fade (...) outside the grid.

        Bit a of a corner's number is its side along axis a. A q that is not a number leads to results that are none.
        """
        xp, joints = self.xp, self.start.shape[0]
        # On a limit the derivative is that within, where minimum and maximum would take half of it.
        inside = xp.where(q < self.start, self.start, xp.where(q > self.last, self.last, q))
        beyond = xp.abs(q - inside) / self.step
        fades = xp.where(beyond < 1, 1 - beyond, xp.zeros_like(beyond))
        fade = reduce(xp.minimum, [fades[..., a] for a in range(joints)])
        steps = (inside - self.start) / self.step
        number = xp.where(xp.isnan(steps), xp.zeros_like(steps), steps)
        last_cell = xp.maximum(self.count - 2, xp.zeros_like(self.count))
        low = xp.minimum(self._integers(xp.floor(number)), last_cell)
        points = xp.zeros_like(low[..., :1])
        for a in range(joints):
            near = points * self.count[a] + low[..., a : a + 1]
            points = xp.concatenate([near, near + (self.count[a] > 1)], -1)
        return points, steps - low, fade

    def _weights(self, fractions: Any) -> Any:
        """Multilinear weights (..., 2^d) of the corners."""
        weights = self.xp.ones_like(fractions[..., :1])
        for a in range(fractions.shape[-1]):
            x = fractions[..., a : a + 1]
            weights = self.xp.concatenate([weights * (1 - x), weights * x], -1)
        return weights

    def _root(self, points: Any, fractions: Any) -> tuple[Any, Any]:
        """The root w (...) of twice the energy and its gradient (..., d), by cubic Hermite polynomials axis by axis.

        Axis a is contracted with the derivatives along it: the numbers of the first a + 1 axes become those of the first a at half as many
        corners. Beside the function its derivative along each axis that was contracted is carried.
        """
        xp, joints = self.xp, self.start.shape[0]
        numbers = xp.swapaxes(self.records[points], -1, -2)[..., None, :, :]
        for a in reversed(range(joints)):
            x = fractions[..., a, None, None, None]
            far, rate = x * x * (3 - 2 * x), 6 * x * (1 - x)
            values = (1 - far, x * (1 - x) * (1 - x), far, x * x * (x - 1))
            rates = (-rate, (1 - x) * (1 - 3 * x), rate, x * (3 * x - 2))
            own = [*range(_width(a)), -1]
            along = [-1] * len(own)
            along[0] = _width(a)
            for b in range(a):
                along[_width(b)] = _width(a) + 1 + b
            half = 1 << a

            def contracted(numbers: Any, weights: tuple[Any, Any, Any, Any]) -> Any:
                own_numbers, slopes = (xp.stack([numbers[..., k, :] for k in kinds], -2) for kinds in (own, along))
                near, rise, beyond, fall = weights
                return (
                    near * own_numbers[..., :half]
                    + rise * slopes[..., :half]
                    + beyond * own_numbers[..., half:]
                    + fall * slopes[..., half:]
                )

            numbers = xp.concatenate([contracted(numbers, values), contracted(numbers[..., :1, :, :], rates)], -3)
        # The derivative along the first axis came last.
        slopes = xp.stack([numbers[..., joints - a, 0, 0] for a in range(joints)], -1)
        return numbers[..., 0, 0, 0], slopes / self.step

    def _sample(self, q: Any) -> tuple[Any, Any, Any]:
        """Torque (..., d), energy (...) and whether there is contact (...)."""
        xp = self.xp
        points, fractions, fade = self._cell(q)
        if self.compliance is None:
            root, slopes = self._root(points, fractions)
            depth = xp.where(root > 0, root, 0 * root)
            torque, energy = -depth[..., None] * slopes, self.free_energy + 0.5 * depth * depth
            inside = root > 0
        else:
            joints = self.start.shape[0]
            means = (self._weights(fractions)[..., None] * self.records[points]).sum(-2)
            torque, depth, energy = means[..., :joints], means[..., joints], means[..., joints + 1]
            inside = depth > 0
            allowed = xp.where(inside, depth, 0 * depth)
            # The size of the torque is taken where it is used alone: at zero a root has no derivative.
            square = (torque * torque * self.compliance).sum(-1)
            held = square > allowed * allowed
            size = xp.sqrt(xp.where(held, square, xp.ones_like(square)))
            torque = torque * xp.where(held, allowed / size, xp.ones_like(size))[..., None]
        return fade[..., None] * torque, energy, inside & (fade > 0)

    def torque(self, q: Any) -> Any:
        """Torque on the arm (N m; N at prismatic joints), of the shape of q."""
        return self._sample(q)[0]

    def energy(self, q: Any) -> Any:
        """Energy that the object stores (J), one number for each configuration; zero where the dataset does not hold it."""
        return self._sample(q)[1]

    def contact(self, q: Any) -> Any:
        """Whether the arm touches the object, for each configuration."""
        return self._sample(q)[2]

    def gap(self, q: Any) -> Any:
        """Signed distance of the arm to the surface at rest (m), interpolated linearly; not a number outside the grid.

        ValueError where the dataset does not hold it.
        """
        if self.gaps is None:
            raise ValueError("the dataset holds no gap, as datasets of real objects do not")
        points, fractions, fade = self._cell(q)
        gap = (self._weights(fractions) * self.gaps[points]).sum(-1)
        return self.xp.where(fade < 1, math.nan + 0 * gap, gap)
