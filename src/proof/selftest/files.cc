// SPDX-License-Identifier: Apache-2.0
// Files written and read back, in a folder that is removed afterwards.
#include <cstring>

#include "base/rng.h"
#include "io/image_file.h"
#include "io/mesh_file.h"
#include "nn/nn.h"
#include "proof/selftest/check.h"
#include "scene/shapes.h"

namespace tilegrad::selftest {
namespace {

// A new temporary folder, removed with its contents at the end.
class TemporaryFolder {
 public:
  TemporaryFolder() {
    std::error_code error;
    std::string name = std::filesystem::temp_directory_path(error) / "tilegrad-selftest-";
    name.append(6, 'X');  // which mkdtemp replaces
    if (error || ::mkdtemp(name.data()) == nullptr) {
      status_ = IoError("no folder for temporary files ({}); set TMPDIR to one",
                        error ? error.message() : std::strerror(errno));
      return;
    }
    path_ = name;
  }
  ~TemporaryFolder() {
    std::error_code error;  // errors are ignored
    if (status_.ok()) std::filesystem::remove_all(path_, error);
  }
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;

  const Status& status() const { return status_; }
  Path operator/(const char* name) const { return path_ / name; }

 private:
  Path path_;
  Status status_;
};

std::vector<std::uint8_t> RandomBytes(std::size_t count) {
  Rng rng(14, 26);
  std::vector<std::uint8_t> out(count);
  for (auto& byte : out) byte = static_cast<std::uint8_t>(rng.Below(256));
  return out;
}

ImageU8 RandomImage(int width, int height, int channels) {
  ImageU8 image(width, height, channels);
  image.pixels = RandomBytes(image.pixels.size());
  return image;
}

// A sphere with a texture, whose coordinates jump at corners.
Mesh TexturedSphere() {
  Rng rng(15, 26);
  Mesh mesh = Icosphere(1, 0.7f);
  for (std::size_t i = 0; i < 3 * mesh.faces.size(); ++i) {
    mesh.corner_uvs.emplace_back(static_cast<float>(rng.Uniform()),
                                 static_cast<float>(rng.Uniform()));
  }
  mesh.materials.resize(1);
  mesh.materials[0].base_color_texture = 0;
  mesh.textures.push_back({"pattern", RandomImage(5, 4, 3)});
  return mesh;
}

// Positions and uv of all corners, since files may split or join vertices.
struct Corners {
  std::vector<float> positions, uvs;

