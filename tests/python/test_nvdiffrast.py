# SPDX-License-Identifier: Apache-2.0
"""tilegrad.compat.nvdiffrast: conventions, gradients, modes, errors."""

import math
import unittest
import warnings

from support import require_torch, torch

if torch:
    import tilegrad.compat.nvdiffrast.torch as dr

setUpModule = require_torch


def triangle(dtype=None):
    """The lower left half of an image, nearer towards the top."""
    pos = torch.tensor([[[-1, -1, 0.5, 1], [1, -1, 0.5, 1], [-1, 1, -0.5, 1]]],
                       dtype=dtype or torch.float32)
    return pos, torch.tensor([[0, 1, 2]], dtype=torch.int32)


def wavy_grid(n=3, images=1, seed=0, dtype=None):
    """A surface in perspective within the image, [images, (n+1)^2, 4], and its triangles."""
    dtype = dtype or torch.float64
    generator = torch.Generator().manual_seed(seed)
    steps = torch.linspace(-0.8, 0.8, n + 1, dtype=dtype)
    y, x = torch.meshgrid(steps, steps, indexing="ij")
    w = 1 + 0.6 * torch.rand(images, n + 1, n + 1, generator=generator, dtype=dtype)
    z = 0.3 * torch.rand(images, n + 1, n + 1, generator=generator, dtype=dtype)
    move = 0.05 * torch.rand(2, images, n + 1, n + 1, generator=generator, dtype=dtype)
    pos = torch.stack([(x + move[0]) * w, (y + move[1]) * w, z * w, w], -1)
    first = torch.arange((n + 1) * n).reshape(n, n + 1)[:, :-1].reshape(-1, 1)
    corners = torch.tensor([[0, 1, n + 2], [0, n + 2, n + 1]])
    tri = (first[:, None] + corners).reshape(-1, 3).int()
    return pos.reshape(images, -1, 4), tri


def random(*shape, seed=0, dtype=None, **options):
    generator = torch.Generator().manual_seed(seed)
    values = 2 * torch.rand(*shape, generator=generator, dtype=dtype or torch.float64) - 1
    return values.requires_grad_(options.get("requires_grad", False))


class Conventions(unittest.TestCase):
    def test_bottom_row_first_ids_from_one_weights_of_the_first_two(self):
        pos, tri = triangle()
        rast, rast_db = dr.rasterize(dr.RasterizeCpuContext(), pos, tri, resolution=[4, 4])
        self.assertEqual(rast.shape, (1, 4, 4, 4))
        self.assertEqual(rast_db.shape, (1, 4, 4, 4))
        self.assertEqual(rast.dtype, torch.float32)
        ids = rast[0, :, :, 3]
        self.assertEqual(ids[0, 0], 1)  # the lower left pixel
        self.assertEqual(ids[3, 3], 0)  # the upper right one
        torch.testing.assert_close(rast[0, 0, 0], torch.tensor([0.75, 0.125, 0.375, 1]))
        torch.testing.assert_close(rast_db[0, 0, 0], torch.tensor([-0.25, -0.25, 0.25, 0]))
        self.assertTrue((rast[0, 3, 3] == 0).all() and (rast_db[0, 3, 3] == 0).all())

    def test_the_weights_say_where_vertices_are(self):
        # Attributes that are the clip positions come back as the pixels' own places.
        pos, tri = wavy_grid()
        rast, _ = dr.rasterize(dr.RasterizeCpuContext(), pos, tri, (30, 40))
        out, none = dr.interpolate(pos, rast, tri)
        self.assertEqual(none.shape, (1, 30, 40, 0))
        seen = rast[0, :, :, 3] > 0
        self.assertGreater(seen.sum(), 500)
        y, x = torch.nonzero(seen, as_tuple=True)
        got = out[0, y, x]
        # Coverage is decided at 1/1024 pixel, and weights stay in the triangle.
        expected = torch.stack([(2 * x + 1) / 40 - 1, (2 * y + 1) / 30 - 1, rast[0, y, x, 2]], 1)
        torch.testing.assert_close(got[:, :3] / got[:, 3:], expected, atol=1e-4, rtol=0)

    def test_the_nearer_triangle_is_seen_and_clipping_is_at_the_near_and_far_plane(self):
        corners = torch.tensor([[-3, -3], [9, -3], [-3, 9]], dtype=torch.float32)

        def layer(z):
            return torch.cat([corners, torch.full((3, 1), z), torch.ones(3, 1)], 1)

        pos = torch.stack([torch.cat([layer(z) for z in depths])
                           for depths in ((0.2, -0.2, 0.0), (1.5, 0.3, 0.9), (-1.5, 2.0, 1.01))])
        tri = torch.arange(9, dtype=torch.int32).reshape(3, 3)
        rast, _ = dr.rasterize(dr.RasterizeCpuContext(), pos, tri, (5, 5))
        for image, expected in enumerate((2, 2, 0)):
            self.assertTrue((rast[image, :, :, 3] == expected).all(), image)

    def test_textures_have_their_first_row_at_the_bottom(self):
        tex = torch.tensor([[1.0, 2.0], [3.0, 4.0]]).reshape(1, 2, 2, 1)
        uv = torch.tensor([[0.25, 0.25], [0.75, 0.25], [0.25, 0.75], [0.5, 0.5]])
        out = dr.texture(tex, uv.reshape(1, 1, 4, 2), filter_mode="linear", boundary_mode="clamp")
        self.assertEqual(out.flatten().tolist(), [1, 2, 3, 2.5])
        nearest = dr.texture(tex, uv.reshape(1, 1, 4, 2), filter_mode="nearest")
        self.assertEqual(nearest.flatten().tolist()[:3], [1, 2, 3])


