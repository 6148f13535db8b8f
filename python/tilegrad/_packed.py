# SPDX-License-Identifier: Apache-2.0
"""Records of a few numbers each (a camera, a surface, a light), one or many in one array."""

from __future__ import annotations

import math
from typing import Any, Optional, Sequence, TypeVar

import numpy as np

from tilegrad import _arrays

Record = TypeVar("Record", bound="Packed")


class Part:
    """A named part of a record: a view of its numbers, of the record's leading axes and `shape`."""

    def __init__(self, first: int, shape: tuple[int, ...], doc: str) -> None:
        self.slice = slice(first, first + math.prod(shape))
        self.shape = shape
        self.__doc__ = doc

    def __set_name__(self, owner: type, name: str) -> None:
        self.name = name

    def __get__(self, record: Optional["Packed"], owner: type) -> Any:
        if record is None:
            return self
        numbers = record.numbers
        return numbers[..., self.slice].reshape(numbers.shape[:-1] + self.shape)


class Packed:
    """Records of the same kind. `numbers` holds them, (..., size): the leading axes are one for
    each record, or none for a single one. Their parts are views of it."""

    __slots__ = ("numbers",)
    _SIZE = 0

    numbers: np.ndarray

    @classmethod
    def of_numbers(cls: type[Record], numbers: np.ndarray) -> Record:
        """From an array (..., size), without a copy."""
        shape = numbers.shape if isinstance(numbers, np.ndarray) else None
        if shape is None or shape[-1:] != (cls._SIZE,):
            got = type(numbers).__name__ if shape is None else f"shape {shape}"
            raise ValueError(f"{cls.__name__}: numbers have {got}, expected an array "
                             f"{_arrays.shape_text(('...', cls._SIZE))}")
        record = cls.__new__(cls)
        record.numbers = numbers
        return record

    def _pack(self, **values: Any) -> None:
        """Sets `numbers` from values for all parts, whose leading axes are broadcast."""
        function = type(self).__name__
        arrays = {}
        lead: tuple[int, ...] = ()
        for name, value in values.items():
            array = _arrays.contiguous(function, name, value, np.float64)
            part = getattr(type(self), name)
            split = array.ndim - len(part.shape)
            if split < 0 or array.shape[split:] != part.shape:
                self._refuse(name, array.shape, part.shape)
            try:
                lead = np.broadcast_shapes(lead, array.shape[:split])
            except ValueError:
                self._refuse(name, array.shape, lead + part.shape)
            arrays[name] = array
        self.numbers = np.empty(lead + (self._SIZE,))
        for name, array in arrays.items():
            part = getattr(type(self), name)
            getattr(self, name)[...] = array

    def _refuse(self, name: str, got: Sequence[int], expected: Sequence[int]) -> None:
        raise ValueError(f"{type(self).__name__}: {name} has shape {tuple(got)}, expected "
                         f"{tuple(expected)} or leading axes before that")

    def replace(self: Record, **changes: Any) -> Record:
        """The same with some parts changed."""
        parts = {name: getattr(self, name) for name in self._names()}
        unknown = sorted(set(changes) - set(parts))
        if unknown:
            raise TypeError(f"{type(self).__name__}.replace: no part {unknown[0]!r}")
        return type(self)(**{**parts, **changes})

    @classmethod
    def _names(cls) -> list[str]:
        return [name for name, value in vars(cls).items() if isinstance(value, Part)]

    def __len__(self) -> int:
        if self.numbers.ndim < 2:
            raise TypeError(f"{type(self).__name__}: a single record has no length")
        return len(self.numbers)

    def __getitem__(self: Record, index: Any) -> Record:
        if self.numbers.ndim < 2:
            raise TypeError(f"{type(self).__name__}: a single record cannot be indexed")
        return type(self).of_numbers(self.numbers[index])

    def __repr__(self) -> str:
        values = {name: getattr(self, name) for name in self._names()}
        parts = ", ".join(f"{name}={value.tolist() if isinstance(value, np.ndarray) else value}"
                          for name, value in values.items())
        return f"{type(self).__name__}({parts})"


def stacked(function: str, argument: str, value: Any, kind: type) -> np.ndarray:
    """The numbers of records given as one object of `kind` or a sequence of them; a leading axis
    for the records."""
    records = [value] if isinstance(value, kind) else value
    if not isinstance(records, (list, tuple)) or not all(isinstance(r, kind) for r in records):
        raise TypeError(f"{function}: {argument} must be a {kind.__name__} or a sequence of them, "
                        f"got {type(value).__name__}")
    shapes = sorted({record.numbers.shape[:-1] for record in records})
    if not shapes:
        raise ValueError(f"{function}: {argument} is an empty sequence; give None instead")
    if len(shapes) > 1:
        raise ValueError(f"{function}: {argument} has records of leading axes {shapes[0]} and "
                         f"{shapes[1]}: they must be alike")
    if len(records) == 1:
        numbers = records[0].numbers
        return numbers[None] if numbers.ndim == 1 else numbers
    return np.stack([record.numbers for record in records], axis=-2)
