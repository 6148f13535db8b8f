// SPDX-License-Identifier: Apache-2.0
// N3MR's silhouettes and hand-made gradient: numbers worked out by hand, independent numbers of the
// published kernels, and the fast code against the reference.
#include "rivals/n3mr.h"

#include <complex>

#include "rivals/n3mr_color.h"
#include "rivals/n3mr_color_ref.h"
#include "rivals/n3mr_ref.h"
#include "rivals/test_util.h"

namespace tilegrad::rivals::n3mr_test {

using namespace test;  // NOLINT: of the tests of one folder

template <class T>
struct Result {
  std::vector<T> alpha, d_corners;
};

template <class T>
Result<T> Reference(const std::vector<T>& corners, int size, const N3mrOptions& options,
                    const std::vector<T>& d_alpha) {
  Result<T> out{std::vector<T>(d_alpha.size()), std::vector<T>(corners.size())};
  N3mrForwardRef<T>(corners, size, options, out.alpha);
  N3mrBackwardRef<T>(corners, size, options, d_alpha, out.d_corners);
  return out;
}

// Rows in three parts, faces in two.
template <class T>
Result<T> Fast(const std::vector<T>& corners, int size, const N3mrOptions& options,
               const std::vector<T>& d_alpha) {
  Result<T> out{std::vector<T>(d_alpha.size()), std::vector<T>(corners.size(), T(7))};
  N3mrImageT<T> image;
  SetUpN3mr<T>(corners, size, options, &image);
  const int m = image.inner;
  for (const RowRange rows : {RowRange{0, m / 3}, {m / 3, m / 2}, {m / 2, m}})
    DrawN3mr(options, rows, &image);
  N3mrAlpha<T>(options, &image, out.alpha);
  N3mrPrepareBackward<T>(options, d_alpha, &image);
  const std::size_t faces = corners.size() / kCornerNumbers;
  N3mrBackward<T>(options, image, 0, faces / 2, out.d_corners);
  N3mrBackward<T>(options, image, faces / 2, faces, out.d_corners);
  return out;
}

N3mrOptions OptionsOf(const Json& scene, double eps) {
  N3mrOptions options;
  const Json& reduction = scene["anti_aliasing"];
  options.reduction = reduction.is_string()   ? N3mrReduction::kBilinear
                      : reduction.get<bool>() ? N3mrReduction::kMean
                                              : N3mrReduction::kNone;
  options.fill_back = scene["fill_back"];
  options.near_plane = scene["near"];
  options.far_plane = scene["far"];
  options.eps = eps;
  return options;
}

// dL/dalpha of an image: a plane of its own, or the fourth of dL/d(r, g, b, alpha, ...).
Json UpstreamAlpha(const Json& scene, std::size_t n) {
  return scene.contains("upstream_alpha") ? scene["upstream_alpha"][n] : scene["upstream"][n][3];
}

// Calls check(scene, its source of inputs, gradient, image) for the gradients that `wanted` takes.
template <class Wanted, class Check>
void ForSharedImages(const Json& file, const Wanted& wanted, const Check& check) {
  const Json& scenes = file["scenes"];
  for (const Json& scene : scenes) {
    const Json& inputs = scene.contains("inputs_of_scene")
                             ? scenes[scene["inputs_of_scene"].get<std::size_t>()]
                             : scene;
    for (const Json& gradient : scene["gradients"]) {
      if (!wanted(scene, gradient)) continue;
      for (std::size_t n = 0; n < inputs["face_vertices"].size(); ++n) {
        SCOPED_TRACE(scene["name"].get<std::string>() + " " + scene["anti_aliasing"].dump() + " " +
                     gradient["outputs"].dump() + " eps " + gradient["eps"].dump());
        check(scene, inputs, gradient, n);
      }
    }
  }
}

// 1e-10: both sides compute in double; a gradient's largest entries are D / eps, its terms up to
// 1e4.
TEST(N3mr, DoubleGivesTheNumbersOfThePublishedKernels) {
  TILEGRAD_VECTORS_OR_SKIP(file, "16_n3mr.json");
  int cases = 0;
  const auto alpha_alone = [](const Json&, const Json& gradient) {
    return gradient["outputs"] == "alpha";
  };
  ForSharedImages(file, alpha_alone,
                  [&](const Json& scene, const Json& inputs, const Json& gradient, std::size_t n) {
                    const int size = scene["image_size"];
                    const auto corners = Numbers(inputs["face_vertices"][n]);
                    const auto d_alpha = Numbers(UpstreamAlpha(inputs, n));
                    N3mrOptions options = OptionsOf(scene, gradient["eps"]);
                    const auto alpha = Numbers(scene["alpha"][n]);
                    const auto expect = [&](const char* key) {
                      const auto want = Numbers(gradient[key][n]);
                      for (const auto& got : {Reference(corners, size, options, d_alpha),
                                              Fast(corners, size, options, d_alpha)}) {
                        EXPECT_LT(Difference(got.alpha, alpha), 1e-10);
                        EXPECT_LT(Difference(PlaneParts(got.d_corners), want),
                                  1e-10 * std::max(1.0, Largest(want)));
                      }
                    };
                    expect("grad_face_vertices");
                    options.floor_lines = true;
                    if (gradient.contains("grad_face_vertices_floor"))
                      expect("grad_face_vertices_floor");
                    ++cases;
                  });
  EXPECT_EQ(cases, 16);
}

const N3mrOptions kPlain{.reduction = N3mrReduction::kNone, .fill_back = false};

// A face over the left half of 4 x 4 pixels: its edge at x = -0.1 lies between the
// centres -0.25 and 0.25. One uncovered pixel is wanted, at (column 3, x = 0.75), in the row of
// centre y = 0.25.
struct HalfImage {
  // Edge 0 from (-0.1, -3) up to (-0.1, 3): the face is left of it.
  std::vector<double> corners = {-0.1, -3, 2, -0.1, 3, 2, -6, 0, 2};
  std::vector<double> d_alpha = std::vector<double>(16);
};

TEST(N3mr, AnUncoveredPixelPullsTheEdgeBesideIt) {
  HalfImage half;
  half.d_alpha[1 * 4 + 3] = -0.7;
  const auto got = Reference(half.corners, 4, kPlain, half.d_alpha);
  EXPECT_EQ(got.alpha, (std::vector<double>{1, 1, 0, 0, 1, 1, 0, 0, 1, 1, 0, 0, 1, 1, 0, 0}));
  // Corner 0 has to move (3 + 3) / (3 - 0.25) times as far as the crossing, corner 1
  // (3 + 3) / (0.25 + 3) times; the crossing moves from -0.1 to 0.75.
  const double eps = kPlain.eps, move = 0.85;
  const double a = -0.7 / (6 / 2.75 * move + eps), b = -0.7 / (6 / 3.25 * move + eps);
  EXPECT_LT(Difference(got.d_corners, std::vector<double>{a, 0, 0, b, 0, 0, 0, 0, 0}), 1e-14);
}

// A covered pixel that the loss wants uncovered, at x = -0.25: the edge moves left by 0.15.
TEST(N3mr, ACoveredPixelPushesTheEdgeInward) {
  HalfImage half;
  half.d_alpha[1 * 4 + 1] = 0.4;
  const auto got = Reference(half.corners, 4, kPlain, half.d_alpha);
  const double eps = kPlain.eps, move = -0.15;
  const double a = -0.4 / (6 / 2.75 * move - eps), b = -0.4 / (6 / 3.25 * move - eps);
  EXPECT_GT(a, 0);
  std::vector<double> of_edge(got.d_corners.begin(), got.d_corners.begin() + 6);
  EXPECT_LT(Difference(of_edge, std::vector<double>{a, 0, 0, b, 0, 0}), 1e-14);
}

// Wishes that a move of this edge cannot grant have no gradient.
TEST(N3mr, OnlyMovesThatLowerTheLossCount) {
  HalfImage half;
  half.d_alpha[1 * 4 + 3] = 0.7;   // uncovered, and wanted so
  half.d_alpha[2 * 4 + 1] = -0.4;  // covered, and wanted so
  EXPECT_EQ(Largest(Reference(half.corners, 4, kPlain, half.d_alpha).d_corners), 0);
}

// A clockwise face is drawn from behind only, and its gradient is that of the face turned around.
TEST(N3mr, FillBackDrawsFacesFromBehind) {
  HalfImage half;
  half.d_alpha[1 * 4 + 3] = -0.7;
  const auto front = Reference(half.corners, 4, kPlain, half.d_alpha);
  const auto turned = [](const std::vector<double>& c) {
    return std::vector<double>{c[6], c[7], c[8], c[3], c[4], c[5], c[0], c[1], c[2]};
  };
  N3mrOptions options = kPlain;
  EXPECT_EQ(Largest(Reference(turned(half.corners), 4, options, half.d_alpha).alpha), 0);
  options.fill_back = true;
  const auto back = Reference(turned(half.corners), 4, options, half.d_alpha);
  EXPECT_EQ(back.alpha, front.alpha);
  EXPECT_LT(Difference(turned(back.d_corners), front.d_corners), 1e-15);
}

// Of two drawn faces at one depth the first wins; nearer ones win; beyond the planes nothing is.
TEST(N3mr, DepthDecidesAndTiesGoToTheFirst) {
  const HalfImage half;
  std::vector<double> corners = half.corners;
  corners.insert(corners.end(), half.corners.begin(), half.corners.end());
  const N3mrDrawingRef<double> tie(corners, 4, kPlain);
  EXPECT_EQ(tie.owner[0], 0);
  corners[9 + 2] = corners[9 + 5] = corners[9 + 8] = 1.5;
  const N3mrDrawingRef<double> nearer(corners, 4, kPlain);
  EXPECT_EQ(nearer.owner[0], 1);
  N3mrOptions options = kPlain;
  options.near_plane = 1.5;
  options.far_plane = 2;  // both excluded
  const N3mrDrawingRef<double> none(corners, 4, options);
  EXPECT_EQ(none.owner, std::vector<std::int32_t>(16, -1));
}

// Double: the same operations but for the planes of weights and depth; no pixel of these scenes
// lies within 1e-9 of an edge. Float: a crossing carries 1e-6 pixels, and gains stand over
// distances of eps = 1e-3 at the least: 1e-3.
TEST(N3mr, FastIsTheReference) {
  constexpr int kSide = 21;
  for (const N3mrReduction reduction :
       {N3mrReduction::kNone, N3mrReduction::kMean, N3mrReduction::kBilinear}) {
    for (const double extent : {0.1, 0.6}) {
      Rng rng(3);
      const auto corners = RandomCorners<float>(60, extent, &rng);
      const auto d_alpha = Random<float>(kSide * kSide, -1, 1, &rng);
      const std::vector<double> exact(corners.begin(), corners.end());
      const std::vector<double> push(d_alpha.begin(), d_alpha.end());
      const N3mrOptions options{.reduction = reduction};
      const auto want = Reference(exact, kSide, options, push);
      const auto fast = Fast(exact, kSide, options, push);
      EXPECT_LT(Difference(fast.alpha, want.alpha), 1e-12);
      EXPECT_LT(Difference(fast.d_corners, want.d_corners), 1e-10 * Largest(want.d_corners));
      const auto got = Fast(corners, kSide, options, d_alpha);
      EXPECT_LT(Difference(got.alpha, want.alpha), 1e-5);
      EXPECT_LT(Difference(got.d_corners, want.d_corners), 1e-3 * Largest(want.d_corners));
    }
  }
}

// Faces without area or with numbers that are none are not drawn, and nothing becomes NaN.
TEST(N3mr, OddFacesAreLeftOut) {
  constexpr int kSide = 9;
  Rng rng(2);
  const auto sound = RandomCorners<float>(3, 0.5, &rng);
  const auto d_alpha = Random<float>(kSide * kSide, -1, 1, &rng);
  std::vector<float> all = WithOddFaces(sound);
  for (const float v : {0, 0, 0, 1, 0, 0, 0, 1, 0}) all.push_back(v);  // at the eye
  const auto alone = Fast(sound, kSide, {}, d_alpha), mixed = Fast(all, kSide, {}, d_alpha);
  EXPECT_EQ(alone.alpha, mixed.alpha);
  std::vector<float> want = alone.d_corners;
  want.resize(all.size(), 0.0f);
  EXPECT_EQ(mixed.d_corners, want);
}

}  // namespace tilegrad::rivals::n3mr_test

