# SPDX-License-Identifier: Apache-2.0
"""tilegrad.compat.kaolin.io and .rep: what a file has, and what comes of it."""

import copy
import importlib.util
import json
import pathlib
import pickle
import tempfile
import unittest

import numpy as np

from support import require_torch, torch
from test_kaolin import double

if torch:
    import tilegrad.compat.kaolin as kaolin

# Two triangles and two materials; (u, v) = (x, y) / (2, 1).
OBJ = """mtllib quad.mtl
v 0 0 0
v 2 0 0
v 2 1 0
v 0 1 0
vt 0 0
vt 1 0
vt 1 1
vt 0 1
vn 0 0 1
vn 0.6 0 0.8
usemtl red
f 1/1/1 2/2/1 3/3/2
usemtl painted
f 1/1/1 3/3/2 4/4/1
"""
MTL = "newmtl red\nKd 1 0 0\nnewmtl painted\nKd 1 1 1\nmap_Kd paint.png\n"

setUpModule = require_torch


class FileTest(unittest.TestCase):
    def setUp(self):
        if importlib.util.find_spec("tilegrad._tools") is None:
            raise unittest.SkipTest("a build without files")
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.root = pathlib.Path(folder.name)
        save_image = importlib.import_module("tilegrad.images").save_image
        self.paint = np.arange(2 * 4 * 3, dtype=np.uint8).reshape(2, 4, 3)
        save_image(self.root / "paint.png", self.paint)
        (self.root / "quad.mtl").write_text(MTL)
        self.path = self.root / "quad.obj"
        self.path.write_text(OBJ)


