// SPDX-License-Identifier: Apache-2.0
#include "io/mesh_samples.h"

#include <assimp/scene.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <assimp/Exporter.hpp>
#include <bit>
#include <cstring>

#include "io/archive.h"

namespace tilegrad::io {
namespace {

constexpr std::array<std::array<float, 3>, 4> kCorners = {
    {{0, 0, 0}, {1, 0, 0}, {0, 2, 0}, {0, 0, 3}}};
constexpr std::array<std::array<std::uint16_t, 3>, 4> kFaces = {
    {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}}};
constexpr std::array<float, 3> kColor = {0.8f, 0.2f, 0.4f};

Bytes ToBytes(const std::string& text) { return {text.begin(), text.end()}; }

// Flat: every corner is a vertex, with a normal and a uv, as exporters want it.
aiMesh* MakeAssimpMesh() {
  auto* mesh = new aiMesh;
  mesh->mName = "tetrahedron";
  mesh->mPrimitiveTypes = aiPrimitiveType_TRIANGLE;
  mesh->mNumVertices = 12;
  mesh->mVertices = new aiVector3D[12];
  mesh->mNormals = new aiVector3D[12];
  mesh->mTextureCoords[0] = new aiVector3D[12];
  mesh->mNumUVComponents[0] = 2;
  mesh->mNumFaces = 4;
  mesh->mFaces = new aiFace[4];
  for (unsigned f = 0; f < 4; ++f) {
    mesh->mFaces[f].mNumIndices = 3;
    mesh->mFaces[f].mIndices = new unsigned[3];
    for (unsigned k = 0; k < 3; ++k) {
      const auto& [x, y, z] = kCorners[kFaces[f][k]];
      const unsigned v = 3 * f + k;
      mesh->mFaces[f].mIndices[k] = v;
      mesh->mVertices[v] = {x, y, z};
      mesh->mNormals[v] = {0, 0, 1};
      mesh->mTextureCoords[0][v] = {x, y / 2, 0};
    }
  }
  return mesh;
}

aiMaterial* MakeAssimpMaterial() {
  auto* material = new aiMaterial;
  const aiString name("paint");
  const aiColor4D color(kColor[0], kColor[1], kColor[2], 1);
  material->AddProperty(&name, AI_MATKEY_NAME);
  material->AddProperty(&color, 1, AI_MATKEY_COLOR_DIFFUSE);
  return material;
}

// By way of a file: some exporters cannot write to memory.
Bytes Export(const char* format, const Path& scratch) {
  aiScene scene;
  scene.mMeshes = new aiMesh* [1] { MakeAssimpMesh() };
  scene.mNumMeshes = 1;
  scene.mMaterials = new aiMaterial* [1] { MakeAssimpMaterial() };
  scene.mNumMaterials = 1;
  scene.mRootNode = new aiNode("root");
  scene.mRootNode->addChildren(1, std::array<aiNode*, 1>{new aiNode("child")}.data());
  aiNode& child = *scene.mRootNode->mChildren[0];
  child.mNumMeshes = 1;
  child.mMeshes = new unsigned[1]{0};
  Assimp::Exporter exporter;
  const Path file = scratch / format;
  EXPECT_EQ(exporter.Export(&scene, format, file.string()), aiReturn_SUCCESS)
      << format << ": " << exporter.GetErrorString();
  return ReadFile(file).value();
}

std::string Number(float value) { return " " + std::to_string(value); }

Bytes Ase() {
  std::string vertices, faces;
  for (std::size_t v = 0; v < kCorners.size(); ++v) {
    vertices += "*MESH_VERTEX " + std::to_string(v);
    for (const float x : kCorners[v]) vertices += Number(x);
    vertices += "\n";
  }
  for (std::size_t f = 0; f < kFaces.size(); ++f) {
    const auto& [a, b, c] = kFaces[f];
    faces += "*MESH_FACE " + std::to_string(f) + ": A: " + std::to_string(a) +
             " B: " + std::to_string(b) + " C: " + std::to_string(c) +
             " AB: 1 BC: 1 CA: 1 *MESH_SMOOTHING 1 *MESH_MTLID 0\n";
  }
  return ToBytes(
      "*3DSMAX_ASCIIEXPORT 200\n*MATERIAL_LIST {\n*MATERIAL_COUNT 1\n*MATERIAL 0 {\n"
      "*MATERIAL_NAME \"paint\"\n*MATERIAL_DIFFUSE" +
      Number(kColor[0]) + Number(kColor[1]) + Number(kColor[2]) +
      "\n}\n}\n*GEOMOBJECT {\n*NODE_NAME \"t\"\n*NODE_TM {\n*TM_ROW0 1 0 0\n*TM_ROW1 0 1 0\n"
      "*TM_ROW2 0 0 1\n*TM_ROW3 0 0 0\n}\n*MESH {\n*TIMEVALUE 0\n*MESH_NUMVERTEX 4\n"
      "*MESH_NUMFACES 4\n*MESH_VERTEX_LIST {\n" +
      vertices + "}\n*MESH_FACE_LIST {\n" + faces + "}\n}\n*MATERIAL_REF 0\n}\n");
}

// DirectX, as text; Assimp's exporter writes no colours.
Bytes X() {
  std::string vertices, faces;
  for (const auto& [x, y, z] : kCorners)
    vertices += Number(x) + ";" + Number(y) + ";" + Number(z) + ";,";
  for (const auto& [a, b, c] : kFaces) {
    faces += "3;" + std::to_string(a) + "," + std::to_string(b) + "," + std::to_string(c) + ";,";
  }
  vertices.back() = faces.back() = ';';
  return ToBytes("xof 0303txt 0032\nMesh t {\n4;\n" + vertices + "\n4;\n" + faces +
                 "\nMeshMaterialList {\n1;\n4;\n0,0,0,0;\nMaterial paint {\n" + Number(kColor[0]) +
                 ";" + Number(kColor[1]) + ";" + Number(kColor[2]) +
                 ";1.0;;\n1.0;\n0.0;0.0;0.0;;\n0.0;0.0;0.0;;\n}\n}\n}\n");
}

// Numbers one after another in a fixed byte order.
class Packer {
 public:
  explicit Packer(std::endian order) : order_(order) {}
  template <class... T>
  Packer& operator()(T... values) {
    (Put(values), ...);
    return *this;
  }
  Packer& Text(std::string text, std::size_t width = 0) {
    if (width > 0) text.resize(width, '\0');
    out.insert(out.end(), text.begin(), text.end());
    return *this;
  }
  Bytes out;

