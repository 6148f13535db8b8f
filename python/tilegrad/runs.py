# SPDX-License-Identifier: Apache-2.0
"""Fits and trainings from Python: `tilegrad.fit`, `tilegrad.train`. They match the commands of that
name bit for bit and write the same folders."""

from __future__ import annotations

import dataclasses
import json
import os
import pathlib
import tempfile
from typing import Any, Callable, Mapping, Optional, Sequence, Union

import numpy as np

from tilegrad import _arrays, _tools
from tilegrad._arrays import as_count, as_flag, name_of, Path, thread_count
from tilegrad._camera import Camera
from tilegrad._camera_arguments import checked_size
from tilegrad._progress import Progress, watched_line
from tilegrad.meshes import Mesh, as_mesh, load_mesh


Callback = Callable[[Progress], Optional[bool]]  # True stops; everything is saved


@dataclasses.dataclass(frozen=True)
class FitResult:
    """The result of `fit`. training, held_out: {"views", "psnr" (dB), "silhouette_iou"} or None;
    voxel_iou: at 32 voxels a side where a truth was given. finished: False if a callback stopped
    it: mesh is then None, and resume=True continues. folder: of the run; None if temporary.
    """

    mesh: Optional[Mesh]
    finished: bool
    steps: int
    seconds: float
    training: Optional[dict[str, float]]
    held_out: Optional[dict[str, float]]
    voxel_iou: Optional[float]
    folder: Optional[pathlib.Path]

    def __repr__(self) -> str:
        scores = self.held_out or self.training or {}
        said = ", ".join(f"{name} {value:.4g}" for name, value in scores.items())
        return f"<tilegrad FitResult: {self.mesh}, {self.steps} steps, {said}>"

    def _repr_png_(self) -> Optional[bytes]:
        return None if self.mesh is None else self.mesh._repr_png_()


@dataclasses.dataclass(frozen=True)
class TrainResult:
    """The result of `train`: its folder and progress. finished: False if a callback or
    max_minutes stopped it; resume=True continues."""

    folder: pathlib.Path
    finished: bool
    steps: int
    seconds: float

    def predictor(self, threads: int = 0) -> Any:
        """`tilegrad.predict.Predictor` of its newest checkpoint."""
        from tilegrad.predict import Predictor
        return Predictor(self.folder, threads)


def fit(images: Any, cameras: Optional[Camera] = None, *, masks: Any = None, model: str = "",
        background: str = "auto", fov: float = 65, up: str = "", find_cameras: bool = False,
        hold_out: int = 0, start: Any = None, truth: Any = None,
        optimize: Union[str, Sequence[str]] = (), material: str = "unlit", lighting: str = "none",
        quality: str = "", out: Optional[Path] = None, resume: bool = False,
        callback: Optional[Callback] = None, threads: int = 0, **options: Any) -> FitResult:
    """A mesh and its texture from images: `tilegrad.fit("photos").mesh`.

    images: (N, H, W, 4), cut out by alpha, or (N, H, W, 3) with masks or on a plain background;
        uint8, or real numbers 0 to 1. Or a folder, as for the command: with transforms.json, of
        COLMAP, of pictures alone, or a dataset with `model` "CLASS/ID".
    cameras: a Camera of N views, in pixels of the images. None: the folder's, or if it has none,
        cameras are estimated from the images, whose longer side spans `fov` degrees.
    masks: (N, H, W), white is the object.
    background: source of the masks: "mask", alpha and masks; "plain", plain backgrounds; "views",
        what six or more views with cameras have in common; "auto", the first of these that is
        available; "none", the object fills the image.
    up: "y", "z" or "x", the up axis of the camera coordinates; the mesh is rotated to y up, as in
        glTF. "": for a folder detected from its cameras, else y.
    find_cameras: estimates the cameras even if some are given.
    hold_out: every hold_out-th image is held out for evaluation; 0: none.
    start: the initial mesh; truth: the ground truth to score against; what `as_mesh` takes.
    optimize: any of positions, colors, texture, uv, camera, light, sh, material; empty: positions
        and texture, or the colours that `start` has. lighting: as in `Scene`.
    material: "unlit"; "lambert" and "phong" fit a light as well as the colours.
    quality: "fast", "normal" or "best": 300, 1200 or 3000 steps, unless `steps` says how many.
    out: the run's folder; None: a temporary one. resume: continues the fit in it; more steps
        extend a finished fit.
    callback: called with each logged step (see `Progress`); returns True to stop. Its exceptions
        end the fit and propagate. If its attribute `stages` is true, it is also called during
        reading, preparation and other stages. None: a progress line on a terminal and in a
        notebook.
    options: those of `tilegrad fit`, with underscores: steps, smoothing, texture_size, ...
    Warns about doubtful masks and cameras, and about damaged checkpoints that `resume` skips.
    ValueError, OSError: name the faulty argument or file. KeyboardInterrupt: Ctrl-C; all is
        saved.
    """
    views = {"hold_out": as_count("fit", "hold_out", hold_out), "fov": _degrees("fov", fov),
             "find_cameras": as_flag("fit", "find_cameras", find_cameras),
             **_texts(background=background, up=up), **_pictures(images, cameras, masks, model)}
    if quality and "steps" in options:
        raise ValueError("fit: quality and steps both set the number of steps; give one of them")
    request = {"options": _words("fit", "options", options), "start": _mesh_dict(start),
               "truth": _mesh_dict(truth), "optimize": _optimized(optimize),
               **_texts(lighting=lighting, material=material, quality=quality),
               "resume": as_flag("fit", "resume", resume), "threads": thread_count("fit", threads)}
    if out is not None:
        return _fit(views, request, pathlib.Path(name_of(out)), callback, keep=True)
    with tempfile.TemporaryDirectory() as folder:
        return _fit(views, request, pathlib.Path(folder), callback, keep=False)


