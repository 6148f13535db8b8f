# SPDX-License-Identifier: Apache-2.0
"""`python -m tilegrad.selftest`: does this installation render what formulas say, with gradients
that differences confirm, and the same bits for any number of threads? Takes seconds; the exit code
is 1 if something fails."""

from __future__ import annotations

import functools
import sys
import time
from typing import Any, Callable

import numpy as np

import tilegrad
from tilegrad import Camera, Light, Renderer, Scene, Texture

_SIZE = 64
_DELTA = 1e-3
# Outside of pixel centres, so that no rounding decides what is covered; z differs.
_CORNERS = np.array([(-0.61, -0.43, -2.0), (0.57, -0.52, -2.5), (0.08, 0.66, -1.5)])
_COLORS = np.array([(0.9, 0.1, 0.2), (0.2, 0.8, 0.3), (0.1, 0.3, 0.7)])


def _triangle(dtype: type) -> Scene:
    return Scene(_CORNERS.astype(dtype), [(0, 1, 2)], Camera(), colors=_COLORS.astype(dtype))


def _screen() -> np.ndarray:
    """The triangle's corners in pixels."""
    return 32 + 64 * np.stack([_CORNERS[:, 0], -_CORNERS[:, 1]], 1) / -_CORNERS[:, 2:]


def _centres() -> np.ndarray:
    x, y = np.meshgrid(np.arange(_SIZE) + 0.5, np.arange(_SIZE) + 0.5)
    return np.stack([x, y], axis=-1)


def _weights() -> np.ndarray:
    """Screen barycentrics of all pixel centres, (H, W, 3)."""
    a, b, c = _screen()
    matrix = np.linalg.inv(np.stack([b - a, c - a], axis=1))
    bc = (_centres() - a) @ matrix.T
    return np.concatenate([1 - bc.sum(-1, keepdims=True), bc], axis=-1)


def _distance() -> np.ndarray:
    """From all pixel centres to the triangle's outline, NDC."""
    corners, points = _screen(), _centres()
    nearest = np.full((_SIZE, _SIZE), np.inf)
    for k in range(3):
        a, edge = corners[k], corners[(k + 1) % 3] - corners[k]
        t = np.clip((points - a) @ edge / (edge @ edge), 0, 1)
        nearest = np.minimum(nearest, np.linalg.norm(points - a - t[..., None] * edge, axis=-1))
    return nearest / (_SIZE / 2)


def _difference(got: np.ndarray, expected: np.ndarray, tolerance: float) -> str:
    worst = float(np.max(np.abs(got - expected)))
    _require(worst <= tolerance, f"off by {worst:.1e}, allowed {tolerance:.0e}")
    return f"off by {worst:.1e}"


def _require(condition: bool, message: str) -> None:
    if not condition:
        raise AssertionError(message)


def _coverage(dtype: type) -> str:
    """Pixels whose centre is inside of the triangle, and no others."""
    frame = Renderer().render(_triangle(dtype), width=_SIZE, height=_SIZE)
    inside = (_weights() > 0).all(axis=-1)
    wrong = int((inside != (frame.face_ids[0] == 0)).sum())
    _require(wrong == 0 and inside.sum() > 300, f"{wrong} pixels differ")
    return f"{inside.sum()} pixels, all right"


def _alpha(dtype: type) -> str:
    """Equation 6 of the DIB-R paper: 1 inside, exp(-d^2 / delta) outside."""
    frame = Renderer().render(_triangle(dtype), width=_SIZE, height=_SIZE, delta=_DELTA)
    inside = (_weights() > 0).all(axis=-1)
    expected = np.where(inside, 1, np.exp(-_distance() ** 2 / _DELTA))
    return _difference(frame.alpha[0], expected, 2e-5 if dtype == np.float32 else 2e-6)


def _color(dtype: type) -> str:
    """Colours that are linear in space, seen in perspective; depth likewise."""
    frame = Renderer().render(_triangle(dtype), width=_SIZE, height=_SIZE,
                              outputs=("color", "depth"))
    weights = _weights() / -_CORNERS[:, 2]
    inverse = weights.sum(axis=-1, keepdims=True)
    inside = (_weights() > 0).all(axis=-1)
    tolerance = 2e-5 if dtype == np.float32 else 1e-12
    _difference(frame.depth[0][inside], 1 / inverse[inside][:, 0], 10 * tolerance)
    color = (weights @ _COLORS) / inverse
    return _difference(frame.color[0][:, inside].T, color[inside], tolerance)


def _sphere(dtype: type, lighting: str, size: tuple[int, int] = (32, 32)) -> Scene:
    positions, faces = tilegrad.icosphere(2, 0.8)
    numbers = np.random.default_rng(1)
    noise = numbers.uniform(-0.01, 0.01, positions.shape)
    positions = (positions + noise).astype(dtype)
    light: dict[str, Any] = {"sh": numbers.uniform(0.1, 0.3, 9).astype(dtype)} \
        if lighting == "spherical_harmonics" else {"lights": Light((0.3, 0.5, 1))}
    return Scene(positions, faces, Camera.orbit(20, 30, 3, width=size[0], height=size[1]),
                 lighting=lighting,
                 colors=numbers.uniform(0.2, 0.9, positions.shape).astype(dtype),
                 uvs=numbers.uniform(0, 1, (len(positions), 2)).astype(dtype),
                 textures=Texture(numbers.uniform(0.2, 0.9, (8, 8, 3)).astype(dtype)), **light)


