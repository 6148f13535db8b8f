// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "base/error.h"
#include "base/rng.h"
#include "base/text.h"
#include "cli/render_job.h"
#include "io/exr_file.h"
#include "io/image_file.h"
#include "io/npz.h"
#include "scene/image.h"

namespace tilegrad::cli {
namespace {

using Planes = std::vector<std::span<const float>>;

Planes PlanesOf(const std::vector<float>& values, std::size_t count) {
  Planes planes;
  const std::size_t size = values.size() / count;
  for (std::size_t c = 0; c < count; ++c)
    planes.push_back(std::span(values).subspan(c * size, size));
  return planes;
}

std::size_t PixelCount(const Picture& p) {
  return static_cast<std::size_t>(p.width) * static_cast<std::size_t>(p.height);
}

bool Wants(const FileSettings& settings, const std::string& output) {
  return std::find(settings.outputs.begin(), settings.outputs.end(), output) !=
         settings.outputs.end();
}

float Encoded(float value, ColorSpace space) {
  return space == ColorSpace::kLinear ? LinearToSrgb(value) : value;
}

// RGBA as people see it, [H,W,4]: sRGB, over the background if there is one.
std::vector<float> ShownColor(const Picture& picture, ColorSpace space,
                              const std::vector<float>& background) {
  const std::size_t pixels = PixelCount(picture);
  std::vector<float> out(4 * pixels);
  for (std::size_t p = 0; p < pixels; ++p) {
    const float alpha = picture.alpha[p];
    for (std::size_t c = 0; c < 3; ++c) {
      const float color = Encoded(picture.color[c * pixels + p], space);
      out[4 * p + c] = background.empty() ? color : background[c] + alpha * (color - background[c]);
    }
    out[4 * p + 3] = background.empty() ? alpha : 1;
  }
  return out;
}

// A distinct colour for each face; black at background pixels.
std::array<float, 3> FaceColor(std::int32_t id) {
  if (id < 0) return {0, 0, 0};
  const std::uint64_t bits = Mix64(static_cast<std::uint64_t>(id));
  std::array<float, 3> color;
  for (std::size_t c = 0; c < 3; ++c)
    color[c] = 0.2f + 0.8f * static_cast<float>(bits >> (8 * c) & 0xFF) / 255.0f;
  return color;
}

// Near is white, far is dark, nothing is black.
std::vector<float> ShownDepth(const std::vector<float>& depth) {
  float near = std::numeric_limits<float>::infinity(), far = 0;
  for (const float z : depth) {
    if (std::isfinite(z)) {
      near = std::min(near, z);
      far = std::max(far, z);
    }
  }
  std::vector<float> out;
  const float range = std::max(far - near, 1e-30f);
  for (const float z : depth) out.push_back(std::isfinite(z) ? 1 - 0.85f * (z - near) / range : 0);
  return out;
}

ImageU8 ToImage(std::span<const float> values, const Picture& picture, int channels) {
  ImageU8 image(picture.width, picture.height, channels);
  std::transform(values.begin(), values.end(), image.pixels.begin(), [](float v) {
    return static_cast<std::uint8_t>(std::clamp(v, 0.0f, 1.0f) * 255.0f + 0.5f);
  });
  return image;
}

// Planar to interleaved, each value through `shown`.
template <class Shown>
std::vector<float> Interleave(const Planes& planes, std::size_t channels, const Shown& shown) {
  std::vector<float> out(planes[0].size() * channels);
  for (std::size_t c = 0; c < planes.size(); ++c) {
    for (std::size_t p = 0; p < planes[c].size(); ++p) out[channels * p + c] = shown(planes[c][p]);
  }
  return out;
}

Path FileOf(const PictureName& name, const std::string& output) {
  const std::string suffix = output == "color" ? "" : "_" + output;
  return Path(name.stem.string() + suffix + name.ending);
}

struct Writer {
  const Picture& picture;
  ColorSpace space;
  const FileSettings& settings;
  const PictureName& name;

  Status Png(const std::string& output, std::span<const float> values, int channels) {
    return io::SavePng(FileOf(name, output), ToImage(values, picture, channels));
  }
  template <class T>
  Status Npy(const std::string& output, std::span<const T> values, std::size_t channels) {
    std::vector<std::size_t> shape = {static_cast<std::size_t>(picture.height),
                                      static_cast<std::size_t>(picture.width)};
    if (channels > 1) shape.push_back(channels);
    return WriteFileAtomic(FileOf(name, output), io::EncodeNpy(io::MakeNpy<T>(shape, values)));
  }

  Status Pngs() {
    const auto same = [](float v) { return v; };
    if (Wants(settings, "color"))
      TILEGRAD_TRY(Png("color", ShownColor(picture, space, settings.background), 4));
    if (Wants(settings, "alpha")) TILEGRAD_TRY(Png("alpha", picture.alpha, 1));
    if (Wants(settings, "depth")) TILEGRAD_TRY(Png("depth", ShownDepth(picture.depth), 1));
    if (Wants(settings, "normals")) {
      const auto shown =
          Interleave(PlanesOf(picture.normals, 3), 3, [](float n) { return 0.5f * n + 0.5f; });
      TILEGRAD_TRY(Png("normals", shown, 3));
    }
    if (Wants(settings, "uv"))
      TILEGRAD_TRY(Png("uv", Interleave(PlanesOf(picture.uv, 2), 3, same), 3));
    if (Wants(settings, "faces")) {
      std::vector<float> shown;
      for (const std::int32_t id : picture.face_ids) {
        const auto color = FaceColor(id);
        shown.insert(shown.end(), color.begin(), color.end());
      }
      TILEGRAD_TRY(Png("faces", shown, 3));
    }
    return {};
  }

