"""Fields in PyTorch: torque, energy, gap and contact of tensors of configurations, on any device, with derivatives.

    field = haptize.torch.Field(haptize.Field.open("sphere.haptize")).to("cuda")
    field.torque(q).square().sum().backward()
"""

from __future__ import annotations

from typing import Any

import torch

from . import _haptize
from ._array_field import ArrayField, tables_of

__all__ = ["Field"]


class Field(ArrayField, torch.nn.Module):
    """A field as a module whose buffers are the dataset's numbers: it goes to a device or a type of numbers by `to`.

    Calling it gives the torque. float64 agrees with `haptize.Field` to rounding; float32 to about a millionth of the greatest torque.
    """

    xp = torch

    def __init__(self, field: _haptize.Field, dtype: torch.dtype = torch.float64) -> None:
        torch.nn.Module.__init__(self)
        tables = tables_of(field)
        self.free_energy = tables.pop("free_energy")
        for name, numbers in tables.items():
            kind = torch.int64 if name == "count" else dtype
            self.register_buffer(name, None if numbers is None else torch.tensor(numbers, dtype=kind))

    @staticmethod
    def _integers(x: Any) -> Any:
        return x.to(torch.int64)

    def forward(self, q: torch.Tensor) -> torch.Tensor:
        """Torque on the arm (N m; N at prismatic joints), of the shape of q."""
        torque: torch.Tensor = self.torque(q)
        return torque
