// SPDX-License-Identifier: Apache-2.0
#include "render/picture/mesh_scene.h"

#include <algorithm>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>
#include <limits>

#include "base/error.h"
#include "render/picture/composite.h"
#include "render/picture/picture.h"
#include "scene/camera_conventions.h"
#include "shade/surface_color.h"

namespace tilegrad {
namespace {

template <class Vec>
std::span<const float> Flat(const std::vector<Vec>& values) {
  static_assert(sizeof(Vec) == Vec::length() * sizeof(float));
  return {reinterpret_cast<const float*>(values.data()), values.size() * Vec::length()};
}

float Decode(float value, ColorSpace space) {
  return space == ColorSpace::kLinear ? SrgbToLinear(value) : value;
}

std::vector<float> DecodeTexels(const ImageU8& image, ColorSpace space) {
  std::array<float, 256> table;
  for (std::size_t i = 0; i < table.size(); ++i)
    table[i] = Decode(static_cast<float>(i) / 255.0f, space);
  const auto channels = static_cast<std::size_t>(image.channels);
  const std::size_t count = image.pixels.size() / channels;
  std::vector<float> out(3 * count);
  for (std::size_t p = 0; p < count; ++p) {
    for (std::size_t c = 0; c < 3; ++c) out[3 * p + c] = table[image.pixels[channels * p + c]];
  }
  return out;
}

// Alpha as a colour.
std::vector<float> AlphaTexels(const ImageU8& image) {
  std::vector<float> out;
  out.reserve(image.pixels.size() / 4 * 3);
  for (std::size_t i = 3; i < image.pixels.size(); i += 4)
    out.insert(out.end(), 3, static_cast<float>(image.pixels[i]) / 255.0f);
  return out;
}

// In formats without alpha modes only materials have alpha; 0 is more often a mistake than
// invisible glass.
SurfaceCover CoverOf(const Material& material, bool blend) {
  const float alpha = material.base_color.a;
  if (material.alpha_mode == AlphaMode::kMask)
    return {SurfaceCover::Kind::kMask, material.alpha_cutoff};
  const bool glass = material.alpha_mode == AlphaMode::kBlend || (alpha > 0 && alpha < 1);
  return {blend && glass ? SurfaceCover::Kind::kBlend : SurfaceCover::Kind::kOpaque};
}

}  // namespace

MeshScene::MeshScene(const Mesh& mesh, const MeshSceneOptions& options)
    : mesh_(mesh), options_(options), texels_(mesh.textures.size()) {
  scene_.positions = Flat(mesh.positions);
  scene_.faces = {mesh.faces.data()->data(), 3 * mesh.faces.size()};
  scene_.shading.two_sided = true;
  AddNormals();
  const bool by_corner = !mesh.corner_colors.empty();
  for (const glm::vec4& color : by_corner ? mesh.corner_colors : mesh.colors) {
    for (int c = 0; c < 3; ++c) colors_.push_back(Decode(color[c], options.color_space));
  }
  scene_.colors = {colors_, by_corner ? Rate::kCorner : Rate::kVertex};
  AddSurfaces();
  if (!textures_.empty()) {
    scene_.uvs = {Flat(mesh.corner_uvs), Rate::kCorner};
    scene_.textures = textures_;
  }
  AddCover();
}

void MeshScene::AddNormals() {
  scene_.shading.normals =
      options_.normals == NormalSource::kSmooth ? Normals::kSmooth : Normals::kFlat;
  if (options_.normals == NormalSource::kAligned) return AddAlignedNormals();
  if (options_.normals != NormalSource::kAuto) return;
  if (!mesh_.corner_normals.empty()) {
    scene_.normals = {Flat(mesh_.corner_normals), Rate::kCorner};
  } else if (!mesh_.normals.empty()) {
    scene_.normals = {Flat(mesh_.normals), Rate::kVertex};
  } else {
    return;
  }
  scene_.shading.normals = Normals::kGiven;
}

void MeshScene::AddAlignedNormals() {
  if (mesh_.corner_normals.empty() && mesh_.normals.empty()) return;
  for (std::size_t f = 0; f < mesh_.faces.size(); ++f) {
    const auto vertex = [&](std::size_t k) { return static_cast<std::size_t>(mesh_.faces[f][k]); };
    const glm::vec3 a = mesh_.positions[vertex(0)];
    const glm::vec3 winding =
        glm::cross(mesh_.positions[vertex(1)] - a, mesh_.positions[vertex(2)] - a);
    for (std::size_t k = 0; k < 3; ++k) {
      const glm::vec3 n =
          mesh_.corner_normals.empty() ? mesh_.normals[vertex(k)] : mesh_.corner_normals[3 * f + k];
      aligned_normals_.push_back(glm::dot(n, winding) < 0 ? -n : n);
    }
  }
  scene_.normals = {Flat(aligned_normals_), Rate::kCorner};
  scene_.shading.normals = Normals::kGiven;
}

// Index of the view of a material's texture, one per sampler.
int MeshScene::AddTexture(const Material& material) {
  if (material.base_color_texture < 0 || mesh_.corner_uvs.empty()) return -1;
  const auto index = static_cast<std::size_t>(material.base_color_texture);
  const ImageU8& image = mesh_.textures[index].image;
  if (texels_[index].empty()) texels_[index] = DecodeTexels(image, options_.color_space);
  const Texture view = {texels_[index], image.width, image.height, shade::WrapOf(material),
                        material.nearest ? Filter::kNearest : options_.filter};
  const auto same = [&](const Texture& v) {
    return v.texels.data() == view.texels.data() && v.wrap == view.wrap && v.filter == view.filter;
  };
  const auto found = std::find_if(textures_.begin(), textures_.end(), same);
  if (found != textures_.end()) return static_cast<int>(found - textures_.begin());
  textures_.push_back(view);
  return static_cast<int>(textures_.size()) - 1;
}

void MeshScene::AddSurfaces() {
  for (const Material& material : mesh_.materials) {
    Surface surface;
    for (int c = 0; c < 3; ++c) {
      surface.base_color[static_cast<std::size_t>(c)] =
          Decode(material.base_color[c], options_.color_space);
    }
    surface.texture = AddTexture(material);
    surface.ambient = options_.ambient;
    surface.diffuse = options_.diffuse;
    surface.specular = options_.specular;
    surface.shininess = options_.shininess;
    if (material.unlit) {
      surface.ambient = {1, 1, 1};
      surface.diffuse = surface.specular = {0, 0, 0};
    }
    surfaces_.push_back(surface);
  }
  if (surfaces_.empty()) {  // a mesh without materials: white times its vertex colours
    surfaces_.push_back(
        {{1, 1, 1}, -1, options_.ambient, options_.diffuse, options_.specular, options_.shininess});
  }
  single_sided_ =
      !mesh_.materials.empty() && std::none_of(mesh_.materials.begin(), mesh_.materials.end(),
                                               [](const Material& m) { return m.double_sided; });
  scene_.surfaces = surfaces_;
  scene_.face_surfaces = mesh_.face_materials;
}

void MeshScene::AddAlphaTextures() {
  alpha_textures_ = textures_;
  texture_alpha_.resize(texels_.size());
  for (Texture& view : alpha_textures_) {
    const auto holds = [&](const auto& texels) { return texels.data() == view.texels.data(); };
    const auto image = static_cast<std::size_t>(
        std::find_if(texels_.begin(), texels_.end(), holds) - texels_.begin());
    if (mesh_.textures[image].image.channels < 4) continue;  // no surface refers to it
    if (texture_alpha_[image].empty())
      texture_alpha_[image] = AlphaTexels(mesh_.textures[image].image);
    view.texels = texture_alpha_[image];
  }
}

void MeshScene::AddCover() {
  std::vector<SurfaceCover> covers;
  for (const Material& material : mesh_.materials)
    covers.push_back(CoverOf(material, options_.blend));
  const auto opaque = [](const SurfaceCover& c) { return c.kind == SurfaceCover::Kind::kOpaque; };
  if (std::all_of(covers.begin(), covers.end(), opaque)) return;
  AddAlphaTextures();
  alpha_surfaces_ = surfaces_;
  for (std::size_t m = 0; m < mesh_.materials.size(); ++m) {
    const Material& material = mesh_.materials[m];
    Surface& surface = alpha_surfaces_[m];
    surface.base_color.fill(material.base_color.a);
    const bool textured =
        surface.texture >= 0 && material.alpha_mode != AlphaMode::kOpaque &&
        mesh_.textures[static_cast<std::size_t>(material.base_color_texture)].image.channels == 4;
    if (!textured) surface.texture = -1;
  }
  for (const glm::vec4& color : mesh_.colors) vertex_alpha_.insert(vertex_alpha_.end(), 3, color.a);
  SceneCover& cover = cover_.emplace(SceneCover{scene_, std::move(covers)});
  cover.alpha.shading = {};
  cover.alpha.normals = {};
  cover.alpha.colors = {vertex_alpha_, Rate::kVertex};
  cover.alpha.surfaces = alpha_surfaces_;
  if (!textures_.empty()) cover.alpha.textures = alpha_textures_;
}

namespace {

constexpr int kMaxSize = 4096;
constexpr int kLitSamples = 4, kUnlitSamples = 3;  // per side of a pixel

MeshSceneOptions LitOptions() {
  MeshSceneOptions options;
  options.color_space = ColorSpace::kSrgb;
  options.normals = NormalSource::kAligned;
  options.ambient.fill(kDatasetAmbient);
  options.blend = false;
  return options;
}

}  // namespace

struct LitRenderer::Impl {
  Workers workers{1};
  PictureRenderer renderer{workers};
  Picture picture;

