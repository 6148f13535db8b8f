# SPDX-License-Identifier: Apache-2.0
"""Converts the caller's arrays to NumPy arrays: shares memory where possible; otherwise copies an
array once and counts the copy. Errors name the function, the argument, and what was expected and
got. Those of numbers, names, paths and threads are here, too.

Accepted: NumPy arrays, anything with the buffer protocol, `__array_interface__`, `__dlpack__` (on
the CPU) or `__array__`, numbers, and nested sequences of numbers. Masked arrays only if nothing in
them is masked.
"""

from __future__ import annotations

import operator
import os
import threading
import warnings
import weakref
from typing import Any, Mapping, Optional, Sequence, Union

import numpy as np

Axis = Union[int, str]  # a length, or the name of one: "V"
Sizes = dict  # name of a length -> length, from the arrays so far
Path = Union[str, bytes, "os.PathLike[Any]"]

NUMBERS = (list, tuple, int, float)  # not yet arrays: making one is not a copy
_CPU_DEVICES = (1, 3)  # of DLPack: kDLCPU, kDLCUDAHost
MOST_PIXELS = 16384  # of an image in each axis: kMaxImageSize of src/raster/conventions.h
_MOST_THREADS = 1024
# The second is of earlier versions.
_THREAD_VARIABLES = ("TILEGRAD_THREADS", "TILEGRAD_NUM_THREADS")
# By id of an array: a weak reference to it, and its copy.
_index_copies: dict[int, tuple[Any, Any]] = {}
_counts = {"arrays": 0, "copies": 0, "bytes_copied": 0}
_lock = threading.Lock()


def stats() -> dict[str, int]:
    """Counts of this process: arrays received (`arrays`), those copied because of their dtype or
    layout (`copies`), and the total size of the copies (`bytes_copied`)."""
    return dict(_counts)


def reset_stats() -> None:
    """Sets the counters of `stats` to zero."""
    with _lock:
        _counts.update(dict.fromkeys(_counts, 0))


def as_array(function: str, argument: str, value: Any, dtype: Any, shape: Sequence[Axis],
             sizes: Optional[Sizes] = None) -> np.ndarray:
    """`value` as a C-contiguous array of `dtype` and `shape`; without a copy if it is one already.

    shape: a length for each axis; a name denotes a length that is looked up in `sizes`, or recorded
        there if it is new.
    TypeError: not an array of numbers, or one that `dtype` cannot represent (complex, or real for
        an integer `dtype`). ValueError: another shape, or an integer out of range.
    """
    array = contiguous(function, argument, value, dtype)
    check_shape(function, argument, array.shape, shape, sizes)
    return array


def contiguous(function: str, argument: str, value: Any, dtype: Any) -> np.ndarray:
    """`value` as a C-contiguous array of `dtype`, of any shape; see `as_array`."""
    dtype = np.dtype(dtype)
    array = value if type(value) is np.ndarray else foreign(function, argument, value)
    count_array()
    if array.dtype == dtype and array.flags.c_contiguous and array.flags.aligned:
        return array
    if array.size or not isinstance(value, NUMBERS):  # [] has no numbers that could be wrong
        _check_dtype(function, argument, array, dtype)
    copy = np.require(array, dtype, ("C", "ALIGNED"))
    if not isinstance(value, NUMBERS):
        _count_copy(copy)
    return copy


def float_dtype(function: str, argument: str, value: Any) -> np.dtype:
    """The dtype in which to compute `value`: float64 for an array of float64, float32 for
    everything else, lists of numbers included."""
    if isinstance(value, NUMBERS):
        return np.dtype(np.float32)
    array = value if type(value) is np.ndarray else foreign(function, argument, value)
    return array.dtype if array.dtype == np.float64 else np.dtype(np.float32)


def check_shape(function: str, argument: str, got: Sequence[int], expected: Sequence[Axis],
                sizes: Optional[Sizes] = None) -> None:
    """ValueError unless `got` is `expected`; names of lengths as in `as_array`."""
    sizes = {} if sizes is None else sizes
    if _fits(got, expected, sizes):
        return
    raise ValueError(f"{function}: {argument} has shape {tuple(got)}, expected "
                     f"{shape_text(expected, sizes)}")


def _fits(got: Sequence[int], expected: Sequence[Axis], sizes: Sizes) -> bool:
    """Whether `got` is `expected`; if so, records new names in `sizes`."""
    if len(got) != len(expected):
        return False
    for length, axis in zip(got, expected):
        if length != (sizes.get(axis, length) if axis.__class__ is str else axis):
            return False
    for length, axis in zip(got, expected):
        if axis.__class__ is str and sizes.setdefault(axis, length) != length:
            return False  # a new name with two lengths
    return True


