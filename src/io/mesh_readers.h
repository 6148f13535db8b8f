// SPDX-License-Identifier: Apache-2.0
// Internal to io: the readers that mesh_file.cc dispatches to, and what they share.
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

// Limit for vertices and for faces: 2^26 faces with all attributes take about 6 GB, and three times
// as many corners still have 32-bit indices.
inline constexpr std::size_t kMaxMeshElements = std::size_t{1} << 26;

// Leave positions in LoadedMesh::exact, and validation to mesh_file.cc.
Result<LoadedMesh> ReadGltf(const FileSource& source, const std::string& name);
Result<LoadedMesh> ReadPly(const FileSource& source, const std::string& name);
Result<LoadedMesh> ReadOff(const FileSource& source, const std::string& name);
Result<LoadedMesh> ReadAc3d(const FileSource& source, const std::string& name);
Result<LoadedMesh> ReadObj(const FileSource& source, const std::string& name);
Result<LoadedMesh> ReadByAssimp(const FileSource& source, const std::string& name);

// The same for a file already read, with limits other than those derived from its size.
Result<LoadedMesh> ReadByAssimp(const FileSource& source, const std::string& name,
                                const Bytes& file, const GuardLimits& limits);

// What Assimp does not report about an FBX file, text or binary: whether a texture clamps (its
// WrapModeU or WrapModeV is not 0). For damaged files the answer is arbitrary, but reads stay in
// `file`.
bool HasClampedFbxTexture(std::span<const std::uint8_t> file);

// The lower-case extension of a file name, with its dot.
std::string MeshEnding(const std::string& name);

// A polygon being read from a file; readers keep it as scratch.
struct Polygon {
  std::vector<std::int32_t> corners;  // vertices of the mesh
  std::vector<Face> triangles;        // set by AddTo: indices into `corners`

  // Adds its triangles (scene/mesh.h: TriangulatePolygon) to the faces.
  void AddTo(LoadedMesh& out);

 private:
  std::vector<glm::vec3> positions_;
};

// For warnings: up to eight names in quotes, and the number of the rest.
std::string ShortList(const std::set<std::string, std::less<>>& names);

// Resolves a file that a mesh file mentions: as written, relative to the mesh, then by its base
// name there, which helps with absolute paths from another computer; then both percent-decoded,
// since some exporters write "%20". Returns its name in the source, or nullopt.
std::optional<std::string> FindBeside(const FileSource& source, const std::string& mesh_name,
                                      std::string_view mentioned);

// The same for formats that specify URIs: decoded first, then as written.
std::optional<std::string> FindByUri(const FileSource& source, const std::string& mesh_name,
                                     std::string_view uri);

// Finds an image that a mesh file mentions. Adds it to out.mesh.textures and returns its index, or
// adds a warning and returns -1.
int AddTexture(const FileSource& source, const std::string& mesh_name,
               const std::string& image_name, LoadedMesh& out);

// The same for a file of the source (nullopt: not found); each file becomes one texture. Warnings
// call the texture `image_name`.
int AddTextureFile(const FileSource& source, const std::optional<std::string>& file,
                   const std::string& image_name, LoadedMesh& out);

// The same for an image that is already in memory.
int AddTexture(Result<ImageU8> image, const std::string& image_name, LoadedMesh& out);

// Appends a part whose only material is `material`, which refers to textures already in out.mesh.
// `exact`: its positions in the scene, one per vertex. An error if the mesh becomes too large: a
// small file can place one part many times.
Status AppendWithMaterial(Mesh part, const Material& material, LoadedMesh& out,
                          std::span<const glm::dvec3> exact);

// The same for a part whose vertices are already in out.mesh, from index `first` on.
Status AppendFacesWithMaterial(const Mesh& part, std::int32_t first, const Material& material,
                               LoadedMesh& out);

// Internal to io: colours of vertices, corners and materials in files.

// The encoding of colours in [0, 1]: linear light, as in glTF, or sRGB.
enum class ColorNumbers { kLinear, kShown };

// For elements without a colour beside others with one: white at any scale.
inline constexpr glm::vec4 kNoColor(1, 1, 1, -1);

bool IsFinite(const glm::vec4& color);

// Converts vertex or corner colours to sRGB in [0, 1]. Divides values scaled to 255 or 65535, which
// are sRGB in any case, and clamps values above 1; each with a warning. Leaves finished colours as
// they are.
void FinishColors(ColorNumbers numbers, std::vector<glm::vec4>* colors,
                  std::vector<std::string>* warnings);

// The same for all materials, once each.
void FinishMaterials(ColorNumbers numbers, LoadedMesh& loaded);

// Warns if vertex or face colours have an alpha below 1 without effect because all materials are
// opaque.
void WarnOfTransparentColors(LoadedMesh& loaded);

}  // namespace tilegrad::io
