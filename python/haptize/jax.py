"""Fields in JAX: torque, energy, gap and contact of arrays of configurations, under `jit`, `vmap` and derivatives.

    field = haptize.jax.Field(haptize.Field.open("sphere.haptize"))
    stiffness = jax.jacfwd(field.torque)(q)
"""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp

from . import _haptize
from ._array_field import ArrayField, tables_of

__all__ = ["Field"]


@jax.tree_util.register_pytree_node_class
class Field(ArrayField):
    """A field as a pytree of the dataset's numbers, which functions under `jit` may take as an argument.

    In float64 it agrees with `haptize.Field` to rounding. JAX takes float32 by default, which agrees to about a millionth of the greatest
    torque; `jax.config.update("jax_enable_x64", True)` makes it float64.
    """

    xp = jnp

    def __init__(self, field: _haptize.Field) -> None:
        kind = jnp.zeros(()).dtype
        tables = tables_of(field)
        self.free_energy = tables.pop("free_energy")
        for name, numbers in tables.items():
            setattr(self, name, None if numbers is None else jnp.asarray(numbers, dtype=None if name == "count" else kind))

    @staticmethod
    def _integers(x: Any) -> Any:
        return x.astype(int)

    def tree_flatten(self) -> tuple[tuple[Any, ...], tuple[str, ...]]:
        """The arrays, and their names."""
        names = tuple(sorted(vars(self)))
        return tuple(getattr(self, name) for name in names), names

    @classmethod
    def tree_unflatten(cls, names: tuple[str, ...], arrays: tuple[Any, ...]) -> Field:
        """A field of these arrays."""
        field = object.__new__(cls)
        vars(field).update(zip(names, arrays))
        return field
