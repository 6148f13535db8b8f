# SPDX-License-Identifier: Apache-2.0
"""The renderer: images and gradients in their shapes, batches, memory, errors."""

import gc
import pickle
import unittest
import weakref

import numpy as np

import tilegrad
from scenes import ALL, IMAGE, LIGHTINGS, cotangents, patch
from tilegrad import Camera, Light, Renderer, Scene, Surface, Texture, files

H, W = IMAGE["height"], IMAGE["width"]


class Picture:
    """An image of another library, which has its bytes without a dtype."""

    def __init__(self, image):
        self.image, self.__array_interface__ = image, image.__array_interface__


def images(frame):
    return {name: np.array(getattr(frame, name)) for name in (*frame.outputs, "face_ids")}


class Images(unittest.TestCase):
    def test_shapes_and_dtypes(self):
        for dtype in (np.float32, np.float64):
            frame = Renderer().render(patch(dtype, count=3), outputs=ALL, **IMAGE)
            self.assertEqual(len(frame), 3)
            channels = {"color": 3, "attributes": 2, "normals": 3, "uv": 2, "barycentrics": 2}
            for name in ALL:
                image = getattr(frame, name)
                lead = (3, channels[name]) if name in channels else (3,)
                self.assertEqual(image.shape, lead + (H, W), name)
                self.assertEqual(image.dtype, dtype)
                self.assertFalse(image.flags.writeable)
            self.assertEqual(frame.face_ids.shape, (3, H, W))
            self.assertEqual(frame.face_ids.dtype, np.int32)
            seen = frame.face_ids >= 0
            self.assertGreater(seen.sum(), 900)
            self.assertTrue(np.array_equal(seen, np.isfinite(frame.depth)))
            self.assertTrue(np.array_equal(seen, frame.alpha == 1))
            self.assertLessEqual(frame.alpha_error_bound, 1e-6)
            self.assertEqual(frame.dtype, dtype)

    # Colours, alpha and attributes are below 2, depth is about 2: 1e-4 is 400 roundings of them.
    def test_float_and_double_agree(self):
        for lighting in LIGHTINGS:
            single = Renderer().render(patch(np.float32, lighting), outputs=ALL, **IMAGE)
            double = Renderer().render(patch(np.float64, lighting), outputs=ALL, **IMAGE)
            self.assertTrue(np.array_equal(single.face_ids, double.face_ids))
            for name in ALL:
                np.testing.assert_allclose(getattr(single, name), getattr(double, name), rtol=0,
                                           atol=1e-4, err_msg=name)

    def test_only_what_is_asked_for_is_there(self):
        scene = patch()
        frame = Renderer().render(scene, outputs="alpha", **IMAGE)
        self.assertEqual(frame.outputs, ("alpha",))
        with self.assertRaisesRegex(AttributeError, "depth was not rendered"):
            frame.depth
        self.assertEqual(frame.scenes, (scene,))

    def test_a_batch_is_its_images(self):
        """An array with a leading axis, a list of scenes, and scenes alone give the same bits."""
        renderer, count = Renderer(), 4
        batch = patch(count=count)
        alone = [batch.replace(positions=batch.positions[n], colors=batch["colors"][n],
                               camera=batch.camera[n], lights=Light.of_numbers(batch["lights"][n]),
                               textures=Texture(batch._arguments["textures"].texels[n], "clamp"))
                 for n in range(count)]
        together = images(renderer.render(batch, outputs=ALL, **IMAGE))
        listed = images(renderer.render(alone, outputs=ALL, **IMAGE))
        mixed = images(renderer.render([alone[0], batch], outputs=ALL, **IMAGE))
        for name, image in together.items():
            self.assertTrue(np.array_equal(image, listed[name]), name)
            self.assertTrue(np.array_equal(image, mixed[name][1:]), name)
            for n, scene in enumerate(alone):
                one = images(renderer.render(scene, outputs=ALL, **IMAGE))
                self.assertTrue(np.array_equal(image[n:n + 1], one[name]), name)

    def test_none_is_a_batch_too(self):
        frame = Renderer().render([], width=5, height=4)
        self.assertEqual(frame.color.shape, (0, 3, 4, 5))
        self.assertEqual(Renderer().backward(frame, alpha=np.zeros((0, 4, 5))), [])

    def test_options_reach_the_engine(self):
        renderer, scene = Renderer(), patch()
        base = images(renderer.render(scene, **IMAGE))
        flipped = scene.replace(faces=np.ascontiguousarray(scene.faces[:, ::-1]), per_corner=(),
                                uvs=np.zeros((16, 2), np.float32))
        self.assertEqual((renderer.render(flipped, culling="back", **IMAGE).face_ids >= 0).sum(), 0)
        for change in ({"delta": 1e-2}, {"interpolation": "screen_linear"},
                       {"alpha_rule": "paper", "paper_box": 0.5, "paper_faces": 1},
                       {"max_alpha_error": 0.2}):
            other = images(renderer.render(scene, **{**IMAGE, **change}))
            self.assertFalse(all(np.array_equal(base[name], other[name]) for name in base), change)
        self.assertTrue(np.isinf(renderer.render(scene, alpha_rule="paper").alpha_error_bound))

    def test_what_is_taken_away_is_not_per_corner(self):
        scene = patch()
        plain = scene.replace(uvs=None, textures=None, surfaces=None, face_surfaces=None)
        self.assertIsNone(plain["uvs"])
        self.assertIsNotNone(plain.replace(uvs=scene["uvs"], per_corner="uvs")["uvs"])
        image = files.MeshTexture("one", np.full((2, 2, 3), 255, np.uint8))
        mesh = files.Mesh(scene.positions, scene.faces, textures=[image],
                          corner_uvs=np.zeros((18, 3, 2), np.float32),
                          materials=[files.Material(texture=0)])
        camera = Camera()
        self.assertIsNotNone(mesh.scene(camera)["uvs"])
        plain = mesh.scene(camera, uvs=None, textures=None, surfaces=None, face_surfaces=None)
        self.assertIsNone(plain["uvs"])

    def test_textures(self):
        """Four texels, seen straight on: where they land, how they wrap."""
        positions = [(-1, -1, -1), (1, -1, -1), (1, 1, -1), (-1, 1, -1)]
        texels = np.arange(12, dtype=np.float32).reshape(2, 2, 3) / 12
        quad = Scene(positions, [(0, 1, 2), (0, 2, 3)], Camera(fx=2, fy=2, cx=2, cy=2),
                     uvs=[(0, 0), (1, 0), (1, 1), (0, 1)], textures=Texture(texels, "clamp",
                                                                            "nearest"))
        got = Renderer().render(quad, width=4, height=4).color[0].transpose(1, 2, 0)
        np.testing.assert_allclose(got, texels.repeat(2, 0).repeat(2, 1), atol=1e-6)
        shifted = quad.replace(uvs=[(1, 0), (2, 0), (2, 1), (1, 1)],
                               textures=Texture(texels, "repeat", "nearest"))
        again = Renderer().render(shifted, width=4, height=4).color[0].transpose(1, 2, 0)
        np.testing.assert_allclose(again, got, atol=1e-6)


