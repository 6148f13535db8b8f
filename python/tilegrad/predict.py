# SPDX-License-Identifier: Apache-2.0
"""Predicts meshes from images with a network trained by `tilegrad train`.

    predictor = Predictor("runs/demo")                     # or Predictor(): installed weights
    mesh = predictor.predict(load_image("chair.png"))      # a cut-out: RGBA
    save_mesh("chair.glb", mesh)
"""

from __future__ import annotations

import os
from typing import Any, Optional

import numpy as np

from tilegrad import _arrays, _tools
from tilegrad._arrays import name_of, Path, thread_count
from tilegrad.images import as_bytes
from tilegrad._mesh import Mesh, mesh_of_dict


class Predictor:
    """A trained network. Gives the same results as `tilegrad predict`, bit for bit.

    Calls from several Python threads run one at a time. Can be pickled (as its path); in a forked
    process it is loaded again at the first call, with one thread.

    path: a run folder (uses its newest complete checkpoint), a checkpoint, a file of weights, or
        the name of installed weights. None: the installed ones for cut-outs.
    threads: as in `tilegrad.Renderer`; the result does not depend on it.
    OSError, ValueError: name the file and what is wrong.
    """

    def __init__(self, path: Optional[Path] = None, threads: int = 0) -> None:
        self._path = name_of(_tools.CUTOUT_WEIGHTS if path is None else path)
        self._threads = thread_count("Predictor", threads)
        self._load(self._threads)

    def _load(self, threads: int) -> None:
        self._loaded = _tools.Model(self._path, threads)
        self._process = os.getpid()

    def _model(self) -> "_tools.Model":
        if self._process != os.getpid():  # a fork may meet a call of another thread
            self._load(1)
        return self._loaded

    def __reduce__(self) -> tuple[Any, ...]:
        return Predictor, (self._path, self._threads)

    @property
    def image_size(self) -> int:
        """Side of the square images that the network sees, pixels."""
        return self._loaded.image_size

    @property
    def description(self) -> str:
        """The network, its number of parameters, and the step that it was trained to."""
        return self._loaded.description

    def template(self) -> Mesh:
        """The sphere that predictions deform."""
        return mesh_of_dict(self._loaded.template_mesh())

    def prepare(self, image: Any, mask: Any = None, *, keep_framing: bool = False) -> np.ndarray:
        """The network's input for a picture: (4, size, size) uint8, RGB over black and alpha.

        image: (H, W, 4), an object cut out by its alpha; or any picture with a mask. uint8, or real
            numbers from 0 to 1. mask: (H, W), white is the object.
        keep_framing: only resize: the picture is already framed like the training images. Otherwise
            the object is centred and scaled as in the training images.
        ValueError: no alpha and no mask, nothing or everything opaque, sizes that differ.
        """
        return self._prepared("prepare", image, mask, keep_framing, self.image_size)

    def predict(self, image: Any, mask: Any = None, *, keep_framing: bool = False,
                refine: Optional[int] = None) -> Mesh:
        """The mesh of a picture, with vertex colours; arguments as in `prepare`. It is centred at
        the origin, with largest half-extent 0.45.

        refine: gradient-descent steps that refine the prediction on the picture, 0 to 100,000;
            0: the network's output, with the faces of the template. None: 800, or 0 for a network
            that predicts texture maps."""
        refine = self._loaded.refine_steps if refine is None else \
            _arrays.as_number("predict", "refine", refine, int)
        if not 0 <= refine <= 100_000:
            raise ValueError(f"predict: refine is {refine}, must be in 0..100000")
        shown = ("predict", image, mask, keep_framing)
        seen = self._prepared(*shown, self.image_size)[None]
        if refine == 0:
            return self.predict_prepared(seen)[0]
        picture = self._prepared(*shown, _tools.REFINE_SIZE)
        return mesh_of_dict(self._model().predict_refined(seen, picture, refine))

    @staticmethod
    def _prepared(function: str, image: Any, mask: Any, keep_framing: bool,
                  size: int) -> np.ndarray:
        """The picture with that side."""
        return _tools.prepare_cutout(as_bytes(function, "image", image),
                                     None if mask is None else as_bytes(function, "mask", mask),
                                     size, _arrays.as_flag(function, "keep_framing", keep_framing))

    def predict_prepared(self, images: Any) -> list[Mesh]:
        """The meshes of N pictures (N, 4, size, size) uint8, as from `prepare` or a dataset. All
        have the faces of the template."""
        size = self.image_size
        array = _arrays.as_array("predict_prepared", "images", images, np.uint8,
                                 ("N", 4, size, size))
        return [mesh_of_dict(mesh) for mesh in self._model().predict(array)]

    def __repr__(self) -> str:
        return f"<tilegrad Predictor: {self.description}>"