class Modes(unittest.TestCase):
    def setUp(self):
        self.context = dr.RasterizeCpuContext()

    def test_ranges_are_those_triangles_of_all(self):
        pos, tri = wavy_grid()
        ranges = torch.tensor([[4, 6], [0, 18], [7, 0]], dtype=torch.int32)
        rast, _ = dr.rasterize(self.context, pos[0], tri, (20, 20), ranges=ranges)
        attr = random(pos.shape[1], 2, seed=1)
        out, _ = dr.interpolate(attr, rast, tri)
        smooth = dr.antialias(out, rast, pos[0], tri)
        self.assertEqual(smooth.shape, (3, 20, 20, 2))
        for image, (first, count) in enumerate(ranges.tolist()):
            if not count:
                self.assertTrue((rast[image] == 0).all())
                continue
            some = tri[first:first + count]
            expected, _ = dr.rasterize(self.context, pos, some, (20, 20))
            ids = expected[0, :, :, 3]
            self.assertTrue(torch.equal(rast[image, :, :, 3], ids + first * (ids > 0)))
            single, _ = dr.interpolate(attr[None], expected, some)
            self.assertTrue(torch.equal(out[image], single[0]))

    def test_instances_with_attributes_of_their_own_or_for_all(self):
        pos, tri = wavy_grid(images=2)
        rast, rast_db = dr.rasterize(self.context, pos, tri, (16, 16))
        attr = random(1, pos.shape[1], 3)
        out, out_da = dr.interpolate(attr, rast, tri, rast_db=rast_db, diff_attrs="all")
        self.assertEqual(out_da.shape, (2, 16, 16, 6))
        both, some = dr.interpolate(attr.expand(2, -1, -1), rast, tri, rast_db, diff_attrs=[2])
        self.assertTrue(torch.equal(out, both))
        self.assertTrue(torch.equal(out_da[..., 4:], some))

    def test_layers_peel_from_front_to_back(self):
        pos, tri = wavy_grid()
        far = pos.clone()
        far[..., 2] += 0.2 * far[..., 3]
        both = torch.cat([far, pos], 1).requires_grad_()
        all_tri = torch.cat([tri, tri + pos.shape[1]])
        with dr.DepthPeeler(self.context, both, all_tri, (24, 24)) as peeler:
            layers = [peeler.rasterize_next_layer()[0] for _ in range(3)]
        first, _ = dr.rasterize(self.context, both, all_tri, (24, 24))
        self.assertTrue(torch.equal(layers[0], first))
        hit = first[..., 3] > 0
        self.assertTrue((layers[1][..., 3] > 0)[hit].all())
        self.assertTrue((layers[0][..., 3] > 18)[hit].all())
        self.assertTrue((layers[1][..., 3] <= 18).all())
        self.assertTrue((layers[2] == 0).all())
        layers[1][..., :2].sum().backward()
        self.assertTrue((both.grad[:, pos.shape[1]:] == 0).all())
        self.assertGreater(both.grad[:, :pos.shape[1]].abs().max(), 0)
        with self.assertRaisesRegex(RuntimeError, "outside of its with block"):
            peeler.rasterize_next_layer()

    def test_filters(self):
        tex = random(1, 8, 8, 3)
        uv, uv_da = random(1, 5, 5, 2, seed=1), random(1, 5, 5, 4, seed=2)
        bias = random(1, 5, 5, seed=3)
        auto = dr.texture(tex, uv, uv_da)
        mipmapped = dr.texture(tex, uv, uv_da, filter_mode="linear-mipmap-linear")
        self.assertTrue(torch.equal(auto, mipmapped))
        self.assertTrue(torch.equal(dr.texture(tex, uv),
                                    dr.texture(tex, uv, uv_da, filter_mode="linear")))
        self.assertFalse(torch.equal(auto, dr.texture(tex, uv, uv_da, bias)))
        self.assertFalse(torch.equal(auto, dr.texture(tex, uv)))
        stack = dr.texture_construct_mip(tex)
        self.assertTrue(torch.equal(auto, dr.texture(tex, uv, uv_da, mip=stack)))
        pooled = [tex]
        for _ in range(3):
            pooled.append(torch.nn.functional.avg_pool2d(pooled[-1].permute(0, 3, 1, 2),
                                                         2).permute(0, 2, 3, 1))
        torch.testing.assert_close(auto, dr.texture(tex, uv, uv_da, mip=pooled[1:]))
        torch.testing.assert_close(dr.texture(tex, uv, uv_da, max_mip_level=1),
                                   dr.texture(tex, uv, uv_da, mip=pooled[1:2]))
        self.assertTrue(torch.equal(dr.texture(tex, uv, uv_da, max_mip_level=0),
                                    dr.texture(tex, uv)))

    def test_old_names_warn_once_and_work(self):
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            for _ in range(2):
                for context in (dr.RasterizeCudaContext("cuda:0"), dr.RasterizeGLContext()):
                    pos, tri = triangle()
                    self.assertEqual(dr.rasterize(context, pos, tri, (4, 4))[0].shape, (1, 4, 4, 4))
        self.assertEqual(sorted(str(w.message).split()[0] for w in caught),
                         ["RasterizeCudaContext", "RasterizeGLContext"])

    def test_log_level(self):
        before = dr.get_log_level()
        dr.set_log_level(2)
        self.assertEqual(dr.get_log_level(), 2)
        dr.set_log_level(before)
        self.assertRaisesRegex(ValueError, "level is 7", dr.set_log_level, 7)