// N3MR's colours: numbers worked out by hand, independent numbers of the published
// kernels, complex step for what is a derivative, and the fast code against the reference.

namespace tilegrad::rivals::n3mr_color_test {

using namespace test;  // NOLINT: of the tests of one folder

using Complex = std::complex<double>;

enum Asked { kColor = 1, kAlpha = 2 };

// Images and gradients of a scene; `d`: dL/d(r, g, b, alpha), planes of the image.
template <class T>
struct Result {
  std::vector<T> color, alpha, d_corners, d_textures;

  Result(const N3mrSceneRef<T>& scene, std::size_t pixels)
      : color(3 * pixels),
        alpha(pixels),
        d_corners(scene.corners.size()),
        d_textures(scene.textures.size()) {}
  N3mrImages<T> Images() { return {color, alpha}; }
  N3mrColorAdjoints<T> Adjoints() { return {d_corners, d_textures}; }
};

template <class T>
N3mrImages<const T> PushesOf(const std::vector<T>& d, int asked) {
  const std::span<const T> all = d;
  const std::size_t pixels = d.size() / 4;
  N3mrImages<const T> out;
  if ((asked & kColor) != 0) out.color = all.first(3 * pixels);
  if ((asked & kAlpha) != 0) out.alpha = all.subspan(3 * pixels, pixels);
  return out;
}

template <class T>
Result<T> Reference(const N3mrSceneRef<T>& scene, const std::vector<T>& d, int asked) {
  Result<T> out(scene, d.size() / 4);
  N3mrSceneForwardRef(scene, out.Images());
  N3mrSceneBackwardRef(scene, PushesOf(d, asked), out.Adjoints());
  return out;
}

// Rows in three parts, faces in two.
template <class T>
Result<T> Fast(const N3mrSceneRef<T>& scene, const std::vector<T>& d, int asked) {
  Result<T> out(scene, d.size() / 4);
  std::fill(out.d_textures.begin(), out.d_textures.end(), T(7));
  N3mrImageT<T> image;
  N3mrPlanesT<T> planes;
  SetUpN3mr<T>(scene.corners, scene.size, scene.options, &image);
  ReserveN3mrPlanes(image, &planes);
  const N3mrColorJob<T> job{scene.options, scene.colors, image, scene.textures};
  const int m = image.inner;
  for (const RowRange rows : {RowRange{0, m / 3}, {m / 3, m / 2}, {m / 2, m}}) {
    DrawN3mr(scene.options, rows, &image);
    N3mrShade(job, rows, &planes);
  }
  N3mrReducePlanes(job, planes, out.Images());
  const N3mrImages<const T> pushes = PushesOf(d, asked);
  N3mrPrepareColorBackward(job, pushes, &planes);
  const std::size_t faces = scene.corners.size() / kCornerNumbers;
  N3mrColorBackward(job, pushes, planes, 0, faces / 2, out.Adjoints());
  N3mrColorBackward(job, pushes, planes, faces / 2, faces, out.Adjoints());
  return out;
}

int AskedOf(const std::string& outputs) {
  return outputs == "rgb" ? kColor : outputs == "alpha" ? kAlpha : kColor | kAlpha;
}

// A scene of the file at one image, in numbers of T.
template <class T>
struct SharedScene {
  std::vector<T> corners, textures, d;
  N3mrSceneRef<T> scene;

