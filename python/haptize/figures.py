"""Figures of datasets as matplotlib axes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Sequence

import numpy as np

if TYPE_CHECKING:
    from ._haptize import Dataset


def plot(
    dataset: Dataset,
    quantity: str = "torque",
    *,
    joint: int = 0,
    axes: tuple[int, int] = (0, 1),
    at: Sequence[int] | None = None,
    ax: Any = None,
) -> Any:
    """Draw a slice of a dataset into a matplotlib axes, and return that.

    quantity: "torque" [N m; N] of `joint`, "energy" [J], "gap" [m], "status" or "residual".
    axes: the joints along x and y; a dataset of one joint is drawn as a curve.
    at: number of the grid line of each joint, of which those of the other joints count; by default the middle.
    """
    values = getattr(dataset, quantity, None)
    if quantity not in ("torque", "energy", "gap", "status", "residual") or values is None:
        raise ValueError(f"the dataset holds no {quantity!r}")
    if ax is None:
        from matplotlib import pyplot

        ax = pyplot.figure().add_subplot()
    names = [f"{axis['name']} [{axis['unit']}]" for axis in dataset.axes]
    lines = dataset.lines
    label = quantity
    if quantity == "torque":
        values = values[..., joint]
        label = f"torque at {dataset.axes[joint]['name']}"
    if len(lines) == 1:
        ax.plot(lines[0], values)
        ax.set(xlabel=names[0], ylabel=label)
        return ax
    x, y = axes
    if x == y:
        raise ValueError("two different joints make a slice")
    chosen: list[Any] = [len(line) // 2 for line in lines] if at is None else list(at)
    chosen[x] = chosen[y] = slice(None)
    part = np.asarray(values[tuple(chosen)], dtype=float)
    image = ax.pcolormesh(lines[x], lines[y], part.T if x < y else part, shading="nearest")
    ax.figure.colorbar(image, ax=ax, label=label)
    ax.set(xlabel=names[x], ylabel=names[y])
    return ax