class Gradients(unittest.TestCase):
    NAMES = ("positions", "camera", "colors", "uvs", "textures", "surfaces", "attributes")

    def names(self, lighting):
        extra = {"none": (), "spherical_harmonics": ("sh",)}.get(lighting, ("lights",))
        return self.NAMES + extra

    def flat(self, scene, name):
        """The numbers of a scene's part, to be changed in place; a rebuilt scene sees them."""
        if name == "textures":
            return scene._arguments["textures"].texels.reshape(-1)
        if name in ("camera", "lights"):
            return scene._arguments[name].numbers.reshape(-1)
        if name == "surfaces":
            return scene._arguments["surfaces"][0].numbers.reshape(-1)
        return scene[name].reshape(-1)

    def test_float64_differences(self):
        """Directional derivatives along random directions, central differences with step h of a
        smooth loss: their error is h^2 f'''/6 plus rounding 1e-16/h; both are below 1e-6 of the
        derivative for the loss here with h = 1e-6. Alpha's kernel exp(-d^2/delta) has the largest
        third derivative, delta^-1.5 = 3e4."""
        renderer, h = Renderer(), 1e-6
        outputs = ("color", "alpha", "attributes", "depth", "normals", "uv")
        for lighting in LIGHTINGS:
            scene = patch(np.float64, lighting)
            frame = renderer.render(scene, outputs=outputs, **IMAGE)
            self.assertGreater((frame.face_ids >= 0).sum(), 300)
            pulled = cotangents(frame, outputs)
            got = renderer.backward(frame, wrt=self.names(lighting), **pulled)

            def loss():
                moved = renderer.render(scene.replace(), outputs=outputs, **IMAGE)
                self.assertTrue(np.array_equal(moved.face_ids, frame.face_ids))
                return sum((pulled[n] * np.where(np.isfinite(getattr(moved, n)),
                                                 getattr(moved, n), 0)).sum() for n in outputs)

            for name in self.names(lighting):
                values, gradient = self.flat(scene, name), getattr(got, name)
                gradient = gradient[0] if name == "textures" else gradient
                gradient = getattr(gradient, "numbers", gradient)
                gradient = (gradient[0] if name == "surfaces" else gradient).reshape(-1)
                direction = np.random.default_rng(1).uniform(-1, 1, values.shape)
                if name == "camera":
                    direction[16] = 0  # the near plane has no gradient
                kept = values.copy()
                values[:] = kept + h * direction
                above = loss()
                values[:] = kept - h * direction
                below = loss()
                values[:] = kept
                expected = (above - below) / (2 * h)
                self.assertAlmostEqual(gradient @ direction, expected,
                                       delta=1e-5 * max(1, abs(expected)), msg=(lighting, name))

    def test_shapes_are_those_of_the_scene(self):
        renderer = Renderer()
        for dtype in (np.float32, np.float64):
            for count in (None, 3):
                scene = patch(dtype, count=count)
                frame = renderer.render(scene, outputs=("color", "alpha", "attributes"), **IMAGE)
                got = renderer.backward(frame, wrt=self.names("phong"),
                                        **cotangents(frame, frame.outputs))
                for name in ("positions", "colors", "uvs", "attributes"):
                    self.assertEqual(getattr(got, name).shape, scene[name].shape, name)
                    self.assertEqual(getattr(got, name).dtype, dtype)
                self.assertEqual(got.camera.rotation.shape, scene.camera.rotation.shape)
                self.assertEqual(got.lights.direction.shape, scene["lights"].shape[:-1] + (3,))
                self.assertEqual(got.surfaces.base_color.shape, (2, 3))
                self.assertEqual(got.textures[0].shape[-3:], (4, 5, 3))
                self.assertEqual(set(got), set(self.names("phong")))

    def test_what_images_share_gets_the_sum(self):
        """In the order of images: the batch's sum is that of its parts."""
        renderer = Renderer()
        cameras = Camera(fx=30, fy=31, cx=[16.0, 17, 18], cy=14)
        scene = patch(np.float64, camera=cameras)
        frame = renderer.render(scene, **IMAGE)
        pulled = cotangents(frame)
        names = ("positions", "colors", "uvs", "textures", "surfaces", "lights")
        together = renderer.backward(frame, wrt=names, **pulled)
        parts = [scene.replace(camera=cameras[n]) for n in range(3)]
        frame = renderer.render(parts, **IMAGE)
        apart = renderer.backward(frame, wrt=names, **pulled)
        self.assertEqual(len(apart), 3)
        for name in names:
            values = [getattr(g, name) for g in (together, *apart)]
            values = [v[0] if name == "textures" else getattr(v, "numbers", v) for v in values]
            self.assertTrue(np.any(values[0] != 0), name)
            np.testing.assert_allclose(values[0], sum(values[1:]), rtol=1e-12, atol=1e-13)

    def test_out_is_overwritten_or_added_to(self):
        renderer = Renderer()
        scene = patch()
        frame = renderer.render(scene, **IMAGE)
        pulled = cotangents(frame)
        names = ("positions", "camera", "surfaces", "lights", "textures")
        first = renderer.backward(frame, wrt=names, **pulled)
        kept = {name: np.array(value) for name, value in self.arrays(first).items()}
        same = renderer.backward(frame, out=first, **pulled)
        for name, value in self.arrays(first).items():
            self.assertIs(self.arrays(same)[name], value)
            self.assertTrue(np.array_equal(value, kept[name]))
        renderer.backward(frame, out=first, accumulate=True, **pulled)
        for name, value in self.arrays(first).items():
            np.testing.assert_allclose(value, 2 * kept[name], rtol=1e-6)

    def test_wrt_may_be_one_name_with_out(self):
        renderer = Renderer()
        frame = renderer.render(patch(), **IMAGE)
        pulled = cotangents(frame)
        first = renderer.backward(frame, wrt="positions", **pulled)
        expected = np.array(first.positions)
        renderer.backward(frame, wrt="positions", out=first, **pulled)
        self.assertTrue(np.array_equal(first.positions, expected))
        with self.assertRaisesRegex(ValueError, "wrt is .'camera',"):
            renderer.backward(frame, wrt="camera", out=first, **pulled)

    @staticmethod
    def arrays(gradients):
        return {name: value[0] if name == "textures" else value
                for name, value in gradients._arrays.items()}

    def test_default_is_positions(self):
        renderer = Renderer()
        frame = renderer.render(patch(), **IMAGE)
        got = renderer.backward(frame, alpha=np.ones_like(frame.alpha))
        self.assertEqual(list(got), ["positions"])
        with self.assertRaisesRegex(AttributeError, "colors was not asked for"):
            got.colors
        self.assertEqual(renderer.backward(frame, alpha=frame.alpha, wrt="uvs").uvs.shape,
                         (18, 3, 2))

    def test_surfaces_without_any(self):
        """The default surface has gradients, too."""
        renderer = Renderer()
        scene = patch(surfaces=None, face_surfaces=None)
        frame = renderer.render(scene, **IMAGE)
        got = renderer.backward(frame, color=np.ones_like(frame.color), wrt="surfaces").surfaces
        self.assertEqual(got.base_color.shape, (1, 3))
        self.assertTrue((got.base_color > 1).all())


