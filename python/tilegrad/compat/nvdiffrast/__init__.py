# SPDX-License-Identifier: Apache-2.0
"""nvdiffrast's operations on the CPU, by tilegrad:

    import tilegrad.compat.nvdiffrast.torch as dr

docs/porting.md says what is the same and what differs.
"""