def as_batched(function: str, argument: str, value: Any, dtype: Any, shape: Sequence[Axis],
               sizes: Sizes) -> np.ndarray:
    """As `as_array`, of `shape` or with an additional leading axis N."""
    array = contiguous(function, argument, value, dtype)
    check_batched(function, argument, array.shape, shape, sizes)
    return array


def check_batched(function: str, argument: str, got: Sequence[int], shape: Sequence[Axis],
                  sizes: Sizes) -> None:
    """ValueError unless `got` is `shape`, or that with an additional leading axis N."""
    batched = ("N", *shape)
    if len(got) == len(batched):
        return check_shape(function, argument, got, batched, sizes)
    if len(got) == len(shape):
        return check_shape(function, argument, got, shape, sizes)
    raise ValueError(f"{function}: {argument} has shape {tuple(got)}, expected "
                     f"{shape_text(shape)} or {shape_text(batched, sizes)}")


def shape_text(shape: Sequence[Axis], sizes: Optional[Sizes] = None) -> str:
    """(V, 3) with V = 642"""
    text = ", ".join(str(axis) for axis in shape)
    text = f"({text},)" if len(shape) == 1 else f"({text})"
    known = [f"{axis} = {sizes[axis]}" for axis in dict.fromkeys(shape)
             if isinstance(axis, str) and sizes and axis in sizes]
    return text + (" with " + ", ".join(known) if known else "")


def check_choice(function: str, argument: str, value: Any, choices: Sequence[str]) -> int:
    """The index of `value` in `choices`; ValueError if it is none of them."""
    if isinstance(value, str) and value in choices:
        return choices.index(value)
    expected = ", ".join(repr(choice) for choice in choices)
    raise ValueError(f"{function}: {argument} is {value!r}, expected one of {expected}")


def check_indices(function: str, argument: str, indices: np.ndarray, count: int) -> None:
    """ValueError unless all `indices` are in [0, count)."""
    wrong = np.flatnonzero((indices < 0) | (indices >= count))
    if wrong.size:
        raise ValueError(f"{function}: {argument}[{wrong[0]}] is {indices.flat[wrong[0]]}, outside "
                         f"of [0, {count})")


def check_finite(function: str, argument: str, array: Union[np.ndarray, float]) -> None:
    """ValueError if `array` has NaN or infinity."""
    if not np.all(np.isfinite(array)):
        raise ValueError(f"{function}: {argument} has numbers that are not finite")


def as_names(function: str, argument: str, value: Any, choices: Sequence[str]) -> tuple[str, ...]:
    """One or several names of `choices`, as a tuple; TypeError for anything else, ValueError for an
    unknown name."""
    try:
        names = (value,) if isinstance(value, str) else tuple(value)
    except TypeError:
        raise TypeError(f"{function}: {argument} must be a name or a sequence of names, got "
                        f"{type(value).__name__}") from None
    for name in names:
        check_choice(function, argument, name, choices)
    return names


def as_number(function: str, argument: str, value: Any, kind: type) -> Any:
    """`value` as an int of 32 bits or a float; TypeError if it is none, ValueError if it is out of
    range."""
    try:
        if isinstance(value, (str, bytes)):
            raise TypeError
        number = operator.index(value) if kind is int else float(value)
    except (TypeError, ValueError):
        raise TypeError(f"{function}: {argument} must be {kind.__name__}, got "
                        f"{value!r} ({type(value).__name__})") from None
    except OverflowError:
        raise ValueError(f"{function}: {argument} is out of float's range") from None
    if kind is int and not -2**31 <= number < 2**31:
        raise ValueError(f"{function}: {argument} is {number}, out of int32's range")
    return number


def as_count(function: str, argument: str, value: Any) -> int:
    """`value` as an int of 0 or more; errors as in `as_number`."""
    number = as_number(function, argument, value, int)
    if number < 0:
        raise ValueError(f"{function}: {argument} is {number}, must be >= 0")
    return number


def as_items(function: str, argument: str, value: Any) -> list[tuple[Any, Any]]:
    """The keys and values of a mapping; TypeError if it is none."""
    if not isinstance(value, Mapping):
        raise TypeError(f"{function}: {argument} must be a mapping, got {type(value).__name__}")
    return list(value.items())


