# SPDX-License-Identifier: Apache-2.0
"""Meshes, images and weights: in, out, and what is wrong with them."""

import numpy as np

import tilegrad
from file_samples import FolderTest, textured_mesh
from tilegrad import files

CAMERA = tilegrad.Camera(translation=(0, 0, -3), fx=48, fy=48, cx=16, cy=16)


class Meshes(FolderTest):
    def test_glb_there_and_back(self) -> None:
        mesh = textured_mesh()
        files.save_mesh(self.folder / "a.glb", mesh)
        got = files.load_mesh(self.folder / "a.glb")
        corners = got.positions[got.faces]
        np.testing.assert_array_equal(corners, mesh.positions[mesh.faces])
        np.testing.assert_array_equal(got.corner_uvs, mesh.corner_uvs)
        np.testing.assert_array_equal(got.normals[got.faces], mesh.normals[mesh.faces])
        self.assertEqual(got.materials, mesh.materials)
        np.testing.assert_array_equal(got.textures[0].image, mesh.textures[0].image)
        self.assertEqual(got.textures[0].name, "texels")
        self.assertNotEqual(got.textures, mesh.textures)  # not an error of NumPy
        self.assertEqual(got.warnings, [])
        self.assertEqual(got.positions.dtype, np.float32)
        self.assertEqual(got.faces.dtype, np.int32)

    def test_colours_there_and_back(self) -> None:
        mesh = textured_mesh()
        mesh.materials, mesh.textures, mesh.face_materials = [], [], None
        mesh.colors = np.random.default_rng(1).random((4, 3), np.float32)
        files.save_mesh(self.folder / "a.glb", mesh)
        got = files.load_mesh(self.folder / "a.glb")
        np.testing.assert_allclose(got.colors[got.faces][..., :3], mesh.colors[mesh.faces],
                                   atol=1e-6)  # encoded and decoded: a few roundings of float32
        self.assertTrue((got.colors[:, 3] == 1).all())

    def test_a_mesh_goes_into_a_scene_without_copies(self) -> None:
        mesh = textured_mesh()
        mesh.scene(CAMERA)  # the arrays are right: none is copied
        tilegrad.reset_stats()
        scene = mesh.scene(CAMERA)
        self.assertIs(scene.positions, mesh.positions)
        frame = tilegrad.Renderer().render(scene, width=32, height=32, culling="back")
        lower, upper = frame.color[0, :, 20, 22], frame.color[0, :, 12, 10]
        self.assertIn(round(float(lower[0]) * 255), (150, 100))  # texels of the lower row
        np.testing.assert_array_equal(lower[1:], 0)
        np.testing.assert_array_equal(upper, [0, 0, 1])

    def test_linear_colours_are_decoded(self) -> None:
        mesh = textured_mesh()
        mesh.materials = [files.Material(base_color=(0.5, 0.5, 0.5, 1))]
        mesh.face_materials, mesh.textures = None, []
        for space, expected in (("srgb", 0.5), ("linear", ((0.5 + 0.055) / 1.055) ** 2.4)):
            frame = tilegrad.Renderer().render(mesh.scene(CAMERA, color_space=space), width=32,
                                               height=32)
            self.assertAlmostEqual(float(frame.color[0, 1, 16, 16]), expected, places=6)

    def test_scene_takes_light_and_refuses_nonsense(self) -> None:
        mesh = textured_mesh()
        scene = mesh.scene(CAMERA, lighting="lambert", lights=tilegrad.Light((0, 0, 1)))
        frame = tilegrad.Renderer().render(scene, width=32, height=32)
        np.testing.assert_allclose(frame.color[0, :, 12, 10], [0, 0, 1])
        with self.assertRaisesRegex(ValueError, "Mesh.scene: color_space is 'hsv'"):
            mesh.scene(CAMERA, color_space="hsv")
        mesh.face_materials[0] = 7
        self.assertRaisesRegex(ValueError, "Mesh.scene.*7", mesh.scene, CAMERA)
        mesh.face_materials = np.zeros(3, np.int32)
        with self.assertRaisesRegex(ValueError, r"face_materials has shape \(3,\).*F = 2"):
            mesh.scene(CAMERA)

    def test_materials_are_checked(self) -> None:
        for change, error, message in (
                ({"wrap": "twice"}, ValueError, "material 'red': wrap is 'twice'"),
                ({"wrap": "repeat twice"}, ValueError, "material 'red': wrap is 'repeat twice'"),
                ({"alpha_cutoff": "x"}, TypeError, "material 'red': alpha_cutoff must be float"),
                ({"alpha_cutoff": float("nan")}, ValueError, "alpha_cutoff"),
                ({"alpha_mode": None}, ValueError, "material 'red': alpha_mode is None"),
                ({"base_color": (1, 0, 0)}, ValueError, r"base_color has shape \(3,\)"),
                ({"texture": "wood"}, TypeError, "material 'red': texture"),
                ({"texture": 3}, ValueError, "texture")):
            mesh = textured_mesh()
            for name, value in change.items():
                setattr(mesh.materials[0], name, value)
            self.assertRaisesRegex(error, message, files.save_mesh, self.folder / "a.glb", mesh)
        mesh = textured_mesh()
        mesh.textures[0].image = mesh.textures[0].image[..., 0]
        with self.assertRaisesRegex(ValueError, r"image of texture 'texels' has shape \(2, 2\)"):
            files.save_mesh(self.folder / "a.glb", mesh)

    def test_far_from_the_origin(self) -> None:
        path = self.folder / "a.off"
        path.write_text("OFF\n3 1 0\n4600000.25 0 7\n4600001.25 0 7\n4600000.25 1 7\n3 0 1 2\n")
        mesh = files.load_mesh(path)
        self.assertEqual(mesh.origin.tolist(), [4600001, 1, 7])
        world = [[4600000.25, 0, 7], [4600001.25, 0, 7], [4600000.25, 1, 7]]
        self.assertEqual((mesh.positions + mesh.origin).tolist(), world)
        self.assertIn("(4600001, 1, 7) was subtracted", mesh.warnings[0])
        files.save_mesh(self.folder / "b.glb", mesh)
        back = files.load_mesh(self.folder / "b.glb")
        self.assertEqual((back.positions + back.origin).tolist(), world)
        mesh.save(self.folder / "c.glb")
        self.assertEqual((self.folder / "c.glb").read_bytes(),
                         (self.folder / "b.glb").read_bytes())
        self.assertRaisesRegex(ValueError, "'c.obj' must end in .glb", mesh.save, "c.obj")
        near = files.Mesh(mesh.positions, mesh.faces)
        self.assertEqual(near.origin.tolist(), [0, 0, 0])

    def test_colours_of_faces(self) -> None:
        path = self.folder / "a.off"
        path.write_text("OFF\n4 2 0\n-1 -1 0\n1 -1 0\n1 1 0\n-1 1 0\n"
                        "3 0 1 2 255 0 0\n3 0 2 3 0 0 255\n")
        mesh = files.load_mesh(path)
        self.assertEqual((mesh.colors, mesh.corner_colors.shape), (None, (2, 3, 4)))
        frame = tilegrad.Renderer().render(mesh.scene(CAMERA), width=32, height=32)
        np.testing.assert_array_equal(frame.color[0, :, 16, 24], [1, 0, 0])
        np.testing.assert_array_equal(frame.color[0, :, 16, 8], [0, 0, 1])
        mesh.corner_colors = mesh.corner_colors[..., :3]
        files.save_mesh(self.folder / "b.glb", mesh)
        self.assertEqual(len(files.load_mesh(self.folder / "b.glb").colors), 6)
        mesh.colors = np.ones((4, 3), np.float32)
        self.assertRaisesRegex(ValueError, "colors and corner_colors", mesh.scene, CAMERA)

    def test_the_tables_of_an_obj_file(self) -> None:
        path = self.folder / "a.obj"
        path.write_text("v 9 9 9\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0.5 0.25\nvn 0 0 3\n"
                        "f 2/1/1 3/1/1 4/1/1\nf 2 4 3\n")
        mesh = files.load_mesh(path)
        self.assertEqual(mesh.positions[:, 0].tolist(), [9, 0, 1, 0])
        self.assertEqual(mesh.faces.tolist(), [[1, 2, 3], [1, 3, 2]])
        self.assertEqual(mesh.tables.uvs.tolist(), [[0.5, 0.25]])
        self.assertEqual(mesh.tables.face_uvs.tolist(), [[0, 0, 0], [-1, -1, -1]])
        self.assertEqual(mesh.tables.normals.tolist(), [[0, 0, 3]])
        self.assertEqual(mesh.tables.face_normals.tolist(), [[0, 0, 0], [-1, -1, -1]])
        path.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
        self.assertIsNone(files.load_mesh(path).tables)

    def test_errors_name_the_file(self) -> None:
        with self.assertRaisesRegex(FileNotFoundError, "none.glb"):
            files.load_mesh(self.folder / "none.glb")
        bad = self.folder / "bad.obj"
        bad.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n")
        self.assertRaisesRegex(ValueError, "bad.obj.*line 4", files.load_mesh, bad)
        with self.assertRaisesRegex(ValueError, "a.mp3"):
            (self.folder / "a.mp3").write_bytes(b"x")
            files.load_mesh(self.folder / "a.mp3")
        with self.assertRaisesRegex(ValueError, "must end in .glb"):
            files.save_mesh(self.folder / "a.obj", textured_mesh())
        with self.assertRaisesRegex(OSError, "file.txt"):
            (self.folder / "file.txt").write_text("")
            files.save_mesh(self.folder / "file.txt" / "a.glb", textured_mesh())
        self.assertRaises(TypeError, files.load_mesh, 3)

    def test_gltf_camera(self) -> None:
        camera = files.MeshCamera("eye", np.eye(4), 0.8, 0.0, 0.1).camera(64, 48)
        self.assertAlmostEqual(float(camera.fy), 24 / np.tan(0.4), places=9)
        self.assertEqual(float(camera.cx), 32)


