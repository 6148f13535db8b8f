// SPDX-License-Identifier: Apache-2.0
// What Collada, FBX and 3DS say about images that is not read: a warning that names it.
#include <gtest/gtest.h>

#include <bit>
#include <cstdint>

#include "base/error.h"
#include "io/archive.h"
#include "io/image_file.h"
#include "io/mesh_file.h"
#include "io/mesh_readers.h"
#include "support/temp_folder.h"

namespace tilegrad::io::assimp_warnings_test {

class AssimpWarningsTest : public TempFolderTest {
 protected:
  void SetUp() override { ASSERT_TRUE(SavePng(folder_ / "q.png", ImageU8(2, 2, 3, 77)).ok()); }

  std::vector<std::string> WarningsOf(const Path& path) {
    const auto loaded = Ok(LoadMesh(path));
    EXPECT_EQ(loaded->mesh.textures.size(), 1u);
    return loaded->warnings;
  }
};

// A textured triangle with two sets of uv.
std::string Collada(const std::string& sampler, const std::string& extra, int set) {
  const auto source = [](const char* id, int stride, const char* numbers) {
    std::string params;
    for (int k = 0; k < stride; ++k)
      params += fmt::format(R"(<param name="{}" type="float"/>)", (stride == 2 ? "ST" : "XYZ")[k]);
    return fmt::format(R"(<source id="{0}"><float_array id="{0}a" count="{1}">{2}</float_array>
<technique_common><accessor source="#{0}a" count="3" stride="{3}">{4}</accessor></technique_common>
</source>)",
                       id, 3 * stride, numbers, stride, params);
  };
  return fmt::format(R"(<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><up_axis>Y_UP</up_axis></asset>
<library_images><image id="i"><init_from>q.png</init_from></image></library_images>
<library_effects><effect id="e"><profile_COMMON>
<newparam sid="f"><surface type="2D"><init_from>i</init_from></surface></newparam>
<newparam sid="s"><sampler2D><source>f</source>{0}</sampler2D></newparam>
<technique sid="t"><lambert><diffuse><texture texture="s" texcoord="UVSET{2}">{1}</texture>
</diffuse></lambert></technique></profile_COMMON></effect></library_effects>
<library_materials><material id="m" name="paint"><instance_effect url="#e"/></material>
</library_materials><library_geometries><geometry id="g"><mesh>{3}
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
<triangles count="1" material="M"><input semantic="VERTEX" source="#v" offset="0"/>
<input semantic="TEXCOORD" source="#u" offset="0" set="0"/>
<input semantic="TEXCOORD" source="#w" offset="0" set="1"/><p>0 1 2</p></triangles>
</mesh></geometry></library_geometries><library_visual_scenes><visual_scene id="S">
<node id="n"><instance_geometry url="#g"><bind_material><technique_common>
<instance_material symbol="M" target="#m">
<bind_vertex_input semantic="UVSET{2}" input_semantic="TEXCOORD" input_set="{2}"/>
</instance_material></technique_common></bind_material></instance_geometry></node>
</visual_scene></library_visual_scenes><scene><instance_visual_scene url="#S"/></scene></COLLADA>)",
                     sampler, extra, set,
                     source("p", 3, "0 0 0 1 0 0 0 1 0") + source("u", 2, "0 0 1 0 0 1") +
                         source("w", 2, "0 0 2 0 0 2"));
}

void ExpectOne(const std::vector<std::string>& warnings, const std::string& part) {
  ExpectOnly(warnings, "\"paint\"");
  ExpectIn(warnings[0], part);
}

TEST_F(AssimpWarningsTest, ColladaSaysWhatIsNotRead) {
  const auto warnings = [&](const std::string& sampler, const std::string& maya, int set) {
    return WarningsOf(
        Write("a.dae",
              Collada(sampler,
                      "<extra><technique profile=\"MAYA\">" + maya + "</technique></extra>", set)));
  };
  EXPECT_TRUE(WarningsOf(Write("a.dae", Collada("", "", 0))).empty());
  EXPECT_TRUE(warnings("<wrap_s>WRAP</wrap_s>", "", 0).empty());
  ExpectOne(warnings("", "", 1), "uv set 1");
  ExpectOne(warnings("", "<repeatU>2</repeatU>", 0), "uv transform");
  ExpectOne(warnings("", "<wrapU>0</wrapU>", 0), "wrapping");
  ExpectOne(warnings("", "<mirrorV>1</mirrorV><offsetV>0.5</offsetV>", 1),
            "uv set 1; set 0 stands in, its wrapping (clamped, mirrored or once); it repeats, its "
            "uv transform");
}

