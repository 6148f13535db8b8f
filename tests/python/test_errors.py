# SPDX-License-Identifier: Apache-2.0
"""What scenes and the renderer refuse, and what they say of it."""

import array
import tempfile
import unittest
import warnings

import numpy as np

import tilegrad
from scenes import IMAGE, patch
from tilegrad import Camera, Light, Renderer, Surface, Texture, _arrays, files
from tilegrad._scene import DIFFERENTIABLE


class Picture:
    """An image of another library, which has its bytes without a dtype."""

    def __init__(self, image):
        self.image, self.__array_interface__ = image, image.__array_interface__


class Errors(unittest.TestCase):
    """Each names the function, the argument, what was expected and got."""

    def expect(self, error, text, call):
        with self.assertRaises(error) as caught:
            call()
        self.assertEqual(str(caught.exception), text)

    def expect_refused(self, cases):
        """cases: (error, text, what Scene.replace is given)."""
        for error, text, change in cases:
            self.expect(error, text, lambda: patch().replace(**change))

    def test_scenes(self):
        scene = patch()
        cases = [
            (ValueError, "Scene: positions has shape (16, 2), expected (V, 3)",
             {"positions": scene.positions[:, :2]}),
            (ValueError, "Scene: colors has shape (15, 3), expected (V, 3) with V = 16",
             {"colors": scene["colors"][:15]}),
            (ValueError, "Scene: colors has shape (3,), expected (V, 3) or (N, V, 3) with V = 16",
             {"colors": scene["colors"][0]}),
            (ValueError, "Scene: uvs has shape (18, 3, 2), expected (N, V, 2) with V = 16",
             {"per_corner": ()}),
            (ValueError, "Scene: camera has shape (3, 17), expected (N, 17) with N = 2",
             {"positions": np.stack([scene.positions] * 2), "camera": Camera(fx=[1, 2, 3])}),
            (TypeError, "Scene: faces has dtype float32, expected int32",
             {"faces": scene.faces.astype(np.float32)}),
            (TypeError, "Scene: camera must be a Camera, got list", {"camera": []}),
            (TypeError, "Scene: lights must be a Light or a sequence of them, got float",
             {"lights": 1.0}),
            (ValueError, "Scene: lighting is 'blinn', expected one of 'none', 'lambert', 'phong', "
             "'spherical_harmonics'", {"lighting": "blinn"}),
            (ValueError, "Scene: normals is 'hard', expected one of 'smooth', 'flat'",
             {"normals": "hard"}),
            (ValueError, "Scene: per_corner is 'uv', expected one of 'colors', 'uvs', 'normals', "
             "'attributes'", {"per_corner": "uv"}),
            (ValueError, "Scene: textures[0] has shape (5, 3), expected (Ht, Wt, 3) or "
             "(N, Ht, Wt, 3)", {"textures": np.zeros((5, 3), np.float32)}),
            (TypeError, "Scene.replace: no argument 'colour'", {"colour": 1}),
            (ValueError, "Scene: lights is an empty sequence; give None instead",
             {"lights": []}),
            (ValueError, "Scene: lights has records of leading axes () and (2,): they must be "
             "alike", {"lights": [Light(), Light(intensity=[1, 2])]}),
            (ValueError, "Surface: texture has shape (3,), expected () or (2,), one for each "
             "surface", {"surfaces": Surface(base_color=np.ones((2, 3)), texture=[0, 0, 0])}),
            (TypeError, "Scene: per_corner must be a name or a sequence of names, got int",
             {"per_corner": 3}),
            (ValueError, "Scene: per_corner has 'normals', but the scene has no normals",
             {"per_corner": ("uvs", "normals")}),
            (ValueError, "Scene: per_corner has 'uvs', but the scene has no uvs",
             {"uvs": None, "textures": None, "per_corner": "uvs"}),
        ]
        self.expect_refused(cases)
        self.expect(ValueError, "Texture: wrap is 'tile', expected one of 'repeat', 'clamp', "
                    "'mirror', 'repeat clamp', 'clamp mirror', 'mirror repeat', 'repeat mirror', "
                    "'clamp repeat', 'mirror clamp'", lambda: Texture(np.zeros((2, 2, 3)), "tile"))

    def test_scenes_of_wrong_types(self):
        self.expect_refused([
            (TypeError, "Scene: colors has dtype uint8, expected float32 from 0 to 1: divide by "
             "255", {"colors": np.full((16, 3), 255, np.uint8)}),
            (TypeError, "Scene: textures[1] has dtype uint8, expected float32 from 0 to 1: divide "
             "by 255", {"textures": [np.ones((2, 2, 3), np.float32),
                                     Texture(np.full((2, 2, 3), 255, np.uint8))]}),
            (TypeError, "Scene: colors has dtype uint8, expected float32 from 0 to 1: divide by "
             "255", {"colors": memoryview(np.full((16, 3), 255, np.uint8))}),
            (TypeError, "Scene: textures[0] has dtype uint8, expected float32 from 0 to 1: divide "
             "by 255", {"textures": Picture(np.full((2, 2, 3), 255, np.uint8))}),
            (TypeError, "Scene: two_sided must be bool, got 'no' (str)", {"two_sided": "no"}),
            (TypeError, "Scene: clamp must be bool, got 2 (int)", {"clamp": 2}),
            (ValueError, "Scene: normals is None, expected one of 'smooth', 'flat'",
             {"normals": None}),
            (ValueError, "Scene: faces has shape (0,), expected (F, 3)", {"faces": []}),
        ])

    def test_render(self):
        scene, render = patch(), Renderer().render
        bad = np.array(scene.positions)
        bad[4, 1] = np.nan
        cases = [
            (TypeError, "render: scenes must be a Scene or a list of them, got ndarray",
             lambda: render(scene.positions)),
            (TypeError, "render: scenes[1] must be a Scene, got int", lambda: render([scene, 1])),
            (TypeError, "render: scenes[1] is float64, expected float32 as scenes[0]",
             lambda: render([scene, patch(np.float64)])),
            (TypeError, "render: width must be int, got 3.5 (float)",
             lambda: render(scene, width=3.5)),
            (ValueError, "render: width is 0, must be in 1..16384 pixels",
             lambda: render(scene, width=0)),
            (ValueError, f"render: height is {2**40}, out of int32's range",
             lambda: render(scene, height=2**40)),
            (TypeError, "render: delta must be float, got 'soft' (str)",
             lambda: render(scene, delta="soft")),
            (TypeError, "render: delta must be float, got '1' (str)",
             lambda: render(scene, delta="1")),
            (ValueError, "render: delta is out of float's range",
             lambda: render(scene, delta=10**400)),
            (TypeError, "render: outputs must be a name or a sequence of names, got int",
             lambda: render(scene, outputs=3)),
            (ValueError, "render: paper_faces is -1, must be >= 0",
             lambda: render(scene, paper_faces=-1)),
            (ValueError, "render: outputs is 'colour', expected one of 'color', 'alpha', "
             "'attributes', 'depth', 'normals', 'uv', 'barycentrics'",
             lambda: render(scene, outputs=("colour",))),
            (ValueError, "render: outputs has 'attributes', but a scene has none",
             lambda: render(scene.replace(attributes=None), outputs="attributes")),
        ]
        for error, text, call in cases:
            self.expect(error, text, call)
        for text, change in ((r"^render: scene 0: faces\[0,2\] is 99", {"faces": [[0, 1, 99]]}),
                             (r"^render: scene 0: positions\[4,1\]", {"positions": bad})):
            moved = {"uvs": None, "textures": None, "surfaces": None, "face_surfaces": None,
                     "per_corner": ()}
            self.assertRaisesRegex(ValueError, text, render, scene.replace(**moved, **change))

    def test_backward(self):
        renderer = Renderer()
        frame = renderer.render(patch(), **IMAGE)
        ones = np.ones_like(frame.alpha)
        cases = [
            (TypeError, "backward: frame must be a Frame, got NoneType",
             lambda: renderer.backward(None)),
            (ValueError, "backward: alpha has shape (3, 3), expected (1, 29, 34)",
             lambda: renderer.backward(frame, alpha=np.ones((3, 3)))),
            (ValueError, "backward: depth was not rendered: outputs=('color', 'alpha')",
             lambda: renderer.backward(frame, depth=ones)),
            (ValueError, "backward: wrt has 'sh', but a scene has none",
             lambda: renderer.backward(frame, alpha=ones, wrt="sh")),
            (ValueError, "backward: wrt is 'vertices', expected one of "
             + ", ".join(repr(name) for name in DIFFERENTIABLE),
             lambda: renderer.backward(frame, alpha=ones, wrt="vertices")),
            (ValueError, "backward: accumulate=True needs out",
             lambda: renderer.backward(frame, alpha=ones, accumulate=True)),
            (TypeError, "backward: out[0] must be Gradients, got int",
             lambda: renderer.backward(frame, alpha=ones, out=[3])),
            (ValueError, "backward: out[1] is there twice; each scene has its own",
             lambda: renderer.backward(frame, alpha=ones,
                                       out=2 * [renderer.backward(frame, alpha=ones)])),
            (TypeError, "backward: out must be Gradients or a list of them, got int",
             lambda: renderer.backward(frame, alpha=ones, out=3)),
            (TypeError, "backward: wrt must be a name or a sequence of names, got int",
             lambda: renderer.backward(frame, alpha=ones, wrt=3)),
            (TypeError, "backward: accumulate must be bool, got 'no' (str)",
             lambda: renderer.backward(frame, alpha=ones, accumulate="no")),
        ]
        for error, text, call in cases:
            self.expect(error, text, call)
        self.expect(ValueError, "backward: alpha[0] is nan",
                    lambda: renderer.backward(frame, alpha=np.full_like(ones, np.nan)))
        small = renderer.backward(renderer.render(patch(positions=np.zeros((16, 3), "f4")),
                                                  **IMAGE), alpha=ones)
        small._arrays["positions"] = np.zeros((4, 3), np.float32)
        self.expect(ValueError, "backward: positions has shape (4, 3), expected (16, 3)",
                    lambda: renderer.backward(frame, alpha=ones, out=small))
        fixed = np.zeros((16, 3), np.float32)
        fixed.flags.writeable = False
        small._arrays["positions"] = fixed
        self.expect(ValueError, "backward: positions is read-only",
                    lambda: renderer.backward(frame, alpha=ones, out=small))

    def test_icosphere(self):
        for radius in (float("nan"), float("inf"), 0.0, -1.0):
            self.expect(ValueError, f"icosphere: radius is {radius:g}, must be finite and > 0",
                        lambda: tilegrad.icosphere(1, radius))

    def test_renderer(self):
        self.expect(ValueError, "Renderer: threads is -1, must be in 0..1024",
                    lambda: Renderer(-1))
        self.expect(TypeError, "Renderer: threads must be int, got 'all' (str)",
                    lambda: Renderer("all"))

    def test_cameras(self):
        cameras = Camera(fx=[1, 2])
        for numbers, got in (([0] * 17, "list"), (np.zeros(5), "shape (5,)")):
            self.expect(ValueError, f"Camera: numbers have {got}, expected an array (..., 17)",
                        lambda: Camera.of_numbers(numbers))
        self.expect(ValueError, "Camera: numbers have shape (2,), expected an array (..., 17)",
                    lambda: cameras[:, 0])
        self.expect(ValueError, "Camera.resize: to_width is 0, to_height 4; both must be above 0",
                    lambda: cameras.resize(4, 4, 0, 4))
        scenes = [patch(camera=Camera(size=(side, side))) for side in (16, 8)]
        self.expect(ValueError, "render: the scenes' cameras are for images of 8 x 8 and 16 x 16 "
                    "pixels; make them one size, with camera.resize",
                    lambda: Renderer().render(scenes))
        self.expect(ValueError, "render: width is 0, expected 1..16384 pixels",
                    lambda: Renderer().render(scenes[0], width=0, height=16))

    def test_names_in_a_scene(self):
        self.assertIn("colors", patch())
        self.assertNotIn("sh", patch())
        self.assertNotIn(3, patch())

    def test_the_engine_goes_on_after_an_error(self):
        renderer, scene = Renderer(), patch()
        expected = np.array(renderer.render(scene, **IMAGE).color)
        self.assertRaises(ValueError, renderer.render, scene, width=-1)
        self.assertTrue(np.array_equal(renderer.render(scene, **IMAGE).color, expected))

    def test_colors_that_look_like_bytes_warn(self):
        """0 to 255 in floating point, of which most is above 1; highlights of a picture are not."""
        scene = patch()
        bytes_ = np.rint(np.asarray(scene["colors"]) * 254 + 1).astype(np.float32)
        for change in ({"colors": bytes_}, {"textures": np.full((4, 4, 3), 128.0)}):
            with self.assertWarnsRegex(RuntimeWarning, "Scene: (colors|textures).*divide by 255"):
                scene.replace(**change)
        bright = np.asarray(scene["colors"]).copy()
        bright[0] = 9
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            scene.replace(colors=bright)
            scene.replace(textures=np.full((4, 4, 3), 1.0))

    def test_numbers_have_the_index_of_their_array(self):
        scene = patch()
        faces, positions = np.array(scene.faces), np.array(scene.positions)
        faces[2, 0], positions[4, 1] = 99, np.nan
        renderer = Renderer(1)
        for change, text in (({"faces": faces}, r"faces\[2,0\] is 99, outside of \[0, 16\)"),
                             ({"positions": positions}, r"positions\[4,1\] is nan"),
                             ({"positions": np.stack([scene.positions, positions])},
                              r"positions\[4,1\] is nan")):
            with self.assertRaisesRegex(ValueError, "render: .*" + text):
                renderer.render(scene.replace(**change), **IMAGE)
        plain = scene.replace(uvs=None, textures=None, surfaces=None, face_surfaces=None,
                              per_corner=())
        more = plain.replace(positions=np.zeros((20, 3), np.float32), colors=np.ones((20, 3)),
                             attributes=np.ones((20, 2)))
        more["attributes"][19, 1] = np.nan
        with self.assertRaisesRegex(ValueError, r"^render: scene 1: attributes\[19,1\] is nan"):
            renderer.render([plain, more], **IMAGE, outputs=("attributes",))
        frame = renderer.render(scene, **IMAGE)
        positions = scene.positions.copy()
        scene.positions[3, 2] = np.inf
        with self.assertRaisesRegex(ValueError, r"^backward: scene 0: positions\[3,2\] is inf"):
            renderer.backward(frame, color=np.ones_like(frame.color))
        scene.positions[...] = positions
        uvs = np.array(scene["uvs"])
        index = (3, 2, 1)[:uvs.ndim]
        uvs[index] = np.inf
        with self.assertRaisesRegex(ValueError, r"uvs\[" + ",".join(map(str, index)) + r"\] is inf"):
            renderer.render(scene.replace(uvs=uvs), **IMAGE, outputs=("uv",))