class Gradients(unittest.TestCase):
    """torch.autograd.gradcheck in float64, of each function and of the chain."""

    def setUp(self):
        self.context = dr.RasterizeCpuContext()

    def check(self, function, *inputs):
        # Not bit by bit the same twice would be an error too.
        self.assertTrue(torch.autograd.gradcheck(function, inputs, eps=1e-6, atol=1e-5, rtol=1e-4,
                                                 nondet_tol=0.0))

    def test_rasterize(self):
        pos, tri = wavy_grid(2, images=2, seed=3)

        def both(p):
            rast, rast_db = dr.rasterize(self.context, p, tri, (7, 9))
            return rast[..., :2], rast_db

        self.check(both, pos.requires_grad_())

    def test_rasterize_shares_positions_over_ranges(self):
        pos, tri = wavy_grid(2, seed=3)
        ranges = torch.tensor([[0, 8], [3, 4]], dtype=torch.int32)
        self.check(lambda p: dr.rasterize(self.context, p, tri, (7, 9), ranges=ranges)[0][..., :2],
                   pos[0].clone().requires_grad_())

    def test_grad_db_false_keeps_derivatives_of_pixels_out(self):
        pos, tri = wavy_grid(2)
        pos.requires_grad_()
        for grad_db in (True, False):
            rast, rast_db = dr.rasterize(self.context, pos, tri, (9, 9), grad_db=grad_db)
            gradient, = torch.autograd.grad(rast_db.sum() + 0 * rast.sum(), pos)
            self.assertEqual(bool(gradient.abs().max() > 1e-3), grad_db)

    def test_depth_has_no_gradient(self):
        pos, tri = wavy_grid(2)
        pos.requires_grad_()
        rast, _ = dr.rasterize(self.context, pos, tri, (9, 9))
        gradient, = torch.autograd.grad(rast[..., 2].sum(), pos)
        self.assertTrue((gradient == 0).all())

    def test_interpolate(self):
        pos, tri = wavy_grid(2, images=2)
        rast, rast_db = dr.rasterize(self.context, pos, tri, (6, 7))
        for images in (1, 2):
            attr = random(images, pos.shape[1], 3, seed=1, requires_grad=True)
            self.check(lambda a, uv, db: dr.interpolate(
                a, torch.cat([uv, rast[..., 2:]], -1), tri, db, diff_attrs=[1, 0]),
                attr, rast[..., :2].clone().requires_grad_(), rast_db.clone().requires_grad_())
        of_rast, = torch.autograd.grad(dr.interpolate(attr, rast.requires_grad_(), tri)[0].sum(),
                                       rast)
        self.assertTrue((of_rast[..., 2:] == 0).all())  # depth and triangle

    def test_texture(self):
        uv = random(2, 4, 5, 2, seed=1, requires_grad=True)
        uv_da = (0.1 * random(2, 4, 5, 4, seed=2)).requires_grad_()
        bias = random(2, 4, 5, seed=3, requires_grad=True)
        for images in (1, 2):
            tex = random(images, 8, 8, 2, seed=4, requires_grad=True)
            for boundary in ("wrap", "clamp", "zero"):
                self.check(lambda *a: dr.texture(*a, boundary_mode=boundary), tex, uv)
                self.check(lambda *a: dr.texture(*a, boundary_mode=boundary), tex, uv, uv_da, bias)
        self.check(lambda t, u: dr.texture(t, u, filter_mode="nearest"), tex, uv)
        self.check(lambda *a: dr.texture(*a, filter_mode="linear-mipmap-nearest"), tex, uv, uv_da)
        self.check(lambda t, u, b: dr.texture(t, u, mip_level_bias=b, boundary_mode="zero"), tex,
                   uv, (2 * bias + 1).detach().requires_grad_())

    def test_texture_of_cube_and_with_levels_of_its_own(self):
        uv = random(1, 4, 5, 3, seed=5, requires_grad=True)
        uv_da = (0.3 * random(1, 4, 5, 6, seed=2)).requires_grad_()
        cube = random(1, 6, 4, 4, 2, seed=4, requires_grad=True)
        self.check(lambda *a: dr.texture(*a, boundary_mode="cube"), cube, uv)
        self.check(lambda *a: dr.texture(*a, boundary_mode="cube"), cube, uv, uv_da)
        tex = random(1, 4, 8, 2, seed=4, requires_grad=True)
        levels = [random(1, 2, 4, 2, seed=6, requires_grad=True),
                  random(1, 1, 2, 2, seed=7, requires_grad=True)]
        plain = random(1, 4, 5, 2, seed=1, requires_grad=True)
        footprint = 0.3 * random(1, 4, 5, 4, seed=2)
        self.check(lambda t, u, a, b: dr.texture(t, u, footprint, mip=[a, b]), tex, plain, *levels)

    def test_antialias(self):
        pos, tri = wavy_grid(2, images=2, seed=1)
        rast, _ = dr.rasterize(self.context, pos, tri, (9, 8))
        color = random(2, 9, 8, 2, seed=1, requires_grad=True)
        topology = dr.antialias_construct_topology_hash(tri)
        self.check(lambda c, p: dr.antialias(c, rast, p, tri, topology), color,
                   pos.requires_grad_())
        shared = pos[0].detach().clone().requires_grad_()
        ranges = torch.tensor([[0, 8], [3, 4]], dtype=torch.int32)
        rast, _ = dr.rasterize(self.context, shared.detach(), tri, (9, 8), ranges=ranges)
        self.check(lambda c, p: dr.antialias(c, rast, p, tri), color, shared)

    def test_pos_gradient_boost(self):
        pos, tri = wavy_grid(2)
        rast, _ = dr.rasterize(self.context, pos, tri, (9, 8))
        color = random(1, 9, 8, 2)
        pos.requires_grad_()
        one, = torch.autograd.grad(dr.antialias(color, rast, pos, tri).pow(2).sum(), pos)
        three, = torch.autograd.grad(
            dr.antialias(color, rast, pos, tri, pos_gradient_boost=3.0).pow(2).sum(), pos)
        self.assertGreater(one.abs().max(), 0)
        torch.testing.assert_close(three, 3 * one)

    def test_float32_follows_float64(self):
        grads = []
        for dtype in (torch.float32, torch.float64):
            pos, tri = wavy_grid(4, dtype=torch.float64)
            pos = pos.to(dtype).requires_grad_()
            attr = random(1, pos.shape[1], 2, seed=2).to(dtype).requires_grad_()
            tex = random(1, 16, 16, 3, seed=3).to(dtype).requires_grad_()
            rast, rast_db = dr.rasterize(self.context, pos, tri, (32, 32))
            uv, uv_da = dr.interpolate(attr, rast, tri, rast_db, diff_attrs="all")
            color = dr.antialias(dr.texture(tex, uv, uv_da), rast, pos, tri)
            grads.append(torch.autograd.grad(color.pow(2).mean(), (pos, attr, tex)))
        for single, double in zip(*grads):
            error = (single.double() - double).abs().max() / double.abs().max()
            # Rounding of positions and coordinates, 6e-8, times 32 pixels, 16 texels and what
            # levels change.
            self.assertLess(error, 1e-3)


