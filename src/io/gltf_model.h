// SPDX-License-Identifier: Apache-2.0
// Internal to io: glTF files as tinygltf's model, and checked access to what a model holds.
// tinygltf itself checks few of the numbers in a file. It is included here alone, with the macros
// that it is compiled with: the layout of its classes depends on them, and Debian's shared library
// was built with others.
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
  tinygltf::Model model;              // images encoded: bytes of data URIs, or a buffer view
  std::vector<std::string> warnings;  // extensions that are not read
};

// The file `name` with its side files. DataLoss for what is not glTF 2, nested too deep or
// compressed; ResourceExhausted above 4 GiB. The numbers in the model are not checked yet.
Result<GltfDocument> ReadGltfDocument(const FileSource& source, const std::string& name);

// The extension by which the JSON compresses geometry, else nothing.
std::string_view GltfCompression(std::string_view json);

// DataLoss: the file cannot be read because of that extension.
Status RefuseGltfCompression(std::string_view extension, const std::string& place);

// DataLoss if the file requires what it cannot be drawn without. One warning names the others that
// are used, are not read and change what viewers draw.
Status CheckGltfExtensions(const tinygltf::Model& model, const std::string& place,
                           std::vector<std::string>* warnings);

// Of a texture that has no image but one of a format that is not read: the extension that has it.
std::string GltfImageExtension(const tinygltf::Texture& texture);

// The bytes of a buffer view, which lie within its buffer. `what` stands in messages.
Result<std::span<const unsigned char>> GltfViewBytes(const tinygltf::Model& model, int view,
                                                     const std::string& what);

// The elements of an accessor: those of its buffer view, or zeros where it has none, and what a
// sparse one puts in their place. Open checks every number, so that reading cannot leave the
// buffer.
class GltfAccessor {
 public:
  // Attributes: float, or 8 or 16 bit integers. `components` numbers an element, 0 for any.
  static Result<GltfAccessor> OpenAttribute(const tinygltf::Model& model, int index, int components,
                                            const std::string& what);
  // Indices: unsigned integers of 8, 16 or 32 bits.
  static Result<GltfAccessor> OpenIndices(const tinygltf::Model& model, int index,
                                          const std::string& what);

  std::size_t count() const { return count_; }
  int components() const { return components_; }
  float Float(std::size_t element, int component) const;  // normalised integers become [-1, 1]
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
  std::shared_ptr<const std::vector<unsigned char>> own_;  // bytes_ of a sparse one
  std::size_t count_ = 0, stride_ = 0, size_ = 0;
  int components_ = 0, type_ = 0;
  bool normalized_ = false;
};

// Where a texture is looked up: the uv set, and KHR_texture_transform on it, in glTF's own
// coordinates (v down).
struct GltfUvUse {
  int set = 0;
  glm::dvec2 offset{0}, scale{1};
  double rotation = 0;  // radians

  std::string Key() const;  // the attribute
  glm::vec2 operator()(glm::vec2 uv) const;
};

// The base colour, or the diffuse colour of KHR_materials_pbrSpecularGlossiness, which comes first
// where a file has both.
struct GltfBaseColor {
  glm::dvec4 factor{1};  // linear
  int texture = -1;
  GltfUvUse uv;
};

// Of a material that does not exist: glTF's default, white.
GltfBaseColor GltfBaseColorOf(const tinygltf::Model& model, int material);

// Lists, strips and fans of triangles as faces, with normals, colours (as in the file) and the uv
// of the material's texture (v up) where the primitive has them; no faces for other modes.
// `weights`: of its morph targets, which are added to it; missing ones are 0. DataLoss names `what`
// and the attribute that is missing, has another length or points outside its buffer.
Result<Mesh> ConvertGltfPrimitive(const tinygltf::Model& model, const tinygltf::Primitive& p,
                                  std::span<const double> weights, const std::string& what);

}  // namespace tilegrad::io