class ImportMesh(FileTest):
    def test_everything_that_the_file_has(self):
        mesh = kaolin.io.obj.import_mesh(self.path, with_materials=True, with_normals=True)
        self.assertEqual((tuple(mesh.faces.shape), mesh.faces.dtype), ((2, 3), torch.int64))
        x, y = mesh.face_vertices[..., 0], mesh.face_vertices[..., 1]
        self.assertTrue(torch.equal(mesh.face_uvs, torch.stack([x / 2, y], dim=-1)))
        self.assertTrue(torch.equal(mesh.uvs[mesh.face_uvs_idx], mesh.face_uvs))
        tilted = ((x == 2) & (y == 1))[..., None]
        expected = torch.where(tilted, torch.tensor([0.6, 0, 0.8]), torch.tensor([0., 0, 1]))
        self.assertLess(float((mesh.face_normals - expected).abs().max()), 1e-6)
        self.assertTrue(torch.equal(mesh.normals[mesh.face_normals_idx], mesh.face_normals))

    def test_materials(self):
        mesh = kaolin.io.obj.import_mesh(self.path, with_materials=True)
        names = [mesh.materials[i]["material_name"] for i in mesh.material_assignments]
        self.assertEqual(sorted(names), ["painted", "red"])
        by_name = {material["material_name"]: material for material in mesh.materials}
        self.assertEqual(by_name["red"]["Kd"].tolist(), [1, 0, 0])
        self.assertNotIn("map_Kd", by_name["red"])
        self.assertTrue(np.array_equal(by_name["painted"]["map_Kd"].numpy(), self.paint))
        self.assertEqual(by_name["painted"]["map_Kd"].dtype, torch.uint8)
        order = mesh.materials_order.tolist()
        self.assertEqual([start for _, start in order], [0, 1])
        self.assertEqual([m for m, _ in order], mesh.material_assignments.tolist())

    def test_materials_are_sorted_by_name(self):
        names = ["b", "C", "a", "\u00e9", "a10", "a2"]
        (self.root / "many.mtl").write_text("".join(
            f"newmtl {name}\nKd 0.{i + 1} 0 0\n" for i, name in enumerate(names)), encoding="utf-8")
        corners = OBJ[OBJ.index("v 0"):OBJ.index("usemtl")]
        path = self.root / "many.obj"
        path.write_text("mtllib many.mtl\n" + corners + "f 1 2 3\n" + "".join(
            f"usemtl {name}\nf 1 2 3\n" for name in [*names, "b"]), encoding="utf-8")
        mesh = kaolin.io.obj.import_mesh(path, with_materials=True)
        self.assertEqual([material["material_name"] for material in mesh.materials], sorted(names))
        self.assertEqual(mesh.material_assignments.dtype, torch.int16)
        self.assertEqual(mesh.material_assignments.tolist(),
                         [-1, *(sorted(names).index(name) for name in [*names, "b"])])
        self.assertEqual(mesh.materials_order[0].tolist(), [sorted(names).index("b"), 1])
        for material in mesh.materials:
            red = (names.index(material["material_name"]) + 1) / 10
            self.assertAlmostEqual(float(material["Kd"][0]), red, places=6)

    def test_materials_of_a_batch(self):
        """Runs end with their mesh, though the next one begins with the same material."""
        corners, faces = torch.zeros(3, 3), torch.tensor(4 * [[0, 1, 2]])
        each = [kaolin.rep.SurfaceMesh(corners, faces, material_assignments=torch.tensor(of_faces),
                                       materials=[{}, {}])
                for of_faces in ([0, 0, 1, 1], [1, 0, 0, -1])]
        order = kaolin.rep.SurfaceMesh.cat(each).materials_order
        self.assertEqual([runs.tolist() for runs in order], [[[0, 0], [1, 2]], [[1, 0], [0, 1]]])
        self.assertEqual(each[1].materials_order.tolist(), order[1].tolist())

    def test_only_what_was_asked_for(self):
        mesh = kaolin.io.obj.import_mesh(self.path)
        for name in ("materials", "material_assignments", "materials_order", "normals",
                     "face_normals_idx", "vertex_colors"):
            self.assertIsNone(getattr(mesh, name), name)
        self.assertEqual(mesh.face_normals.tolist(), 2 * [3 * [[0, 0, 1]]])  # of the faces
        everything = kaolin.io.import_mesh(self.path)
        self.assertIsNotNone(everything.normals)
        self.assertEqual(len(everything.materials), 2)

    def test_the_files_own_tables(self):
        mesh = kaolin.io.obj.import_mesh(self.path, with_normals=True)
        self.assertEqual(mesh.uvs.tolist(), [[0, 0], [1, 0], [1, 1], [0, 1]])
        self.assertEqual(mesh.face_uvs_idx.tolist(), [[0, 1, 2], [0, 2, 3]])
        self.assertEqual(mesh.face_normals_idx.tolist(), [[0, 0, 1], [0, 1, 0]])

    def test_off(self):
        path = self.root / "one.off"
        path.write_text("OFF\n4 1 0\n0 0 0\n2 0 0\n2 1 0\n0 1 0\n4 0 1 2 3\n")
        mesh = kaolin.io.off.import_mesh(path)
        self.assertEqual((tuple(mesh.vertices.shape), tuple(mesh.faces.shape)), ((4, 3), (2, 3)))
        self.assertIsNone(mesh.face_colors)
        path.write_text("OFF\n4 2 0\n0 0 0\n2 0 0\n2 1 0\n0 1 0\n3 0 1 2 255 0 51\n3 0 2 3\n")
        colored = kaolin.io.off.import_mesh(path, with_face_colors=True)
        self.assertEqual(colored.face_colors.tolist(), [[255, 0, 51], [255, 255, 255]])
        with self.assertRaisesRegex(OSError, "absent.off"):
            kaolin.io.off.import_mesh(self.root / "absent.off")

    def test_fit_with_a_batch_of_it(self):
        """What the tutorials do with a file."""
        mesh = kaolin.io.obj.import_mesh(self.path, with_materials=True).cuda().to_batched()
        mesh.vertices = kaolin.ops.pointcloud.center_points(mesh.vertices, normalize=True)
        mesh.vertices.requires_grad_()
        camera = kaolin.render.camera
        transform = camera.generate_transformation_matrix(
            torch.tensor([[0., 0, 2]]), torch.zeros(1, 3), torch.tensor([[0., 1, 0]]))
        corners, on_image, normals = kaolin.render.mesh.prepare_vertices(
            mesh.vertices, mesh.faces, camera.generate_perspective_projection(0.8),
            camera_transform=transform)
        uv, mask, ids = kaolin.render.mesh.dibr_rasterization(
            16, 16, corners[..., 2], on_image, mesh.face_uvs, normals[..., 2], exact_kaolin=True)
        texture = mesh.materials[0][int(mesh.material_assignments[0, 1])]["map_Kd"]
        image = kaolin.render.mesh.texture_mapping(
            uv, texture.permute(2, 0, 1).unsqueeze(0).float() / 255)
        (image.sum() + mask.sum()).backward()
        self.assertGreater(int((ids >= 0).sum()), 20)
        self.assertGreater(float(mesh.vertices.grad.abs().max()), 0)


