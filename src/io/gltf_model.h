// SPDX-License-Identifier: Apache-2.0
// Internal to io: glTF files as tinygltf's model, with checked access, since tinygltf validates few
// of a file's numbers. The only include of tinygltf, with the macros that it is compiled with: its
// class layout depends on them, and Debian's shared library was built with others.
#pragma once

#include <glm/vec2.hpp>
#include <glm/vec4.hpp>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "io/archive.h"
#include "scene/mesh.h"
#include "tilegrad/status.h"

#define TINYGLTF_NO_STB_IMAGE
#define TINYGLTF_NO_STB_IMAGE_WRITE
#define TINYGLTF_NO_EXTERNAL_IMAGE
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wshadow"
#pragma GCC diagnostic ignored "-Wpedantic"
#include <tiny_gltf.h>
#pragma GCC diagnostic pop

namespace tilegrad::io {

struct GltfDocument {
  tinygltf::Model model;              // images still encoded: bytes of data URIs, or a buffer view
  std::vector<std::string> warnings;  // ignored extensions
};

// Whether a list of the model has such an element: any number may stand in a file.
template <class List>
bool Has(const List& list, int index) {
  return index >= 0 && static_cast<std::size_t>(index) < list.size();
}

// Reads the file `name` with its side files. DataLoss if it is not glTF 2, nested too deep or
// compressed; ResourceExhausted above 4 GiB. Numbers in the model are not validated yet.
Result<GltfDocument> ReadGltfDocument(const FileSource& source, const std::string& name);

// DataLoss that says that the file cannot be read because of the extension.
Status RefuseGltfCompression(std::string_view extension, const std::string& place);

// For a texture whose only image has an unsupported format: the extension that holds it.
std::string GltfImageExtension(const tinygltf::Texture& texture);

// The bytes of a buffer view, checked against its buffer. Messages call it `what`.
Result<std::span<const unsigned char>> GltfViewBytes(const tinygltf::Model& model, int view,
                                                     const std::string& what);

// The elements of an accessor: from its buffer view, or zeros without one, with sparse values
// substituted. Open checks every number, so that reads stay in the buffer.
class GltfAccessor {
 public:
  // Attributes: float, or 8 or 16 bit integers. `components` per element, 0 for any.
  static Result<GltfAccessor> OpenAttribute(const tinygltf::Model& model, int index, int components,
                                            const std::string& what);
  // Indices: unsigned integers of 8, 16 or 32 bits.
  static Result<GltfAccessor> OpenIndices(const tinygltf::Model& model, int index,
                                          const std::string& what);

  std::size_t count() const { return count_; }
  int components() const { return components_; }
  float Float(std::size_t element, int component) const;  // normalised integers map to [-1, 1]
  std::uint32_t Index(std::size_t element) const;

 private:
  static Result<GltfAccessor> Open(const tinygltf::Model& model, int index,
                                   const std::string& what);

  static Result<GltfAccessor> OpenDense(const tinygltf::Model& model, const tinygltf::Accessor& a,
                                        const std::string& what);
  Status OpenView(const tinygltf::Model& model, const tinygltf::Accessor& a,
                  const std::string& what);
  Status ApplySparse(const tinygltf::Model& model, const tinygltf::Accessor& a,
                     const std::string& what);
  Status CheckIndexType(const std::string& what) const;
  std::size_t element() const { return size_ * static_cast<std::size_t>(components_); }

  std::span<const unsigned char> bytes_;
  std::shared_ptr<const std::vector<unsigned char>> own_;  // backs bytes_ of a sparse accessor
  std::size_t count_ = 0, stride_ = 0, size_ = 0;
  int components_ = 0, type_ = 0;
  bool normalized_ = false;
};

// How a material samples a texture: the uv set, and KHR_texture_transform, in glTF's coordinates (v
// down).
struct GltfUvUse {
  int set = 0;
  glm::dvec2 offset{0}, scale{1};
  double rotation = 0;  // radians

  std::string Key() const;  // the attribute's name
  glm::vec2 operator()(glm::vec2 uv) const;
};

// The base colour, or the diffuse colour of KHR_materials_pbrSpecularGlossiness, which takes
// precedence.
struct GltfBaseColor {
  glm::dvec4 factor{1};  // linear
  int texture = -1;
  GltfUvUse uv;
};

// glTF's default, white, if the material does not exist.
GltfBaseColor GltfBaseColorOf(const tinygltf::Model& model, int material);

// Converts triangle lists, strips and fans to faces, with normals, colours (as in the file) and the
// uvs of the material's texture (v up) if the primitive has them; no faces for other modes.
// `weights`: of the morph targets, which are applied; missing ones are 0. DataLoss names `what` and
// the attribute that is missing, has the wrong length or points outside its buffer.
Result<Mesh> ConvertGltfPrimitive(const tinygltf::Model& model, const tinygltf::Primitive& p,
                                  std::span<const double> weights, const std::string& what);

}  // namespace tilegrad::io