  template <class Visit>
  Status Draw(const Mesh& mesh, std::span<const Camera> cameras, int size, const Visit& visit) {
    if (size < 1 || size > kMaxSize) {
      return InvalidArgument("the size must be in [1, {}] pixels, got {}", kMaxSize, size);
    }
    TILEGRAD_TRY(Validate(mesh));
    if (mesh.faces.empty()) return InvalidArgument("the mesh has no faces");
    const std::array<Light, 2> lights = DatasetLights();
    const MeshScene made(mesh, LitOptions());
    Scene scene = made.scene();
    scene.shading.lighting = Lighting::kLambert;
    scene.lights = lights;
    for (const Camera& camera : cameras) {
      scene.camera = camera;
      const PictureRequest request{
          .width = size, .height = size, .supersampling = kLitSamples, .cover = made.cover()};
      TILEGRAD_TRY(renderer.Render(scene, request, &picture));
      visit(picture);
    }
    return {};
  }
};

LitRenderer::LitRenderer() : impl_(std::make_unique<Impl>()) {}
LitRenderer::~LitRenderer() = default;
LitRenderer::LitRenderer(LitRenderer&&) noexcept = default;

Result<std::vector<std::uint8_t>> LitRenderer::Render(const Mesh& mesh,
                                                      std::span<const Camera> cameras, int size) {
  std::vector<std::uint8_t> out;
  TILEGRAD_TRY(impl_->Draw(mesh, cameras, size, [&](const Picture& picture) {
    const auto planes = PremultipliedPlanes(picture);
    out.insert(out.end(), planes.begin(), planes.end());
  }));
  return out;
}

Result<ImageU8> LitRenderer::RenderStraight(const Mesh& mesh, const Camera& camera, int size) {
  ImageU8 out;
  TILEGRAD_TRY(impl_->Draw(mesh, {&camera, 1}, size,
                           [&](const Picture& picture) { out = StraightRgba(picture); }));
  return out;
}

Result<std::vector<ImageU8>> DrawMesh(const Mesh& mesh, const UnlitPictures& request,
                                      const Workers& workers) {
  TILEGRAD_TRY(Validate(mesh));
  const MeshScene made(mesh, {.color_space = ColorSpace::kSrgb});
  Scene scene = made.scene();
  PictureRenderer renderer(workers);
  Picture picture;
  std::vector<ImageU8> out;
  for (const Camera& camera : request.cameras) {
    scene.camera = ScaledCamera(
        camera, static_cast<float>(request.size) / static_cast<float>(request.camera_size));
    TILEGRAD_TRY(renderer.Render(
        scene, {.width = request.size, .height = request.size, .supersampling = kUnlitSamples},
        &picture));
    out.push_back(OverGrey(picture, kPaper));
  }
  return out;
}

std::vector<glm::vec3> CornerColors(const Mesh& mesh) {
  const shade::SurfaceColor surface(mesh);
  std::vector<glm::vec3> out;
  out.reserve(3 * mesh.faces.size());
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
    for (int k = 0; k < 3; ++k) out.push_back(surface.AtCorner(f, k));
  }
  return out;
}

