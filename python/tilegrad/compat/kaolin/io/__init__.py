# SPDX-License-Identifier: Apache-2.0
"""kaolin.io: obj, render: what its DIB-R examples read."""

from tilegrad.compat.kaolin._missing import missing_from
from tilegrad.compat.kaolin.io import obj, render

__all__ = ["obj", "render"]

__getattr__ = missing_from(__name__)
