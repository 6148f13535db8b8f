# SPDX-License-Identifier: Apache-2.0
"""Weights of networks, as arrays by name."""

from __future__ import annotations

import dataclasses
import os
from typing import Any, Mapping, Optional

import numpy as np

from tilegrad import _arrays, _tools
from tilegrad._arrays import ending_of, name_of, Path


class Weights(dict[str, np.ndarray]):
    """Arrays by name, and the metadata texts of a safetensors file."""

    def __init__(self, arrays: Mapping[str, np.ndarray] = {},
                 metadata: Optional[Mapping[str, str]] = None) -> None:
        super().__init__(arrays)
        self.metadata: dict[str, str] = dict(metadata or {})


def load_weights(path: Path, *, max_bytes: Optional[int] = None) -> Weights:
    """Reads a .safetensors or .npz file, float16 as float32. max_bytes: as in `load_mesh`. OSError,
    ValueError: name the file and what is wrong."""
    ending = _ending("load_weights", path)
    limit = _arrays.as_limit("load_weights", max_bytes)
    if ending == ".npz":
        return Weights(_tools.load_npz(name_of(path), limit))
    return Weights(*_tools.load_safetensors(name_of(path), limit))


def save_weights(path: Path, weights: Mapping[str, Any],
                 metadata: Optional[Mapping[str, str]] = None) -> None:
    """Writes a .safetensors or .npz file, whole or not at all.

    weights: arrays by name; safetensors: at most five axes of float32, float64, uint8, int32 or
    int64. metadata: texts, safetensors only; by default those of `Weights`.
    """
    arrays = {_arrays.as_text("save_weights", "name", name): _plain(name, value)
              for name, value in _arrays.as_items("save_weights", "weights", weights)}
    if metadata is None:
        metadata = getattr(weights, "metadata", {})
    if _ending("save_weights", path) == ".npz":
        if metadata:
            raise ValueError("save_weights: an .npz file holds no metadata; save .safetensors")
        return _tools.save_npz(name_of(path), arrays)
    texts = {_arrays.as_text("save_weights", "metadata key", key):
             _arrays.as_text("save_weights", "metadata", value)
             for key, value in _arrays.as_items("save_weights", "metadata", metadata)}
    return _tools.save_safetensors(name_of(path), arrays, texts)


@dataclasses.dataclass
class Checkpoint:
    """A state of a training run. step: steps done; image_size: pixels; config: TOML; seconds:
    trained so far; weights: every weight, statistic and moment by name; warnings: newer files of
    the run that are damaged."""

    file: str
    step: int
    image_size: int
    config: str
    seconds: float
    weights: Weights
    warnings: list[str]


def load_checkpoint(path: Path) -> Checkpoint:
    """Reads a checkpoint of `tilegrad train`: one file, or the newest complete one of a run folder.
    OSError, ValueError: name the file and what is wrong."""
    found = _tools.load_checkpoint(name_of(path))
    found["weights"] = Weights(found.pop("tensors"))
    found["file"] = os.fspath(found["file"])
    return Checkpoint(**found)


def _ending(function: str, path: Path) -> str:
    ending = ending_of(path)
    if ending not in (".safetensors", ".npz"):
        raise ValueError(f"{function}: {os.fsdecode(path)!r} must end in .safetensors or .npz")
    return ending


def _plain(name: str, value: Any) -> np.ndarray:
    array = _arrays.plain("save_weights", name, value)
    return np.ascontiguousarray(array).reshape(array.shape)  # keeps arrays without axes
