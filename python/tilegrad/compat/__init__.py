# SPDX-License-Identifier: Apache-2.0
"""Modules with the names, signatures and conventions of other differentiable renderers, so that
code written for them runs with one import changed. They need torch."""