def as_limit(function: str, max_bytes: Any) -> int:
    """`max_bytes`, None or an int above 0, as C++ takes it: 0 for None."""
    if max_bytes is None:
        return 0
    try:
        number = operator.index(max_bytes)
    except TypeError:
        raise TypeError(f"{function}: max_bytes must be int or None, got {max_bytes!r} "
                        f"({type(max_bytes).__name__})") from None
    if not 0 < number < 2**63:
        raise ValueError(f"{function}: max_bytes is {number}, must be above 0 and below 2**63")
    return number


def as_text(function: str, argument: str, value: Any) -> str:
    """`value`, a str; TypeError if it is anything else, ValueError if UTF-8 cannot encode it."""
    if not isinstance(value, str):
        raise TypeError(f"{function}: {argument} {value!r} is not a string")
    try:
        value.encode()
    except UnicodeEncodeError:
        raise ValueError(f"{function}: {argument} {value!r} has an unpaired surrogate, "
                         f"which no file can hold") from None
    return value


def as_flag(function: str, argument: str, value: Any) -> bool:
    """`value`, which is True or False (or 1 or 0), as a bool; TypeError if it is anything else,
    since "no" is truthy."""
    if isinstance(value, (bool, np.bool_)):
        return bool(value)
    try:
        return bool((0, 1).index(operator.index(value)))
    except (TypeError, ValueError):
        raise TypeError(f"{function}: {argument} must be bool, got {value!r} "
                        f"({type(value).__name__})") from None


def as_pixels(function: str, argument: str, value: Any) -> int:
    """`value` as a side of an image; TypeError if it is not an int, ValueError if it is out of range."""
    number = as_number(function, argument, value, int)
    if not 1 <= number <= MOST_PIXELS:
        raise ValueError(f"{function}: {argument} is {number}, expected 1..{MOST_PIXELS} pixels")
    return number


def _count_masked(value: Any, depth: int = 0) -> int:
    """The number of masked elements of an array, or of arrays in nested sequences."""
    if isinstance(value, np.ma.MaskedArray):
        return int(np.ma.count_masked(value)) if np.ma.is_masked(value) else 0
    if not isinstance(value, (list, tuple)) or depth > 64:  # more than an array can have dimensions
        return 0
    nested = (list, tuple, np.ma.MaskedArray)
    return sum(_count_masked(part, depth + 1) for part in value if isinstance(part, nested))


def refuse_masked(function: str, argument: str, value: Any) -> None:
    """TypeError if elements of `value` are masked: NumPy would use the values under the mask."""
    count = _count_masked(value)
    if count:
        what = "is a masked array" if isinstance(value, np.ndarray) else "holds masked arrays"
        raise TypeError(f"{function}: {argument} {what}, and {count} of its numbers are masked; "
                        f"fill them first, with filled()")


def plain(function: str, argument: str, value: Any) -> np.ndarray:
    """Anything as a NumPy array, without a copy where the protocol allows it; TypeError if that
    fails, as for tensors that are sparse, on another device or require a gradient."""
    refuse_masked(function, argument, value)
    try:
        if hasattr(value, "__dlpack__") and not isinstance(value, np.ndarray):
            return _from_dlpack(function, argument, value)
        return np.asarray(value)
    except (TypeError, ValueError, OverflowError, RuntimeError, BufferError) as error:
        if str(error).startswith(function + ": "):
            raise
        raise TypeError(f"{function}: {argument} is not an array of numbers but "
                        f"{type(value).__name__}: {error}") from error


def foreign(function: str, argument: str, value: Any) -> np.ndarray:
    """Anything but a plain NumPy array as one that holds numbers."""
    array = plain(function, argument, value)
    if array.dtype.kind not in "biufc":
        raise TypeError(f"{function}: {argument} is not an array of numbers but "
                        f"{type(value).__name__}")
    return array


def _from_dlpack(function: str, argument: str, value: Any) -> np.ndarray:
    device = value.__dlpack_device__()[0]
    if device not in _CPU_DEVICES:
        raise TypeError(f"{function}: {argument} is on another device than the CPU; copy it there "
                        f"first (value.cpu(), for example)")
    if getattr(value, "is_neg", bool)():  # torch would export the numbers without their sign
        value = value.resolve_neg()
    return np.from_dlpack(value)


def _check_dtype(function: str, argument: str, array: np.ndarray, dtype: np.dtype) -> None:
    """Real numbers may become float32 or float64; integers another integer type if they fit."""
    kind = array.dtype.kind
    if kind not in ("iuf" if dtype.kind == "f" else "b" if dtype.kind == "b" else "iu"):
        raise TypeError(f"{function}: {argument} has dtype {array.dtype}, expected {dtype}")
    if dtype.kind == "i" and array.size and array.dtype != dtype:
        limits = np.iinfo(dtype)
        if int(array.min()) < limits.min or int(array.max()) > limits.max:
            raise ValueError(f"{function}: {argument} has values of {array.min()} to "
                             f"{array.max()}, out of {dtype}'s range")


