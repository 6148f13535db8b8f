// SPDX-License-Identifier: Apache-2.0
// Meshes read by Assimp, which runs in a child process; converts its result to a mesh.
#include <algorithm>
#include <array>
#include <charconv>
#include <cstring>
#include <glm/mat3x3.hpp>
#include <optional>
#include <string_view>
#include <unordered_map>

#include "base/error.h"
#include "io/archive.h"
#include "io/image_file.h"
#include "io/imported_scene.h"
#include "io/mesh_readers.h"
#include "io/text_scan.h"
#include "scene/shapes.h"

namespace tilegrad::io {
namespace {

// The quoted value after `name`, which begins with a space and ends with "=".
std::string_view ValueOf(std::string_view tag, std::string_view name) {
  const std::size_t found = tag.find(name);
  if (found == std::string_view::npos) return {};
  const std::string_view rest = tag.substr(std::min(found + name.size() + 1, tag.size()));
  return rest.substr(0, rest.find_first_of("\"'"));
}

// Whether triangles of one object of a 3MF model have different materials, or colour groups are
// used: Assimp 5.2 gives an object the material of its last triangle, and ignores the groups.
bool HasPaintedTriangles(std::string_view model_xml) {
  // Attributes of the base-material extension, and those of slicers.
  constexpr std::array<std::string_view, 6> kPaint = {
      " pid=", " p1=", " p2=", " p3=", ":mmu_segmentation=", " paint_color="};
  using Paint = std::array<std::string_view, kPaint.size()>;
  std::optional<Paint> first;  // in this object
  for (std::size_t at = model_xml.find('<'); at != std::string_view::npos;
       at = model_xml.find('<', at + 1)) {
    const std::string_view tag = model_xml.substr(at, model_xml.find('>', at) - at);
    if (tag.find("colorgroup") != std::string_view::npos) return true;
    if (tag.starts_with("<object")) first.reset();
    if (!tag.starts_with("<triangle ")) continue;
    Paint paint;
    std::transform(kPaint.begin(), kPaint.end(), paint.begin(),
                   [&](std::string_view name) { return ValueOf(tag, name); });
    if (first && *first != paint) return true;
    first = paint;
  }
  return false;
}

// Corners that agree in position and colour become one vertex; uv and normals stay per corner.
class Welder {
 public:
  explicit Welder(Mesh& mesh) : mesh_(mesh) {}
  std::int32_t Add(glm::vec3 position, const glm::vec4* color) {
    std::string key(reinterpret_cast<const char*>(&position), sizeof(position));
    if (color != nullptr) key.append(reinterpret_cast<const char*>(color), sizeof(*color));
    const auto [it, added] =
        seen_.try_emplace(std::move(key), static_cast<std::int32_t>(mesh_.positions.size()));
    if (added) {
      mesh_.positions.push_back(position);
      if (color != nullptr) mesh_.colors.push_back(*color);
    }
    return it->second;
  }

 private:
  Mesh& mesh_;
  std::unordered_map<std::string, std::int32_t> seen_;
};

Mesh ConvertPart(const ImportedPart& part) {
  Mesh mesh;
  Welder welder(mesh);
  std::vector<std::int32_t> vertex;
  for (std::size_t i = 0; i < part.positions.size(); ++i) {
    vertex.push_back(
        welder.Add(part.positions[i], part.colors.empty() ? nullptr : &part.colors[i]));
  }
  for (const auto& [a, b, c] : part.triangles) {
    mesh.faces.push_back({vertex[a], vertex[b], vertex[c]});
    for (const std::uint32_t v : {a, b, c}) {
      if (!part.uvs.empty()) mesh.corner_uvs.push_back(part.uvs[v]);
      if (!part.normals.empty()) mesh.corner_normals.push_back(part.normals[v]);
    }
  }
  return mesh;
}

class Assembly {
 public:
  Assembly(ImportedScene scene, const FileSource& source, const std::string& name)
      : scene_(std::move(scene)),
        source_(source),
        name_(name),
        images_(scene_.images.size()),
        materials_(scene_.materials.size()) {}

  Result<LoadedMesh> Run() {
    out_.warnings = std::move(scene_.warnings);
    for (const ImportedInstance& instance : scene_.instances) TILEGRAD_TRY(Add(instance));
    return std::move(out_);
  }

