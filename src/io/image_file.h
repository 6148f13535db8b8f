// SPDX-License-Identifier: Apache-2.0
// Image files: PNG, JPEG, BMP, TGA by stb_image, WebP by libwebp, binary PGM and PPM and SGI in;
// PNG out.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "base/file.h"
#include "scene/image.h"

namespace tilegrad::io {

// Pixels; a larger header is refused before any memory is taken.
inline constexpr int kMaxImageSide = 16384;

// How to turn an image upright: cameras store the sensor's rows and say it in a tag (Exif 2.32,
// 4.6.4, tag 274). 1 to 8, of a JPEG's Exif segment, a PNG's eXIf or a WebP's EXIF chunk; 1,
// upright, where there is none or it makes no sense. `bytes` may be anything.
int OrientationOf(std::span<const std::uint8_t> bytes);

// The image turned and mirrored so that it is upright. `orientation` is 1 to 8.
ImageU8 Upright(ImageU8 image, int orientation);

// 1 to 4 channels as in the file (16-bit files are reduced to 8; CMYK becomes RGB). `name` stands
// in error messages. DecodeImage, of what other files hold, reads no WebP, and is kCancelled where
// they are not to be read on (StopGuardedBy).
Result<ImageU8> DecodeImage(std::span<const std::uint8_t> bytes, const std::string& name);
Result<ImageU8> LoadImage(const Path& path);

// As its file stores it, in which programs count pixels that ignore the tag, and how to turn it.
struct StoredImage {
  ImageU8 image;
  int orientation = 1;
};
Result<StoredImage> LoadStoredImage(const Path& path);

// 3 or 4 channels: grey becomes RGB, grey with alpha RGBA.
ImageU8 ToColor(ImageU8 image);

// 1 to 4 channels, 8 bits. SavePng appears whole or not at all.
Result<Bytes> EncodePng(const ImageU8& image);
Status SavePng(const Path& path, const ImageU8& image);

// Pictures that are looked for in a folder, rather than named.

// By the endings of their names; sorted.
struct PictureNames {
  std::vector<Path> read;    // PNG, JPEG and WebP
  std::vector<Path> others;  // formats that cameras and programs write, and that are not read

  // "2 pictures not in PNG, JPEG or WebP: a.heic, b.tif"; empty where there are none.
  std::string DescribeOthers() const;
};

// Empty if there is no such folder.
PictureNames PicturesIn(const Path& folder);

}  // namespace tilegrad::io
