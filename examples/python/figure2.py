# SPDX-License-Identifier: Apache-2.0
"""The paper's Figure 2, its sanity check of all gradients: eight small scenes, in each of which one
attribute is wrong and is brought back by gradient descent on the L1 loss between RGBA images.

    /usr/bin/python3 examples/python/figure2.py --out figure2.svg
"""

import argparse
import base64
import collections
import sys

import numpy as np

import tilegrad

GOAL = 0.05  # of the loss at the start
# `argument` of the scene is of_value(value), and the name of its gradient.
Case = collections.namedtuple("Case", "name truth start rate scene argument of_value",
                              defaults=(np.float32,))


def cases(size):
    sphere, faces = tilegrad.icosphere(3, 1)
    x, y, z = sphere.T
    bump = 0.22 * np.sin(3 * x + 1) * np.cos(4 * y) + 0.15 * np.sin(5 * z)
    shape = ((1 + bump)[:, None] * sphere * (1, 0.8, 1)).astype(np.float32)

    def camera(pose):  # azimuth, elevation, distance
        return tilegrad.Camera.orbit(*np.degrees(pose[:2]), pose[2], fov_y=40, width=size,
                                     height=size)

    def surface(value):
        return tilegrad.Surface(ambient=value[:3], diffuse=value[3:6], specular=value[6:9],
                                shininess=np.exp(value[9]))

    pose = np.array([1.05, 0.44, 4])
    rainbow = 0.5 + 0.45 * np.sin(3 * shape + (0, 2, 4))
    u, v = np.meshgrid(np.linspace(0, 1, 96), np.linspace(0, 1, 48))
    checks = np.tanh(3 * np.sin(8 * np.pi * u) * np.sin(6 * np.pi * v))
    texels = 0.5 + 0.4 * np.stack([checks, np.sin(2 * np.pi * u), -np.cos(2 * np.pi * v)], -1)
    uvs = 0.5 + 0.45 * sphere[:, :2]
    colored = tilegrad.Scene(shape, faces, camera(pose), colors=rainbow.astype(np.float32))
    painted = colored.replace(colors=None, uvs=uvs, textures=np.float32(texels))
    lambert = colored.replace(colors=np.full_like(shape, (0.9, 0.75, 0.6)), lighting="lambert",
                              lights=tilegrad.Light((0.6, 0.7, 0.4)))
    harmonics = lambert.replace(lighting="spherical_harmonics", lights=None)
    light = np.array([2.2, -0.5, 0.4, -0.7, 0.3, -0.2, 0.25, -0.3, 0.35])
    other = np.array([1, 0.5, -0.6, 0.6, 0, 0, 0, 0, 0])
    gloss = np.array([0.1] * 3 + [0.8, 0.6, 0.4] + [0.5] * 3 + [np.log(40)])
    dull = np.array([0.3] * 3 + [0.4, 0.4, 0.8] + [0.2] * 3 + [np.log(5)])
    return [
        Case("(a) vertex colour: vertex position", shape, 0.9 * sphere, 0.03, colored, "positions"),
        Case("(b) vertex colour: vertex colour", rainbow, 0 * rainbow + 0.5, 0.02, colored,
             "colors"),
        Case("(c) texture: texture", texels, 0 * texels + 0.5, 0.03, painted, "textures"),
        Case("(d) texture: texture coordinates", uvs, uvs + 0.03 * np.sin(4 * np.pi * uvs[:, ::-1]),
             0.002, painted, "uvs"),
        Case("(e) Lambert: vertex position", shape, 0.9 * sphere, 0.03, lambert, "positions"),
        Case("(f) Lambert: camera position", pose, pose + (0.4, -0.25, 0.6), 0.02, lambert,
             "camera", camera),
        Case("(g) spherical harmonics: light", light, other, 0.04, harmonics, "sh"),
        Case("(h) Phong: material", gloss, dull, 0.03, lambert.replace(lighting="phong"),
             "surfaces", surface)]


def gradient_of(case, value, d):
    """dL/d(value) from that of the argument."""
    if not hasattr(d, "numbers"):
        return d[0] if case.argument == "textures" else d
    steps = 1e-4 * np.eye(len(value))
    return np.array([np.sum((case.of_value(value + h).numbers - case.of_value(value - h).numbers)
                            * d.numbers) for h in steps]) / 2e-4


