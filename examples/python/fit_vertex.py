# SPDX-License-Identifier: Apache-2.0
"""Gradient descent on one vertex: where is the top of the triangle in a picture? Alpha pulls from
outside of the triangle, colours that are interpolated over it pull from inside.

    /usr/bin/python3 examples/python/fit_vertex.py
"""

import sys

import numpy as np

import tilegrad

# A softer silhouette is felt from farther away: here it fades over about two pixels.
OPTIONS = {"width": 64, "height": 64, "delta": 4e-3}


def main() -> int:
    truth = np.array([(-0.5, -0.4, -2), (0.5, -0.4, -2), (0.2, 0.6, -2)], np.float32)
    colors = np.eye(3, dtype=np.float32)
    scene = tilegrad.Scene(truth, [(0, 1, 2)], tilegrad.Camera(), colors=colors)
    renderer = tilegrad.Renderer()
    target = renderer.render(scene, **OPTIONS)  # keeps its images, whatever is rendered next

    positions = truth.copy()
    positions[2, :2] = -0.3, 0.3  # the top, moved away
    scene = scene.replace(positions=positions)  # looks at the array: moving it moves the mesh
    for step in range(41):
        frame = renderer.render(scene, **OPTIONS)
        alpha, color = frame.alpha - target.alpha, frame.color - target.color
        # The loss is mean(alpha^2) + mean(color^2); these are its derivatives.
        gradients = renderer.backward(frame, alpha=2 * alpha / alpha.size,
                                      color=2 * color / color.size)
        if step % 10 == 0:
            loss = (alpha**2).mean() + (color**2).mean()
            print(f"step {step:3}: loss {loss:.2e}, top at "
                  f"({positions[2, 0]:.4f}, {positions[2, 1]:.4f})")
        positions[2, :2] -= 0.5 * gradients.positions[2, :2]
    distance = np.linalg.norm(positions - truth)
    print(f"{distance:.5f} world units from the truth")
    return 0 if distance < 1e-2 else 1


if __name__ == "__main__":
    sys.exit(main())
