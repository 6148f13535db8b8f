// SPDX-License-Identifier: Apache-2.0
// Internal to cli: the command line of `tilegrad render`, and its parts: cameras, files.
#pragma once

#include <array>
#include <string>
#include <string_view>
#include <vector>

#include "io/camera_file.h"
#include "io/mesh_file.h"
#include "render/picture/picture.h"
#include "scene/mesh.h"

namespace tilegrad::cli {

struct ViewSettings {
  std::string size;         // "W" or "WxH"; empty: from the cameras, else 512
  std::string camera_file;  // COLMAP folder, transforms.json, OpenCV's numbers
  std::string gltf_camera;  // name, index or "all"
  std::string opencv_centre = "integer";
  std::vector<double> eye, target = {0, 0, 0};
  std::string up = "y";  // an axis of the mesh, or with `eye` "X,Y,Z"
  double fov = 40, azimuth = 60, elevation = 20, distance = 0, margin = 0.05;
  int turntable = 0;  // views around; 0: none
};

// The camera after the world is moved by `by`.
Camera64 MovedCamera(Camera64 camera, const glm::dvec3& by);

// Cameras of a mesh, as it is loaded (LoadedMesh::origin), in the order of their pictures; names
// serve for files, empty for a single view. Errors name the option or the file.
Result<std::vector<io::CameraView>> ChooseViews(const ViewSettings& settings,
                                                const io::LoadedMesh& mesh);

// The axis that --up names.
Result<UpAxis> UpAxisOf(const ViewSettings& settings);

inline constexpr std::array<std::string_view, 6> kOutputNames = {"color",   "alpha", "depth",
                                                                 "normals", "uv",    "faces"};

struct FileSettings {
  std::string out;     // a file for one picture, a folder for several; empty: this folder
  std::string format;  // png, exr, npy; empty: the ending of `out`, else png
  std::vector<std::string> outputs = {"color"};
  std::vector<float> background;  // RGB 0..1 sRGB; empty: transparent
  bool force = false;             // base/output_guard.h
};

// Fails for an unknown output or format. Sets what the outputs need.
Status RequestOutputs(const FileSettings& settings, PictureRequest* request);

// The path of a picture without ending: `out` itself for a single picture, else NAME in the folder.
struct PictureName {
  Path stem;
  std::string format;  // png, exr, npy
  std::string ending;  // of its files: ".png", or as `out` has it, ".PNG"
};
Result<PictureName> NamePicture(const FileSettings& settings, const std::string& name, bool single);

// The files that WritePicture will write.
std::vector<Path> PictureFiles(const FileSettings& settings, const PictureName& name);

// Writes the files of a picture. PNG: straight alpha, sRGB. NPY: the same
// numbers as floats, [H,W,4]. EXR: linear, colour times alpha, all outputs as layers of one file.
Status WritePicture(const Picture& picture, ColorSpace space, const FileSettings& settings,
                    const PictureName& name);

}  // namespace tilegrad::cli
