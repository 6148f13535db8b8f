// SPDX-License-Identifier: Apache-2.0
#include "io/imported_scene.h"

#include <algorithm>
#include <cstring>
#include <type_traits>

#include "base/error.h"

namespace tilegrad::io {
namespace {

constexpr std::uint32_t kSceneMagic = 0x54475332;  // "TGS2"; the digit is the version

// The fields of each record in their order, for both directions.
template <class Archive, class T>
void Fields(Archive& archive, T& value) {
  using Record = std::remove_const_t<T>;
  if constexpr (std::is_same_v<Record, ImportedPart>) {
    archive(value.name, value.material, value.positions, value.normals, value.uvs, value.colors,
            value.triangles);
  } else if constexpr (std::is_same_v<Record, ImportedMaterial>) {
    archive(value.name, value.color, value.image, value.embedded, value.not_read);
  } else if constexpr (std::is_same_v<Record, ImportedImage>) {
    archive(value.name, value.bytes);
  } else {
    static_assert(std::is_same_v<Record, ImportedScene>);
    archive(value.parts, value.materials, value.images, value.instances, value.warnings);
  }
}

template <class T>
struct IsList : std::false_type {};
template <class E>
struct IsList<std::vector<E>> : std::true_type {};
template <>
struct IsList<std::string> : std::true_type {};

// Counts bytes if it has nowhere to put them, so that what is written is allocated once.
class SceneWriter {
 public:
  explicit SceneWriter(std::uint8_t* to) : to_(to) {}
  template <class... T>
  void operator()(const T&... values) {
    (Write(values), ...);
  }
  std::size_t written() const { return written_; }

 private:
  template <class T>
  void Write(const T& value) {
    if constexpr (IsList<T>::value) {
      Write(std::uint64_t{value.size()});
      if constexpr (std::is_trivially_copyable_v<typename T::value_type>) {
        Raw(value.data(), value.size() * sizeof(typename T::value_type));
      } else {
        for (const auto& element : value) Write(element);
      }
    } else if constexpr (std::is_trivially_copyable_v<T>) {
      Raw(&value, sizeof(value));
    } else {
      Fields(*this, value);
    }
  }
  void Raw(const void* from, std::size_t size) {
    if (to_ != nullptr && size > 0) std::memcpy(to_ + written_, from, size);
    written_ += size;
  }

  std::uint8_t* to_;
  std::size_t written_ = 0;
};

class SceneReader {
 public:
  explicit SceneReader(std::span<const std::uint8_t> bytes) : left_(bytes) {}
  template <class... T>
  void operator()(T&... values) {
    (Read(values), ...);
  }
  bool whole() const { return good_ && left_.empty(); }
  bool good() const { return good_; }

 private:
  template <class T>
  void Read(T& value) {
    if constexpr (IsList<T>::value) {
      ReadList(value);
    } else if constexpr (std::is_trivially_copyable_v<T>) {
      Raw(&value, sizeof(value));
    } else {
      Fields(*this, value);
    }
  }
  template <class T>
  void ReadList(T& list) {
    std::uint64_t count = 0;
    Read(count);
    if constexpr (std::is_trivially_copyable_v<typename T::value_type>) {
      if (count > left_.size() / sizeof(typename T::value_type)) good_ = false;
      if (!good_) return;
      list.resize(count);
      Raw(list.data(), count * sizeof(typename T::value_type));
    } else {  // grows as its elements are read, each of which takes bytes
      for (; good_ && count > 0; --count) Read(list.emplace_back());
    }
  }
  void Raw(void* to, std::size_t size) {
    if (size > left_.size()) good_ = false;
    if (!good_ || size == 0) return;
    std::memcpy(to, left_.data(), size);
    left_ = left_.subspan(size);
  }

  std::span<const std::uint8_t> left_;
  bool good_ = true;
};

Status CheckPart(const ImportedPart& part) {
  const std::size_t vertices = part.positions.size();
  for (const std::size_t count : {part.normals.size(), part.uvs.size(), part.colors.size()}) {
    if (count != 0 && count != vertices)
      return DataLoss("part \"{}\": {} attributes for {} vertices", part.name, count, vertices);
  }
  for (std::size_t f = 0; f < part.triangles.size(); ++f) {
    for (const std::uint32_t v : part.triangles[f]) {
      if (v >= vertices)
        return DataLoss("part \"{}\": face {} uses vertex {} of {}", part.name, f, v, vertices);
    }
  }
  return {};
}

Status CheckScene(const ImportedScene& scene) {
  for (const ImportedPart& part : scene.parts) TILEGRAD_TRY(CheckPart(part));
  for (const ImportedInstance& instance : scene.instances) {
    if (instance.part >= scene.parts.size())
      return DataLoss("part {} of {} is placed", instance.part, scene.parts.size());
  }
  for (const ImportedMaterial& material : scene.materials) {
    if (material.embedded < -1 || material.embedded >= std::ssize(scene.images)) {
      return DataLoss("material \"{}\" uses image {} of {}", material.name, material.embedded,
                      scene.images.size());
    }
  }
  return {};
}

}  // namespace

Bytes EncodeScene(const Result<ImportedScene>& scene) {
  const Status status = scene.status();
  const auto write = [&](std::uint8_t* to) {
    SceneWriter writer(to);
    writer(kSceneMagic, static_cast<std::uint32_t>(status.code()), status.message());
    if (scene.ok()) writer(*scene);
    return writer.written();
  };
  Bytes out(write(nullptr));
  write(out.data());
  return out;
}

Result<ImportedScene> DecodeScene(std::span<const std::uint8_t> bytes) {
  const Status broken = DataLoss("the importer handed over data that is not whole");
  SceneReader reader(bytes);
  std::uint32_t magic = 0, code = 0;
  std::string message;
  reader(magic, code, message);
  if (!reader.good() || magic != kSceneMagic) return broken;
  if (code != static_cast<std::uint32_t>(StatusCode::kOk)) {
    return message.empty() ? broken : DataLoss("{}", message);
  }
  ImportedScene scene;
  reader(scene);
  if (!reader.whole()) return broken;
  TILEGRAD_TRY(CheckScene(scene));
  return scene;
}

}  // namespace tilegrad::io
