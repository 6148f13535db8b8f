# SPDX-License-Identifier: Apache-2.0
"""The number of threads."""

from __future__ import annotations

import os

from tilegrad import _arrays

_MOST = 1024
_VARIABLES = ("TILEGRAD_THREADS", "TILEGRAD_NUM_THREADS")  # the second is of earlier versions


def thread_count(function: str, threads: int) -> int:
    """`threads`, checked; 0 becomes the value of TILEGRAD_THREADS, or stays 0 (one thread for each
    core that the process may use) if that is not set."""
    threads = _arrays.as_number(function, "threads", threads, int)
    if not 0 <= threads <= _MOST:
        raise ValueError(f"{function}: threads is {threads}, must be in 0..{_MOST}")
    variable = next((name for name in _VARIABLES if os.environ.get(name)), None)
    if threads or variable is None:
        return threads
    text = os.environ[variable]
    if not text.isdecimal() or not 1 <= int(text) <= _MOST:
        raise ValueError(f"{function}: {variable}={text!r} in the environment, must be a number "
                         f"in 1..{_MOST}")
    return int(text)