class Copies(unittest.TestCase):
    def test_a_step_copies_nothing(self):
        renderer = Renderer()
        for dtype in (np.float32, np.float64):
            for count in (None, 3):
                kept = patch(dtype, count=count)
                tilegrad.reset_stats()
                scene = Scene(**kept._arguments)
                frame = renderer.render(scene, **IMAGE)
                renderer.backward(frame, **cotangents(frame))
                counts = tilegrad.stats()
                self.assertEqual((counts["copies"], counts["bytes_copied"]), (0, 0))
                self.assertGreater(counts["arrays"], 8)
                for name in ("positions", "faces", "colors", "uvs", "attributes"):
                    self.assertIs(scene[name], kept._arguments[name])

    def test_what_must_be_copied_is_counted(self):
        scene = patch()
        tilegrad.reset_stats()
        scene.replace(faces=scene.faces.astype(np.int64))
        self.assertEqual(tilegrad.stats()["copies"], 1)
        self.assertEqual(tilegrad.stats()["bytes_copied"], scene.faces.nbytes)
        scene.replace(colors=np.asfortranarray(scene["colors"]))
        scene.replace(colors=scene["colors"].astype(np.float64))
        scene.replace(positions=np.asfortranarray(scene.positions))
        self.assertEqual(tilegrad.stats()["copies"], 4)
        frame = Renderer().render(scene, **IMAGE)
        Renderer().backward(frame, alpha=np.ones(frame.alpha.shape))
        self.assertEqual(tilegrad.stats()["copies"], 5)

    def test_changes_in_place_are_seen(self):
        """Scenes are views: moving the array moves the mesh."""
        renderer, scene = Renderer(), patch()
        before = np.array(renderer.render(scene, **IMAGE).alpha)
        scene.positions[:, 0] += 0.2
        self.assertFalse(np.array_equal(before, renderer.render(scene, **IMAGE).alpha))

    def test_other_arrays(self):
        """The buffer protocol and DLPack, for scenes and cotangents."""
        plain = patch()

        class Dlpack:
            def __init__(self, values):
                self.values = values

            def __dlpack__(self, stream=None):
                return self.values.__dlpack__()

            def __dlpack_device__(self):
                return self.values.__dlpack_device__()

        wrapped = plain.replace(positions=Dlpack(plain.positions), faces=memoryview(plain.faces),
                                colors=memoryview(plain["colors"]))
        self.assertTrue(np.shares_memory(wrapped.positions, plain.positions))
        self.assertTrue(np.shares_memory(wrapped.faces, plain.faces))
        renderer = Renderer()
        frame = renderer.render(wrapped, **IMAGE)
        expected = renderer.render(plain, **IMAGE)
        self.assertTrue(np.array_equal(frame.color, expected.color))
        weights = np.array(frame.alpha)
        got = renderer.backward(frame, alpha=Dlpack(weights))
        self.assertTrue(np.array_equal(got.positions,
                                       renderer.backward(frame, alpha=weights).positions))