// A chunk of a 3DS file.
std::string Chunk(std::uint16_t id, const std::string& body) {
  const auto size = static_cast<std::uint32_t>(6 + body.size());
  std::string head(6, '\0');
  for (int i = 0; i < 2; ++i) head[i] = static_cast<char>(id >> (8 * i));
  for (int i = 0; i < 4; ++i) head[2 + i] = static_cast<char>(size >> (8 * i));
  return head + body;
}

std::string Words(std::initializer_list<std::uint16_t> words) {
  std::string out;
  for (const std::uint16_t w : words)
    out += {static_cast<char>(w & 255), static_cast<char>(w >> 8)};
  return out;
}

std::string Floats(std::initializer_list<float> values) {
  std::string out;
  for (const float value : values) {
    const auto bits = std::bit_cast<std::uint32_t>(value);
    out += Words({static_cast<std::uint16_t>(bits), static_cast<std::uint16_t>(bits >> 16)});
  }
  return out;
}

std::string Name(const std::string& text) { return text + '\0'; }

// A textured triangle of 3DS; `map` has further chunks of its image.
std::string ThreeDs(const std::string& map) {
  const std::string material = Chunk(
      0xAFFF, Chunk(0xA000, Name("paint")) +
                  Chunk(0xA200, Chunk(0x0030, Words({100})) + Chunk(0xA300, Name("q.png")) + map));
  const std::string mesh =
      Chunk(0x4110, Words({3}) + Floats({0, 0, 0, 1, 0, 0, 0, 1, 0})) +
      Chunk(0x4140, Words({3}) + Floats({0, 0, 1, 0, 0, 1})) +
      Chunk(0x4120, Words({1, 0, 1, 2, 7}) + Chunk(0x4130, Name("paint") + Words({1, 0})));
  return Chunk(0x4D4D,
               Chunk(0x0002, Words({3, 0})) +
                   Chunk(0x3D3D, material + Chunk(0x4000, Name("t") + Chunk(0x4100, mesh))));
}

TEST_F(AssimpWarningsTest, ThreeDsSaysWhatIsNotRead) {
  EXPECT_TRUE(WarningsOf(Write("a.3ds", ThreeDs(""))).empty());
  EXPECT_TRUE(WarningsOf(Write("b.3ds", ThreeDs(Chunk(0xA351, Words({0}))))).empty());
  ExpectOne(WarningsOf(Write("c.3ds", ThreeDs(Chunk(0xA351, Words({0x10}))))), "wrapping");
  ExpectOne(WarningsOf(Write("d.3ds", ThreeDs(Chunk(0xA351, Words({2}))))), "wrapping");
  ExpectOne(WarningsOf(Write("e.3ds", ThreeDs(Chunk(0xA354, Floats({2}))))), "uv transform");
  ExpectOne(WarningsOf(Write("f.3ds", ThreeDs(Chunk(0xA358, Floats({.5f}))))), "uv transform");
  ExpectOne(WarningsOf(Write("g.3ds", ThreeDs(Chunk(0xA35C, Floats({30}))))), "uv transform");
}

std::string FbxUv(int set) {
  return fmt::format(
      "LayerElementUV: {0} {{\nVersion: 101\nName: \"set{0}\"\nMappingInformationType: "
      "\"ByPolygonVertex\"\nReferenceInformationType: \"Direct\"\nUV: *6 {{\na: "
      "0,0,1,0,0,1\n}}\n}}\n",
      set);
}

std::string FbxLayer(int set, const std::string& first) {
  return fmt::format(
      "Layer: {0} {{\nVersion: 100\n{1}LayerElement: {{\nType: \"LayerElementUV\"\nTypedIndex: "
      "{0}\n}}\n}}\n",
      set, first);
}

// A textured triangle of FBX with two sets of uv; `texture` has properties of its image, `more` and
// `links` further objects and what they belong to.
std::string Fbx(const std::string& texture, const std::string& more = "",
                const std::string& links = "") {
  return "; FBX 7.3.0 project file\nFBXHeaderExtension: {\nFBXHeaderVersion: 1003\nFBXVersion: "
         "7300\n}\nObjects: {\nGeometry: 1, \"Geometry::g\", \"Mesh\" {\nVertices: *9 {\na: "
         "0,0,0,1,0,0,0,1,0\n}\nPolygonVertexIndex: *3 {\na: 0,1,-3\n}\nLayerElementMaterial: 0 "
         "{\nVersion: 101\nName: \"\"\nMappingInformationType: \"AllSame\"\n"
         "ReferenceInformationType: \"IndexToDirect\"\nMaterials: *1 {\na: 0\n}\n}\n" +
         FbxUv(0) + FbxUv(1) +
         FbxLayer(0, "LayerElement: {\nType: \"LayerElementMaterial\"\nTypedIndex: 0\n}\n") +
         FbxLayer(1, "") +
         "}\nModel: 2, \"Model::t\", \"Mesh\" {\nVersion: 232\n}\nMaterial: 3, "
         "\"Material::paint\", \"\" {\nVersion: 102\n}\nTexture: 4, \"Texture::t\", \"\" {\nType: "
         "\"TextureVideoClip\"\nVersion: 202\nProperties70: {\n" +
         texture + "}\nFileName: \"q.png\"\nRelativeFilename: \"q.png\"\n}\n" + more +
         "}\nConnections: {\nC: \"OO\",2,0\nC: \"OO\",1,2\nC: \"OO\",3,2\nC: \"OP\",4,3, "
         "\"DiffuseColor\"\n" +
         links + "}\n";
}