class PlainFiles(FileTest):
    def test_import_mesh(self):
        path = self.root / "plain.obj"
        path.write_text("v 0 0 0\nv 2 0 0\nv 2 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n"
                        "f 1/1 2/2 3/3 4/4\n")
        loaded = kaolin.io.obj.import_mesh(path, with_materials=True)
        self.assertEqual(tuple(loaded.faces.shape), (2, 3))
        corners = loaded.vertices[loaded.faces]
        uvs = kaolin.ops.mesh.index_vertices_by_faces(loaded.uvs[None], loaded.face_uvs_idx)[0]
        self.assertTrue(torch.equal(uvs * torch.tensor([2., 1]), corners[..., :2]))
        with self.assertRaisesRegex(OSError, "absent.obj"):
            kaolin.io.obj.import_mesh(self.root / "absent.obj")

    def test_import_synthetic_view(self):
        save_image = importlib.import_module("tilegrad.images").save_image
        transform = np.vstack([np.eye(3), [[0, 0, -4]]])
        camera = {"tf_mat": np.column_stack([transform, [0, 0, 0, 1]]).tolist(),
                  "resolution": {"width": 4, "height": 2}, "focal_length": 1.0,
                  "horizontal_aperture": 2.0, "clipping_range": [0.1, 100]}
        path = self.root / "7_metadata.json"
        path.write_text(json.dumps({"camera_properties": camera, "bbox_2d_tight": [1, 2, 3, 4],
                                    "asset_transforms": [["x", np.eye(4).tolist()]]}))
        rgb = np.arange(2 * 4 * 4, dtype=np.uint8).reshape(2, 4, 4)
        save_image(self.root / "7_rgb.png", rgb)
        save_image(self.root / "7_semantic.npy", np.eye(2, 4, dtype=np.int32))
        view = kaolin.io.render.import_synthetic_view(self.root, 7, semantic=True, normals=True,
                                                      bbox_2d_tight=True)
        self.assertTrue(np.allclose(view["rgb"], rgb[..., :3] / 255))
        self.assertEqual(view["semantic"].tolist(), np.eye(2, 4).tolist())
        self.assertIsNone(view["normals"])
        self.assertEqual(view["bbox_2d_tight"], [1, 2, 3, 4])
        metadata = view["metadata"]
        self.assertTrue(np.allclose(metadata["cam_transform"], transform))
        self.assertTrue(np.allclose(metadata["cam_proj"], [[0.5], [1], [-1]]))
        path.write_text("{}")
        with self.assertRaisesRegex(ValueError, "7_metadata.json: not the metadata of a view"):
            kaolin.io.render.import_synthetic_view(self.root, 7)


