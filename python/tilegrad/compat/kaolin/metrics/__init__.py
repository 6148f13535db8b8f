# SPDX-License-Identifier: Apache-2.0
"""kaolin.metrics: render."""

from tilegrad.compat.kaolin.metrics import render

__all__ = ["render"]
