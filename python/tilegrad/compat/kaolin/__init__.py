# SPDX-License-Identifier: Apache-2.0
"""Kaolin's DIB-R functions on the CPU, by tilegrad:

    import tilegrad.compat.kaolin as kaolin

Signatures, shapes and conventions are Kaolin's: the camera looks along -z and the largest z is
nearest; the image plane spans [-1, 1] with y up, row 0 on top; faces are interpolated linearly on
the screen. Tensors are torch's, on the CPU, float32 or float64, and gradients flow wherever
Kaolin's do. docs/porting.md says what is the same and what differs.
"""

from tilegrad.compat.kaolin import metrics, ops, render

__all__ = ["metrics", "ops", "render"]
