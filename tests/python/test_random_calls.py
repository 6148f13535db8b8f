# SPDX-License-Identifier: Apache-2.0
"""The Python interface under random calls, most of them wrong: arrays of any dtype, shape, order
and content, tensors of any kind, numbers out of range, names that do not exist. Each call returns
or raises a documented exception with a message. What it returns is the same, bit by bit, as from a
renderer that is new, where fresh memory holds other bytes: so nothing stays unwritten.

A failure names its seed: TILEGRAD_SEED=number repeats it; TILEGRAD_SECONDS lengthens the test."""

import ctypes
import os
import random
import time
import traceback
import unittest

import numpy as np

import tilegrad
from scenes import ALL, LIGHTINGS, patch
from support import long_test, needs_torch, torch
from tilegrad import Camera, Light, Renderer, Scene, Surface, Texture

if torch:
    import tilegrad.compat.nvdiffrast.torch as dr
    import tilegrad.torch
    from tilegrad.compat import kaolin

DOCUMENTED = (TypeError, ValueError, MemoryError)
GRADIENTS = ("positions", "camera", "colors", "uvs", "normals", "textures", "surfaces", "lights",
             "light_directions", "sh", "attributes")
OPTIONS = {
    "width": (1, 7, 34, 70), "height": (1, 5, 29, 130), "delta": (1e-3, 1e-2, 1.0),
    "max_alpha_error": (0, 1e-3, 0.5), "interpolation": ("perspective", "screen_linear"),
    "culling": ("none", "back"), "alpha_rule": ("all_faces", "paper"), "paper_box": (0.0, 0.1),
    "paper_faces": (0, 30)}
NUMBERS = (0, -1, 1, 0.5, 1e-45, 3e38, 1e39, -1e300, float("nan"), float("inf"), 2**31, 2**63,
           -(2**63), 10**400, True, None, "1", b"1", 1j, (), [1], {}, object(), np.float16(1),
           np.int8(-1), np.array(1.0), np.array([]))
DTYPES = ("f2", "f4", "f8", ">f4", "i1", "i4", "u4", "i8", "u8", "b1", "c8", "O", "U3", "M8[s]",
          "f4,f4")
_PERTURB = -6  # mallopt: what memory holds before it is written


def poison(byte):
    """Fresh memory holds `byte` from now on."""
    try:
        ctypes.CDLL(None).mallopt(_PERTURB, ~byte & 0xff)
    except AttributeError:  # not glibc
        pass


