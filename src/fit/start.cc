// SPDX-License-Identifier: Apache-2.0
// From a job to the scene that its fit starts with.
#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <numbers>

#include "base/error.h"
#include "base/hash.h"
#include "base/rng.h"
#include "fit/cutout.h"
#include "fit/hull/hull_mesh.h"
#include "fit/material.h"
#include "fit/run.h"
#include "fit/sphere.h"
#include "scene/shapes.h"
#include "scene/unwrap.h"

namespace tilegrad::train {
namespace {

constexpr float kGrey = 0.5f;                 // what is to be coloured
constexpr float kFirstHarmonic = 3.5449077f;  // 2 sqrt(pi): light 1 from everywhere
// Hulls with a mean thickness below kThinPixels get the smaller weight, since the area's pull
// removes thin parts first. Tables, taps and leaves have 2 to 4 pixels; chairs and lamps of sheet
// metal 6 to 19, sofas and cabinets more, and these lose 0 to 2 points of IoU with it.
constexpr double kThinPixels = 5, kThinArea = 0.05;

Status CheckConfig(const FitConfig& config) {
  FitConfig c = config;
  TILEGRAD_TRY(CheckFields(FieldsOf(&c)));
  if (c.loss.color_weight + c.loss.silhouette_weight == 0) {
    return InvalidArgument(
        "the weights of colour and silhouette are both 0: there is no loss to minimise");
  }
  const auto& d = c.light_direction;
  if (!(std::isfinite(d[0]) && std::isfinite(d[1]) && std::isfinite(d[2])) ||
      (d[0] == 0 && d[1] == 0 && d[2] == 0)) {
    return InvalidArgument("light_direction is {}, must be finite and not 0 0 0",
                           fmt::join(d, " "));
  }
  return {};
}

// The masks are what positions and cameras are fitted by.
Status CheckMasks(const FitJob& job) {
  if (job.input.masked || job.input.seeks_masks || job.config.loss.silhouette_weight == 0)
    return {};
  return InvalidArgument(
      "no image has alpha, a mask or a plain background: add masks (--masks, or \"mask_path\" in "
      "transforms.json), or fit colours alone with a silhouette weight of 0");
}

void SetBlankTexture(int width, int height, FitScene* scene) {
  scene->texture = Image(width, std::max(1, height), 3, kGrey);
  scene->colors.clear();
}

Result<FitScene> SphereScene(const FitJob& job, const Sphere& sphere) {
  const Mesh unit = Icosphere(job.config.template_level, 1);
  Mesh mesh = unit;
  for (glm::vec3& p : mesh.positions) p = sphere.centre + sphere.radius * p;
  TILEGRAD_ASSIGN(FitScene scene, SceneOfMesh(mesh));
  std::fill(scene.colors.begin(), scene.colors.end(), kGrey);
  if (!job.config.vertex_colors) {
    SetSphereUv(unit, &scene);
    SetBlankTexture(job.config.texture_size, job.config.texture_size / 2, &scene);
  }
  return scene;
}

// Gives the mesh charts in a texture of `side` x `side` texels, or of twice or four times as many a
// side: ragged things fall into thousands of charts. Returns that side.
Result<int> UnwrapRagged(int side, Mesh* mesh) {
  for (const int most = 4 * side;; side *= 2) {
    const Status done = Unwrap({.width = side, .height = side}, mesh);
    if (done.ok()) return side;
    if (2 * side > most) return done;
  }
}

// Where a scene without a given mesh comes from.
struct Origin {
  bool hull = false;
  HullTraits traits;
  std::string note;  // what is in doubt, and why there is no hull where one was tried
};

Result<FitScene> HullScene(const FitJob& job, const Workers& workers, const Watch& watch,
                           Origin* origin) {
  HullOptions options;
  options.carve.tolerance = job.config.mask_tolerance;
  TILEGRAD_ASSIGN(Mesh mesh, HullMesh(job.input, options, workers, watch, &origin->traits));
  int size = job.config.texture_size;
  if (!job.config.vertex_colors) {
    TILEGRAD_TRY(watch.At({"placing the texture", 0, 0, ""}));
    TILEGRAD_ASSIGN(size, UnwrapRagged(size, &mesh));
  }
  TILEGRAD_ASSIGN(FitScene scene, SceneOfMesh(mesh));
  std::fill(scene.colors.begin(), scene.colors.end(), kGrey);
  if (!job.config.vertex_colors) SetBlankTexture(size, size, &scene);
  return scene;
}

Result<FitScene> TemplateScene(const FitJob& job, const Workers& workers, const Watch& watch,
                               Origin* origin) {
  const FitConfig& config = job.config;
  TILEGRAD_ASSIGN(const Sphere sphere, GuessSphere(job.input));
  origin->note = sphere.doubt;
  origin->hull = config.start == StartShape::kHull;
  if (origin->hull) return HullScene(job, workers, watch, origin);
  if (MayStartFromHull(job) && sphere.doubt.empty()) {
    auto hull = HullScene(job, workers, watch, origin);
    origin->hull = hull.ok();
    if (hull.ok() || hull.status().code() == StatusCode::kCancelled) return hull;
    origin->note = fmt::format("the fit starts from a sphere, because there is no hull: {}",
                               hull.status().message());
  }
  return SphereScene(job, sphere);
}

Result<FitScene> MeshScene(const FitJob& job) {
  TILEGRAD_ASSIGN(FitScene scene, SceneOfMesh(*job.start));
  const ParameterSet& set = job.config.parameters;
  if (!(set[Parameter::kTexture] || set[Parameter::kUv]) || !scene.texture.empty()) return scene;
  if (scene.uvs.empty()) {
    return InvalidArgument(
        "the mesh has no texture coordinates, so it cannot get a texture: fit \"colors\" instead");
  }
  SetBlankTexture(job.config.texture_size, job.config.texture_size / 2, &scene);
  return scene;
}

bool HasColors(const Mesh& mesh) {
  return !mesh.textures.empty() || !mesh.colors.empty() || !mesh.corner_colors.empty();
}

struct Bounds {
  glm::vec3 low{HUGE_VALF}, high{-HUGE_VALF};
  glm::vec3 middle() const { return 0.5f * (low + high); }
};
Bounds BoundsOf(const FitScene& scene) {
  Bounds box;
  for (std::size_t i = 0; i < scene.positions.size(); i += 3) {
    const glm::vec3 p(scene.positions[i], scene.positions[i + 1], scene.positions[i + 2]);
    box.low = glm::min(box.low, p);
    box.high = glm::max(box.high, p);
  }
  return box;
}

float RadiusOf(const FitScene& scene) {
  const Bounds box = BoundsOf(scene);
  const glm::vec3 extent = box.high - box.low;
  return 0.5f * std::max({extent.x, extent.y, extent.z, 0.0f});
}

// Turns a camera about the object's middle by `degrees` around a random axis: it moves and looks
// elsewhere, but still at the object.
Camera Perturbed(const Camera& camera, const glm::dvec3& middle, double degrees, Rng* rng) {
  const glm::dvec3 axis =
      glm::normalize(glm::dvec3(rng->Normal(), rng->Normal(), rng->Normal()) + 1e-9);
  const double angle = degrees * std::numbers::pi / 180, s = std::sin(angle), c = std::cos(angle);
  Camera out = camera;
  for (int r = 0; r < 3; ++r) {
    const glm::dvec3 row(camera.rotation[3 * r], camera.rotation[3 * r + 1],
                         camera.rotation[3 * r + 2]);
    const glm::dvec3 turned =
        c * row + s * glm::cross(axis, row) + (1 - c) * glm::dot(axis, row) * axis;
    for (int k = 0; k < 3; ++k) out.rotation[3 * r + k] = static_cast<float>(turned[k]);
    // R p + t at the middle stays what it was.
    out.translation[r] += static_cast<float>(glm::dot(row - turned, middle));
  }
  return out;
}

void SetCameras(const FitJob& job, FitScene* scene) {
  const glm::vec3 middle = BoundsOf(*scene).middle();
  scene->pivot = {middle.x, middle.y, middle.z};
  scene->unit = 2 * RadiusOf(*scene);
  if (!(scene->unit > 0)) scene->unit = 1;  // a single point
  scene->cameras = job.start_cameras.empty() ? TurnedCameras(job, scene->pivot) : job.start_cameras;
}

void SetLight(const FitConfig& config, FitScene* scene) {
  scene->shading.lighting = config.lighting;
  scene->filter = config.filter;
  scene->light = config.light_direction;
  scene->sh[0] = kFirstHarmonic;
}

// The default weight of the area, or -1 for that of other hulls.
double AreaFor(const HullTraits& hull) {
  if (hull.hollow) return 0;  // a smaller area closes it: the lid is smaller than what is below
  return hull.thickness < kThinPixels ? kThinArea : -1;
}

void AddMesh(const Mesh& mesh, Hash* hash) {
  hash->AddAll(mesh.positions);
  hash->AddAll(mesh.faces);
  hash->AddAll(mesh.colors);
  hash->AddAll(mesh.corner_uvs);
  if (!mesh.corner_colors.empty()) hash->AddAll(mesh.corner_colors);
  for (const MeshTexture& texture : mesh.textures) hash->AddAll(texture.image.pixels);
}

// Of the images, the cameras, which of them are held out, and the mesh to start from.
std::string InputHash(const FitJob& job) {
  Hash hash;
  hash.AddAll(job.input.images.color);
  hash.AddAll(job.input.images.alpha);
  for (const Camera& c : job.input.cameras) {
    hash.AddBytes(c.rotation, sizeof(c.rotation));
    hash.AddBytes(c.translation, sizeof(c.translation));
    for (const float number : {c.fx, c.fy, c.cx, c.cy}) hash.AddBytes(&number, sizeof(number));
  }
  hash.AddAll(job.input.held_out);
  if (job.start.has_value()) AddMesh(*job.start, &hash);
  return hash.Text();
}

}  // namespace

std::vector<Camera> TurnedCameras(const FitJob& job, const std::array<float, 3>& middle) {
  std::vector<Camera> cameras = job.input.cameras;
  if (job.config.perturb_cameras == 0) return cameras;
  constexpr std::uint64_t kStream = 0x6361'6d65'7261;  // apart from those of the steps
  Rng rng(static_cast<std::uint64_t>(job.config.seed), kStream);
  for (const int i : job.input.training) {
    Camera& camera = cameras[static_cast<std::size_t>(i)];
    camera = Perturbed(camera, {middle[0], middle[1], middle[2]}, job.config.perturb_cameras, &rng);
  }
  return cameras;
}

bool MayStartFromHull(const FitJob& job) {
  const FitConfig& config = job.config;
  if (job.start.has_value() || config.start == StartShape::kSphere) return false;
  const bool known_cameras = !config.parameters[Parameter::kCamera] && config.perturb_cameras == 0;
  return config.start == StartShape::kHull ||
         (job.input.masked && known_cameras && job.input.training.size() >= kLeastHullViews);
}

std::string DescribeJob(const FitJob& job) {
  return DescribeConfig(job.config) +
         fmt::format("images = {} of {} x {}, {} held out\nmesh = {}\ninput = {}\n",
                     job.input.cameras.size(), job.input.images.width, job.input.images.height,
                     job.input.held_out.size(),
                     job.start.has_value()
                         ? fmt::format("{} vertices, {} faces", job.start->positions.size(),
                                       job.start->faces.size())
                         : "none given",
                     InputHash(job));
}

Status CheckFit(const FitJob& job) {
  TILEGRAD_TRY(CheckConfig(job.config));
  TILEGRAD_TRY(CheckMaterial(job.config));
  TILEGRAD_TRY(CheckCutout(job));
  return CheckMasks(job);
}

Result<FitStart> PrepareFit(const FitJob& job, const Workers& workers, const Watch& watch) {
  TILEGRAD_TRY(CheckFit(job));
  if (!job.input.posed && !job.input.found) {
    return InvalidArgument("the images have no cameras; `tilegrad fit` estimates them");
  }
  if (job.input.seeks_masks) {
    return InvalidArgument("the images have no masks, which `tilegrad fit` would look for first");
  }
  FitStart start;
  Origin origin;
  TILEGRAD_ASSIGN(start.scene, job.start.has_value() ? MeshScene(job)
                                                     : TemplateScene(job, workers, watch, &origin));
  start.note = origin.note;
  start.config = job.config;
  if (start.config.regularizers.area < 0) start.config.regularizers.area = AreaFor(origin.traits);
  start.config =
      ResolveDefaults(start.config, origin.hull, {job.input.images.width, job.input.images.height});
  SetCameras(job, &start.scene);
  SetLight(start.config, &start.scene);
  const bool blank = !job.start.has_value() || !HasColors(*job.start);
  if (job.config.material != MaterialKind::kUnlit) StartMaterial(job.input, blank, &start.scene);
  FitterOptions& options = start.options;
  options.parameters = job.config.parameters;
  if (options.parameters.empty()) {
    options.parameters[Parameter::kPositions] = true;
    options.parameters[start.scene.texture.empty() ? Parameter::kColors : Parameter::kTexture] =
        true;
    options.parameters[Parameter::kCamera] = job.input.found;  // to a few degrees so far
  }
  for (const Parameter p : kParameters)
    options.parameters[p] |= LightParameters(job.config.material)[p];
  options.rates = job.config.rates;
  options.rates[Parameter::kPositions] *= static_cast<double>(RadiusOf(start.scene));
  if (options.parameters[Parameter::kExposure]) {
    start.scene.gains.assign(start.scene.cameras.size(), 1.0f);
    options.exposure_reference = job.input.training.front();
  }
  options.loss = job.config.loss;
  options.regularizers = start.config.regularizers;
  options.smoothing = job.config.smoothing;
  return start;
}

}  // namespace tilegrad::train
