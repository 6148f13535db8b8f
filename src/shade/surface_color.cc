// SPDX-License-Identifier: Apache-2.0
#include "shade/surface_color.h"

#include <algorithm>
#include <array>

#include "shade/texture_ref.h"

namespace tilegrad::shade {
namespace {

// Halves the size by averaging 2 x 2 texels; drops an odd last row or column.
ImageU8 Halve(const ImageU8& image) {
  const int w = std::max(1, image.width / 2), h = std::max(1, image.height / 2);
  ImageU8 out(w, h, image.channels);
  for (int y = 0; y < h; ++y) {
    for (int x = 0; x < w; ++x) {
      const int x1 = std::min(2 * x + 1, image.width - 1),
                y1 = std::min(2 * y + 1, image.height - 1);
      for (int c = 0; c < image.channels; ++c) {
        const int sum = image.at(2 * x, 2 * y)[c] + image.at(x1, 2 * y)[c] +
                        image.at(2 * x, y1)[c] + image.at(x1, y1)[c];
        out.at(x, y)[c] = static_cast<std::uint8_t>((sum + 2) / 4);
      }
    }
  }
  return out;
}

Wrap WayOf(TextureWrap wrap) {
  return wrap == TextureWrap::kClamp    ? Wrap::kClamp
         : wrap == TextureWrap::kMirror ? Wrap::kMirror
                                        : Wrap::kRepeat;
}

}  // namespace

Wrap WrapOf(const Material& material) {
  return WrapOf(WayOf(material.wrap[0]), WayOf(material.wrap[1]));
}

SurfaceColor::SurfaceColor(const Mesh& mesh) : mesh_(mesh) {
  for (const MeshTexture& texture : mesh.textures) textures_.push_back(Prepare(texture.image));
}

SurfaceColor::Texels SurfaceColor::Prepare(const ImageU8& image) {
  if (image.empty()) return {};
  if (std::max(image.width, image.height) > kMaxTextureSide) return Prepare(Halve(image));
  Texels out{image.width, image.height, {}};
  const std::size_t texels = static_cast<std::size_t>(image.width) * image.height;
  out.rgb.reserve(3 * texels);
  for (std::size_t i = 0; i < texels; ++i) {
    const auto* p = image.pixels.data() + i * static_cast<std::size_t>(image.channels);
    for (int c = 0; c < 3; ++c) {
      out.rgb.push_back(static_cast<float>(p[image.channels >= 3 ? c : 0]) / 255);
    }
  }
  return out;
}

glm::vec3 SurfaceColor::At(std::size_t face, glm::vec2 uv, glm::vec3 vertex_color) const {
  if (mesh_.materials.empty()) return vertex_color;
  const Material& material = mesh_.materials[this->material(face)];
  const glm::vec3 color = glm::vec3(material.base_color) * vertex_color;
  if (material.base_color_texture < 0 || mesh_.corner_uvs.empty()) return color;
  const Texels& texels = textures_[static_cast<std::size_t>(material.base_color_texture)];
  if (texels.rgb.empty()) return color;
  std::array<float, 3> texel;
  SampleLevelRef<float>({texels.rgb, texels.width, texels.height, 3, WrapOf(material)}, uv.x, uv.y,
                        texel);
  return color * glm::vec3(texel[0], texel[1], texel[2]);
}

glm::vec3 SurfaceColor::AtCorner(std::size_t face, int k) const {
  const auto vertex = static_cast<std::size_t>(mesh_.faces[face][static_cast<std::size_t>(k)]);
  const std::size_t corner = 3 * face + static_cast<std::size_t>(k);
  const glm::vec2 uv = mesh_.corner_uvs.empty() ? glm::vec2(0) : mesh_.corner_uvs[corner];
  if (!mesh_.corner_colors.empty()) return At(face, uv, glm::vec3(mesh_.corner_colors[corner]));
  return At(face, uv, mesh_.colors.empty() ? glm::vec3(1) : glm::vec3(mesh_.colors[vertex]));
}

}  // namespace tilegrad::shade