def train(config: Path = "quick", *, data: Path, out: Path,
          set: Optional[Mapping[str, Any]] = None,  # pylint: disable=redefined-builtin
          resume: bool = False, max_minutes: float = 0, callback: Optional[Callback] = None,
          threads: int = 0) -> TrainResult:
    """Trains the network of a configuration on a dataset.

    config: a name (`config_names`) or a TOML file. data: a dataset's folder. out: the run's.
    set: keys to override, {"schedule.steps": 100}. max_minutes: saves and stops then; 0: no limit.
    resume, callback, threads, errors: as in `fit`; more steps: set={"schedule.steps": ...}.
    Warns about damaged checkpoints and what the configuration warns of.
    """
    minutes = _arrays.as_number("train", "max_minutes", max_minutes, float)
    if not minutes >= 0:
        raise ValueError(f"train: max_minutes is {minutes}, must be >= 0")
    request = {"config": name_of(config), "data": name_of(data), "out": name_of(out),
               "overrides": _words("train", "set", set or {}),
               "resume": as_flag("train", "resume", resume),
               "max_minutes": minutes, "threads": thread_count("train", threads)}
    with _Listener(pathlib.Path(request["out"]), callback) as listener:
        done = _tools.train(request, listener)
    return TrainResult(pathlib.Path(request["out"]), done["finished"],
                       done.get("steps", listener.done), done.get("seconds", 0.0))


def config_names() -> list[str]:
    """Names of the built-in configurations."""
    return _tools.config_names()


def _fit(views: dict, request: dict, folder: pathlib.Path, callback: Optional[Callback],
         keep: bool) -> FitResult:
    with _Listener(folder, callback) as listener:
        stopped = listener("preparing", 0, 0) is True
        done = {"finished": False} if stopped else _tools.fit(
            views, {**request, "out": os.fspath(folder)}, listener)
    finished = done["finished"]
    return FitResult(load_mesh(folder / "mesh.glb") if finished else None, finished,
                     done.get("steps", listener.done), done.get("seconds", 0.0),
                     done.get("training"), done.get("held_out"), done.get("voxel_iou"),
                     folder if keep else None)