 private:
  Status Add(const ImportedInstance& instance) {
    const ImportedPart& part = scene_.parts[instance.part];
    if (part.triangles.empty()) return {};
    Mesh mesh = ConvertPart(part);
    FinishColors(ColorNumbers::kShown, &mesh.colors, &out_.warnings);
    const glm::dmat4x3& m = instance.to_scene;
    std::vector<glm::dvec3> exact;
    for (const glm::vec3& p : mesh.positions) exact.push_back(m * glm::dvec4(p, 1));
    if (m != glm::dmat4x3(1))
      Transform(mesh, {glm::vec3(m[0]), glm::vec3(m[1]), glm::vec3(m[2])}, glm::vec3(m[3]));
    const Material material =
        part.material < materials_.size() ? MaterialOf(part.material) : Material{};
    return AppendWithMaterial(std::move(mesh), material, out_, exact);
  }

  // Converted at first use, so that materials without a face ask for no texture.
  Material MaterialOf(std::size_t index) {
    if (!materials_[index]) materials_[index] = Convert(scene_.materials[index]);
    return *materials_[index];
  }

  Material Convert(const ImportedMaterial& from) {
    Material material;
    material.name = from.name;
    material.base_color = from.color;
    if (!from.image.empty()) material.base_color_texture = Texture(from);
    if (material.base_color_texture >= 0 && !from.not_read.empty())
      out_.Warn("material \"{}\": not read of its image: {}", from.name, from.not_read);
    // With a texture, exporters often leave the diffuse colour black or grey; use the image alone.
    if (material.base_color_texture >= 0) material.base_color = {1, 1, 1, from.color.a};
    return material;
  }

  int Texture(const ImportedMaterial& from) {
    if (from.embedded < 0) return AddTexture(source_, name_, ImageName(from.image), out_);
    std::optional<int>& image = images_[static_cast<std::size_t>(from.embedded)];
    if (!image)
      image = Embedded(scene_.images[static_cast<std::size_t>(from.embedded)], from.image);
    return *image;
  }

  // Skins of MD2 often have no extension, start with a dot for "beside the mesh", or have the
  // extension of a format that was replaced since.
  std::string ImageName(const std::string& written) const {
    if (MeshEnding(name_) != ".md2" || FindBeside(source_, name_, written)) return written;
    const std::string stem = Path(written.substr(written.starts_with('.') ? 1 : 0)).stem().string();
    for (const char* ending : {".png", ".jpg", ".jpeg", ".tga", ".bmp"}) {
      if (FindBeside(source_, name_, stem + ending)) return stem + ending;
    }
    return written;
  }

  int Embedded(const ImportedImage& image, const std::string& label) {
    if (!image.bytes.empty()) return AddTexture(DecodeImage(image.bytes, label), label, out_);
    out_.Warn("texture \"{}\" left out: embedded without compression", label);
    return -1;
  }