class Memory(unittest.TestCase):
    def test_views_keep_their_frame(self):
        """Whatever is deleted and rendered after: an image stays what it was."""
        renderer = Renderer()
        scene = patch()
        frame = renderer.render(scene, outputs=ALL, **IMAGE)
        kept = {name: (getattr(frame, name), np.array(getattr(frame, name)))
                for name in (*ALL, "face_ids")}
        shared = frame.shared("color")
        del frame
        gc.collect()
        for _ in range(8):
            other = renderer.render(patch(seed=3), outputs=ALL, **IMAGE)
            del other
        del renderer, scene
        gc.collect()
        for name, (view, copy) in kept.items():
            self.assertTrue(np.array_equal(view, copy), name)
        self.assertTrue(np.array_equal(shared, kept["color"][1]))

    def test_frames_are_independent(self):
        renderer = Renderer()
        frames = [renderer.render(patch(seed=seed), **IMAGE) for seed in range(5)]
        for seed, frame in enumerate(frames):
            self.assertTrue(np.array_equal(frame.color,
                                           Renderer().render(patch(seed=seed), **IMAGE).color))

    def test_a_frame_keeps_its_scene(self):
        """backward reads the scene's arrays, long after anybody else has forgotten them."""
        renderer = Renderer()
        expected = renderer.render(patch(), **IMAGE)
        pulled = cotangents(expected)
        expected = renderer.backward(expected, **pulled).positions
        frame = renderer.render(patch(), **IMAGE)
        gc.collect()
        junk = [np.full((16, 3), np.nan, np.float32) for _ in range(100)]
        self.assertTrue(np.array_equal(renderer.backward(frame, **pulled).positions, expected))
        del junk

    def test_memory_is_reused_and_released(self):
        renderer = Renderer()
        scene, places = patch(), set()
        for _ in range(10):
            frame = renderer.render(scene, **IMAGE)
            places.add(frame.color.ctypes.data)
        self.assertLessEqual(len(places), 3)
        gone = weakref.ref(scene.positions)
        del frame, scene
        gc.collect()
        self.assertIsNone(gone())

    def test_shared_arrays_can_be_written_to(self):
        frame = Renderer().render(patch(), **IMAGE)
        self.assertTrue(frame.shared("color").flags.writeable)
        self.assertTrue(np.shares_memory(frame.shared("color"), frame.color))
        with self.assertRaisesRegex(AttributeError, "uv was not rendered"):
            frame.shared("uv")