 private:
  template <class T>
  void Put(T value) {
    auto bytes = std::bit_cast<std::array<std::uint8_t, sizeof(T)>>(value);
    if (order_ != std::endian::native) std::reverse(bytes.begin(), bytes.end());
    out.insert(out.end(), bytes.begin(), bytes.end());
  }
  std::endian order_;
};

void Chunk(Packer& to, const std::string& id, const Bytes& body) {
  to.Text(id)(static_cast<std::uint32_t>(body.size()));
  to.out.insert(to.out.end(), body.begin(), body.end());
}

Packer Big() { return Packer(std::endian::big); }

// LightWave, IFF of the second kind.
Bytes Lwo() {
  using U16 = std::uint16_t;
  Packer points = Big(), polygons = Big(), tags = Big(), surface = Big(), chunks = Big();
  polygons.Text("FACE");
  tags.Text("SURF");
  for (const auto& [x, y, z] : kCorners) points(x, y, z);
  for (U16 f = 0; f < 4; ++f) {
    polygons(U16{3}, kFaces[f][0], kFaces[f][1], kFaces[f][2]);
    tags(f, U16{0});
  }
  surface.Text("paint", 6)
      .Text("", 2)
      .Text("COLR")(U16{14}, kColor[0], kColor[1], kColor[2], U16{0});
  chunks.Text("LWO2");
  Chunk(chunks, "TAGS", Big().Text("paint", 6).out);
  Chunk(chunks, "LAYR", Big()(U16{0}, U16{0}, 0.0f, 0.0f, 0.0f).Text("", 2).out);
  Chunk(chunks, "PNTS", points.out);
  Chunk(chunks, "POLS", polygons.out);
  Chunk(chunks, "PTAG", tags.out);
  Chunk(chunks, "SURF", surface.out);
  Packer file = Big();
  Chunk(file, "FORM", chunks.out);
  return file.out;
}

// Milkshape.
Bytes Ms3d() {
  using U8 = std::uint8_t;
  using U16 = std::uint16_t;
  Packer p(std::endian::little);
  p.Text("MS3D000000")(std::int32_t{4}, U16{4});
  for (const auto& [x, y, z] : kCorners) p(U8{0}, x, y, z, U8{255}, U8{0});
  p(U16{4});
  for (const auto& [a, b, c] : kFaces) {
    p(U16{0}, a, b, c);
    for (int k = 0; k < 3; ++k) p(0.0f, 0.0f, 1.0f);
    for (int k = 0; k < 6; ++k) p(0.5f);
    p(U8{1}, U8{0});
  }
  p(U16{1}, U8{0}).Text("group", 32)(U16{4}, U16{0}, U16{1}, U16{2}, U16{3}, U8{0});
  p(U16{1}).Text("paint", 32)(0.2f, 0.2f, 0.2f, 1.0f, kColor[0], kColor[1], kColor[2], 1.0f);
  p(0.0f, 0.0f, 0.0f, 1.0f, 0.0f, 0.0f, 0.0f, 1.0f, 0.0f, 1.0f, U8{0}).Text("", 256);
  p(24.0f, 0.0f, std::int32_t{0}, U16{0});
  return p.out;
}

// A node of binary FBX 7.4; Assimp's exporter leaves out the zeros that end a list of children.
struct FbxNode {
  explicit FbxNode(const char* node_name) : name(node_name) {}

