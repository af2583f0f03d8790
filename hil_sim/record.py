# SPDX-License-Identifier: MIT
"""The record of a run: C samples seen as a NumPy structured array, without a copy."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from omniwheel._core import ffi

_FORMATS = {"double": "f8", "uint32_t": "u4", "uint64_t": "u8", "int32_t": "i4"}


def _field_format(ctype: Any) -> Any:
    if ctype.kind == "array":
        return (_FORMATS[ctype.item.cname], (ctype.length,))
    return _FORMATS[ctype.cname]


def struct_dtype(name: str) -> np.dtype[np.void]:
    """Return the layout of a C struct of numbers and arrays of them, from its declaration."""
    struct = ffi.typeof(name)
    names, fields = zip(*struct.fields, strict=True)
    return np.dtype(
        {
            "names": list(names),
            "formats": [_field_format(field.type) for field in fields],
            "offsets": [field.offset for field in fields],
            "itemsize": ffi.sizeof(struct),
        }
    )


def sample_dtype() -> np.dtype[np.void]:
    """Return the layout of ``hil_sample_t``; ``runner.h`` has units and meaning."""
    return struct_dtype("hil_sample_t")


class Record:
    """Room for ``capacity`` samples, one taken at every ``every``-th tick.

    Pass :attr:`c` to the runners; they fill it from where the last run stopped.
    """

    def __init__(self, capacity: int, every: int = 1) -> None:
        if capacity < 1 or every < 1:
            raise ValueError(f"capacity is {capacity} and every is {every}; both must be 1 or more")
        self._array = np.zeros(capacity, dtype=sample_dtype())
        self.c: Any = ffi.new("hil_record_t *")
        self.c.samples = ffi.cast("hil_sample_t *", ffi.from_buffer(self._array))
        self.c.capacity = capacity
        self.c.every = every

    def __len__(self) -> int:
        return int(self.c.count)

    @property
    def samples(self) -> npt.NDArray[np.void]:
        """The samples taken so far: a view, with the fields of ``hil_sample_t``; arrays per wheel have four columns."""
        return self._array[: len(self)]