def _gradients(lighting: str) -> str:
    """Gradients of colour and alpha against central differences in float64, h = 1e-6. Pixels where
    a face becomes another one have no derivative: they are left out of the loss."""
    renderer, h = Renderer(), 1e-6
    scene: Any = _sphere(np.float64, lighting)
    options: dict[str, Any] = {"width": 32, "height": 32, "delta": 1e-2}
    frame = renderer.render(scene, **options)
    numbers = np.random.default_rng(2)
    weights: dict[str, Any] = {"color": numbers.uniform(-1, 1, frame.color.shape),
                               "alpha": numbers.uniform(-1, 1, frame.alpha.shape)}
    names = ("positions", "colors", "uvs")
    worst = 0.0
    for name in names:
        direction = numbers.uniform(-1, 1, scene[name].shape)
        ends = [renderer.render(scene.replace(**{name: scene[name] + s * direction}), **options)
                for s in (h, -h)]
        same = (ends[0].face_ids == frame.face_ids) & (ends[1].face_ids == frame.face_ids)
        _require(same.mean() > 0.99, "the mesh jumps")
        pulled: dict[str, Any] = {"color": weights["color"] * same[:, None],
                                  "alpha": weights["alpha"] * same}
        got = getattr(renderer.backward(frame, wrt=names, **pulled), name)
        expected = sum((pulled[image] * (getattr(ends[0], image) - getattr(ends[1], image))).sum()
                       for image in pulled) / (2 * h)
        worst = max(worst, abs((got * direction).sum() - expected) / max(1, abs(expected)))
    _require(worst < 1e-5, f"a gradient is off by {worst:.1e}, relative")
    return f"off by {worst:.1e}, relative"


def _precision() -> str:
    """The float32 engine's gradients beside those of the float64 reference."""
    renderer, worst = Renderer(), 0.0
    options: dict[str, Any] = {"width": 32, "height": 32, "delta": 1e-2}
    results = []
    for dtype in (np.float32, np.float64):
        frame = renderer.render(_sphere(dtype, "phong"), **options)
        numbers = np.random.default_rng(2)
        weights: dict[str, Any] = {name: numbers.uniform(-1, 1, getattr(frame, name).shape)
                                   .astype(dtype) for name in frame.outputs}
        results.append(renderer.backward(frame, wrt=("positions", "colors", "camera"), **weights))
    for name in ("positions", "colors"):
        single, double = (getattr(result, name) for result in results)
        worst = max(worst, float(np.abs(single - double).max() / np.abs(double).max()))
    _require(worst < 1e-3, f"off by {worst:.1e} of the largest")
    return f"off by {worst:.1e} of the largest"


def _determinism() -> str:
    """Images and gradients of 7 spheres, bit by bit."""
    results = []
    for threads in (1, 2, 7):
        renderer = Renderer(threads)
        frame = renderer.render([_sphere(np.float32, "phong", (100, 70))] * 7)
        got = renderer.backward(frame, color=np.ones_like(frame.color),
                                alpha=np.ones_like(frame.alpha), wrt=("positions", "textures"))
        results.append((frame.color.tobytes(), frame.alpha.tobytes(),
                        b"".join(g.positions.tobytes() + g.textures[0].tobytes() for g in got)))
    _require(results[0] == results[1] == results[2], "threads change the result")
    return "1, 2 and 7 threads agree"


def _finite() -> str:
    """Faces without area, edge-on, behind the camera and huge: numbers stay numbers."""
    positions = np.array([(0, 0, -1), (0, 0, -1), (0, 0, -1), (1, 0, -2), (1, 1, -2), (1, 0, -4),
                          (0, 0, 5), (1, 0, 5), (0, 1, 5), (-1e8, -1e8, -3), (1e8, -1e8, -3),
                          (0, 1e8, 1)], np.float32)
    scene = Scene(positions, np.arange(12).reshape(4, 3), Camera())
    renderer = Renderer()
    for delta in (1e-12, 1e-3, 1e6):
        frame = renderer.render(scene, delta=delta)
        got = renderer.backward(frame, alpha=np.ones_like(frame.alpha),
                                wrt=("positions", "camera"))
        for array in (frame.alpha, got.positions, got.camera.numbers):
            _require(bool(np.isfinite(array).all()), f"not finite with delta = {delta}")
    return "finite"


_TRIANGLE = (("coverage", _coverage), ("alpha", _alpha), ("colour and depth", _color))


def _checks() -> list[tuple[str, Callable[[], str]]]:
    out: list[tuple[str, Callable[[], str]]] = [
        (f"{title} of a triangle, {np.dtype(dtype)}", functools.partial(check, dtype))
        for dtype in (np.float32, np.float64) for title, check in _TRIANGLE]
    out += [(f"gradients, {lighting}", functools.partial(_gradients, lighting))
            for lighting in ("lambert", "phong", "spherical_harmonics")]
    out += [("float32 gradients beside float64", _precision), ("same bits", _determinism),
            ("degenerate faces", _finite)]
    return out


def main() -> int:
    """Runs all checks, prints a line for each; 0 if all hold, 1 otherwise."""
    print(f"tilegrad {tilegrad.__version__}, {tilegrad.simd_target()}, numpy {np.__version__}, "
          f"Python {sys.version.split()[0]}")
    failed, started = 0, time.perf_counter()
    for title, check in _checks():
        begun = time.perf_counter()
        try:
            mark, result = "ok  ", check()
        except Exception as error:  # noqa: BLE001: whatever it is, the next check is run
            mark, result = "FAIL", f"{type(error).__name__}: {error}"
            failed += 1
        print(f"{mark}  {title:42} {result} ({time.perf_counter() - begun:.2f} s)", flush=True)
    seconds = time.perf_counter() - started
    print(f"{failed} of {len(_checks())} checks FAILED" if failed else
          f"all {len(_checks())} checks hold", f"({seconds:.1f} s)")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
