# SPDX-License-Identifier: Apache-2.0
"""Small GLB files of what viewers do with alpha, textures, skins and an axis that is up, for compare.sh: make_cases.py FOLDER"""

import json
import math
import pathlib
import struct
import sys
import zlib

FLOAT, BYTE, SHORT = 5126, 5121, 5123
CODES = {FLOAT: "f", BYTE: "B", SHORT: "H"}
NO_SHINE = {"metallicFactor": 0, "roughnessFactor": 1}


class Glb:
    """A scene with one node for each mesh."""

    def __init__(self):
        self.data = b""
        self.json = {"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": []}], "nodes": [],
                     "meshes": [], "materials": [], "accessors": [], "bufferViews": []}

    def view(self, data):
        self.data += b"\0" * (-len(self.data) % 4)
        self.json["bufferViews"].append({"buffer": 0, "byteOffset": len(self.data), "byteLength": len(data)})
        self.data += data
        return len(self.json["bufferViews"]) - 1

    def accessor(self, rows, kind, code=FLOAT):
        numbers = [x for row in rows for x in (row if isinstance(row, (tuple, list)) else (row,))]
        accessor = {"bufferView": self.view(struct.pack(f"<{len(numbers)}{CODES[code]}", *numbers)), "componentType": code,
                    "count": len(rows), "type": kind}
        if kind == "VEC3":
            accessor.update(min=[min(r[i] for r in rows) for i in range(3)], max=[max(r[i] for r in rows) for i in range(3)])
        self.json["accessors"].append(accessor)
        return len(self.json["accessors"]) - 1

    def material(self, base_color=(1, 1, 1, 1), texture=None, **more):
        pbr = {"baseColorFactor": list(base_color), **NO_SHINE}
        if texture is not None:
            pbr["baseColorTexture"] = texture
        self.json["materials"].append({"pbrMetallicRoughness": pbr, "doubleSided": True, **more})
        return len(self.json["materials"]) - 1

    def texture(self, pixels, **sampler):
        """pixels: rows of RGBA. Returns the texture's index."""
        raw = b"".join(b"\0" + bytes(x for pixel in row for x in pixel) for row in pixels)
        def chunk(name, data):
            return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))
        header = struct.pack(">IIBBBBB", len(pixels[0]), len(pixels), 8, 6, 0, 0, 0)
        png = b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(raw, 9)) + chunk(b"IEND", b"")
        for name in ("images", "samplers", "textures"):
            self.json.setdefault(name, [])
        self.json["images"].append({"bufferView": self.view(png), "mimeType": "image/png"})
        self.json["samplers"].append(sampler)
        self.json["textures"].append({"source": len(self.json["images"]) - 1, "sampler": len(self.json["samplers"]) - 1})
        return len(self.json["textures"]) - 1

    def mesh(self, material, positions, faces, node=None, **attributes):
        primitive = {"attributes": {"POSITION": self.accessor(positions, "VEC3"), **attributes}, "material": material,
                     "indices": self.accessor([i for face in faces for i in face], "SCALAR", SHORT)}
        self.json["meshes"].append({"primitives": [primitive]})
        self.json["nodes"].append({"mesh": len(self.json["meshes"]) - 1, **(node or {})})
        self.json["scenes"][0]["nodes"].append(len(self.json["nodes"]) - 1)

    def quad(self, material, corners, node=None):
        uvs = self.accessor([(0, 1), (1, 1), (1, 0), (0, 0)], "VEC2")
        self.mesh(material, corners, [(0, 1, 2), (0, 2, 3)], node, TEXCOORD_0=uvs)

    def box(self, material, centre, half):
        corners = [tuple(c + h * s for c, h, s in zip(centre, half, signs))
                   for signs in ((-1, -1, 1), (1, -1, 1), (1, 1, 1), (-1, 1, 1), (-1, -1, -1), (1, -1, -1), (1, 1, -1), (-1, 1, -1))]
        for face in ((0, 1, 2, 3), (5, 4, 7, 6), (1, 5, 6, 2), (4, 0, 3, 7), (3, 2, 6, 7), (4, 5, 1, 0)):
            self.quad(material, [corners[i] for i in face])

    def save(self, path):
        self.data += b"\0" * (-len(self.data) % 4)
        self.json["buffers"] = [{"byteLength": len(self.data)}]
        text = json.dumps(self.json).encode()
        text += b" " * (-len(text) % 4)
        path.write_bytes(struct.pack("<4sII", b"glTF", 2, 28 + len(text) + len(self.data)) + struct.pack("<I4s", len(text), b"JSON") +
                         text + struct.pack("<I4s", len(self.data), b"BIN\0") + self.data)


def wall(x, z, half):
    return [(x - half, -half, z), (x + half, -half, z), (x + half, half, z), (x - half, half, z)]


def leaf(x, y):
    """Green discs on nothing, which is red: a viewer that draws it shows that."""
    u, v = x % 16 - 7.5, y % 16 - 7.5
    return (40, 150 + 5 * (x % 16), 60, 255) if math.hypot(u, v) < 6.5 else (255, 0, 0, 0)


