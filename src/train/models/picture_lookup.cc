// SPDX-License-Identifier: Apache-2.0
#include "train/models/picture_lookup.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>

#include "nn/nn.h"

namespace tilegrad::train {
namespace {

// Where the numbers of Pose are 0, and what 1 is.
constexpr double kScale = 0.75, kNearness = 0.6;
constexpr double kShiftUnit = 0.1, kScaleUnit = 0.1, kNearnessUnit = 0.5;
constexpr double kLeastDepth = 0.2;   // of the distance: nothing is nearer
constexpr double kLeastCover = 0.3;   // colours are not divided by less
constexpr double kLeastLight = 0.25;  // nor by less light: dark pixels would turn into noise
constexpr double kBlack = 0.03;       // brightness of what no light reaches, at most

// A pose as it is used.
template <class T>
struct View {
  using Vec3 = glm::vec<3, T>;
  Vec3 right, up, back;  // rows of the rotation
  T x, y, scale, nearness;

  explicit View(const T* p)
      : right(p[0], p[1], p[2]),
        up(p[3], p[4], p[5]),
        x(T(0.5) + T(kShiftUnit) * p[6]),
        y(T(0.5) + T(kShiftUnit) * p[7]),
        scale(T(kScale) + T(kScaleUnit) * p[8]),
        nearness(std::max(T(0), T(kNearness) + T(kNearnessUnit) * p[9])) {
    right /= glm::length(right) + T(1e-9);
    up -= glm::dot(up, right) * right;
    up /= glm::length(up) + T(1e-9);
    back = glm::cross(right, up);
  }
  Vec3 Turned(const Vec3& v) const {
    return {glm::dot(right, v), glm::dot(up, v), glm::dot(back, v)};
  }
};

// Along one axis of a picture: two pixels, and the shares of a place between them. Nothing is
// beyond the edges.
template <class T>
struct TwoPixels {
  std::size_t first, second;
  T first_share, second_share;