class Memory(unittest.TestCase):
    def test_results_have_their_own(self):
        tex, uv = torch.rand(1, 64, 64, 3), torch.rand(1, 128, 128, 2)
        alive = {}
        for i in range(40):  # in no order
            alive[i * 7 % 11] = i, dr.texture(tex + i, uv)
        first = dr.texture(tex, uv)
        pointers = {result.data_ptr() for _, result in alive.values()} | {first.data_ptr()}
        self.assertEqual(len(pointers), len(alive) + 1)
        for i, result in alive.values():
            torch.testing.assert_close(result, first + i, rtol=1e-6, atol=1e-5)
        self.assertEqual(len({dr.texture(tex, uv).data_ptr() for _ in range(10)}), 1)


class Errors(unittest.TestCase):
    def setUp(self):
        self.context = dr.RasterizeCpuContext()
        self.pos, self.tri = triangle()
        self.rast, self.rast_db = dr.rasterize(self.context, self.pos, self.tri, (4, 4))

    def check(self, error, pattern, function, *arguments, **options):
        self.assertRaisesRegex(error, pattern, function, *arguments, **options)

    def test_rasterize(self):
        pos, tri, context = self.pos, self.tri, self.context
        self.check(TypeError, "rasterize: glctx is NoneType", dr.rasterize, None, pos, tri, (4, 4))
        self.check(ValueError, r"rasterize: pos has shape \(1, 3, 3\), expected \(N, V, 4\)",
                   dr.rasterize, context, pos[..., :3], tri, (4, 4))
        self.check(TypeError, "rasterize: pos has dtype torch.float16", dr.rasterize, context,
                   pos.half(), tri, (4, 4))
        self.check(ValueError, "needs ranges", dr.rasterize, context, pos[0], tri, (4, 4))
        self.check(ValueError, r"tri has shape \(3,\), expected \(F, 3\)", dr.rasterize, context,
                   pos, tri[0], (4, 4))
        self.check(ValueError, "rasterize: face 0 has vertex 3, but there are 3", dr.rasterize,
                   context, pos, tri + 1, (4, 4))
        self.check(ValueError, "resolution is 4, expected", dr.rasterize, context, pos, tri, 4)
        for wrong in ((0, 4), (-1, 4), (4, 16385), (10**9, 10**9), (4.5, 4), (None, 4),
                      (4, float("inf")), (4, float("nan"))):
            for function in (dr.rasterize, dr.DepthPeeler):
                self.check(ValueError, f"{function.__name__}: resolution is .*, each 1 to 16384",
                           function, context, pos, tri, wrong)
        self.check(ValueError, "range 0 is 2 faces from 0 on", dr.rasterize, context, pos[0], tri,
                   (4, 4), ranges=torch.tensor([[0, 2]], dtype=torch.int32))
        bad = pos.clone()
        bad[0, 1, 2] = float("nan")
        self.check(ValueError, "position 2 of vertex 1 is nan", dr.rasterize, context, bad, tri,
                   (4, 4))
        self.check(ValueError, "device is 'cuda'", dr.RasterizeCpuContext, "cuda")

    def test_interpolate(self):
        attr = torch.ones(1, 3, 2)
        self.check(ValueError, r"rast has shape \(4, 4, 4\)", dr.interpolate, attr, self.rast[0],
                   self.tri)
        self.check(TypeError, "attr has dtype torch.float64, the tensors before it torch.float32",
                   dr.interpolate, attr.double(), self.rast, self.tri)
        self.check(ValueError, "diff_attrs is 'some'", dr.interpolate, attr, self.rast, self.tri,
                   self.rast_db, "some")
        for wrong, error, message in (([2], ValueError, r"diff_attrs\[0\] is 2, outside of"),
                                      (1, ValueError, r"diff_attrs has shape \(\)"),
                                      ([1.7], TypeError, "diff_attrs has dtype float64")):
            self.check(error, message, dr.interpolate, attr, self.rast, self.tri, self.rast_db,
                       wrong)
        for wrong in (9, 0.5, -1, -0.5, 3, 3e38, math.nan):
            self.check(ValueError, "pixel 0 of rast names triangle", dr.interpolate, attr,
                       torch.full_like(self.rast, wrong), self.tri)
        self.check(ValueError, "face 0 has vertex 2, but there are 2", dr.interpolate,
                   attr[:, :2], self.rast, self.tri)

    def test_texture(self):
        tex, uv = torch.ones(1, 6, 8, 3), torch.ones(2, 4, 4, 2)
        da = torch.ones(2, 4, 4, 4)
        self.check(ValueError, "boundary_mode is 'mirror', expected one of 'wrap'", dr.texture, tex,
                   uv, boundary_mode="mirror")
        self.check(ValueError, "filter_mode is 'cubic'", dr.texture, tex, uv, filter_mode="cubic")
        self.check(ValueError, "needs uv_da or mip_level_bias", dr.texture, tex, uv,
                   filter_mode="linear-mipmap-linear")
        self.check(ValueError, "6 x 8 texels cannot be halved below 3 x 4.*max_mip_level to 1",
                   dr.texture, tex, uv, da)
        self.check(ValueError, r"tex has shape \(1, 6, 8, 3\), expected \(Nt, 6, S, S, C\)",
                   dr.texture, tex, torch.ones(1, 4, 4, 3), boundary_mode="cube")
        self.check(ValueError, "tex has 3 textures, expected 1, or 2", dr.texture,
                   torch.ones(3, 4, 4, 1), uv)
        self.check(ValueError, r"uv_da has shape \(2, 4, 4, 2\), expected \(N, h, w, 4\)",
                   dr.texture, tex, uv, uv, max_mip_level=1)
        self.check(ValueError, r"mip\[0\] has shape \(1, 3, 3, 3\), expected \(1, 3, 4, 3\)",
                   dr.texture, tex, uv, da, mip=[torch.ones(1, 3, 3, 3)])
        self.check(ValueError, "mip was made of a texture", dr.texture, tex, uv, da,
                   mip=dr.texture_construct_mip(torch.ones(1, 4, 4, 3)))
        one = torch.ones(1, 1, 1, 3)
        self.check(ValueError, "the sizes of the levels do not match", dr.texture,
                   one, uv[:1], da[:1], mip=[one] * 40)
        for level in (-1, 0.5, math.nan, math.inf, "2"):
            self.check(ValueError, f"max_mip_level is {level!r}, must be a whole number, 0 or more",
                       dr.texture, tex, uv, da, max_mip_level=level)

    def test_texture_of_more_levels_than_there_are(self):
        tex, uv = torch.rand(1, 4, 8, 3), torch.rand(1, 4, 4, 2)
        bias = torch.full((1, 4, 4), 1.7)
        all_levels = dr.texture(tex, uv, mip_level_bias=bias)
        for most in (3, 31, 2**31, 2**70):
            self.assertTrue(torch.equal(
                dr.texture(tex, uv, mip_level_bias=bias, max_mip_level=most), all_levels))
            self.assertEqual(len(dr.texture_construct_mip(tex, most).levels), 3)

    def test_antialias(self):
        color = torch.ones(1, 4, 4, 3)
        self.check(ValueError, r"rast has shape \(1, 4, 4, 4\), expected \(N, H, W, 4\) with",
                   dr.antialias, color[:, :3], self.rast, self.pos, self.tri)
        other = dr.antialias_construct_topology_hash(self.tri.repeat(2, 1))
        self.check(ValueError, "topology hash is that of 2 triangles, but tri has 1", dr.antialias,
                   color, self.rast, self.pos, self.tri, topology_hash=other)
        self.check(TypeError, "topology_hash is int", dr.antialias, color, self.rast, self.pos,
                   self.tri, topology_hash=3)