  SharedScene(const Json& file, const Json& of, const Json& inputs, std::size_t n, double eps)
      : corners(Numbers<T>(inputs["face_vertices"][n])),
        textures(Numbers<T>(file["textures"][of["texture"].get<std::string>()][n])),
        d(Numbers<T>(inputs["upstream"][n])) {
    scene = {corners, textures, of["image_size"], n3mr_test::OptionsOf(of, eps), {}};
    d.resize(4 * static_cast<std::size_t>(scene.size * scene.size));
    const auto background = Numbers(of["background"]);
    std::copy_n(background.begin(), 3, scene.colors.background);
    const double texels = static_cast<double>(3 * textures.size() / corners.size());
    scene.colors.resolution = static_cast<int>(std::lround(std::cbrt(texels)));
  }
};

template <class T>
void ExpectShared(const Json& of, const Json& gradient, std::size_t n, const Result<T>& got,
                  double of_image, double of_gradient) {
  // The lookup's eps is that of the scene.
  if (of["eps"] == gradient["eps"]) {
    EXPECT_LT(Difference(got.color, Numbers(of["rgb"][n])), of_image);
  }
  EXPECT_LT(Difference(got.alpha, Numbers(of["alpha"][n])), of_image);
  const auto want = Numbers(gradient["grad_face_vertices"][n]);
  EXPECT_LT(Difference(PlaneParts(got.d_corners), want),
            of_gradient * std::max(1e-3, Largest(want)));
  if (!gradient.contains("grad_textures")) return;
  const auto d_textures = Numbers(gradient["grad_textures"][n]);
  EXPECT_LT(Difference(got.d_textures, d_textures),
            of_gradient * std::max(1.0, Largest(d_textures)));
}

// 1e-10: both sides compute in double.
TEST(N3mrColors, DoubleGivesTheNumbersOfThePublishedKernels) {
  TILEGRAD_VECTORS_OR_SKIP(file, "16_n3mr.json");
  int cases = 0;
  const auto of_colors = [](const Json& of, const Json& gradient) {
    return of.contains("texture") && gradient["outputs"] != "depth";
  };
  n3mr_test::ForSharedImages(
      file, of_colors,
      [&](const Json& of, const Json& inputs, const Json& gradient, std::size_t n) {
        const SharedScene<double> at(file, of, inputs, n, gradient["eps"]);
        const int asked = AskedOf(gradient["outputs"]);
        ExpectShared(of, gradient, n, Reference(at.scene, at.d, asked), 1e-10, 1e-10);
        ExpectShared(of, gradient, n, Fast(at.scene, at.d, asked), 1e-10, 1e-10);
        ++cases;
      });
  EXPECT_EQ(cases, 22);
}

// A cube of 2 at its face's middle, depths equal: u = 1/3 each, so corner (0,0,0) of the cube
// weighs (2/3)^3 and (1,1,1) (1/3)^3.
TEST(N3mrColors, ACubeAtTheMiddleOfItsFace) {
  const N3mrFaceT<double> face{{{0, 1, 0}, {0, 0, 1}, {2, 2, 2}}, 1, 0, false};
  const double w[3] = {1.0 / 3, 1.0 / 3, 1.0 / 3};
  const auto at = N3mrTexelsAt(face, w, 2.0, 2, 1e-3);
  EXPECT_EQ(at.index[0], 0u);
  EXPECT_NEAR(at.weight[0], 8.0 / 27, 1e-15);
  EXPECT_EQ(at.index[7], 7u);
  EXPECT_NEAR(at.weight[7], 1.0 / 27, 1e-15);
  double sum = 0;
  for (const double weight : at.weight) sum += weight;
  EXPECT_NEAR(sum, 1, 1e-15);
}

// At corner 0 the texel (1,0,0) of a cube of 2 weighs 1 - eps; of a face from behind, whose drawn
// corner 0 is corner 2 as given, the texel (0,0,1).
TEST(N3mrColors, ACubeAtACornerOfItsFace) {
  N3mrFaceT<double> face{{{0, 1, 0}, {0, 0, 1}, {2, 3, 4}}, 1, 0, false};
  const double w[3] = {1, 0, 0};
  const auto weight_of = [&](std::size_t texel) {
    const auto at = N3mrTexelsAt(face, w, 2.0, 2, 0.01);
    double sum = 0;
    for (int n = 0; n < 8; ++n) sum += at.index[n] == texel ? at.weight[n] : 0;
    return sum;
  };
  EXPECT_NEAR(weight_of(4), 0.99, 1e-15);
  EXPECT_NEAR(weight_of(0), 0.01, 1e-15);
  face.reversed = true;
  EXPECT_NEAR(weight_of(1), 0.99, 1e-15);
}

template <class T>
struct RandomScene {
  std::vector<T> corners, textures, d;
  N3mrSceneRef<T> scene;