  explicit Corners(const Mesh& mesh) {
    for (const Face& face : mesh.faces) {
      for (const std::int32_t v : face) {
        const glm::vec3& p = mesh.positions[static_cast<std::size_t>(v)];
        positions.insert(positions.end(), {p.x, p.y, p.z});
      }
    }
    for (const glm::vec2& uv : mesh.corner_uvs) uvs.insert(uvs.end(), {uv.x, uv.y});
  }
};

Status ExpectMesh(const CheckContext& context, const Mesh& got, const Mesh& want, double uv_error) {
  Corners read(got);
  const Corners written(want);
  context.Take("positions", read.positions);
  context.Take("uvs", read.uvs);
  TILEGRAD_TRY(ExpectSameBits("positions", read.positions, written.positions));
  return Gauge().Expect("uvs", read.uvs, written.uvs, uv_error);
}

Status ExpectBytes(const CheckContext& context, std::string_view what,
                   std::vector<std::uint8_t> got, const std::vector<std::uint8_t>& want) {
  context.Take(what, got);
  return Gauge().Expect(what, got, want, 0);
}

// The file measures v from the top: 1 - v rounds twice, by 2^-25 each time.
Result<Finding> Glb(const CheckContext& context) {
  const TemporaryFolder folder;
  TILEGRAD_TRY(folder.status());
  const Mesh mesh = TexturedSphere();
  TILEGRAD_TRY(io::SaveGlb(folder / "sphere.glb", mesh));
  TILEGRAD_ASSIGN(const auto loaded, io::LoadMesh(folder / "sphere.glb"));
  TILEGRAD_TRY(ExpectMesh(context, loaded.mesh, mesh, 0x1.0p-24));
  if (loaded.mesh.textures.size() != 1) return InternalError("the texture is missing");
  TILEGRAD_TRY(ExpectBytes(context, "texels", loaded.mesh.textures[0].image.pixels,
                           mesh.textures[0].image.pixels));
  return Finding{"written and read back"};
}

// Numbers with nine digits round-trip exactly.
std::string ObjText(const Mesh& mesh) {
  std::string text;
  for (const glm::vec3& p : mesh.positions) {
    text += fmt::format("v {:.9g} {:.9g} {:.9g}\n", p.x, p.y, p.z);
  }
  for (const glm::vec2& uv : mesh.corner_uvs) text += fmt::format("vt {:.9g} {:.9g}\n", uv.x, uv.y);
  std::size_t corner = 0;
  for (const Face& face : mesh.faces) {
    text += 'f';
    for (const std::int32_t v : face) text += fmt::format(" {}/{}", v + 1, ++corner);
    text += '\n';
  }
  return text;
}

Result<Finding> Obj(const CheckContext& context) {
  const TemporaryFolder folder;
  TILEGRAD_TRY(folder.status());
  const Mesh mesh = TexturedSphere();
  TILEGRAD_TRY(WriteTextAtomic(folder / "sphere.obj", ObjText(mesh)));
  TILEGRAD_ASSIGN(const auto loaded, io::LoadMesh(folder / "sphere.obj"));
  TILEGRAD_TRY(ExpectMesh(context, loaded.mesh, mesh, 0));
  return Finding{"read as written"};
}

Result<Finding> Png(const CheckContext& context) {
  const TemporaryFolder folder;
  TILEGRAD_TRY(folder.status());
  const ImageU8 image = RandomImage(17, 9, 4);
  TILEGRAD_TRY(io::SavePng(folder / "image.png", image));
  TILEGRAD_ASSIGN(const auto loaded, io::LoadImage(folder / "image.png"));
  TILEGRAD_TRY(ExpectBytes(context, "pixels", loaded.pixels, image.pixels));
  return Finding{"written and read back"};
}

Result<Finding> Safetensors(const CheckContext& context) {
  const TemporaryFolder folder;
  TILEGRAD_TRY(folder.status());
  nn::Context networks(context.workers);
  Rng rng(16, 26);
  nn::Tensor weights = networks.Empty({3, 5, 2});
  nn::FillNormal(weights, rng, 1);
  const std::int32_t order[] = {4, -7, 1 << 30};
  const std::vector<nn::NamedTensor> written = {{"weights", weights},
                                                {"order", networks.Indices(order)}};
  TILEGRAD_TRY(nn::WriteSafetensors(folder / "net.safetensors", {written, {{"step", "12"}}}));
  TILEGRAD_ASSIGN(const auto file, nn::ReadSafetensors(networks, folder / "net.safetensors"));
  for (const auto& [name, tensor] : written) {
    const nn::Tensor* read = nn::Find(file.tensors, name);
    if (read == nullptr || !(read->shape() == tensor.shape()) || read->dtype() != tensor.dtype()) {
      return InternalError("{} has changed", name);
    }
    const auto bytes = [](const nn::Tensor& t) {
      const auto* begin = reinterpret_cast<const std::uint8_t*>(t.raw());
      return std::vector<std::uint8_t>(begin, begin + t.bytes());
    };
    TILEGRAD_TRY(ExpectBytes(context, name, bytes(*read), bytes(tensor)));
  }
  return Finding{"written and read back"};
}

}  // namespace

std::vector<Check> FileChecks() {
  return {{"files: GLB", Glb},
          {"files: OBJ", Obj},
          {"files: PNG", Png},
          {"files: safetensors", Safetensors}};
}

}  // namespace tilegrad::selftest
