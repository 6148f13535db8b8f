# SPDX-License-Identifier: Apache-2.0
"""Scenes in, images out; gradients of images in, gradients of scenes out."""

from __future__ import annotations

from typing import Any, Callable, Iterator, Optional, Sequence, Union

import numpy as np

from tilegrad import _arrays, _core
from tilegrad._arrays import thread_count
from tilegrad._camera import Camera
from tilegrad._camera_arguments import checked_size, common_size, filled_size
from tilegrad._packed import Packed
from tilegrad._picture import Pictured
from tilegrad._scene import DIFFERENTIABLE, Light, Scene, Surface

_Reader = Callable[[str, str, Any], Any]


def _number(kind: type) -> _Reader:
    return lambda function, name, value: _arrays.as_number(function, name, value, kind)


def _choice(choices: Sequence[str]) -> _Reader:
    return lambda function, name, value: _arrays.check_choice(function, name, value, choices)


def _option(name: str, choices: Optional[Sequence[str]] = None) -> tuple[Any, _Reader]:
    """C++'s default of an option, and the function that checks other values."""
    value = getattr(_core.RenderOptions(), name)
    return (choices[value], _choice(choices)) if choices else (value, _number(type(value)))


# In the order in which Renderer.render has them.
_OPTIONS = {"width": _option("width"), "height": _option("height"), "delta": _option("delta"),
            "max_alpha_error": _option("max_alpha_error"),
            "interpolation": _option("interpolation", _core.INTERPOLATIONS),
            "culling": _option("culling", _core.CULLINGS),
            "alpha_rule": _option("alpha_rule", _core.ALPHA_RULES),
            "paper_box": _option("paper_box"), "paper_faces": _option("paper_faces")}
_D = {name: default for name, (default, _) in _OPTIONS.items()}
# Those that functions hand on, beside the size of the image.
PASSED_ON = frozenset(_OPTIONS) - {"width", "height"}


def options_of(*values: Any) -> _core.RenderOptions:
    """The options from a value for each; checks those that are not the default itself."""
    options = _core.RenderOptions()
    for (name, (default, read)), value in zip(_OPTIONS.items(), values):
        if value is not default:
            setattr(options, name, read("render", name, value))
    return options


_OUTPUTS = ("color", "alpha")
# Names whose values are not plain arrays.
RECORDS: dict[str, type[Packed]] = {"camera": Camera, "surfaces": Surface, "lights": Light}


class Image:
    """An image of a frame, if it was rendered: a view of the renderer's memory."""

    def __init__(self, doc: str) -> None:
        self.__doc__ = doc

    def __set_name__(self, owner: type, name: str) -> None:
        self.name = name

    def __get__(self, frame: Optional["Frame"], owner: type) -> Any:
        return self if frame is None else frame._view(self.name)


class Frame(Pictured):
    """The images of N scenes, row 0 on top, and what backward needs.

    Images are read-only views of the renderer's memory, which they keep alive. Copy them to modify
    them or to keep them longer than the frame.
    """

    __slots__ = ("_frame", "_scenes", "_single", "_outputs", "_views", "background")

    def __init__(self, frame: Union[_core.Frame32, _core.Frame64], scenes: tuple[Scene, ...],
                 single: bool, outputs: tuple[str, ...]) -> None:
        self._frame, self._scenes, self._single, self._outputs = frame, scenes, single, outputs
        self._views: dict[str, np.ndarray] = {}

    color = Image("(N, 3, H, W); 0 at background pixels.")
    alpha = Image("(N, H, W), 0 to 1; 1 where there is a face.")
    attributes = Image("(N, C, H, W); 0 at background pixels.")
    depth = Image("(N, H, W), world units; +infinity at background pixels.")
    normals = Image("(N, 3, H, W), unit, world, as shading uses them; 0 at background pixels.")
    uv = Image("(N, 2, H, W); 0 at background pixels.")
    barycentrics = Image("(N, 2, H, W), weights of corners 1 and 2 of the face; 0 at background pixels.")

    @property
    def face_ids(self) -> np.ndarray:
        """(N, H, W) int32, index into the scene's faces; -1: background."""
        if "face_ids" not in self._views:
            self._views["face_ids"] = self._frame.face_ids
        return self._views["face_ids"]

    @property
    def alpha_error_bound(self) -> float:
        """No alpha is farther than this from equation 6 of the DIB-R paper; infinite with
        alpha_rule="paper"."""
        return self._frame.alpha_error_bound

    @property
    def scenes(self) -> tuple[Scene, ...]:
        """The rendered scene or scenes."""
        return self._scenes

    @property
    def outputs(self) -> tuple[str, ...]:
        """The names of its images other than face_ids."""
        return self._outputs

    @property
    def dtype(self) -> np.dtype:
        """float32 or float64, as the scenes."""
        return np.dtype(np.float64 if isinstance(self._frame, _core.Frame64) else np.float32)

    def shared(self, name: str) -> np.ndarray:
        """The image of that name as a writable array, for libraries that accept no other
        (torch.from_numpy). Writing to it changes what backward computes."""
        self._view(name)
        return self._frame.view(name, True)

    def __len__(self) -> int:
        """N, the number of images."""
        return self._frame.count

    def __repr__(self) -> str:
        size, names = f"{self._frame.width} x {self._frame.height}", ", ".join(self._outputs)
        return f"<tilegrad.Frame: {len(self)} images of {size}, {names}>"

    def _view(self, name: str) -> np.ndarray:
        if name not in self._views:
            if name not in self._outputs:
                raise AttributeError(f"{name} was not rendered: outputs={self._outputs!r}")
            self._views[name] = self._frame.view(name)
        return self._views[name]


