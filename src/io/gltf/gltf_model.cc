// SPDX-License-Identifier: Apache-2.0
#define TINYGLTF_IMPLEMENTATION
#include "io/gltf/gltf_model.h"

#include <algorithm>
#include <cstring>

#include "base/error.h"

namespace tilegrad::io {
namespace {

template <class List>
bool Has(const List& list, int index) {
  return index >= 0 && static_cast<std::size_t>(index) < list.size();
}

template <class T>
T Read(const unsigned char* at) {
  T value;
  std::memcpy(&value, at, sizeof(T));
  return value;
}

}  // namespace

Result<std::span<const unsigned char>> GltfViewBytes(const tinygltf::Model& model, int view,
                                                     const std::string& what) {
  if (!Has(model.bufferViews, view))
    return DataLoss("{}: buffer view {} does not exist", what, view);
  const tinygltf::BufferView& v = model.bufferViews[view];
  if (!Has(model.buffers, v.buffer))
    return DataLoss("{}: buffer {} does not exist", what, v.buffer);
  const auto& data = model.buffers[v.buffer].data;
  if (v.byteOffset > data.size() || v.byteLength > data.size() - v.byteOffset) {
    return DataLoss("{}: buffer view {} ({} bytes from {}) reaches beyond its buffer of {} bytes",
                    what, view, v.byteLength, v.byteOffset, data.size());
  }
  return std::span(data).subspan(v.byteOffset, v.byteLength);
}

Result<GltfAccessor> GltfAccessor::Open(const tinygltf::Model& model, int index,
                                        const std::string& what) {
  if (!Has(model.accessors, index)) return DataLoss("{}: accessor {} does not exist", what, index);
  const tinygltf::Accessor& a = model.accessors[index];
  if (a.sparse.isSparse)
    return DataLoss("{}: sparse accessors are not supported; save the file without them", what);
  TILEGRAD_ASSIGN(const auto view, GltfViewBytes(model, a.bufferView, what));
  const int size = tinygltf::GetComponentSizeInBytes(static_cast<std::uint32_t>(a.componentType));
  const int components = tinygltf::GetNumComponentsInType(static_cast<std::uint32_t>(a.type));
  const int stride = a.ByteStride(model.bufferViews[a.bufferView]);
  if (size <= 0 || components <= 0 || stride <= 0) {
    return DataLoss("{}: accessor {} has an invalid type, component type ({}) or stride", what,
                    index, a.componentType);
  }
  const std::size_t element = static_cast<std::size_t>(size) * components;
  if (a.count > 0 && (a.byteOffset > view.size() || element > view.size() - a.byteOffset ||
                      a.count - 1 > (view.size() - a.byteOffset - element) / stride)) {
    return DataLoss("{}: accessor {} ({} elements) reaches beyond its buffer view of {} bytes",
                    what, index, a.count, view.size());
  }
  GltfAccessor out;
  out.bytes_ = view.subspan(std::min(a.byteOffset, view.size()));
  out.count_ = a.count;
  out.stride_ = static_cast<std::size_t>(stride);
  out.size_ = static_cast<std::size_t>(size);
  out.components_ = components;
  out.type_ = a.componentType;
  out.normalized_ = a.normalized;
  return out;
}

Result<GltfAccessor> GltfAccessor::OpenAttribute(const tinygltf::Model& model, int index,
                                                 int components, const std::string& what) {
  TILEGRAD_ASSIGN(GltfAccessor out, Open(model, index, what));
  if (components > 0 && out.components_ != components) {
    return DataLoss("{}: expected {} numbers an element, got {}", what, components,
                    out.components_);
  }
  if (out.type_ != TINYGLTF_COMPONENT_TYPE_FLOAT && out.size_ > 2)
    return DataLoss("{}: component type {} is not allowed in an attribute", what, out.type_);
  return out;
}

Result<GltfAccessor> GltfAccessor::OpenIndices(const tinygltf::Model& model, int index,
                                               const std::string& what) {
  TILEGRAD_ASSIGN(GltfAccessor out, Open(model, index, what));
  const bool is_unsigned = out.type_ == TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE ||
                           out.type_ == TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT ||
                           out.type_ == TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT;
  if (!is_unsigned || out.components_ != 1)
    return DataLoss("{}: indices must be unsigned scalars, got component type {}", what, out.type_);
  return out;
}

float GltfAccessor::Float(std::size_t element, int component) const {
  const unsigned char* at =
      bytes_.data() + element * stride_ + static_cast<std::size_t>(component) * size_;
  const auto scaled = [this](float value, float largest) {
    return normalized_ ? std::max(-1.0f, value / largest) : value;
  };
  switch (type_) {
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE:
      return scaled(*at, 255);
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT:
      return scaled(Read<std::uint16_t>(at), 65535);
    case TINYGLTF_COMPONENT_TYPE_BYTE:
      return scaled(Read<std::int8_t>(at), 127);
    case TINYGLTF_COMPONENT_TYPE_SHORT:
      return scaled(Read<std::int16_t>(at), 32767);
    default:  // OpenAttribute lets nothing else pass
      return Read<float>(at);
  }
}

std::uint32_t GltfAccessor::Index(std::size_t element) const {
  const unsigned char* at = bytes_.data() + element * stride_;
  switch (type_) {
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE:
      return *at;
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT:
      return Read<std::uint16_t>(at);
    default:  // OpenIndices lets nothing else pass
      return Read<std::uint32_t>(at);
  }
}

}  // namespace tilegrad::io