  ImportedScene scene_;
  const FileSource& source_;
  const std::string& name_;
  LoadedMesh out_;
  std::vector<std::optional<int>> images_;          // texture of each used image
  std::vector<std::optional<Material>> materials_;  // used ones
};

std::optional<Bytes> Answer(const FileSource& source, std::string_view question) {
  const std::string name(question.substr(1));
  if (question[0] == kAskExists) return source.Exists(name) ? std::optional(Bytes()) : std::nullopt;
  auto content = source.Read(name);
  return content.ok() ? std::optional(std::move(content).value()) : std::nullopt;
}

// Far above what sound files take: at most 0.1 s and 15 MB per MiB were seen, for text FBX.
GuardLimits LimitsFor(std::size_t bytes) {
  GuardLimits limits;
  const auto mebibytes = static_cast<int>(bytes >> 20);
  limits.cpu_seconds += 2 * mebibytes;
  limits.wall_seconds += 10.0 * mebibytes;
  limits.memory_bytes += 200 * bytes;
  return limits;
}

Status Explain(const Status& failure, const std::string& place, const std::string& name) {
  // A refusal by the system or a stop says nothing about the file.
  if (failure.code() == StatusCode::kIo || failure.code() == StatusCode::kCancelled)
    return failure.Within(fmt::format("{}: the {} reader", place, MeshEnding(name)));
  return Status(failure.code(),
                fmt::format("{}: the {} reader {}; the file is probably damaged, try to save it "
                            "anew or as .glb",
                            place, MeshEnding(name), failure.message()));
}

// Bit 15 of a facet's attribute means that the facet has its own colour; in files of Magics, which
// writes COLOR= into the header, that it has the header's. Assimp 5.2 reads one as the other, so
// this inverts the bits of Magics, unless all attributes are 0, as programs without colours write
// them. Facets without a colour beside coloured ones become white: Assimp would make them grey
// glass.
void MendStlColors(Bytes& stl) {
  constexpr std::size_t kHeader = 80, kFirstFacet = 84, kFacet = 50, kAttribute = 48;
  constexpr std::uint8_t kMark = 0x80;  // in the second byte
  if (stl.size() < kFirstFacet) return;
  std::uint32_t count = 0;
  std::memcpy(&count, &stl[kHeader], sizeof(count));
  if (stl.size() != kFirstFacet + kFacet * std::uint64_t{count}) return;  // text
  const bool magics = TextOf(stl).substr(0, kHeader).find("COLOR=") != std::string::npos;
  bool colored = false;
  for (std::size_t at = kFirstFacet + kAttribute; at < stl.size(); at += kFacet)
    colored = colored || (stl[at + 1] & kMark) != 0 || (magics && (stl[at] | stl[at + 1]) != 0);
  for (std::size_t at = kFirstFacet + kAttribute; colored && at < stl.size(); at += kFacet) {
    if (magics) {
      stl[at + 1] ^= kMark;
    } else if ((stl[at + 1] & kMark) == 0) {
      stl[at] = 0xff;
      stl[at + 1] = 0xff;
    }
  }
}

void WarnOfPaint(const Bytes& threemf, const std::string& place,
                 std::vector<std::string>* warnings) {
  const auto model = ReadFromZip(threemf, place, "3D/3dmodel.model");
  if (!model.ok() || !HasPaintedTriangles(TextOf(*model))) return;
  warnings->emplace_back("colours of single triangles and colour groups left out");
}

constexpr std::string_view kName = "WrapMode";  // and U or V

// After the name in a text file: `", "enum", "", "",1` to the end of the line.
int TextValue(std::string_view rest) {
  rest = rest.substr(0, rest.find_first_of("\r\n"));
  const std::size_t comma = rest.rfind(',');
  if (comma == std::string_view::npos) return 0;
  rest.remove_prefix(std::min(rest.find_first_not_of(" \t", comma + 1), rest.size()));
  int value = 0;
  std::from_chars(rest.data(), rest.data() + rest.size(), value);
  return value;
}

// After the name in a binary file: three texts, S with 32 bits of length, then I and the value.
int BinaryValue(std::string_view rest) {
  const auto number = [&]() {
    std::uint32_t value = 0;
    std::memcpy(&value, rest.data() + 1, sizeof(value));
    return value;
  };
  constexpr std::size_t kHead = 1 + sizeof(std::uint32_t);
  for (int text = 0; text < 3; ++text) {
    if (rest.size() < kHead || rest[0] != 'S' || number() > rest.size() - kHead) return 0;
    rest.remove_prefix(kHead + number());
  }
  return rest.size() < kHead || rest[0] != 'I' ? 0 : static_cast<int>(number());
}

}  // namespace

bool HasClampedFbxTexture(std::span<const std::uint8_t> file) {
  const std::string_view all = TextOf(file);
  for (std::size_t at = all.find(kName); at < all.size(); at = all.find(kName, at + 1)) {
    std::string_view rest = all.substr(at + kName.size());
    if (!rest.starts_with('U') && !rest.starts_with('V')) continue;
    rest.remove_prefix(1);
    if ((rest.starts_with('"') ? TextValue(rest) : BinaryValue(rest)) != 0) return true;
  }
  return false;
}

Result<LoadedMesh> ReadByAssimp(const FileSource& source, const std::string& name,
                                const Bytes& file, const GuardLimits& limits) {
  const std::string place = source.Describe(name);
  const auto bytes =
      RunGuarded([&](AskParent ask) { return EncodeScene(ImportByAssimp(name, file, ask)); },
                 [&](std::string_view question) { return Answer(source, question); }, limits);
  if (!bytes.ok()) return Explain(bytes.status(), place, name);
  auto scene = DecodeScene(*bytes);
  if (!scene.ok()) return scene.status().Within(place);
  auto loaded = Assembly(std::move(*scene), source, name).Run();
  if (!loaded.ok()) return loaded.status().Within(place);
  if (!loaded->mesh.textures.empty() && MeshEnding(name) == ".fbx" && HasClampedFbxTexture(file)) {
    loaded->warnings.emplace_back(
        "the wrapping of a texture (clamped) is not read; all textures repeat");
  }
  if (MeshEnding(name) == ".3mf") WarnOfPaint(file, place, &loaded->warnings);
  return loaded;
}

Result<LoadedMesh> ReadByAssimp(const FileSource& source, const std::string& name) {
  TILEGRAD_ASSIGN(Bytes file, source.Read(name));
  // Assimp 5.2 takes frames that end at the end of the file for frames beyond it.
  if (MeshEnding(name) == ".md2") file.push_back(0);
  if (MeshEnding(name) == ".stl") MendStlColors(file);
  return ReadByAssimp(source, name, file, LimitsFor(file.size()));
}

}  // namespace tilegrad::io