class Scenes(unittest.TestCase):
    def test_pickle(self):
        scene = patch(count=2)
        again = pickle.loads(pickle.dumps(scene))
        renderer = Renderer()
        self.assertTrue(np.array_equal(renderer.render(scene, **IMAGE).color,
                                       renderer.render(again, **IMAGE).color))
        self.assertEqual(repr(again), "<tilegrad.Scene: 2 images, 16 vertices, 18 faces, float32>")

    def test_lists_of_records(self):
        """One Light of two, or two Lights; likewise surfaces."""
        scene = patch()
        two = [Light(d, i) for d, i in zip(scene._arguments["lights"].direction, (0.8, 0.3))]
        self.assertTrue(np.array_equal(scene.replace(lights=two)["lights"], scene["lights"]))
        each = scene._arguments["surfaces"]
        joined = Surface(ambient=[s.ambient for s in each], texture=[0, 0])
        got = Renderer().render([scene, scene.replace(surfaces=joined)], **IMAGE).color
        self.assertTrue(np.array_equal(got[0], got[1]))

    def test_surfaces_keep_their_textures(self):
        pair = Surface(base_color=np.ones((2, 3)), texture=[1, 0])
        self.assertEqual(pair.replace(shininess=3).textures(), [1, 0])
        self.assertEqual(pair.replace(texture=-1).textures(), [-1, -1])
        self.assertEqual([one.textures() for one in pair], [[1], [0]])
        self.assertEqual(pair[1:].textures(), [0])
        self.assertEqual(pair.replace(texture=1)[0].textures(), [1])
        self.assertEqual(Surface.of_numbers(pair.numbers).textures(), [-1, -1])
        self.assertIn("texture=[1, 0]", repr(pair))
        scene = patch(surfaces=pair, textures=[np.full((2, 2, 3), v, np.float32) for v in (1, 2)])
        for other in (list(pair), pair.replace(base_color=(1, 1, 1))):
            self.assertTrue(np.array_equal(
                Renderer().render(scene.replace(surfaces=other), **IMAGE).color,
                Renderer().render(scene, **IMAGE).color))

    def test_lists_of_numbers_are_float32(self):
        scene = Scene([[0, 0, -1], [1, 0, -1], [0, 1, -1]], [[0, 1, 2]], Camera())
        self.assertEqual(scene.dtype, np.float32)