class Gradients:
    """dL/d(scene): for each requested name, an array of the shape of the scene's own, or
    for camera, surfaces and lights a Camera, Surface and Light of such arrays; for textures a list.
    Shared arrays receive the sum over images.
    """

    __slots__ = ("_arrays",)

    def __init__(self, arrays: dict[str, Any]) -> None:
        self._arrays = arrays

    def __getattr__(self, name: str) -> Any:
        if name not in DIFFERENTIABLE:
            raise AttributeError(f"Gradients have no {name!r}")
        if name not in self._arrays:
            raise AttributeError(f"{name} was not requested: wrt={tuple(self._arrays)!r}")
        value = self._arrays[name]
        return RECORDS[name].of_numbers(value) if name in RECORDS else value

    def __iter__(self) -> Iterator[str]:
        """The requested names."""
        return iter(self._arrays)

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *self._arrays]

    def __repr__(self) -> str:
        return f"<tilegrad.Gradients of {', '.join(self._arrays)}>"


class Renderer:
    """Renders scenes, and their gradients.

    Owns threads, which start with the first call, and memory, which it reuses: keep a renderer. The
    same input gives the same bits for any number of threads. Calls of one renderer from several
    Python threads run one at a time. After a fork a renderer works in both processes.

    threads: 1 to 1024; 1: only the caller's; 0: as many as TILEGRAD_THREADS in the environment
        says, or one for each core. Fewer, with a RuntimeWarning, if the system refuses some.
    """

    __slots__ = ("_renderer", "__weakref__")

    def __init__(self, threads: int = 0) -> None:
        self._renderer = _core.Renderer(thread_count("Renderer", threads))

    @property
    def threads(self) -> int:
        """The requested number of threads; 0: one for each core."""
        return self._renderer.threads

    def render(self, scenes: Union[Scene, Sequence[Scene]], *, width: Optional[int] = None,
               height: Optional[int] = None, outputs: Sequence[str] = _OUTPUTS,
               delta: float = _D["delta"], max_alpha_error: float = _D["max_alpha_error"],
               interpolation: str = _D["interpolation"], culling: str = _D["culling"],
               alpha_rule: str = _D["alpha_rule"], paper_box: float = _D["paper_box"],
               paper_faces: int = _D["paper_faces"]) -> Frame:
        """The images of a scene, or of a list of scenes one after the other.

        width, height: pixels, 1 to 16384, of all images; None: the size of the cameras
            (`Camera.size`), or 64 if unknown.
        outputs: the images to compute, of "color", "alpha", "attributes", "depth", "normals",
            "uv", "barycentrics"; others are not computed. face_ids are always computed.
        delta: > 0, how soft silhouettes are: alpha = 1 - prod over faces (1 - exp(-d^2 / delta))
            with d the distance to the face in NDC, in which the image spans [-1, 1] in each axis.
        max_alpha_error: [0, 1], absolute error of alpha: larger is faster, 0 drops nothing.
        interpolation: "perspective", or "screen_linear" as in the paper's implementation.
        culling: "none", or "back": clockwise faces are not drawn, but count for alpha.
        alpha_rule: "all_faces", or "paper": faces whose box, grown by paper_box (NDC, >= 0),
            contains the pixel, and of these the first paper_faces; slow, for comparisons.

        Errors: TypeError, ValueError; MemoryError. The scenes of a list must agree in dtype and in
        which arguments are None.
        """
        single = isinstance(scenes, Scene)
        checked = (scenes,) if isinstance(scenes, Scene) else self._checked(scenes)
        sizes = [scene._arguments["camera"].size for scene in checked]
        known = common_size("render", sizes) or (_D["width"], _D["height"])
        size = filled_size(width, height, known)
        options = options_of(*size, delta, max_alpha_error, interpolation, culling, alpha_rule,
                           paper_box, paper_faces)
        for own in sizes:
            checked_size("render", own, (options.width, options.height))
        outputs = _arrays.as_names("render", "outputs", outputs, _core.IMAGES)
        if "attributes" in outputs and any(scene["attributes"] is None for scene in checked):
            raise ValueError("render: outputs has 'attributes', but a scene has none")
        wanted = [name in outputs for name in _core.IMAGES]
        frame = self._renderer.render([s._record for s in checked], options, wanted)
        return Frame(frame, checked, single, outputs)

    def backward(self, frame: Frame, *, color: Any = None, alpha: Any = None,
                 attributes: Any = None, depth: Any = None, normals: Any = None, uv: Any = None,
                 wrt: Optional[Sequence[str]] = None,
                 out: Union[Gradients, Sequence[Gradients], None] = None,
                 accumulate: bool = False) -> Any:
        """The gradients of sum(given * images) with respect to the frame's scenes.

        color, alpha, attributes, depth, normals, uv: dL/d(image), in the image's shape and dtype;
            None is zero. The image must have been rendered. depth: background pixels are not read.
        wrt: the gradients to compute: names of the Scene's arguments that are real numbers
            ("positions", "camera", "colors", ...); others are not computed. Default:
            those of `out`, or positions.
        out: the result of an earlier backward of such scenes, to overwrite.
        accumulate: add to `out` instead.

        Returns Gradients for a scene, a list of them for a list of scenes. The scenes' arrays must
        be unchanged since render. Errors: TypeError, ValueError; `out` is then undefined or, with
        `accumulate`, unchanged.
        """
        if not isinstance(frame, Frame):
            raise TypeError(f"backward: frame must be a Frame, got {type(frame).__name__}")
        given = {"color": color, "alpha": alpha, "attributes": attributes, "depth": depth,
                 "normals": normals, "uv": uv}
        cotangents = {name: self._cotangent(frame, name, value)
                      for name, value in given.items() if value is not None}
        accumulate = _arrays.as_flag("backward", "accumulate", accumulate)
        gradients = self._outputs(frame, wrt, out, accumulate)
        self._renderer.backward(frame._frame, cotangents, [g._arrays for g in gradients],
                                accumulate)
        return gradients[0] if frame._single else gradients

    @staticmethod
    def _checked(scenes: Sequence[Scene]) -> tuple[Scene, ...]:
        if not isinstance(scenes, (list, tuple)):
            raise TypeError(f"render: scenes must be a Scene or a list of them, got "
                            f"{type(scenes).__name__}")
        for i, scene in enumerate(scenes):
            if not isinstance(scene, Scene):
                raise TypeError(f"render: scenes[{i}] must be a Scene, got {type(scene).__name__}")
            if scene.dtype != scenes[0].dtype:
                raise TypeError(f"render: scenes[{i}] is {scene.dtype}, expected "
                                f"{scenes[0].dtype} as scenes[0]")
        return tuple(scenes)

    @staticmethod
    def _cotangent(frame: Frame, name: str, value: Any) -> np.ndarray:
        if name not in frame.outputs:
            raise ValueError(f"backward: {name} was not rendered: outputs={frame.outputs!r}")
        image = frame._view(name)
        return _arrays.as_array("backward", name, value, image.dtype, image.shape)

    def _outputs(self, frame: Frame, wrt: Optional[Sequence[str]], out: Any,
                 accumulate: bool) -> list[Gradients]:
        if out is None and accumulate:
            raise ValueError("backward: accumulate=True needs out")
        names = _arrays.as_names("backward", "wrt", "positions" if wrt is None else wrt,
                                 DIFFERENTIABLE)
        if out is None:
            return [Gradients({name: _empty_like(scene, name) for name in names})
                    for scene in frame.scenes]
        if not isinstance(out, (Gradients, list, tuple)):
            raise TypeError(f"backward: out must be Gradients or a list of them, got "
                            f"{type(out).__name__}")
        gradients = [out] if isinstance(out, Gradients) else list(out)
        for i, gradient in enumerate(gradients):
            if not isinstance(gradient, Gradients):
                raise TypeError(f"backward: out[{i}] must be Gradients, got "
                                f"{type(gradient).__name__}")
            if wrt is not None and set(names) != set(gradient):
                raise ValueError(f"backward: out[{i}] has {tuple(gradient)!r}, wrt is {names!r}")
            if any(gradient is other for other in gradients[:i]):
                raise ValueError(f"backward: out[{i}] is there twice; each scene has its own")
        return gradients


def _empty_like(scene: Scene, name: str) -> Any:
    """An array for the gradient of that name."""
    if name == "textures":
        if not scene._textures:
            raise ValueError("backward: wrt has 'textures', but a scene has none")
        return [np.empty_like(texels) for texels, _, _ in scene._textures]
    if name == "surfaces":
        numbers = scene._surface[0]
        return np.empty((1, Surface._SIZE), scene.dtype) if numbers is None else \
            np.empty_like(numbers)
    array = scene[name]
    if array is None:
        raise ValueError(f"backward: wrt has {name!r}, but a scene has none")
    return np.empty_like(array)