def alpha_mask():
    """Two walls of discs that stand across each other, and a box that is seen between them."""
    glb = Glb()
    image = glb.texture([[leaf(x, y) for x in range(64)] for y in range(64)])
    cut = glb.material(texture={"index": image}, alphaMode="MASK")
    glb.quad(cut, wall(0, 0, 1))
    glb.quad(cut, [(0, -1, 1), (0, -1, -1), (0, 1, -1), (0, 1, 1)])
    glb.box(glb.material((0.8, 0.5, 0.1, 1)), (-0.5, 0, -0.5), (0.3, 0.3, 0.3))
    return glb


def alpha_blend():
    """Three panes, the nearest first in the file, before a box. Each is a node, which three.js sorts them by."""
    glb = Glb()
    for z, color in ((0.8, (0.9, 0.05, 0.05, 0.4)), (0.3, (0.05, 0.6, 0.1, 0.5)), (-0.2, (0.05, 0.1, 0.9, 0.6))):
        glb.quad(glb.material(color, alphaMode="BLEND"), wall(0, 0, 0.6), {"translation": [z - 0.3, 0, z]})
    glb.box(glb.material((0.8, 0.5, 0.1, 1)), (0, 0, -0.9), (0.4, 0.4, 0.4))
    return glb


def arrow(x, y):
    if 10 <= y < 22 and 4 <= x < 18 or x >= 18 and abs(y - 15.5) < 30 - x:
        return (230, 60, 40, 255)
    return (250, 240, 200, 255) if (x // 8 + y // 8) % 2 else (90, 130, 200, 255)


def texture_transform():
    """Turned, scaled and moved; repeated along u, clamped along v."""
    glb = Glb()
    image = glb.texture([[arrow(x, y) for x in range(32)] for y in range(32)], wrapS=10497, wrapT=33071, magFilter=9728)
    transform = {"offset": [0.2, -0.4], "rotation": 0.5, "scale": [2, 2]}  # three.js scales after it turns: only equal scales agree
    texture = {"index": image, "extensions": {"KHR_texture_transform": transform}}
    glb.json["extensionsUsed"] = ["KHR_texture_transform"]
    glb.quad(glb.material(texture=texture), wall(0, 0, 1))
    return glb


def skin():
    """An arm of three joints, each turned by 35 degrees against the last. Its node stands far away: that must not count."""
    glb = Glb()
    rings, sides, bones = 25, 16, 3
    positions, normals, colors, joints, weights = [], [], [], [], []
    for i in range(rings):
        y = 3 * i / (rings - 1)
        at = min(max(y - 0.5, 0), bones - 1)
        low = min(int(at), bones - 2)
        for k in range(sides):
            a = 2 * math.pi * k / sides
            positions.append((0.3 * math.cos(a), y, 0.3 * math.sin(a)))
            normals.append((math.cos(a), 0, math.sin(a)))
            colors.append((0.9, 0.3 * y, 0.1) if i // 3 % 2 else (0.1, 0.3, 0.9))
            joints.append((low, low + 1, 0, 0))
            weights.append((1 - (at - low), at - low, 0, 0))
    faces = []
    for i in range(rings - 1):
        for k in range(sides):
            a, b = i * sides + k, i * sides + (k + 1) % sides
            faces += [(a, a + sides, b), (b, a + sides, b + sides)]
    turn = [0, 0, math.sin(math.radians(17.5)), math.cos(math.radians(17.5))]
    binds = [[1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, -j, 0, 1] for j in range(bones)]
    attributes = {"NORMAL": glb.accessor(normals, "VEC3"), "COLOR_0": glb.accessor(colors, "VEC3"),
                  "JOINTS_0": glb.accessor(joints, "VEC4", BYTE), "WEIGHTS_0": glb.accessor(weights, "VEC4")}
    glb.mesh(glb.material(), positions, faces, {"skin": 0, "translation": [50, 0, 0]}, **attributes)
    for j in range(bones):
        node = {"rotation": turn, "translation": [0, 1 if j else 0, 0]}
        glb.json["nodes"].append({**node, "children": [j + 2]} if j + 1 < bones else node)
    glb.json["scenes"][0]["nodes"].append(1)
    glb.json["skins"] = [{"joints": [1, 2, 3], "inverseBindMatrices": glb.accessor(binds, "MAT4")}]
    return glb


def z_up():
    """A chair that stands on the plane z = 0 and looks towards -y."""
    glb = Glb()
    wood, cloth = glb.material((0.5, 0.25, 0.08, 1)), glb.material((0.1, 0.25, 0.6, 1))
    for x in (-0.35, 0.35):
        for y in (-0.35, 0.35):
            glb.box(wood, (x, y, 0.4), (0.05, 0.05, 0.4))
    glb.box(cloth, (0, 0, 0.85), (0.42, 0.42, 0.06))
    glb.box(wood, (0, 0.38, 1.35), (0.42, 0.04, 0.45))
    return glb


if __name__ == "__main__":
    for make in (alpha_mask, alpha_blend, texture_transform, skin, z_up):
        make().save(pathlib.Path(sys.argv[1]) / (make.__name__ + ".glb"))
