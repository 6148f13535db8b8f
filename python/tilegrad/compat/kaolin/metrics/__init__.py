# SPDX-License-Identifier: Apache-2.0
"""kaolin.metrics: render."""

from tilegrad.compat.kaolin._missing import missing_from
from tilegrad.compat.kaolin.metrics import render

__all__ = ["render"]

__getattr__ = missing_from(__name__)