  // at: in (-1, size).
  TwoPixels(T at, std::size_t size) {
    // Of the first pixel, plus 1. The sum may round up to size + 1.
    const std::size_t low = std::min(static_cast<std::size_t>(at + T(1)), size);
    const T share = at + T(1) - static_cast<T>(low);
    first = low > 0 ? low - 1 : 0;
    second = std::min(low, size - 1);
    first_share = low > 0 ? T(1) - share : T(0);
    second_share = low < size ? share : T(0);
  }
};

// Samples a picture at (x, y), in [0, 1] from its upper left corner.
template <class T>
std::array<T, 4> SampleAt(const T* image, std::size_t size, T x, T y) {
  const T extent = static_cast<T>(size), column = x * extent - T(0.5), row = y * extent - T(0.5);
  if (!(column > -1 && row > -1 && column < extent && row < extent)) return {};
  const TwoPixels<T> across(column, size), down(row, size);
  std::array<T, 4> out;
  for (std::size_t c = 0; c < 4; ++c) {
    const T* const upper = image + (c * size + down.first) * size;
    const T* const lower = image + (c * size + down.second) * size;
    const auto along = [&across](const T* r) {
      return across.first_share * r[across.first] + across.second_share * r[across.second];
    };
    out[c] = down.first_share * along(upper) + down.second_share * along(lower);
  }
  return out;
}

// Sums of face normals that are as long as their faces are large.
template <class T>
std::vector<glm::dvec3> SmoothNormals(const std::vector<Face>& faces, const T* p,
                                      std::size_t vertices) {
  std::vector<glm::dvec3> normals(vertices, glm::dvec3(0));
  const auto at = [p](std::int32_t v) { return glm::dvec3(p[3 * v], p[3 * v + 1], p[3 * v + 2]); };
  for (const Face& f : faces) {
    const glm::dvec3 a = at(f[0]);
    const glm::dvec3 normal = glm::cross(at(f[1]) - a, at(f[2]) - a);
    for (const std::int32_t v : f) normals[static_cast<std::size_t>(v)] += normal;
  }
  return normals;
}

// Barycentric coordinates of a cube's texel.
glm::vec3 PlaceOf(std::int64_t texel) {
  const glm::vec3 p(texel >> 2 & 1, texel >> 1 & 1, texel & 1);
  const float sum = p.x + p.y + p.z;
  return sum > 0 ? p / sum : glm::vec3(1.0f / 3);
}

// The four texels around (u, v): u repeats, v is clamped.
void AddBilinear(glm::vec2 uv, std::int64_t side, nn::AxisTerms* terms) {
  const double x = static_cast<double>(uv.x) * static_cast<double>(side) - 0.5;
  const double y = (1 - static_cast<double>(uv.y)) * static_cast<double>(side) - 0.5;
  const double a = x - std::floor(x), b = y - std::floor(y);
  for (int k = 0; k < 4; ++k) {
    const auto column = static_cast<std::int64_t>(std::floor(x)) + k % 2;
    const auto row = static_cast<std::int64_t>(std::floor(y)) + k / 2;
    const std::int64_t i = std::clamp(row, std::int64_t{0}, side - 1);
    terms->push_back({i * side + (column % side + side) % side,
                      (k % 2 == 1 ? a : 1 - a) * (k / 2 == 1 ? b : 1 - b)});
  }
}

// N3MR's mixture at barycentric weights w of a face: each axis of the cube at w of its corner.
void AddMixture(std::int64_t face, const std::array<float, 3>& w, nn::AxisTerms* terms) {
  for (std::int64_t t = 0; t < FaceCubes::kTexels; ++t) {
    double weight = 1;
    for (int k = 0; k < 3; ++k) {
      const double share = w[static_cast<std::size_t>(k)];
      weight *= (t >> (2 - k) & 1) == 1 ? share : 1 - share;
    }
    terms->push_back({face * FaceCubes::kTexels + t, weight});
  }
}

nn::Var Cross(const nn::Var& a, const nn::Var& b) {
  const auto turned = [](const nn::Var& v, int by) {
    const int axis = v.shape().rank() - 1;
    return nn::Concat({nn::Slice(v, axis, by, 3), nn::Slice(v, axis, 0, by)}, axis);
  };
  return turned(a, 1) * turned(b, 2) - turned(a, 2) * turned(b, 1);
}

}  // namespace

Pose PoseOf(const Camera& camera, int size) {
  Pose pose;
  for (std::size_t i = 0; i < 6; ++i) pose[i] = static_cast<double>(camera.rotation[i]);
  const double distance = -static_cast<double>(camera.translation[2]);
  // A shift of the origin along the image is one of the principal point.
  const double x = (camera.cx + camera.fx * camera.translation[0] / distance) / size;
  const double y = (camera.cy - camera.fy * camera.translation[1] / distance) / size;
  pose[6] = (x - 0.5) / kShiftUnit;
  pose[7] = (y - 0.5) / kShiftUnit;
  pose[8] = (camera.fx / distance / size - kScale) / kScaleUnit;
  pose[9] = (1 / distance - kNearness) / kNearnessUnit;
  return pose;
}

Camera CameraOf(const Pose& pose, int size) {
  constexpr double kFarthest = 100;
  const View<double> view(pose.data());
  Camera camera;
  const glm::dvec3 rows[3] = {view.right, view.up, view.back};
  for (int i = 0; i < 9; ++i) camera.rotation[i] = static_cast<float>(rows[i / 3][i % 3]);
  const double distance = 1 / std::max(view.nearness, 1 / kFarthest);
  camera.translation[2] = static_cast<float>(-distance);
  camera.fx = camera.fy = static_cast<float>(view.scale * distance * size);
  camera.cx = static_cast<float>(view.x * size);
  camera.cy = static_cast<float>(view.y * size);
  return camera;
}

PictureLookup::PictureLookup(const Mesh& sphere, int side)
    : side_(static_cast<std::size_t>(side)),
      faces_(sphere.faces),
      texels_(SphereTexels(sphere, side, side)) {}

// A texel of the surface as a picture shows it.
template <class T>
struct SeenTexel {
  std::array<T, 4> rgba;  // over black
  glm::vec<3, T> normal;  // unit, in the axes of the camera
  T facing;               // its cosine to the camera
  T Color(std::size_t c) const { return rgba[c] / std::max(T(kLeastCover), rgba[3]); }
};

template <class T>
class PictureLookup::Picture {
  using Vec3 = glm::vec<3, T>;