  std::string name;
  std::uint32_t count = 0;  // of properties
  Packer properties{std::endian::little};
  std::vector<FbxNode> children;

  FbxNode& Text(const std::string& value) {
    ++count;
    properties.Text("S")(static_cast<std::uint32_t>(value.size())).Text(value);
    return *this;
  }
  template <class T>
  FbxNode& Value(const char* type, T value) {
    ++count;
    properties.Text(type)(value);
    return *this;
  }
  template <class T>
  FbxNode& Array(const char* type, const std::vector<T>& values) {
    ++count;
    const auto size = static_cast<std::uint32_t>(values.size());
    properties.Text(type)(size, std::uint32_t{0}, static_cast<std::uint32_t>(size * sizeof(T)));
    for (const T& value : values) properties(value);
    return *this;
  }
  FbxNode& Child(const FbxNode& child) {
    children.push_back(child);
    return *this;
  }
  void AppendTo(Packer& file) const {
    Packer body(std::endian::little);
    body.out = file.out;  // for offsets, which count from the start of the file
    body(std::uint32_t{0}, count, static_cast<std::uint32_t>(properties.out.size()),
         static_cast<std::uint8_t>(name.size()))
        .Text(name)
        .Text({properties.out.begin(), properties.out.end()});
    for (const FbxNode& child : children) child.AppendTo(body);
    if (!children.empty()) body.Text("", 13);
    const auto end = static_cast<std::uint32_t>(body.out.size());
    std::memcpy(&body.out[file.out.size()], &end, sizeof(end));
    file.out = std::move(body.out);
  }
};

FbxNode Connection(std::int64_t child, std::int64_t parent) {
  return FbxNode{"C"}.Text("OO").Value("L", child).Value("L", parent);
}

std::string FbxName(const std::string& name, const std::string& kind) {
  return name + std::string("\0\1", 2) + kind;
}

FbxNode FbxGeometry() {
  std::vector<double> vertices;
  std::vector<std::int32_t> corners;
  for (const auto& corner : kCorners) vertices.insert(vertices.end(), corner.begin(), corner.end());
  for (const auto& [a, b, c] : kFaces) corners.insert(corners.end(), {a, b, ~c});
  const std::int32_t zero = 0;
  const FbxNode materials =
      FbxNode{"LayerElementMaterial"}
          .Value("I", zero)
          .Child(FbxNode{"MappingInformationType"}.Text("AllSame"))
          .Child(FbxNode{"ReferenceInformationType"}.Text("IndexToDirect"))
          .Child(FbxNode{"Materials"}.Array("i", std::vector<std::int32_t>{zero}));
  const FbxNode layer = FbxNode{"Layer"}.Value("I", zero).Child(
      FbxNode{"LayerElement"}
          .Child(FbxNode{"Type"}.Text("LayerElementMaterial"))
          .Child(FbxNode{"TypedIndex"}.Value("I", zero)));
  return FbxNode{"Geometry"}
      .Value("L", std::int64_t{1})
      .Text(FbxName("t", "Geometry"))
      .Text("Mesh")
      .Child(FbxNode{"Vertices"}.Array("d", vertices))
      .Child(FbxNode{"PolygonVertexIndex"}.Array("i", corners))
      .Child(materials)
      .Child(layer);
}

FbxNode FbxMaterial() {
  FbxNode color{"P"};
  color.Text("DiffuseColor").Text("Color").Text("").Text("A");
  for (const float x : kColor) color.Value("D", double{x});
  return FbxNode{"Material"}
      .Value("L", std::int64_t{3})
      .Text(FbxName("paint", "Material"))
      .Text("")
      .Child(FbxNode{"ShadingModel"}.Text("lambert"))
      .Child(FbxNode{"Properties70"}.Child(color));
}

Bytes BinaryFbx() {
  const FbxNode model = FbxNode{"Model"}
                            .Value("L", std::int64_t{2})
                            .Text(FbxName("t", "Model"))
                            .Text("Mesh")
                            .Child(FbxNode{"Version"}.Value("I", std::int32_t{232}));
  Packer file(std::endian::little);
  file.Text("Kaydara FBX Binary  ", 21).Text("\x1a", 2)(std::uint32_t{7400});
  FbxNode{"FBXHeaderExtension"}
      .Child(FbxNode{"FBXVersion"}.Value("I", std::int32_t{7400}))
      .AppendTo(file);
  FbxNode{"Objects"}.Child(FbxGeometry()).Child(model).Child(FbxMaterial()).AppendTo(file);
  FbxNode{"Connections"}
      .Child(Connection(2, 0))
      .Child(Connection(1, 2))
      .Child(Connection(3, 2))
      .AppendTo(file);
  return file.Text("", 13).out;
}

// Assimp's exporter writes black for every colour.
Bytes ThreeMf(const Path& scratch) {
  std::string vertices, triangles;
  const auto attribute = [](const char* name, auto value) {
    return " " + std::string(name) + "=\"" + std::to_string(value) + "\"";
  };
  for (const auto& [x, y, z] : kCorners)
    vertices += "<vertex" + attribute("x", x) + attribute("y", y) + attribute("z", z) + "/>";
  for (const auto& [a, b, c] : kFaces) {
    triangles += "<triangle" + attribute("v1", a) + attribute("v2", b) + attribute("v3", c) +
                 " pid=\"1\" p1=\"0\"/>";
  }
  const std::string head = "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n";
  const std::string model =
      head +
      "<model unit=\"millimeter\" "
      "xmlns=\"http://schemas.microsoft.com/3dmanufacturing/core/2015/02\"><resources>"
      "<basematerials id=\"1\"><base name=\"paint\" displaycolor=\"#CC3366FF\"/></basematerials>"
      "<object id=\"2\" type=\"model\"><mesh><vertices>" +
      vertices + "</vertices><triangles>" + triangles +
      "</triangles></mesh></object></resources><build><item objectid=\"2\"/></build></model>";
  const std::string relations =
      head +
      "<Relationships xmlns=\"http://schemas.openxmlformats.org/package/2006/relationships\">"
      "<Relationship Id=\"rel0\" Target=\"/3D/3dmodel.model\" "
      "Type=\"http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel\"/></Relationships>";
  EXPECT_TRUE(WriteZip(scratch / "3mf",
                       {{"_rels/.rels", ToBytes(relations)}, {"3D/3dmodel.model", ToBytes(model)}})
                  .ok());
  return ReadFile(scratch / "3mf").value();
}

}  // namespace