class Dice(random.Random):
    """Choices that a seed repeats."""

    def one_in(self, n):
        return self.randrange(n) == 0

    def odd_array(self, array):
        """Something like `array`, and mostly not what is wanted."""
        array = np.array(array)
        kind = self.randrange(16)
        if kind < 3:
            flat = array.reshape(-1).copy()
            if flat.size and flat.dtype.kind == "f":
                flat[self.randrange(flat.size)] = self.choice(
                    [np.nan, np.inf, -np.inf, 3e38, 1e-42, 0])
            elif flat.size:
                flat[self.randrange(flat.size)] = self.choice([-1, 2**31 - 1, -2**31, 17])
            return flat.reshape(array.shape)
        if kind == 3:
            with np.errstate(all="ignore"):
                return np.zeros(array.shape, self.choice(DTYPES))
        if kind == 4:
            return np.asfortranarray(array)
        if kind == 5:
            return array[..., ::-1] if array.ndim else array
        if kind == 6:
            return array[:0] if array.ndim else array
        if kind == 7:
            return array[None]
        if kind == 8:
            return np.resize(array, tuple(self.randrange(6) for _ in range(self.randrange(5))))
        if kind == 9:
            return np.broadcast_to(array.flat[0], array.shape) if array.size else array
        if kind == 10:
            return np.ma.masked_array(array, mask=self.one_in(2))
        if kind == 11:
            return array.tolist()
        if kind == 12:
            array.flags.writeable = False
            return array
        if kind == 13:
            plain = array.dtype.kind in "biuf"  # others have no buffer
            return memoryview(np.ascontiguousarray(array)) if plain else array
        if kind == 14:
            raw = np.frombuffer(b"\0" + array.tobytes(), np.uint8)[1:]  # misaligned
            return raw.view(array.dtype).reshape(array.shape)
        return self.choice(NUMBERS)

    def odd_tensor(self, tensor):
        kind = self.randrange(14)
        if kind < 6:
            array = self.odd_array(tensor.detach().numpy())
            try:
                return torch.as_tensor(array)
            except Exception:  # noqa: BLE001: not ours
                return array
        if kind == 6:
            return tensor.to("meta")
        if kind == 7:
            return tensor.to_sparse()
        if kind == 8:
            return tensor.to(self.choice([torch.bfloat16, torch.float16, torch.complex64,
                                          torch.bool, torch.int64, torch.uint8]))
        if kind == 9:
            return torch.quantize_per_tensor(tensor.detach().float(), 0.1, 0, torch.qint8)
        if kind == 10:
            return tensor.expand(2, *tensor.shape)
        if kind == 11:
            return torch.nn.Parameter(tensor.detach().clone()) if tensor.is_floating_point() \
                else tensor
        if kind == 12:
            return (tensor * 1j).conj().imag if tensor.is_floating_point() else tensor
        return torch._neg_view(tensor) if tensor.is_floating_point() else tensor


class World:
    """The arguments of one scene and what is asked of it, by a seed."""

    def __init__(self, seed):
        dice = self.dice = Dice(seed)
        self.dtype = dice.choice((np.float32, np.float32, np.float64))
        self.lighting = dice.choice(LIGHTINGS)
        self.count = dice.choice((None, None, 1, 2))
        scene = patch(self.dtype, self.lighting, self.count, seed=seed % 1000)
        self.arguments = {name: value for name, value in scene._arguments.items()}
        self.options = {name: dice.choice(values) for name, values in OPTIONS.items()}
        self.options["outputs"] = tuple(dice.sample(ALL, dice.randrange(len(ALL) + 1)))
        for _ in range(dice.choice((0, 0, 1, 1, 2, 3))):
            self._spoil()

    def _spoil(self):
        dice = self.dice
        if dice.one_in(4):
            name = dice.choice(list(self.options))
            self.options[name] = dice.choice(NUMBERS)
            return
        name = dice.choice(list(self.arguments))
        value = self.arguments[name]
        if dice.one_in(5):
            self.arguments.pop(name)
        elif isinstance(value, np.ndarray):
            self.arguments[name] = dice.odd_array(value)
        else:
            self.arguments[name] = dice.choice(NUMBERS)


def result_of(call):
    """What a call gives: its value, or the documented exception's type and message."""
    try:
        return call()
    except DOCUMENTED as error:
        assert str(error), f"{type(error).__name__} without a message"
        return f"{type(error).__name__}: {error}"


def images_of(frame):
    return {name: np.array(getattr(frame, name)) for name in frame.outputs + ("face_ids",)}


def bits(value):
    if isinstance(value, dict):
        return {name: bits(part) for name, part in value.items()}
    if isinstance(value, (list, tuple)):
        return [bits(part) for part in value]
    return (value.shape, value.dtype.str, value.tobytes()) if isinstance(value, np.ndarray) \
        else value


def all_finite(value, name=""):
    if isinstance(value, dict):
        return all(all_finite(part, key) for key, part in value.items())
    if isinstance(value, (list, tuple)):
        return all(all_finite(part, name) for part in value)
    return name == "depth" or not isinstance(value, np.ndarray) or bool(np.isfinite(value).all())