TEST_F(AssimpWarningsTest, FbxSaysWhatIsNotRead) {
  const auto warnings = [&](const std::string& texture) {
    return WarningsOf(Write("a.fbx", Fbx(texture)));
  };
  EXPECT_TRUE(warnings("").empty());
  EXPECT_TRUE(warnings("P: \"UVSet\", \"KString\", \"\", \"\", \"set0\"\n").empty());
  EXPECT_TRUE(warnings("P: \"WrapModeU\", \"enum\", \"\", \"\",0\n").empty());
  ExpectOne(warnings("P: \"UVSet\", \"KString\", \"\", \"\", \"set1\"\n"), "uv set 1");
  ExpectOne(warnings("P: \"Translation\", \"Vector\", \"\", \"A\",0.5,0,0\n"), "uv transform");
  ExpectOne(warnings("P: \"Scaling\", \"Vector\", \"\", \"A\",2,2,1\n"), "uv transform");
  ExpectOne(warnings("P: \"Rotation\", \"Vector\", \"\", \"A\",0,0,30\n"), "uv transform");
  for (const char* axis : {"U", "V"}) {
    const auto wrapped =
        warnings(fmt::format("P: \"WrapMode{}\", \"enum\", \"\", \"\", 1\r\n", axis));
    ExpectOnly(wrapped, "wrapping");
  }
}

TEST_F(AssimpWarningsTest, ThreeMfSaysThatTrianglesArePainted) {
  const auto load = [&](const std::string& resources, const std::string& first,
                        const std::string& second) {
    const std::string model =
        "<model><resources>" + resources +
        "<object id=\"1\" pid=\"5\" pindex=\"0\"><mesh><vertices><vertex x=\"0\" y=\"0\" z=\"0\"/>"
        "<vertex x=\"1\" y=\"0\" z=\"0\"/><vertex x=\"0\" y=\"1\" z=\"0\"/></vertices><triangles>"
        "<triangle v1=\"0\" v2=\"1\" v3=\"2\"" +
        first + "/><triangle v1=\"2\" v2=\"1\" v3=\"0\"" + second +
        "/></triangles></mesh></object></resources><build><item objectid=\"1\"/></build></model>";
    const std::string relations =
        "<Relationships><Relationship Id=\"r\" Target=\"/3D/3dmodel.model\" "
        "Type=\"http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel\"/></Relationships>";
    EXPECT_TRUE(WriteZip(folder_ / "a.3mf", {{"_rels/.rels", {relations.begin(), relations.end()}},
                                             {"3D/3dmodel.model", {model.begin(), model.end()}}})
                    .ok());
    return Ok(LoadMesh(folder_ / "a.3mf"))->warnings;
  };
  const std::string materials =
      "<basematerials id=\"5\"><base name=\"a\" displaycolor=\"#FF0000\"/>"
      "<base name=\"b\" displaycolor=\"#00FF00\"/></basematerials>";
  const std::string red = " pid=\"5\" p1=\"0\"", green = " pid=\"5\" p1=\"1\"";
  const std::vector<std::string> said = {"colours of single triangles and colour groups left out"};
  EXPECT_TRUE(load(materials, "", "").empty());
  EXPECT_TRUE(load(materials, green, green).empty());
  EXPECT_EQ(load(materials, red, green), said);
  EXPECT_EQ(load(materials, "", green), said);
  EXPECT_EQ(load(materials, "", " paint_color=\"4\""), said);
  EXPECT_EQ(load("<m:colorgroup id=\"5\"><m:color color=\"#FF0000\"/></m:colorgroup>", "", ""),
            said);
}

// Materials of Stingray, Arnold and Maya have the image of their colour under another name.
TEST_F(AssimpWarningsTest, FbxImagesOfBaseColourAreRead) {
  for (const char* name : {"DiffuseColor", "Maya|baseColor", "Maya|TEX_color_map",
                           "3dsMax|Parameters|base_color_map", "3dsMax|main|base_color_map"}) {
    std::string file = Fbx("");
    file.replace(file.find("DiffuseColor"), 12, name);
    EXPECT_TRUE(WarningsOf(Write("a.fbx", file)).empty()) << name;  // and there is one texture
  }
}