class _Listener:
    """Calls back when there is a new line in the log, or, if the callback wants stages, always."""

    def __init__(self, folder: pathlib.Path, callback: Optional[Callback]) -> None:
        if callback is not None and not callable(callback):
            raise TypeError(f"callback is {callback!r}, expected a function")
        self._line = watched_line() if callback is None else None
        self._log, self._callback = folder / "metrics.jsonl", self._line or callback
        self._stages = getattr(self._callback, "stages", False)
        self._size, self._values, self.done = -1, {}, 0

    def __enter__(self) -> _Listener:
        return self

    def __exit__(self, *exception: Any) -> None:
        if self._line is not None:
            self._line.finish()

    def __call__(self, stage: str, done: int, total: int) -> Optional[bool]:
        stepping = stage in ("fitting", "training")
        if stepping:
            self.done = done
        if self._callback is None or not (self._stages or (stepping and self._is_logged())):
            return None
        values = self._logged() if stepping else {}
        return self._callback(Progress(done, total, values, stage))

    def _is_logged(self) -> bool:
        """Whether there is a new line."""
        return self._log.exists() and self._log.stat().st_size != self._size

    def _logged(self) -> dict[str, float]:
        """The values of the last line."""
        if self._is_logged():
            self._size = self._log.stat().st_size
            with open(self._log, "rb") as file:
                file.seek(max(0, self._size - 8192))
                lines = file.read().splitlines()
            self._values = json.loads(lines[-1]) if lines else {}
            self._values.pop("step", None)
        return self._values


def _pictures(images: Any, cameras: Any, masks: Any, model: str) -> dict[str, Any]:
    """A folder, or arrays."""
    if not isinstance(images, (str, bytes, os.PathLike)):
        return _views(images, cameras, masks)
    if cameras is not None or masks is not None:
        raise ValueError("fit: a folder has its own cameras and masks")
    return {"folder": name_of(images), "model": _arrays.as_text("fit", "model", model)}


def _texts(**words: Any) -> dict[str, str]:
    return {name: _arrays.as_text("fit", name, word) for name, word in words.items()}


def _optimized(names: Union[str, Sequence[str]]) -> list[str]:
    return [_arrays.as_text("fit", "optimize", name)
            for name in ((names,) if isinstance(names, str) else names)]


def _degrees(argument: str, value: Any) -> float:
    """Of a field of view."""
    degrees = _arrays.as_number("fit", argument, value, float)
    if 5 <= degrees <= 150:
        return degrees
    raise ValueError(f"fit: {argument} is {value}, expected 5 to 150 degrees")


def _views(images: Any, cameras: Any, masks: Any) -> dict[str, Any]:
    pixels = _unit("images", images)
    if pixels.ndim != 4 or pixels.shape[-1] not in (3, 4):
        raise ValueError(f"fit: images has shape {pixels.shape}, expected (N, H, W, 3 or 4)")
    if masks is not None:
        alpha = _unit("masks", masks)
    elif pixels.shape[-1] == 4:
        alpha = pixels[..., 3]
    else:
        alpha = np.ones(pixels.shape[:3], np.float32)
    _arrays.check_shape("fit", "masks", alpha.shape, pixels.shape[:3])
    return {"names": [str(i) for i in range(len(pixels))], "cameras": _rows(cameras, pixels.shape),
            "color": np.ascontiguousarray(np.moveaxis(pixels[..., :3], -1, 1)),
            "alpha": np.ascontiguousarray(alpha)}


def _rows(cameras: Any, shape: tuple[int, ...]) -> Optional[list[list[float]]]:
    if cameras is None:
        return None
    views, height, width = shape[:3]
    if not isinstance(cameras, Camera):
        raise TypeError(f"fit: cameras is {type(cameras).__name__}, expected a Camera of {views} "
                        "views")
    numbers = np.asarray(cameras.numbers, np.float64)
    _arrays.check_shape("fit", "cameras", numbers.shape, (views, 17))
    checked_size("fit", cameras.size, (width, height))
    return numbers.tolist()


def _unit(argument: str, value: Any) -> np.ndarray:
    """float32, 0 to 1, of bytes or real numbers."""
    array = _arrays.plain("fit", argument, value)
    if array.dtype == np.uint8:
        return array.astype(np.float32) / 255
    if array.dtype.kind not in "bf":
        raise TypeError(f"fit: {argument} has dtype {array.dtype}, expected uint8 or real numbers")
    array = array.astype(np.float32)
    if not (np.isfinite(array).all() and array.min(initial=0) >= 0 and array.max(initial=0) <= 1):
        raise ValueError(f"fit: {argument} has numbers outside of [0, 1]")
    return array


def _words(function: str, argument: str, options: Any) -> list[str]:
    def text(value: Any) -> str:
        return str(value).lower() if isinstance(value, (bool, np.bool_)) else str(value)

    return [_arrays.as_text(function, argument, f"{key}={text(value)}")
            for key, value in _arrays.as_items(function, argument, options)]


def _mesh_dict(mesh: Any) -> Optional[dict[str, Any]]:
    return None if mesh is None else as_mesh(mesh)._checked("fit")