class RandomCalls(unittest.TestCase):
    SECONDS = 6

    def run_seeds(self, call):
        seed = int(os.environ.get("TILEGRAD_SEED", 1))
        seconds = float(os.environ.get("TILEGRAD_SECONDS", self.SECONDS))
        end, calls, done = time.monotonic() + seconds, 0, 0
        while time.monotonic() < end or calls == 0:
            try:
                with np.errstate(all="ignore"):
                    done += not isinstance(call(seed + calls), str)
            except Exception:
                traceback.print_exc()
                self.fail(f"TILEGRAD_SEED={seed + calls}")
            calls += 1
        print(f"{self.id()}: {calls} calls from seed {seed}, {done} without an error")
        self.assertTrue(done > 0 or calls < 50)

    def same_from_fresh_memory(self, call):
        """The value of call(renderer), whose bits do not depend on what memory held."""
        poison(0x7f)
        first = result_of(lambda: call(self.renderer))
        poison(0xc1)
        again = result_of(lambda: call(Renderer(threads=1)))
        assert bits(first) == bits(again), "bits differ between an old and a new renderer"
        assert all_finite(first), "a number is not finite"
        return first

    def setUp(self):
        self.renderer = Renderer(threads=2)
        self.addCleanup(poison, 0xff)

    def test_render_and_backward(self):
        def call(seed):
            world = World(seed)
            names = [name for name, value in world.arguments.items()
                     if value is not None and (name in GRADIENTS or world.dice.one_in(50))]
            wrt = tuple(world.dice.sample(names, world.dice.randrange(len(names) + 1)))
            odd = world.dice.one_in(6)
            given = world.dice.getrandbits(32)

            def step(renderer):
                scene = Scene(**world.arguments)
                frame = renderer.render(scene, **world.options)
                images = images_of(frame)
                dice, pulled = Dice(given), {}
                for name in frame.outputs:
                    if name not in ("barycentrics", "face_ids"):
                        image = np.random.default_rng(seed).uniform(-1, 1, images[name].shape)
                        pulled[name] = image.astype(frame.dtype)
                        if odd:
                            pulled[name] = dice.odd_array(pulled[name])
                gradients = renderer.backward(frame, wrt=wrt, **pulled)
                return images, dict(gradients._arrays)

            return self.same_from_fresh_memory(step)

        self.run_seeds(call)

    def test_parts(self):
        makers = (
            lambda d, n: Camera(**{k: n() for k in d.sample(
                ("rotation", "translation", "fx", "fy", "cx", "cy", "near_plane"), 3)}),
            lambda d, n: Camera.orbit(n(), n(), n(), width=n(), height=n()),
            lambda d, n: Camera.look_at(n(), n(), n(), width=n(), height=n()),
            lambda d, n: Camera.from_opencv(n(), n(), n()),
            lambda d, n: Camera.from_colmap(n(), n(), n(), n(), n(), n()),
            lambda d, n: Camera.from_opengl(n(), n(), width=n(), height=n()),
            lambda d, n: Camera.from_kaolin(n(), n(), n(), width=n(), height=n()),
            lambda d, n: Camera.from_pytorch3d(n(), n(), n(), n(), width=n(), height=n()),
            lambda d, n: Camera.from_nerf(n(), n(), n(), n(), n()),
            lambda d, n: Camera().to_opengl(width=n(), height=n(), far_plane=n()),
            lambda d, n: Camera().resize(n(), n(), n(), n()),
            lambda d, n: Light(n(), n()),
            lambda d, n: Surface(base_color=n(), ambient=n(), diffuse=n(), specular=n(),
                                 shininess=n(), texture=n()),
            lambda d, n: Texture(n(), n(), n()),
            lambda d, n: tilegrad.icosphere(n() if not d.one_in(2) else d.randrange(-2, 4), n()),
            lambda d, n: Renderer(threads=n()),
        )
        good = (1, 2.0, 34, (0, 0, 1), np.eye(3), np.eye(4), np.zeros(3), (1.0, 0.0, 0.0, 0.0),
                np.full((4, 5, 3), 0.5, np.float32))

        def call(seed):
            dice = Dice(seed)

            def number():
                value = dice.choice(good)
                return value if dice.one_in(2) else dice.odd_array(value)

            result = result_of(lambda: dice.choice(makers)(dice, number))
            return result if isinstance(result, str) else 0

        self.run_seeds(call)

    @needs_torch
    def test_torch(self):
        def call(seed):
            world = World(seed)
            dice = world.dice
            arguments = {name: torch.from_numpy(value.copy()) if isinstance(value, np.ndarray)
                         and value.dtype.kind in "fi" and value.dtype.isnative else value
                         for name, value in world.arguments.items()}
            for name, value in arguments.items():
                if isinstance(value, torch.Tensor) and dice.one_in(6):
                    arguments[name] = dice.odd_tensor(value)
                elif isinstance(value, torch.Tensor) and value.is_floating_point():
                    value.requires_grad_(dice.one_in(2))

            def step():
                images = tilegrad.torch.render(**arguments, **world.options)
                total = sum((image * 0.5).where(torch.isfinite(image), image * 0).sum()
                            for image in images if image is not None and image.requires_grad)
                if isinstance(total, torch.Tensor) and total.requires_grad:
                    total.backward()
                return [value.grad for value in arguments.values()
                        if isinstance(value, torch.Tensor) and value.is_leaf]

            return result_of(step)

        self.run_seeds(call)


    @needs_torch
    def test_ported_functions(self):
        f4 = {"dtype": torch.float32}
        pos = torch.tensor([[[-1, -1, 0.5, 1], [1, -1, 0.5, 1], [-1, 1, -0.5, 1]]], **f4)
        tri = torch.tensor([[0, 1, 2]], dtype=torch.int32)
        context = dr.RasterizeCpuContext() if hasattr(dr, "RasterizeCpuContext") \
            else dr.RasterizeCudaContext()
        rast, rast_db = dr.rasterize(context, pos, tri, (8, 8))
        attr, tex = torch.rand(1, 3, 2), torch.rand(1, 8, 8, 3)
        corners = torch.rand(1, 2, 3, 3) - 0.5
        calls = (
            (lambda p, t: dr.rasterize(context, p, t, (8, 8)), pos, tri),
            (dr.interpolate, attr, rast, tri),
            (lambda a, r, t, d: dr.interpolate(a, r, t, rast_db=d, diff_attrs="all"),
             attr, rast, tri, rast_db),
            (lambda t, u: dr.texture(t, u, filter_mode="linear"), tex, rast[..., :2]),
            (dr.antialias, tex, rast, pos, tri),
            (lambda z, c, f, n: kaolin.render.mesh.dibr_rasterization(8, 8, z, c, f, n),
             corners[..., 2], corners[..., :2], torch.rand(1, 2, 3, 2), torch.ones(1, 2)),
            (kaolin.render.mesh.texture_mapping, torch.rand(1, 4, 4, 2), torch.rand(1, 3, 5, 4)),
            (kaolin.metrics.render.mask_iou, torch.rand(2, 4, 4), torch.rand(2, 4, 4)),
            (tilegrad.torch.rotation_6d, torch.rand(2, 6)),
            (tilegrad.torch.lights, torch.rand(2, 3), torch.rand(2)),
            (tilegrad.torch.camera, torch.rand(3, 3), torch.rand(3)),
        )

        def call(seed):
            dice = Dice(seed)
            function, *given = dice.choice(calls)
            given = [dice.odd_tensor(x) if dice.one_in(3) else x for x in given]
            result = result_of(lambda: function(*given))
            return result if isinstance(result, str) else 0

        self.run_seeds(call)


@long_test
class RandomCallsLong(RandomCalls):
    """Four minutes of it: one for each of the tests above."""

    SECONDS = 60