 public:
  Picture(const std::vector<Face>& faces, const Job& job, std::size_t m)
      : size_(static_cast<std::size_t>(job.images.shape()[3])),
        image_(job.images.data<T>() + m * 4 * size_ * size_),
        view_(job.pose.data<T>() + static_cast<std::size_t>(kPoseNumbers) * m) {
    const auto vertices = static_cast<std::size_t>(job.positions.shape()[1]);
    const T* const p = job.positions.data<T>() + m * 3 * vertices;
    const std::vector<glm::dvec3> normals = SmoothNormals(faces, p, vertices);
    for (std::size_t v = 0; v < vertices; ++v)
      vertices_.push_back(
          {view_.Turned({p[3 * v], p[3 * v + 1], p[3 * v + 2]}), view_.Turned(Vec3(normals[v]))});
  }

  SeenTexel<T> At(const SurfacePoint& point) const {
    Vec3 x(0), n(0);
    for (std::size_t k = 0; k < 3; ++k) {
      const Vertex& v = vertices_[static_cast<std::size_t>(point.vertices[k])];
      const T weight = static_cast<T>(point.weights[k]);
      x += weight * v.position;
      n += weight * v.normal;
    }
    n /= glm::length(n) + T(1e-12);
    // In units of the camera's distance: depth 1 at the origin.
    const T depth = std::max(T(kLeastDepth), 1 - view_.nearness * x.z), zoom = view_.scale / depth;
    const Vec3 eye(-view_.nearness * x.x, -view_.nearness * x.y, depth);
    return {SampleAt(image_, size_, view_.x + zoom * x.x, view_.y - zoom * x.y), n,
            glm::dot(n, eye) / glm::length(eye)};
  }

 private:
  struct Vertex {
    Vec3 position, normal;  // in the axes of the camera
  };
  std::size_t size_;
  const T* image_;
  View<T> view_;
  std::vector<Vertex> vertices_;
};

template <class T>
void PictureLookup::LookAt(const Job& job, std::size_t m, std::size_t channels, T* out) const {
  const Picture<T> picture(faces_, job, m);
  const T* l = job.light.empty() ? nullptr : job.light.data<T>() + 3 * m;
  const std::size_t plane = side_ * side_;
  for (std::size_t t = 0; t < plane; ++t) {
    const SeenTexel<T> seen = picture.At(texels_[t]);
    std::array<T, kChannels> values = {seen.Color(0), seen.Color(1), seen.Color(2),
                                       seen.rgba[3],  seen.facing,   T(0)};
    if (l != nullptr && channels == kChannels) {
      const T lit = glm::dot(seen.normal, glm::vec<3, T>(l[0], l[1], l[2]));
      values[5] = -std::log(std::max(T(kLeastLight), lit));
    }
    // The mirror image of column j is side / 2 - 1 - j, as scene/shapes.h says.
    const std::size_t j = t % side_, other = t - j + (side_ + side_ / 2 - 1 - j) % side_;
    for (std::size_t c = 0; c < channels; ++c) {
      out[c * plane + t] = values[c];
      out[(channels + c) * plane + other] = values[c];
    }
  }
}

// Sums over texels, by their cover and their cosine to the camera.
struct CueSums {
  double all = 1e-9, bright = 0, lit = 1e-9;
  glm::dvec3 normal{0}, bright_normal{0}, lit_normal{0}, lit_bright_normal{0};
  glm::dmat3 lit_products{0};  // of normals with themselves