Bytes Md2Sample(const std::string& skin) {
  constexpr std::int32_t kHeader = 68, kSkin = 64, kFrame = 40 + 4 * 4;
  const std::int32_t skins = skin.empty() ? 0 : 1, uvs = kHeader + skins * kSkin,
                     triangles = uvs + 4 * 4, frames = triangles + 4 * 12;
  Packer file(std::endian::little);
  file.Text("IDP2", 4)(std::int32_t{8}, std::int32_t{4}, std::int32_t{2}, kFrame, skins);
  for (const std::int32_t count : {4, 4, 4, 0, 1}) file(count);
  file(kHeader, uvs, triangles, frames, frames, frames + kFrame);
  if (skins == 1) file.Text(skin, kSkin);
  for (std::int16_t i = 0; i < 4; ++i) file(i, static_cast<std::int16_t>(i / 2));
  for (const auto& [a, b, c] : kFaces) file(a, b, c, a, b, c);
  file(1.0f, 1.0f, 1.0f, 0.0f, 0.0f, 0.0f).Text("rest", 16);
  for (const auto& corner : kCorners) {
    for (const float x : corner) file(static_cast<std::uint8_t>(x));
    file(std::uint8_t{0});
  }
  return file.out;
}

std::vector<MeshSample> MakeMeshSamples(const Path& scratch) {
  return {{"text.stl", Export("stl", scratch)},
          {"binary.stl", Export("stlb", scratch)},
          {"a.3ds", Export("3ds", scratch)},
          {"a.dae", Export("collada", scratch)},
          {"text.fbx", Export("fbxa", scratch)},
          {"binary.fbx", BinaryFbx()},
          {"a.3mf", ThreeMf(scratch)},
          {"a.x", X()},
          {"a.x3d", Export("x3d", scratch)},
          {"a.ase", Ase()},
          {"a.lwo", Lwo()},
          {"a.ms3d", Ms3d()},
          {"a.md2", Md2Sample("")}};
}

}  // namespace tilegrad::io