TEST_F(AssimpWarningsTest, WhatElseOfAMaterialIsSeenIsSaid) {
  const auto linked = [&](const char* property) {
    return Fbx("", "", fmt::format("C: \"OP\",4,3, \"{}\"\n", property));
  };
  ExpectOne(WarningsOf(Write("a.fbx", linked("TransparentColor"))),
            "left out: its image of opacity");
  ExpectOne(WarningsOf(Write("b.fbx", linked("EmissiveColor"))), "left out: its emission");
  ExpectOne(WarningsOf(Write("c.fbx", linked("DisplacementColor"))), "left out: its displacement");
  std::string dae = Collada("", "", 0);
  dae.replace(dae.find("<lambert>"), 9, "<lambert><emission><color>0.5 0 0 1</color></emission>");
  ExpectOne(WarningsOf(Write("d.dae", dae)), "left out: its emission");
}

// A name in a URI, as Collada and X3D have it.
TEST_F(AssimpWarningsTest, NamesOfImagesAreDecoded) {
  for (const auto& [file, uri] : std::vector<std::pair<std::string, std::string>>{
           {"my q.png", "my%20q.png"}, {"a+b.png", "a+b.png"}, {"a+b.png", "a%2Bb.png"}}) {
    ASSERT_TRUE(SavePng(folder_ / file, ImageU8(2, 2, 3, 77)).ok());
    std::string dae = Collada("", "", 0);
    dae.replace(dae.find("q.png"), 5, uri);
    EXPECT_TRUE(WarningsOf(Write("a.dae", dae)).empty()) << uri;
  }
}

// The same property as binary files have it, whole, cut, and with a length beyond the end.
TEST_F(AssimpWarningsTest, FbxWrappingOfBinaryFiles) {
  const auto text = [](const std::string& t) {
    return std::string("S") + static_cast<char>(t.size()) + std::string(3, '\0') + t;
  };
  const std::string head = "Kaydara" + text("WrapModeU") + text("enum") + text("") + text("");
  const auto clamped = [](const std::string& bytes) {
    return HasClampedFbxTexture(
        {reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size()});
  };
  const std::string one = {'I', 1, 0, 0, 0}, none = {'I', 0, 0, 0, 0};
  EXPECT_TRUE(clamped(head + one));
  EXPECT_TRUE(clamped(head + none + head + one));
  EXPECT_FALSE(clamped(head + none));
  for (std::size_t size = 0; size < head.size() + one.size(); ++size)
    EXPECT_FALSE(clamped((head + one).substr(0, size))) << size;
  EXPECT_FALSE(clamped("WrapModeUS\xff\xff\xff\xff" + one));
}

// Skins and shapes move vertices in other programs.
TEST_F(AssimpWarningsTest, BonesAndMorphTargetsAreSaid) {
  const std::string shape =
      "Geometry: 5, \"Geometry::s\", \"Shape\" {\nVersion: 100\nIndexes: *1 {\na: 0\n}\nVertices: "
      "*3 {\na: 0,0,1\n}\nNormals: *3 {\na: 0,0,0\n}\n}\nDeformer: 6, \"Deformer::b\", "
      "\"BlendShape\" {\nVersion: 100\n}\nDeformer: 7, \"SubDeformer::c\", \"BlendShapeChannel\" "
      "{\nVersion: 100\nDeformPercent: 0\nFullWeights: *1 {\na: 100\n}\n}\n";
  const std::string unit = "*16 {\na: 1,0,0,0,0,1,0,0,0,0,1,0,0,0,0,1\n}\n";
  const std::string skin =
      "Model: 8, \"Model::bone\", \"LimbNode\" {\nVersion: 232\n}\nDeformer: 9, \"Deformer::s\", "
      "\"Skin\" {\nVersion: 101\n}\nDeformer: 10, \"SubDeformer::cl\", \"Cluster\" {\nVersion: "
      "100\nIndexes: *3 {\na: 0,1,2\n}\nWeights: *3 {\na: 1,1,1\n}\nTransform: " +
      unit + "TransformLink: " + unit + "}\n";
  for (const std::string& file :
       {Fbx("", shape, "C: \"OO\",6,1\nC: \"OO\",7,6\nC: \"OO\",5,7\n"),
        Fbx("", skin, "C: \"OO\",8,0\nC: \"OO\",9,1\nC: \"OO\",10,9\nC: \"OO\",8,10\n")}) {
    const auto warnings = WarningsOf(Write("a.fbx", file));
    ExpectOnly(warnings, "part \"g\": bones and morph targets are not read");
  }
}

}  // namespace tilegrad::io::assimp_warnings_test