  template <class T>
  void Add(const SeenTexel<T>& seen) {
    const double weight = std::max(T(0), seen.facing) * seen.rgba[3];
    if (weight == 0) return;
    const double brightness = (seen.Color(0) + seen.Color(1) + seen.Color(2)) / 3;
    const glm::dvec3 n(seen.normal);
    all += weight;
    bright += weight * brightness;
    normal += weight * n;
    bright_normal += weight * brightness * n;
    if (brightness < kBlack) return;
    lit += weight;
    lit_normal += weight * n;
    lit_bright_normal += weight * brightness * n;
    lit_products += glm::outerProduct(weight * n, n);
  }
  // Least squares, drawn a little towards the camera where normals leave it open.
  glm::dvec3 Light() const {
    const double little = 0.02 * lit + 1e-9;
    const glm::dvec3 d = glm::inverse(lit_products + glm::dmat3(little)) *
                         (lit_bright_normal + glm::dvec3(0, 0, 1e-3 * little));
    return d / (glm::length(d) + 1e-12);
  }
  std::array<double, PictureLookup::kCues> Numbers() const {
    const double mean = bright / all;
    const glm::dvec3 n = normal / all, goes = (bright_normal / all - mean * n) / (mean + kBlack),
                     where = lit_normal / lit;
    const glm::dvec3 light = Light();
    return {n.x,       n.y,     n.z,     mean,    4 * goes.x, 4 * goes.y, 4 * goes.z,
            lit / all, where.x, where.y, where.z, light.x,    light.y,    light.z};
  }
};

nn::Tensor PictureLookup::Cues(nn::Context& context, const Job& job) const {
  const std::int64_t images = job.images.shape()[0];
  nn::Tensor out = context.Empty({images, kCues}, job.images.dtype());
  nn::WithFloatType(out.dtype(), [&]<class T>(T) {
    context.workers().For(static_cast<std::size_t>(images), [&](std::size_t m, std::size_t) {
      const Picture<T> picture(faces_, job, m);
      CueSums sums;
      for (const SurfacePoint& texel : texels_) sums.Add(picture.At(texel));
      std::ranges::transform(sums.Numbers(), out.data<T>() + m * kCues,
                             [](double x) { return static_cast<T>(x); });
    });
  });
  return out;
}

nn::Tensor PictureLookup::Run(nn::Context& context, const Job& job, std::int64_t channels) const {
  const std::int64_t images = job.images.shape()[0], side = static_cast<std::int64_t>(side_);
  nn::Tensor out = context.Empty({images, 2 * channels, side, side}, job.images.dtype());
  nn::WithFloatType(out.dtype(), [&]<class T>(T) {
    const std::size_t numbers = static_cast<std::size_t>(2 * channels) * side_ * side_;
    context.workers().For(static_cast<std::size_t>(images), [&](std::size_t m, std::size_t) {
      LookAt<T>(job, m, static_cast<std::size_t>(channels), out.data<T>() + m * numbers);
    });
  });
  return out;
}

nn::Tensor PictureLookup::Look(nn::Context& context, const Job& job) const {
  return Run(context, job, kChannels);
}

nn::Tensor PictureLookup::Colors(nn::Context& context, const Job& job) const {
  return Run(context, job, 3);
}

nn::UNetShape UNetOf(const PictureCodeConfig& config, nn::UNetShape ends) {
  ends.base = config.base;
  ends.most = config.most;
  ends.levels = static_cast<int>(config.levels);
  ends.skips = config.skips;
  ends.enlarge = static_cast<int>(config.enlarge);
  return ends;
}

PictureCode::PictureCode(nn::Context& context, const nn::UNetShape& unet,
                         const PictureCodeShape& shape, Rng& rng)
    : unet_(context, unet, rng) {
  const std::int64_t side = shape.image_size >> unet.levels;
  bottom_ = {std::min(unet.most, unet.base << (unet.levels - 1)), side, side};
  latent_.Add<nn::Flatten>("flatten");
  latent_.Add<nn::Activation>("act", &nn::LeakyRelu02);
  for (int i = 1; i <= shape.layers; ++i) {
    const std::string number = shape.layers == 1 ? "" : std::to_string(i);
    nn::AddLinear(latent_, "fc" + number, context, i == 1 ? bottom_.elements() : shape.latent,
                  shape.latent, rng);
    latent_.Add<nn::Activation>("act" + std::to_string(i), &nn::LeakyRelu02);
  }
  nn::AddLinear(map_, "fc", context, shape.latent, bottom_.elements(), rng);
}

PictureCode::Encoded PictureCode::Encode(const nn::Var& pictures, nn::Mode mode) {
  Encoded out{.levels = unet_.Encode(pictures, mode), .latent = {}};
  out.latent = latent_.Forward(out.levels.back(), mode);
  return out;
}

nn::Var PictureCode::DecodeMap(const Encoded& encoded, nn::Mode mode) {
  const nn::Var code = nn::Reshape(map_.Forward(encoded.latent, mode),
                                   {encoded.latent.shape()[0], bottom_[0], bottom_[1], bottom_[2]});
  return unet_.Decode(code, encoded.levels, mode);
}

void PictureCode::Visit(const std::string& prefix, nn::ModuleVisitor& visitor) {
  unet_.Visit(prefix + "unet.", visitor);
  latent_.Visit(prefix + "latent.", visitor);
  map_.Visit(prefix + "map.", visitor);
}

nn::Var UnitRows(const nn::Var& v) {
  return v / nn::Sqrt(nn::Sum(nn::Square(v), {1}, nn::Keep::kYes) + 1e-8);
}

FaceCubes::FaceCubes(nn::Context& context, const Mesh& sphere, int side)
    : side_(side), faces_(static_cast<std::int64_t>(sphere.faces.size())) {
  const nn::Var like = nn::Constant(context, 0.0);
  const std::vector<glm::vec2> uvs = SphereUvs(sphere);
  const std::int64_t texels = side_ * side_, cubes = faces_ * kTexels;
  to_cubes_ = nn::MakeAxisMap(like, {texels, cubes}, [&](std::int64_t i, nn::AxisTerms& terms) {
    const glm::vec3 w = PlaceOf(i % kTexels);
    const auto corner = static_cast<std::size_t>(3 * (i / kTexels));
    AddBilinear(w.x * uvs[corner] + w.y * uvs[corner + 1] + w.z * uvs[corner + 2], side_, &terms);
  });
  const std::vector<SurfacePoint> points = SphereTexels(sphere, side, side);
  to_maps_ = nn::MakeAxisMap(like, {cubes, texels}, [&](std::int64_t i, nn::AxisTerms& terms) {
    const SurfacePoint& at = points[static_cast<std::size_t>(i)];
    AddMixture(at.face, at.weights, &terms);
  });
}

nn::Var FaceCubes::Cubes(const nn::Var& textures) const {
  const std::int64_t batch = textures.shape()[0];
  const nn::Var flat = nn::Reshape(textures, {batch, side_ * side_, 3});
  return nn::Reshape(nn::MapAxis(flat, 1, to_cubes_), {batch, faces_, kTexels, 3});
}

nn::Var FaceCubes::Maps(const nn::Var& cubes) const {
  const std::int64_t batch = cubes.shape()[0];
  const nn::Var flat = nn::Reshape(cubes, {batch, faces_ * kTexels, 3});
  return nn::Reshape(nn::MapAxis(flat, 1, to_maps_), {batch, side_, side_, 3});
}

nn::Var FaceLight(const nn::Var& positions, const std::vector<Face>& faces,
                  const nn::Var& directions, double ambient) {
  if (!positions.valid() || !directions.valid()) return nn::Invalid({&positions, &directions});
  nn::Context& context = positions.context();
  const auto corner = [&](std::size_t k) {
    std::vector<std::int32_t> vertices;
    for (const Face& face : faces) vertices.push_back(face[k]);
    return nn::Gather(positions, 1, context.Indices(vertices));
  };
  const nn::Var a = corner(0);
  const nn::Var normal = Cross(corner(1) - a, corner(2) - a);
  const nn::Var length = nn::Sqrt(nn::Sum(nn::Square(normal), {2}, nn::Keep::kYes) + 1e-14);
  const std::int64_t images = positions.shape()[0], count = static_cast<std::int64_t>(faces.size());
  const nn::Var cosine =
      nn::Sum(normal * nn::Reshape(directions, {images, 1, 3}), {2}, nn::Keep::kYes) / length;
  return nn::Reshape(nn::Relu(cosine) + ambient, {images, count, 1, 1});
}

}  // namespace tilegrad::train