namespace {

constexpr float kKey = 0.45f, kFill = 0.2f;

Light LightFrom(glm::vec3 towards, float intensity) {
  const glm::vec3 d = glm::normalize(towards);
  return {{d.x, d.y, d.z}, intensity};
}

}  // namespace

std::array<Light, 2> DatasetLights() {
  return {LightFrom({0.35f, 0.8f, 0.5f}, kKey), LightFrom({-0.6f, 0.3f, -0.75f}, kFill)};
}

Surface DatasetSurface() {
  Surface surface;
  surface.ambient.fill(kDatasetAmbient);
  surface.specular.fill(0);
  return surface;
}

float SurfaceCover::Of(float alpha) const {
  if (kind == Kind::kOpaque) return 1;
  if (kind == Kind::kMask) return alpha >= cutoff ? 1.0f : 0.0f;
  return std::clamp(alpha, 0.0f, 1.0f);
}

Status LayerRenderer::DrawAlpha(const SceneCover& cover, const Camera& camera,
                                const RenderOptions& options) {
  Scene scene = cover.alpha;
  scene.camera = camera;
  Outputs outputs;
  outputs.attributes = outputs.alpha = false;
  return engine_.Render({&scene, 1}, options, outputs, &alpha_);
}

// Reports what this layer shows, and opens unfinished pixels to the next one. Returns whether there
// are any.
bool LayerRenderer::Visit(const Scene& scene, const SceneCover& cover, const TakeLayer& take) {
  const Images images = ImagesOf(layer_);
  bool any = false;
  for (std::size_t at = 0; at < images.face_ids.size(); ++at) {
    const std::int32_t face = images.face_ids[at];
    if (face < 0) continue;
    const auto surface =
        scene.face_surfaces.empty()
            ? std::size_t{0}
            : static_cast<std::size_t>(scene.face_surfaces[static_cast<std::size_t>(face)]);
    const bool done = take(images, at, cover.surfaces[surface].Of(alpha_.color[at]));
    if (done) layer_.peeled[at] = 0;
    any |= !done;
  }
  return any;
}

Status LayerRenderer::RenderAll(const Scene& scene, const SceneCover& cover,
                                const RenderOptions& options, const Outputs& outputs,
                                const TakeLayer& take) {
  const auto pixels =
      static_cast<std::size_t>(options.width) * static_cast<std::size_t>(options.height);
  layer_.peeled.assign(pixels, std::numeric_limits<float>::infinity());
  for (int layer = 0; layer < kMostLayers; ++layer) {
    alpha_.peeled = layer_.peeled;
    TILEGRAD_TRY(engine_.Render({&scene, 1}, options, outputs, &layer_));
    if (layer == 0) plan_ = engine_.Explain();
    TILEGRAD_TRY(DrawAlpha(cover, scene.camera, options));
    if (!Visit(scene, cover, take)) break;
  }
  return {};
}

Status LayerRenderer::Render(const Scene& scene, const SceneCover& cover,
                             const RenderOptions& options, const Outputs& outputs,
                             const TakeLayer& take) {
  return Guarded([&] { return RenderAll(scene, cover, options, outputs, take); });
}

}  // namespace tilegrad
