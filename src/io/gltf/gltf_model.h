// SPDX-License-Identifier: Apache-2.0
// Internal to io: tinygltf with the macros that it is compiled with here (the layout of its classes
// depends on them, and Debian's shared library was built with others), and checked access to the
// bytes of a model. tinygltf itself checks few of the numbers in a file.
#pragma once

#include <memory>
#include <span>
#include <string>
#include <vector>

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

}  // namespace tilegrad::io
