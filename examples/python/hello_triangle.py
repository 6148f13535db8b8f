# SPDX-License-Identifier: Apache-2.0
"""One triangle: its image, and which way its corners would have to move for the silhouette to grow.

    /usr/bin/python3 examples/python/hello_triangle.py
"""

import sys

import numpy as np

import tilegrad


def main() -> int:
    # The camera stands at the origin and looks along -z.
    positions = np.array([(-0.5, -0.4, -2), (0.5, -0.4, -2), (0, 0.6, -2)], np.float32)
    faces = np.array([(0, 1, 2)], np.int32)
    colors = np.eye(3, dtype=np.float32)  # red, green, blue
    scene = tilegrad.Scene(positions, faces, tilegrad.Camera(), colors=colors)

    # Scenes in, images out. delta is how soft the silhouette is: here about a pixel.
    renderer = tilegrad.Renderer()
    frame = renderer.render(scene, width=64, height=64, delta=1e-3)
    for row in frame.alpha[0, 14:50:2, 12:52]:  # every second row: characters are higher than wide
        print("".join(" .:-=+*#%@"[int(9.9 * alpha)] for alpha in row))

    # Gradients of images in, gradients of scenes out. The loss is the sum of alpha: the area.
    gradients = renderer.backward(frame, alpha=np.ones_like(frame.alpha))
    for vertex, (x, y, _) in enumerate(gradients.positions):
        print(f"vertex {vertex}: the silhouette grows by ({x:6.1f}, {y:6.1f}) pixels for each unit "
              "to the right and up")

    outward = np.sign(gradients.positions[:, :2]).tolist()
    return 0 if outward[:2] == [[-1, -1], [1, -1]] and outward[2][1] == 1 else 1


if __name__ == "__main__":
    sys.exit(main())
