// SPDX-License-Identifier: Apache-2.0
// What Collada, FBX and 3DS say about images that is not read: a warning that names it.
#include <gtest/gtest.h>

#include "base/error.h"
#include "io/image_file.h"
#include "io/mesh_file.h"
#include "support/temp_folder.h"

namespace tilegrad::io {
namespace {

class AssimpWarningsTest : public TempFolderTest {
 protected:
  void SetUp() override { ASSERT_TRUE(SavePng(folder_ / "q.png", ImageU8(2, 2, 3, 77)).ok()); }

  std::vector<std::string> WarningsOf(const Path& path) {
    const auto loaded = LoadMesh(path);
    EXPECT_TRUE(loaded.ok()) << loaded.status().message();
    if (!loaded.ok()) return {};
    EXPECT_EQ(loaded->mesh.textures.size(), 1u);
    return loaded->warnings;
  }
};

// A textured triangle with two sets of uv.
std::string Collada(const std::string& sampler, const std::string& extra, int set) {
  const std::string floats =
      "<float_array id=\"{0}a\" count=\"{1}\">{2}</float_array>"
      "<technique_common><accessor source=\"#{0}a\" count=\"3\" stride=\"{3}\">{4}"
      "</accessor></technique_common>";
  const auto source = [&](const char* id, int stride, const char* numbers, const char* params) {
    return fmt::format("<source id=\"{}\">", id) +
           fmt::format(fmt::runtime(floats), id, 3 * stride, numbers, stride, params) + "</source>";
  };
  const std::string st = "<param name=\"S\" type=\"float\"/><param name=\"T\" type=\"float\"/>";
  const std::string xyz =
      "<param name=\"X\" type=\"float\"/><param name=\"Y\" type=\"float\"/>"
      "<param name=\"Z\" type=\"float\"/>";
  return "<?xml version=\"1.0\"?><COLLADA xmlns=\"http://www.collada.org/2005/11/COLLADASchema\" "
         "version=\"1.4.1\"><asset><up_axis>Y_UP</up_axis></asset>"
         "<library_images><image id=\"i\"><init_from>q.png</init_from></image></library_images>"
         "<library_effects><effect id=\"e\"><profile_COMMON>"
         "<newparam sid=\"f\"><surface type=\"2D\"><init_from>i</init_from></surface></newparam>"
         "<newparam sid=\"s\"><sampler2D><source>f</source>" +
         sampler +
         "</sampler2D></newparam><technique sid=\"t\"><lambert><diffuse>"
         "<texture texture=\"s\" texcoord=\"UVSET" +
         std::to_string(set) + "\">" + extra +
         "</texture></diffuse></lambert></technique></profile_COMMON></effect></library_effects>"
         "<library_materials><material id=\"m\" name=\"paint\"><instance_effect "
         "url=\"#e\"/></material>"
         "</library_materials><library_geometries><geometry id=\"g\"><mesh>" +
         source("p", 3, "0 0 0 1 0 0 0 1 0", xyz.c_str()) +
         source("u", 2, "0 0 1 0 0 1", st.c_str()) + source("w", 2, "0 0 2 0 0 2", st.c_str()) +
         "<vertices id=\"v\"><input semantic=\"POSITION\" source=\"#p\"/></vertices>"
         "<triangles count=\"1\" material=\"M\"><input semantic=\"VERTEX\" source=\"#v\" "
         "offset=\"0\"/>"
         "<input semantic=\"TEXCOORD\" source=\"#u\" offset=\"0\" set=\"0\"/>"
         "<input semantic=\"TEXCOORD\" source=\"#w\" offset=\"0\" set=\"1\"/><p>0 1 "
         "2</p></triangles>"
         "</mesh></geometry></library_geometries><library_visual_scenes><visual_scene id=\"S\">"
         "<node id=\"n\"><instance_geometry url=\"#g\"><bind_material><technique_common>"
         "<instance_material symbol=\"M\" target=\"#m\"><bind_vertex_input semantic=\"UVSET" +
         std::to_string(set) +
         "\" "
         "input_semantic=\"TEXCOORD\" input_set=\"" +
         std::to_string(set) +
         "\"/></instance_material></technique_common></bind_material></instance_geometry></node>"
         "</visual_scene></library_visual_scenes><scene><instance_visual_scene url=\"#S\"/></scene>"
         "</COLLADA>";
}

void ExpectOne(const std::vector<std::string>& warnings, const std::string& part) {
  ASSERT_EQ(warnings.size(), 1u);
  EXPECT_NE(warnings[0].find("\"paint\""), std::string::npos) << warnings[0];
  EXPECT_NE(warnings[0].find(part), std::string::npos) << warnings[0];
}

TEST_F(AssimpWarningsTest, ColladaSaysWhatIsNotRead) {
  EXPECT_TRUE(WarningsOf(Write("a.dae", Collada("", "", 0))).empty());
  EXPECT_TRUE(WarningsOf(Write("b.dae", Collada("<wrap_s>WRAP</wrap_s>", "", 0))).empty());
  ExpectOne(WarningsOf(Write("c.dae", Collada("", "", 1))), "uv set 1");
  const std::string maya = "<extra><technique profile=\"MAYA\">{}</technique></extra>";
  ExpectOne(WarningsOf(Write(
                "d.dae", Collada("", fmt::format(fmt::runtime(maya), "<repeatU>2</repeatU>"), 0))),
            "uv transform");
  ExpectOne(WarningsOf(Write("e.dae",
                             Collada("", fmt::format(fmt::runtime(maya), "<wrapU>0</wrapU>"), 0))),
            "wrapping");
  ExpectOne(
      WarningsOf(Write("f.dae", Collada("",
                                        fmt::format(fmt::runtime(maya),
                                                    "<mirrorV>1</mirrorV>"
                                                    "<offsetV>0.5</offsetV>"),
                                        1))),
      "uv set 1; set 0 stands in, its wrapping (clamped, mirrored or once); it repeats, its uv "
      "transform");
}

}  // namespace
}  // namespace tilegrad::io
