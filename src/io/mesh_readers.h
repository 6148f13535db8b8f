// SPDX-License-Identifier: Apache-2.0
// Internal to io: what mesh_file.cc dispatches to, and what the readers share.
#pragma once

#include <glm/vec3.hpp>
#include <glm/vec4.hpp>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "io/guarded_process.h"
#include "io/mesh_file.h"

namespace tilegrad::io {

// Vertices or faces of one mesh: 2^26 faces with all attributes take about 6 GB, and three times as
// many corners still have 32-bit indices.
inline constexpr std::size_t kMaxMeshElements = std::size_t{1} << 26;

// All leave positions in LoadedMesh::exact, and validation to mesh_file.cc.
Result<LoadedMesh> ReadGltf(const FileSource& source, const std::string& name);
Result<LoadedMesh> ReadPly(const FileSource& source, const std::string& name);
Result<LoadedMesh> ReadOff(const FileSource& source, const std::string& name);
Result<LoadedMesh> ReadAc3d(const FileSource& source, const std::string& name);
Result<LoadedMesh> ReadObj(const FileSource& source, const std::string& name);
Result<LoadedMesh> ReadByAssimp(const FileSource& source, const std::string& name);

// The same of a file that is read already, with limits other than those that suit its size.
Result<LoadedMesh> ReadByAssimp(const FileSource& source, const std::string& name,
                                const Bytes& file, const GuardLimits& limits);

// What Assimp does not tell of an FBX file, text or binary: whether some texture does not repeat;
// its WrapModeU or WrapModeV is not 0. Of damaged files anything, but nothing outside of `file` is
// read.
bool HasClampedFbxTexture(std::span<const std::uint8_t> file);

// The ending of a file name in lower case, with its point.
std::string MeshEnding(const std::string& name);

// A polygon of a file on its way into a mesh; kept by readers as scratch.
struct Polygon {
  std::vector<std::int32_t> corners;  // vertices of the mesh
  std::vector<Face> triangles;        // set by AddTo: positions in `corners`

  // Adds its triangles (scene/mesh.h) to the faces.
  void AddTo(LoadedMesh& out);

 private:
  std::vector<glm::vec3> positions_;
};

// For warnings: up to eight names in quotes, and how many more there are.
std::string ShortList(const std::set<std::string, std::less<>>& names);

// A file that a mesh file mentions: as written beside the mesh, then by its base name there, which
// helps absolute paths of another computer; then the same with "%20" and the like decoded, as some
// exporters write names. Its name in the source, or nothing.
std::optional<std::string> FindBeside(const FileSource& source, const std::string& mesh_name,
                                      std::string_view mentioned);

// The same where the format says that it is a URI: decoded first, then as written.
std::optional<std::string> FindByUri(const FileSource& source, const std::string& mesh_name,
                                     std::string_view uri);

// Finds an image that a mesh file mentions. Adds it to out.mesh.textures and returns its index, or
// adds a warning and returns -1.
int AddTexture(const FileSource& source, const std::string& mesh_name,
               const std::string& image_name, LoadedMesh& out);

// The same of a file of the source, each of which becomes one texture; nothing: it was not found.
// `image_name` is the texture's, and stands in warnings.
int AddTextureFile(const FileSource& source, const std::optional<std::string>& file,
                   const std::string& image_name, LoadedMesh& out);

// The same for an image that is already in memory.
int AddTexture(Result<ImageU8> image, const std::string& image_name, LoadedMesh& out);

// Adds a part whose only material is `material`, which refers to textures that are already in
// out.mesh. `exact`: its positions in the scene, one for each vertex. An error if the whole becomes
// too large: a small file can place one part many times.
Status AppendWithMaterial(Mesh part, const Material& material, LoadedMesh& out,
                          std::span<const glm::dvec3> exact);

// The same of a part whose vertices are in out.mesh already, from number `first` on.
Status AppendFacesWithMaterial(const Mesh& part, std::int32_t first, const Material& material,
                               LoadedMesh& out);

// Internal to io: colours of vertices, corners and materials as files have them.

// What fractions between 0 and 1 mean: light, as in glTF, or what is shown (sRGB).
enum class ColorNumbers { kLinear, kShown };

// Of what has none beside others that have one: white, whatever those are counted to.
inline constexpr glm::vec4 kNoColor(1, 1, 1, -1);

bool IsFinite(const glm::vec4& color);

// Makes colours of vertices or corners sRGB from 0 to 1. What is counted to 255 or 65535, as nobody
// counts light, is divided; what is more than 1 is cut; each with a warning. Colours that are
// finished stay as they are.
void FinishColors(ColorNumbers numbers, std::vector<glm::vec4>* colors,
                  std::vector<std::string>* warnings);

// The same of all materials, once each.
void FinishMaterials(ColorNumbers numbers, LoadedMesh& loaded);

// A warning if colours of vertices or faces have an alpha below 1 that nothing draws, because all
// materials are opaque.
void WarnOfTransparentColors(LoadedMesh& loaded);

}  // namespace tilegrad::io