class Errors(unittest.TestCase):
    """Each names the function, the argument, what was expected and got."""

    def expect(self, error, text, call):
        with self.assertRaises(error) as caught:
            call()
        self.assertEqual(str(caught.exception), text)

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
            (TypeError, "Scene.replace: no argument is called 'colour'", {"colour": 1}),
            (ValueError, "Scene: lights is an empty sequence; None stands for none",
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
        ]
        for error, text, change in cases:
            self.expect(error, text, lambda: scene.replace(**change))
        self.expect(ValueError, "Texture: wrap is 'tile', expected one of 'repeat', 'clamp', "
                    "'mirror'", lambda: Texture(np.zeros((2, 2, 3)), "tile"))

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
        for text, change in ((r"^render: scene 0: faces\[2\] is 99", {"faces": [[0, 1, 99]]}),
                             (r"^render: scene 0: positions\[13\]", {"positions": bad})):
            moved = {"uvs": None, "textures": None, "surfaces": None, "face_surfaces": None,
                     "per_corner": ()}
            with self.assertRaisesRegex(ValueError, text):
                render(scene.replace(**moved, **change))

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
            (ValueError, "backward: wrt is 'vertices', expected one of 'positions', 'camera', "
             "'colors', 'uvs', 'normals', 'textures', 'surfaces', 'lights', 'light_directions', "
             "'sh', 'attributes'", lambda: renderer.backward(frame, alpha=ones, wrt="vertices")),
            (ValueError, "backward: accumulate=True needs out",
             lambda: renderer.backward(frame, alpha=ones, accumulate=True)),
            (TypeError, "backward: out[0] must be Gradients, got int",
             lambda: renderer.backward(frame, alpha=ones, out=[3])),
            (TypeError, "backward: out must be Gradients or a list of them, got int",
             lambda: renderer.backward(frame, alpha=ones, out=3)),
            (TypeError, "backward: wrt must be a name or a sequence of names, got int",
             lambda: renderer.backward(frame, alpha=ones, wrt=3)),
            (TypeError, "backward: accumulate must be bool, got 'no' (str)",
             lambda: renderer.backward(frame, alpha=ones, accumulate="no")),
        ]
        for error, text, call in cases:
            self.expect(error, text, call)
        with self.assertRaisesRegex(ValueError, "^backward: .*alpha"):
            renderer.backward(frame, alpha=np.full_like(ones, np.nan))
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

    def test_the_engine_goes_on_after_an_error(self):
        renderer, scene = Renderer(), patch()
        expected = np.array(renderer.render(scene, **IMAGE).color)
        with self.assertRaises(ValueError):
            renderer.render(scene, width=-1)
        self.assertTrue(np.array_equal(renderer.render(scene, **IMAGE).color, expected))


if __name__ == "__main__":
    unittest.main()