class Images(FolderTest):
    def test_png_of_every_channel_count(self) -> None:
        random = np.random.default_rng(2)
        for channels in (1, 2, 3, 4):
            image = random.integers(0, 256, (5, 7, channels), np.uint8)
            files.save_image(self.folder / "a.png", image)
            np.testing.assert_array_equal(files.load_image(self.folder / "a.png"), image)
            files.save_image(self.folder / "a.png", np.moveaxis(image, -1, 0), planar=True)
            np.testing.assert_array_equal(files.load_image(self.folder / "a.png"), image)

    def test_png_of_real_numbers(self) -> None:
        files.save_image(self.folder / "a.png", np.array([[0, 0.5, 1], [-1, 2, 0.2]]))
        np.testing.assert_array_equal(files.load_image(self.folder / "a.png")[..., 0],
                                      [[0, 128, 255], [0, 255, 51]])
        files.save_image(self.folder / "a.png", np.array([[True, False]]))
        np.testing.assert_array_equal(files.load_image(self.folder / "a.png")[..., 0], [[255, 0]])

    def test_exr_and_npy_keep_every_bit(self) -> None:
        random = np.random.default_rng(3)
        for channels in (1, 2, 3, 4):
            image = random.normal(size=(4, 6, channels)).astype(np.float32)
            for name in ("a.exr", "a.npy"):
                files.save_image(self.folder / name, image)
                np.testing.assert_array_equal(files.load_image(self.folder / name), image)
        for dtype in (bool, np.int16, np.uint64, np.float64):
            array = np.arange(6).reshape(1, 2, 3).astype(dtype)
            files.save_image(self.folder / "a.npy", array)
            got = files.load_image(self.folder / "a.npy")
            self.assertEqual(got.dtype, array.dtype)
            np.testing.assert_array_equal(got, array)
            np.testing.assert_array_equal(np.load(self.folder / "a.npy"), array)

    def test_layers(self) -> None:
        layers = {"Z": np.full((2, 3), np.inf, np.float32),
                  "normal.X": np.arange(6, dtype=np.float32).reshape(2, 3)}
        files.save_layers(self.folder / "a.exr", layers)
        got = files.load_layers(self.folder / "a.exr")
        self.assertEqual(set(got), set(layers))
        for name, plane in layers.items():
            np.testing.assert_array_equal(got[name], plane)
        with self.assertRaisesRegex(ValueError, "Z, normal.X.*load_layers"):
            files.load_image(self.folder / "a.exr")
        with self.assertRaisesRegex(ValueError, r"Z has shape \(3, 2\)"):
            files.save_layers(self.folder / "a.exr", {"R": np.zeros((2, 3)), "Z": np.zeros((3, 2))})

    def test_a_render_goes_into_a_file(self) -> None:
        frame = tilegrad.Renderer().render(textured_mesh().scene(CAMERA), width=32, height=32)
        for name, step in (("a.png", 0.5 / 255), ("a.exr", 0)):
            files.save_image(self.folder / name, frame.color[0], planar=True)
            got = files.load_image(self.folder / name)
            if got.dtype == np.uint8:
                got = got / 255
            np.testing.assert_allclose(np.moveaxis(got, -1, 0), frame.color[0], atol=step + 1e-6)

    def test_errors(self) -> None:
        image = np.zeros((2, 2, 3))
        for name, value, message in (
                ("a.jpg", image, "must end in .png, .exr or .npy"),
                ("a.png", np.zeros((2, 2, 5)), r"image has shape \(2, 2, 5\)"),
                ("a.png", np.zeros(3), r"image has shape \(3,\)"),
                ("a.png", image * np.nan, "not finite")):
            with self.assertRaisesRegex(ValueError, "save_image: .*" + message):
                files.save_image(self.folder / name, value)
        for value in (image.astype(np.int64), np.array(["a"]), image.astype(complex)):
            with self.assertRaisesRegex(TypeError, "save_image: image has dtype"):
                files.save_image(self.folder / "a.png", value)
        for name in ("none.png", "none.exr", "none.npy"):
            self.assertRaisesRegex(FileNotFoundError, name, files.load_image, self.folder / name)