def count_array() -> None:
    """Counts a received array for `stats`."""
    _counts["arrays"] += 1


def _count_copy(copy: np.ndarray) -> None:
    with _lock:
        _counts["copies"] += 1
        _counts["bytes_copied"] += copy.nbytes


def as_indices(function: str, argument: str, value: Any, shape: Sequence[Axis],
               sizes: Optional[Sizes] = None) -> np.ndarray:
    """As `as_array` of int32, for indices, which rarely change and often have another integer type.
    An array that must be copied is copied once; the copy is reused while the array keeps its
    values."""
    if isinstance(value, NUMBERS):
        return as_array(function, argument, value, np.int32, shape, sizes)
    array = value if type(value) is np.ndarray else foreign(function, argument, value)
    owner, copy = _index_copies.get(id(value), (None, None))
    if owner is not None and owner() is value and np.array_equal(copy, array):
        count_array()
    else:
        copy = contiguous(function, argument, array, np.int32)
        if copy is not array:
            _keep_copy(value, copy)
    check_shape(function, argument, copy.shape, shape, sizes)
    return copy


def _keep_copy(value: Any, copy: np.ndarray) -> None:
    """As long as `value` lives."""
    key = id(value)

    def forget(reference: Any) -> None:
        if _index_copies.get(key, (None, None))[0] is reference:
            del _index_copies[key]

    copy.flags.writeable = False  # others may share it
    try:
        _index_copies[key] = (weakref.ref(value, forget), copy)
    except TypeError:  # without a weak reference
        pass


def refuse_bytes(function: str, argument: str, value: Any, dtype: Any) -> None:
    """TypeError if `value` is of bytes where 0 to 1 is expected: the result would silently be 255
    times too bright."""
    array = value if type(value) is np.ndarray else foreign(function, argument, value)
    if array.dtype == np.uint8:
        raise TypeError(f"{function}: {argument} has dtype uint8, expected {dtype} from 0 to 1: "
                        f"divide by 255")


def warn_of_bytes(function: str, argument: str, array: np.ndarray) -> None:
    """Warns if floating-point colours look like bytes, 0 to 255, where 0 to 1 is expected: most
    of those that are not black exceed 1. Highlights may. Checks about 4096 numbers."""
    sample = np.ravel(array)[::max(1, array.size // 4096)]
    colored = sample[sample > 0]
    if colored.size == 0 or not 2 < colored.max() <= 255 or np.mean(colored > 1) <= 0.5:
        return
    warnings.warn(f"{function}: {argument} has numbers up to {colored.max():g}, expected 0 "
                  f"to 1: divide by 255 if they are bytes", RuntimeWarning, stacklevel=5)


def as_colors(function: str, argument: str, value: Any, dtype: Any, shape: Sequence[Axis],
              sizes: Sizes) -> np.ndarray:
    """As `as_batched`; refuses bytes, and warns of numbers that look like them."""
    refuse_bytes(function, argument, value, dtype)
    array = as_batched(function, argument, value, dtype, shape, sizes)
    warn_of_bytes(function, argument, array)
    return array


def thread_count(function: str, threads: int) -> int:
    """`threads`, checked; 0 becomes the value of TILEGRAD_THREADS, or stays 0 (one thread for each
    core that the process may use) if that is not set."""
    threads = as_number(function, "threads", threads, int)
    if not 0 <= threads <= _MOST_THREADS:
        raise ValueError(f"{function}: threads is {threads}, must be in 0..{_MOST_THREADS}")
    variable = next((name for name in _THREAD_VARIABLES if os.environ.get(name)), None)
    if threads or variable is None:
        return threads
    text = os.environ[variable]
    if not text.isdecimal() or not 1 <= int(text) <= _MOST_THREADS:
        raise ValueError(f"{function}: {variable}={text!r} in the environment, must be a number "
                         f"in 1..{_MOST_THREADS}")
    return int(text)


def name_of(path: Path) -> str:
    """The name of a file or folder, as C++ takes it. ValueError: not a possible file name."""
    name = os.fsdecode(path)
    try:
        if b"\0" not in os.fsencode(name):
            return name
    except UnicodeEncodeError:  # an unpaired surrogate
        pass
    raise ValueError(f"{name!r} cannot be the name of a file")


def ending_of(path: Path) -> str:
    """The ending of a file name, in lower case: ".png"; "" if it has none."""
    return os.path.splitext(os.fsdecode(path))[1].lower()