class SurfaceMeshes(unittest.TestCase):
    def mesh(self, **members):
        return kaolin.rep.SurfaceMesh(double([[0., 0, 0], [2, 0, 0], [0, 2, 0], [0, 0, 2]]),
                                      torch.tensor([[0, 1, 2], [0, 2, 3]]), **members)

    def test_members_follow_what_they_come_from(self):
        mesh = self.mesh().float_tensors_to(torch.float32)
        self.assertEqual(mesh.face_normals[:, 0].tolist(), [[0, 0, 1], [1, 0, 0]])
        self.assertEqual(mesh.vertex_normals.tolist(),
                         [[0.5, 0, 0.5], [0, 0, 1], [0.5, 0, 0.5], [1, 0, 0]])
        mesh.vertices = -mesh.vertices
        self.assertEqual(mesh.face_vertices.min().item(), -2)
        mesh.vertex_normals = torch.tensor([[0., 1, 0]]).expand(4, 3)
        self.assertEqual(mesh.face_normals.flatten(0, 1).tolist(), 6 * [[0, 1, 0]])
        mesh.vertex_normals = None
        self.assertEqual(mesh.face_normals[1, 2].tolist(), [1, 0, 0])

    def test_batches(self):
        mesh = self.mesh(uvs=double([[0., 0], [1, 0], [0, 1]]), materials=[{"Kd": 1}],
                         face_uvs_idx=torch.tensor([[0, 1, 2], [0, 2, -1]]))
        alone = {name: getattr(mesh, name) for name in
                 ("face_vertices", "face_normals", "face_uvs", "vertex_normals")}
        self.assertIs(mesh.to_batched(), mesh)
        self.assertEqual((len(mesh), mesh.batching, tuple(mesh.vertices.shape), mesh.materials),
                         (1, mesh.Batching.FIXED, (1, 4, 3), [[{"Kd": 1}]]))
        for name, value in alone.items():
            self.assertTrue(torch.equal(getattr(mesh, name)[0], value), name)
        both = kaolin.rep.SurfaceMesh.cat([mesh, self.mesh(uvs=mesh.uvs[0] / 2,
                                                           face_uvs_idx=mesh.face_uvs_idx[0])])
        self.assertEqual((len(both), tuple(both.face_uvs.shape)), (2, (2, 2, 3, 2)))
        self.assertTrue(torch.equal(both.face_uvs[1], alone["face_uvs"] / 2))
        self.assertIsNone(both.materials)
        with self.assertRaisesRegex(ValueError, "2 meshes cannot become one"):
            both.set_batching(both.Batching.NONE)
        self.assertTrue(torch.equal(mesh.set_batching(mesh.Batching.NONE).face_uvs,
                                    alone["face_uvs"]))

    def test_copies_and_conversions(self):
        mesh = self.mesh(vertex_colors=torch.ones(4, 3))
        mesh.vertices.requires_grad_()
        self.assertIs(mesh.to("cpu").cpu().cuda(), mesh)
        self.assertFalse(mesh.detach().vertices.requires_grad)
        self.assertTrue(mesh.vertices.requires_grad)
        self.assertEqual(mesh.float_tensors_to(torch.float32).vertices.dtype, torch.float32)
        self.assertEqual(mesh.face_colors.tolist(), 2 * [3 * [[1, 1, 1]]])
        for other in (copy.copy(mesh), copy.deepcopy(mesh.detach()),
                      pickle.loads(pickle.dumps(mesh.detach()))):
            self.assertTrue(torch.equal(other.face_vertices, mesh.face_vertices))
        self.assertEqual(sorted(mesh.as_dict()), ["faces", "vertex_colors", "vertices"])
        self.assertFalse(mesh.has_attribute("face_normals"))

    def test_names_that_it_lacks(self):
        with self.assertRaisesRegex(AttributeError, "'no_such': docs/porting.md"):
            getattr(self.mesh(), "no_such")
        with self.assertRaisesRegex(AttributeError, "no member 'no_such'"):
            self.mesh().no_such = 1
        self.assertRaisesRegex(TypeError, "no member 'no_such'", self.mesh, no_such=1)


class TriangleMeshes(FileTest):
    def test_from_obj(self):
        mesh = kaolin.rep.TriangleMesh.from_obj(str(self.path), enable_adjacency=True)
        mesh.cuda()
        self.assertEqual(mesh.device.type, "cpu")
        x, y = mesh.vertices[mesh.faces][..., 0], mesh.vertices[mesh.faces][..., 1]
        self.assertTrue(torch.equal(mesh.uvs[mesh.face_textures], torch.stack([x / 2, y], -1)))
        self.assertIsNone(kaolin.rep.TriangleMesh.from_obj(self.path).ff)

    def test_operations_by_hand(self):
        mesh = kaolin.rep.TriangleMesh.from_tensors(
            torch.tensor([[0., 0, 0], [4, 0, 0], [0, 4, 0], [0, 0, 4]]),
            torch.tensor([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]]), enable_adjacency=True)
        self.assertEqual(mesh.edges.tolist(), [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]])
        self.assertEqual(mesh.ff.tolist(), [[3, 2, 1], [0, 2, 3], [0, 3, 1], [0, 1, 2]])
        self.assertTrue((mesh.compute_adjacency_matrix_full() == 1).all())
        self.assertTrue((mesh.compute_adjacency_matrix_sparse().to_dense() == 1).all())
        self.assertLess(float((mesh.compute_laplacian()[0] + 4 / 3).abs().max()), 1e-6)
        self.assertEqual(mesh.compute_face_normals()[:2].tolist(), [[0, 0, -1], [0, -1, 0]])
        points, faces = mesh.sample(100)
        self.assertTrue((points[faces == 0][:, 2] == 0).all() and (points >= 0).all())
        mesh.laplacian_smoothing(2)
        self.assertEqual(mesh.vertices.tolist(), 4 * [[1, 1, 1]])
        one = kaolin.rep.TriangleMesh.from_tensors(mesh.vertices, mesh.faces[:1],
                                                   enable_adjacency=True)
        self.assertEqual(one.ff.tolist(), [[-1, -1, -1]])
