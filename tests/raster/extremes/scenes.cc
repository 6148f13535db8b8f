// SPDX-License-Identifier: Apache-2.0
#include "raster/extremes/scenes.h"

#include <cmath>
#include <iterator>
#include <limits>

namespace tilegrad::test {
namespace {

double Log(Rng* rng, double low, double high) { return std::pow(10.0, rng->Uniform(low, high)); }
double Sign(Rng* rng) { return rng->Below(2) == 0 ? 1 : -1; }

// A corner in pixels and depth.
struct Corner {
  double x, y, depth;
};

// A camera that leaves pixels as they are: (x depth, -y depth, -depth) lands on (x, y).
void SetPixelCamera(float near_plane, TestScene<float>* scene) {
  scene->camera.fx = scene->camera.fy = 1;
  scene->camera.cx = scene->camera.cy = 0;
  scene->camera.near_plane = near_plane;
}

void AddVertex(const Corner& c, TestScene<float>* scene) {
  scene->faces.push_back(static_cast<std::int32_t>(scene->vertex_count()));
  for (const double v : {c.x * c.depth, -c.y * c.depth, -c.depth}) {
    scene->positions.push_back(static_cast<float>(v));
  }
}

Corner RandomCorner(const RenderOptions& o, Rng* rng) {
  return {rng->Uniform(-0.5, 1.5) * o.width, rng->Uniform(-0.5, 1.5) * o.height,
          Log(rng, -0.3, 0.5)};
}

std::size_t FewFaces(Rng* rng) { return 1 + rng->Below(8); }

void AnyMagnitude(ExtremeScene* e, Rng* rng) {
  e->scene.camera.near_plane = static_cast<float>(Log(rng, -30, 5));
  e->scene.camera.fx = static_cast<float>(Log(rng, -10, 10));
  e->scene.camera.fy = static_cast<float>(Sign(rng) * Log(rng, -10, 10));
  const double most = rng->Uniform(-30, 30);
  for (std::size_t v = 3 * FewFaces(rng); v-- > 0;) {
    e->scene.faces.push_back(static_cast<std::int32_t>(v));
    for (int k = 0; k < 3; ++k) {
      e->scene.positions.push_back(static_cast<float>(Sign(rng) * Log(rng, -30, most)));
    }
  }
}

void SmallestNumbers(ExtremeScene* e, Rng* rng) {
  const float values[] = {0.0f,    -0.0f,  std::numeric_limits<float>::denorm_min(),
                          -1e-40f, 1e-38f, std::numeric_limits<float>::min(),
                          -1e-30f, 0.5f,   -0.5f,
                          1.0f,    -1.0f,  -2.0f};
  e->scene.camera.near_plane = rng->Below(2) == 0 ? 1e-40f : 0.25f;
  for (std::size_t v = 3 * FewFaces(rng); v-- > 0;) {
    e->scene.faces.push_back(static_cast<std::int32_t>(v));
    for (int k = 0; k < 3; ++k) {
      e->scene.positions.push_back(values[rng->Below(std::size(values))]);
    }
  }
}

// Points, segments, and faces that name a vertex twice.
void NoArea(ExtremeScene* e, Rng* rng) {
  SetPixelCamera(0.1f, &e->scene);
  for (std::size_t f = FewFaces(rng); f-- > 0;) {
    const Corner a = RandomCorner(e->options, rng), b = RandomCorner(e->options, rng);
    const double t = rng->Uniform();
    const Corner c{a.x + t * (b.x - a.x), a.y + t * (b.y - a.y), b.depth};
    const bool point = rng->Below(3) == 0;
    for (const Corner& corner : {a, point ? a : b, point ? a : c}) AddVertex(corner, &e->scene);
    if (rng->Below(3) == 0) e->scene.faces.back() = e->scene.faces[e->scene.faces.size() - 2];
  }
}

void Slivers(ExtremeScene* e, Rng* rng) {
  SetPixelCamera(0.1f, &e->scene);
  for (std::size_t f = FewFaces(rng); f-- > 0;) {
    const Corner a = RandomCorner(e->options, rng), b = RandomCorner(e->options, rng);
    const double thickness = Log(rng, -12, 0), t = rng->Uniform();
    const double length = std::hypot(b.x - a.x, b.y - a.y) + 1e-9;
    AddVertex(a, &e->scene);
    AddVertex(b, &e->scene);
    AddVertex({a.x + t * (b.x - a.x) - thickness * (b.y - a.y) / length,
               a.y + t * (b.y - a.y) + thickness * (b.x - a.x) / length, a.depth},
              &e->scene);
  }
}

void Heap(ExtremeScene* e, Rng* rng, std::size_t faces) {
  e->options.width = 1 + static_cast<int>(rng->Below(4));
  e->options.height = 1 + static_cast<int>(rng->Below(4));
  SetPixelCamera(0.1f, &e->scene);
  const double x = rng->Uniform(0, e->options.width), y = rng->Uniform(0, e->options.height);
  const double size = Log(rng, -3, 0);
  for (std::size_t v = 0; v < 3 * faces; ++v) {
    AddVertex({x + size * rng->Normal(), y + size * rng->Normal(), rng->Uniform(0.5, 2)},
              &e->scene);
  }
}

void AcrossNearPlane(ExtremeScene* e, Rng* rng) {
  e->scene = SoupAroundCamera(FewFaces(rng), e->options.width, e->options.height, rng);
  e->scene.camera.near_plane = static_cast<float>(Log(rng, -6, 0));
}

void Behind(ExtremeScene* e, Rng* rng) {
  e->scene = TriangleSoup(FewFaces(rng), 0.5, e->options.width, e->options.height, rng);
  e->scene.camera.near_plane = static_cast<float>(Log(rng, 1, 30));
}

// Vertices and edges through pixel centres and corners, depths that are powers of two.
void OnCentres(ExtremeScene* e, Rng* rng) {
  SetPixelCamera(0.125f, &e->scene);
  const double offset = rng->Below(3) == 0 ? 0 : 0.5;
  const auto w = static_cast<std::uint64_t>(e->options.width) + 2;
  const auto h = static_cast<std::uint64_t>(e->options.height) + 2;
  for (std::size_t v = 3 * FewFaces(rng); v-- > 0;) {
    AddVertex({static_cast<double>(rng->Below(w)) - 1 + offset,
               static_cast<double>(rng->Below(h)) - 1 + offset,
               std::pow(2.0, static_cast<double>(rng->Below(4)) - 2)},
              &e->scene);
  }
}

// The same face again, at other corners, wound the other way; and planes at one depth.
void DepthTies(ExtremeScene* e, Rng* rng) {
  SetPixelCamera(0.1f, &e->scene);
  const double depth = rng->Uniform(0.5, 2);
  const bool flat = rng->Below(2) == 0;
  for (std::size_t f = FewFaces(rng); f-- > 0;) {
    const auto first = static_cast<std::int32_t>(e->scene.vertex_count());
    for (int k = 0; k < 3; ++k) {
      Corner c = RandomCorner(e->options, rng);
      if (flat) c.depth = depth;
      AddVertex(c, &e->scene);
    }
    const auto turn = static_cast<std::int32_t>(rng->Below(3));
    const std::int32_t way = rng->Below(2) == 0 ? 1 : 2;
    for (std::int32_t k = 0; k < 3; ++k) e->scene.faces.push_back(first + (turn + way * k) % 3);
  }
}

// From 1e-6 in front of the eye to 1e9 away.
void DeepScene(ExtremeScene* e, Rng* rng) {
  SetPixelCamera(1e-6f, &e->scene);
  for (std::size_t v = 3 * FewFaces(rng); v-- > 0;) {
    Corner c = RandomCorner(e->options, rng);
    c.depth = Log(rng, -6.5, 9);
    AddVertex(c, &e->scene);
  }
}

void Soup(ExtremeScene* e, Rng* rng) {
  e->scene = TriangleSoup(FewFaces(rng), Log(rng, -4, 0), e->options.width, e->options.height, rng);
}

void Sphere(ExtremeScene* e, Rng* rng) {
  e->scene = BumpySphere(3, 4, e->options.width, e->options.height, rng);
}

void Nothing(ExtremeScene* e, Rng* rng) {
  if (rng->Below(2) == 0) e->scene.positions.assign(9, 1.0f);  // vertices, but no faces
}

// The longest rows and columns.
void LongRow(ExtremeScene* e, Rng* rng) {
  const int length = rng->Below(2) == 0 ? 16384 : 1 + static_cast<int>(rng->Below(16384));
  const bool row = rng->Below(2) == 0;
  e->options.width = row ? length : 1;
  e->options.height = row ? 1 : length;
  SetPixelCamera(0.1f, &e->scene);
  for (std::size_t v = 3 * FewFaces(rng); v-- > 0;) {
    AddVertex(RandomCorner(e->options, rng), &e->scene);
  }
}

// Far beyond the guard band and the range of coverage, edges through the image.
void BeyondGuardBand(ExtremeScene* e, Rng* rng) {
  SetPixelCamera(0.1f, &e->scene);
  const double reach = rng->Uniform(3, 30);
  for (std::size_t f = FewFaces(rng); f-- > 0;) {
    for (int k = 0; k < 3; ++k) {
      const double far = Log(rng, 2, reach);
      AddVertex({Sign(rng) * far, Sign(rng) * far * rng->Uniform(), 1}, &e->scene);
    }
  }
}

void RandomOptions(RenderOptions* o, Rng* rng) {
  const double errors[] = {0, 0, 1e-6, 1e-4, 1e-2, 1};
  o->width = 1 + static_cast<int>(rng->Below(rng->Below(4) == 0 ? 40 : 12));
  o->height = 1 + static_cast<int>(rng->Below(rng->Below(4) == 0 ? 40 : 12));
  o->delta = rng->Below(3) == 0 ? 1.0 / 7000 : Log(rng, -12, 6);
  o->max_alpha_error = errors[rng->Below(std::size(errors))];
  o->interpolation =
      rng->Below(2) == 0 ? Interpolation::kPerspective : Interpolation::kScreenLinear;
  o->culling = rng->Below(4) == 0 ? FaceCulling::kBack : FaceCulling::kNone;
}

void RandomChannels(Rng* rng, TestScene<float>* scene) {
  RandomAttributes(static_cast<int>(rng->Below(5)),
                   rng->Below(2) == 0 ? Rate::kVertex : Rate::kCorner, rng, scene);
  const double scale = rng->Below(8) == 0 ? Log(rng, -30, 30) : 1;
  for (float& a : scene->attributes) a = static_cast<float>(a * scale * Sign(rng));
}

struct Kind {
  const char* name;
  void (*make)(ExtremeScene*, Rng*);
};
constexpr Kind kKinds[] = {
    {"any magnitude", AnyMagnitude},
    {"smallest numbers", SmallestNumbers},
    {"no area", NoArea},
    {"slivers", Slivers},
    {"across near", AcrossNearPlane},
    {"behind", Behind},
    {"on centres", OnCentres},
    {"depth ties", DepthTies},
    {"deep", DeepScene},
    {"soup", Soup},
    {"sphere", Sphere},
    {"nothing", Nothing},
    {"beyond guard band", BeyondGuardBand},
};

}  // namespace

ExtremeScene MakeExtremeScene(std::uint64_t number, std::size_t most_faces) {
  Rng rng(number, 4711);
  ExtremeScene e;
  RandomOptions(&e.options, &rng);
  const std::uint64_t rare = rng.Below(200);
  if (rare == 0) {
    e.kind = "long row";
    LongRow(&e, &rng);
  } else if (rare < 4) {
    e.kind = "heap";
    Heap(&e, &rng, static_cast<std::size_t>(std::pow(most_faces, rng.Uniform())));
  } else {
    const Kind& kind = kKinds[rng.Below(std::size(kKinds))];
    e.kind = kind.name;
    kind.make(&e, &rng);
  }
  RandomChannels(&rng, &e.scene);
  return e;
}

ExtremeScene MakeHeap(std::uint64_t number, std::size_t faces) {
  Rng rng(number, 4711);
  ExtremeScene e;
  e.kind = "heap";
  Heap(&e, &rng, faces);
  RandomChannels(&rng, &e.scene);
  return e;
}

}  // namespace tilegrad::test