class Weights(FolderTest):
    ARRAYS = {"a.weight": np.arange(6, dtype=np.float32).reshape(2, 3), "b": np.array(2.5),
              "c": np.zeros((0, 3), np.int64), "d": np.array([1, 255], np.uint8)}

    def test_there_and_back(self) -> None:
        for name in ("w.safetensors", "w.npz"):
            files.save_weights(self.folder / name, self.ARRAYS)
            got = files.load_weights(self.folder / name)
            self.assertEqual(set(got), set(self.ARRAYS))
            for key, array in self.ARRAYS.items():
                self.assertEqual((got[key].dtype, got[key].shape), (array.dtype, array.shape))
                np.testing.assert_array_equal(got[key], array)

    def test_numpy_reads_npz_and_we_read_numpys(self) -> None:
        files.save_weights(self.folder / "w.npz", self.ARRAYS)
        with np.load(self.folder / "w.npz") as got:
            self.assertEqual(set(got.files), set(self.ARRAYS))
        np.savez(self.folder / "n.npz", **self.ARRAYS)
        np.testing.assert_array_equal(files.load_weights(self.folder / "n.npz")["b"], 2.5)

    def test_metadata(self) -> None:
        files.save_weights(self.folder / "w.safetensors", self.ARRAYS, {"step": "7"})
        got = files.load_weights(self.folder / "w.safetensors")
        self.assertEqual(got.metadata, {"step": "7"})
        files.save_weights(self.folder / "again.safetensors", got)
        self.assertEqual((self.folder / "again.safetensors").read_bytes(),
                         (self.folder / "w.safetensors").read_bytes())
        with self.assertRaisesRegex(ValueError, "no metadata"):
            files.save_weights(self.folder / "w.npz", got)

    def test_errors(self) -> None:
        path = self.folder / "w.safetensors"
        self.assertRaisesRegex(FileNotFoundError, "w.safetensors", files.load_weights, path)
        with self.assertRaisesRegex(TypeError, "save_weights: x has dtype complex128"):
            files.save_weights(path, {"x": np.zeros(2, complex)})
        with self.assertRaisesRegex(TypeError, "save_weights: x has dtype int16"):
            files.save_weights(path, {"x": np.zeros(2, np.int16)})
        with self.assertRaisesRegex(TypeError, "name 3 is not a string"):
            files.save_weights(path, {3: np.zeros(2)})
        with self.assertRaisesRegex(ValueError, "save_weights: x has 6 axes"):
            files.save_weights(path, {"x": np.zeros((1,) * 6)})
        with self.assertRaisesRegex(ValueError, ".safetensors or .npz"):
            files.load_weights(self.folder / "w.pt")
        self.assertFalse(path.exists())