# What callers give as arrays: shared where it may be, copied once where not, refused precisely.

class DlpackOnly:
    """An array of another library, as far as tilegrad sees."""

    def __init__(self, values, device=1):
        self._values, self._device = values, device

    def __dlpack__(self, stream=None):
        return self._values.__dlpack__()

    def __dlpack_device__(self):
        return (self._device, 0)


def take(value, dtype=np.float32, shape=("V", 3), sizes=None):
    return _arrays.as_array("render", "positions", value, dtype, shape, sizes)


class Shared(unittest.TestCase):
    def setUp(self):
        tilegrad.reset_stats()

    def test_what_is_right_is_not_copied(self):
        values = np.arange(6, dtype=np.float32).reshape(2, 3)
        buffers = [values, memoryview(values), DlpackOnly(values), values.view(np.matrix)]
        for value in buffers:
            got = take(value)
            self.assertTrue(np.shares_memory(got, values))
        self.assertEqual(tilegrad.stats(), {"arrays": 4, "copies": 0, "bytes_copied": 0})

    def test_what_is_not_is_copied_once(self):
        values = np.arange(12, dtype=np.float32).reshape(2, 6)
        for wrong in (values[:, ::2], np.asfortranarray(values[:, :3]), values[:, :3].astype("f8"),
                      values[:, :3].astype("i8"), values[:, :3].astype(">f4")):
            tilegrad.reset_stats()
            got = take(wrong)
            self.assertTrue(np.array_equal(got, wrong))
            self.assertTrue(got.flags.c_contiguous)
            self.assertEqual(got.dtype, np.float32)
            self.assertEqual(tilegrad.stats(), {"arrays": 1, "copies": 1, "bytes_copied": 24})

    def test_what_is_not_aligned_is_copied(self):
        memory = np.zeros(25, np.uint8)[1:]
        values = memory.view(np.float32).reshape(2, 3)
        values[:] = np.arange(6).reshape(2, 3)
        self.assertFalse(values.flags.aligned)
        got = take(values)
        self.assertTrue(got.flags.aligned)
        self.assertTrue(np.array_equal(got, values))
        self.assertEqual(tilegrad.stats(), {"arrays": 1, "copies": 1, "bytes_copied": 24})

    def test_numbers_and_buffers(self):
        self.assertEqual(take([[1, 2, 3.5]]).dtype, np.float32)
        self.assertEqual(take(array.array("f", [1, 2, 3]), shape=(3,)).tolist(), [1, 2, 3])
        self.assertEqual(take(2, shape=()).shape, ())
        self.assertEqual(take(np.float64(2), shape=()).shape, ())
        self.assertEqual(tilegrad.stats(), {"arrays": 4, "copies": 0, "bytes_copied": 0})

    def test_dtype_to_compute_in(self):
        for value, expected in ((np.zeros(3), "f8"), (np.zeros(3, "f4"), "f4"), ([0.0], "f4"),
                                (DlpackOnly(np.zeros(3)), "f8"), (np.zeros(3, int), "f4")):
            self.assertEqual(_arrays.float_dtype("f", "a", value), np.dtype(expected))