  Status Npys() {
    const auto same = [](float v) { return v; };
    const auto floats = [&](const std::string& output, const std::vector<float>& values,
                            std::size_t channels) { return Npy<float>(output, values, channels); };
    if (Wants(settings, "color"))
      TILEGRAD_TRY(floats("color", ShownColor(picture, space, settings.background), 4));
    if (Wants(settings, "alpha")) TILEGRAD_TRY(floats("alpha", picture.alpha, 1));
    if (Wants(settings, "depth")) TILEGRAD_TRY(floats("depth", picture.depth, 1));
    if (Wants(settings, "normals"))
      TILEGRAD_TRY(floats("normals", Interleave(PlanesOf(picture.normals, 3), 3, same), 3));
    if (Wants(settings, "uv"))
      TILEGRAD_TRY(floats("uv", Interleave(PlanesOf(picture.uv, 2), 2, same), 2));
    if (Wants(settings, "faces")) TILEGRAD_TRY(Npy<std::int32_t>("faces", picture.face_ids, 1));
    return {};
  }

  Status Exr() {
    const std::size_t pixels = PixelCount(picture);
    std::vector<float> color = picture.color;
    for (std::size_t i = 0; i < color.size(); ++i) {
      const float linear = space == ColorSpace::kLinear ? color[i] : SrgbToLinear(color[i]);
      color[i] = linear * picture.alpha[i % pixels];
    }
    // Exact up to 2^24 faces: a float channel is what every reader takes.
    const std::vector<float> faces(picture.face_ids.begin(), picture.face_ids.end());
    io::ExrImage image{picture.width, picture.height, {}};
    const auto add = [&](const std::string& output, const std::vector<float>& values,
                         std::initializer_list<const char*> channels) {
      if (!Wants(settings, output)) return;
      const Planes planes = PlanesOf(values, channels.size());
      for (std::size_t c = 0; c < channels.size(); ++c)
        image.channels.push_back({channels.begin()[c], planes[c]});
    };
    add("color", color, {"R", "G", "B"});
    if (Wants(settings, "color") || Wants(settings, "alpha"))
      image.channels.push_back({"A", picture.alpha});
    add("depth", picture.depth, {"Z"});
    add("normals", picture.normals, {"normal.X", "normal.Y", "normal.Z"});
    add("uv", picture.uv, {"uv.U", "uv.V"});
    add("faces", faces, {"face.id"});
    return io::SaveExr(FileOf(name, "color"), image);
  }
};

}  // namespace

Status RequestOutputs(const FileSettings& settings, PictureRequest* request) {
  const std::array<bool*, kOutputNames.size()> wanted = {&request->color, &request->alpha,
                                                         &request->depth, &request->normals,
                                                         &request->uv,    &request->face_ids};
  for (std::size_t i = 0; i < wanted.size(); ++i)
    *wanted[i] = Wants(settings, std::string(kOutputNames[i]));
  for (const std::string& output : settings.outputs) {
    if (std::find(kOutputNames.begin(), kOutputNames.end(), output) == kOutputNames.end())
      return InvalidArgument("--outputs {}: not one of color, alpha, depth, normals, uv, faces",
                             output);
  }
  return {};
}

Result<PictureName> NamePicture(const FileSettings& settings, const std::string& name,
                                bool single) {
  const Path out(settings.out);
  std::string ending = LowerCase(out.extension().string());
  if (!ending.empty()) ending.erase(0, 1);
  // A folder pic.jpg with a PNG in it is not what anybody asks for.
  for (const char* other : {"jpg", "jpeg", "bmp", "gif", "tga", "tif", "tiff", "webp", "ppm"}) {
    if (ending != other) continue;
    return InvalidArgument("--out {}: images are written as .png, .exr or .npy", settings.out);
  }
  const bool is_file = ending == "png" || ending == "exr" || ending == "npy";
  if (is_file && !single) {
    return InvalidArgument("--out {}: there are several images; name a folder", settings.out);
  }
  if (is_file && !settings.format.empty() && settings.format != ending)
    return InvalidArgument("--out {} and --format {} disagree", settings.out, settings.format);
  const std::string format = is_file ? ending : settings.format.empty() ? "png" : settings.format;
  if (format == "exr" && !settings.background.empty()) {
    return InvalidArgument("--background: EXR files keep their alpha and have no background");
  }
  if (is_file) return PictureName{Path(out).replace_extension(), format, out.extension()};
  return PictureName{out / name, format, "." + format};
}

std::vector<Path> PictureFiles(const FileSettings& settings, const PictureName& name) {
  if (name.format == "exr") return {FileOf(name, "color")};
  std::vector<Path> files;
  for (const std::string& output : settings.outputs) {
    const Path file = FileOf(name, output);
    if (std::find(files.begin(), files.end(), file) == files.end()) files.push_back(file);
  }
  return files;
}

Status WritePicture(const Picture& picture, ColorSpace space, const FileSettings& settings,
                    const PictureName& name) {
  Writer writer{picture, space, settings, name};
  return name.format == "exr" ? writer.Exr() : name.format == "npy" ? writer.Npys() : writer.Pngs();
}

}  // namespace tilegrad::cli