def smoothing(faces):
    """(1 + L)^-1 with the Laplacian L of the edges: steps of vertices that stay smooth (Nicolet et
    al., Large Steps in Inverse Rendering of Geometry, 2021)."""
    laplacian = np.zeros((faces.max() + 1,) * 2)
    for a, b in ((0, 1), (1, 2), (2, 0)):
        laplacian[faces[:, a], faces[:, b]] = laplacian[faces[:, b], faces[:, a]] = -1
    np.fill_diagonal(laplacian, -laplacian.sum(axis=1))
    return np.linalg.inv(np.eye(len(laplacian)) + laplacian)


def descend(renderer, case, steps):
    """(PNG of start, target and result, losses), by Adam; of vertices with one second moment."""
    def render(value):
        scene = case.scene.replace(**{case.argument: case.of_value(value)})
        return renderer.render(scene, delta=1e-3 if case.argument == "camera" else 1 / 3000)
    of_vertices = case.argument == "positions"
    smooth = smoothing(case.scene.faces) if of_vertices else None
    target = render(case.truth)
    value, m, v, first, losses = case.start.astype(float), 0, 0, None, []
    for step in range(1, steps + 2):
        frame = render(value)
        color, alpha = frame.color - target.color, frame.alpha - target.alpha
        losses.append(float(np.abs(color).mean() + np.abs(alpha).mean()))
        first = first or frame
        gradients = renderer.backward(frame, color=np.sign(color) / color.size,
                                      alpha=np.sign(alpha) / alpha.size, wrt=(case.argument,))
        gradient = gradient_of(case, value, getattr(gradients, case.argument))
        gradient = smooth @ gradient if of_vertices else gradient
        m, v = 0.9 * m + 0.1 * gradient, 0.999 * v + 0.001 * gradient**2
        root = np.sqrt((v.max() if of_vertices else v) / (1 - 0.999**step)) + 1e-12
        move = m / (1 - 0.9**step) / root
        rate = case.rate * (0.005 + 0.995 * 0.5 * (1 + np.cos(np.pi * (step - 1) / steps)))
        value = value - rate * (smooth @ move if of_vertices else move)
    for picture in (first, target, frame):
        picture.background = (1, 1, 1)
    return [picture._repr_png_() for picture in (first, target, frame)], losses


def row_svg(name, pictures, losses, left, top):
    """Three pictures, and the loss over its start, logarithmic from 1 to 1/1000."""
    def y_of(share):
        return top + 100 * np.clip(-np.log10(max(share, 1e-12)) / 3, 0, 1)
    parts = [f'<text x="{left}" y="{top - 5}">{name}, {losses[-1] / losses[0]:.2%} left</text>']
    for i, png in enumerate(pictures):
        parts.append(f'<image x="{left + 106 * i}" y="{top}" width="100" height="100" '
                     f'href="data:image/png;base64,{base64.b64encode(png).decode()}"/>')
    for share in (1, 0.1, GOAL, 0.01, 0.001):
        parts.append(f'<path d="M{left + 318} {y_of(share):.1f}h130" '
                     f'stroke="{"#c2571a" if share == GOAL else "#ddd"}"/>')
    points = " ".join(f"{left + 318 + 130 * i / (len(losses) - 1):.1f},{y_of(loss / losses[0]):.1f}"
                      for i, loss in enumerate(losses))
    return "\n".join([*parts, f'<polyline points="{points}" fill="none" stroke="#0b6a9a"/>'])


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    for option, default in (("--out", "figure2.svg"), ("--size", 128), ("--steps", 400)):
        parser.add_argument(option, type=type(default), default=default)
    args = parser.parse_args()
    renderer, rows, worst = tilegrad.Renderer(), [], 0.0
    for i, case in enumerate(cases(args.size)):
        pictures, losses = descend(renderer, case, args.steps)
        left = losses[-1] / losses[0]
        print(f"{case.name}: L1 {losses[0]:.5f} -> {losses[-1]:.6f}, {left:.2%} left")
        worst = max(worst, left)
        rows.append(row_svg(case.name, pictures, losses, 6 + 470 * (i // 4), 24 + 130 * (i % 4)))
    with open(args.out, "w", encoding="utf-8") as file:
        file.write('<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 940 530" font-size="12" '
                   'font-family="sans-serif" style="background:#fff">\n' + "\n".join(rows) + "</svg>\n")
    return 0 if worst <= GOAL else 1


if __name__ == "__main__":
    sys.exit(main())