class Refused(unittest.TestCase):
    def expect(self, error, text, *args, **kwargs):
        with self.assertRaises(error) as caught:
            take(*args, **kwargs)
        self.assertEqual(str(caught.exception), text)

    def test_no_arrays(self):
        for value in (None, "abc", {"a": 1}, [[1, 2, 3], [4, 5]], object()):
            with self.assertRaisesRegex(TypeError, "^render: positions is not an array of numbers"):
                take(value)

    def test_masked_numbers(self):
        positions = np.ma.masked_invalid(np.full((4, 3), np.nan))
        positions[1:] = 1
        for dtype in (np.float32, np.float64):
            self.expect(TypeError, "render: positions is a masked array, and 3 of its numbers are "
                        "masked; fill them first, with filled()", positions, dtype)
        row = np.ma.masked_array([0.0, 1.0, 2.0], mask=[False, True, False])
        for rows in ([row, row], (row.filled(0), row, [1.0, np.ma.masked, 2.0])):
            self.expect(TypeError, "render: positions holds masked arrays, and 2 of its numbers "
                        "are masked; fill them first, with filled()", rows, np.float32)
        endless = []
        endless.append(endless)
        with self.assertRaisesRegex(TypeError, "^render: positions is not an array of numbers"):
            take(endless)
        self.assertTrue((take(positions.filled(2))[0] == 2).all())
        whole = np.ma.masked_array(np.ones((4, 3), np.float32), mask=False)
        self.assertTrue(np.shares_memory(take(whole), whole.data))
        with tempfile.TemporaryDirectory() as folder:
            for save in (lambda: files.save_image(f"{folder}/a.png", positions),
                         lambda: files.save_image(f"{folder}/a.npy", positions),
                         lambda: files.save_weights(f"{folder}/a.npz", {"a": positions})):
                self.assertRaisesRegex(TypeError, "is a masked array", save)

    def test_other_devices(self):
        with self.assertRaisesRegex(TypeError, "^render: positions is on another device"):
            take(DlpackOnly(np.zeros((4, 3), np.float32), device=2))