  RandomScene(N3mrReduction reduction, std::size_t faces, double extent, int size) {
    Rng rng(13);
    N3mrColors colors{.resolution = 3, .background = {0.1, 0.6, 0.3}};
    corners = RandomCorners<T>(faces, extent, &rng);
    textures = Random<T>(faces * colors.texels() * 3, 0, 1, &rng);
    d = Random<T>(4 * static_cast<std::size_t>(size * size), -1, 1, &rng);
    scene = {corners, textures, size, {.reduction = reduction}, colors};
  }
};

// Complex step: 1e-10 as for SoftRas.
TEST(N3mrColors, GradientsOfTexelsAreDerivatives) {
  for (const N3mrReduction reduction : {N3mrReduction::kMean, N3mrReduction::kBilinear}) {
    const RandomScene<double> at(reduction, 6, 0.6, 7);
    const auto color = Reference(at.scene, at.d, kColor);
    std::vector<double> d_textures(at.textures.size());
    const std::vector<Complex> corners(at.corners.begin(), at.corners.end());
    for (std::size_t i = 0; i < d_textures.size(); ++i) {
      std::vector<Complex> textures(at.textures.begin(), at.textures.end());
      textures[i] += Complex(0, 1e-30);
      std::vector<Complex> planes(3 * at.d.size() / 4);
      N3mrSceneForwardRef<Complex>(
          {corners, textures, at.scene.size, at.scene.options, at.scene.colors}, {planes, {}});
      for (std::size_t p = 0; p < planes.size(); ++p)
        d_textures[i] += at.d[p] * planes[p].imag() / 1e-30;
    }
    EXPECT_GT(Largest(d_textures), 0.1);
    EXPECT_LT(Difference(color.d_textures, d_textures), 1e-10 * Largest(d_textures));
  }
}

// Tolerances as of alpha alone (n3mr_test.cc).
TEST(N3mrColors, FastIsTheReference) {
  for (const N3mrReduction reduction :
       {N3mrReduction::kNone, N3mrReduction::kMean, N3mrReduction::kBilinear}) {
    for (const int asked : {int{kColor}, int{kAlpha}, kColor | kAlpha}) {
      const RandomScene<double> exact(reduction, 40, 0.3, 19);
      const RandomScene<float> narrow(reduction, 40, 0.3, 19);
      const auto want = Reference(exact.scene, exact.d, asked);
      const auto fast = Fast(exact.scene, exact.d, asked);
      const auto got = Fast(narrow.scene, narrow.d, asked);
      EXPECT_LT(Difference(fast.color, want.color), 1e-11);
      EXPECT_LT(Difference(got.color, want.color), 1e-4);
      EXPECT_LT(Difference(got.alpha, want.alpha), 1e-5);
      EXPECT_LT(Difference(fast.d_corners, want.d_corners), 1e-10 * Largest(want.d_corners));
      EXPECT_LT(Difference(got.d_corners, want.d_corners), 1e-3 * Largest(want.d_corners));
      EXPECT_LE(Difference(got.d_textures, want.d_textures), 1e-3 * Largest(want.d_textures));
    }
  }
}

}  // namespace tilegrad::rivals::n3mr_color_test
