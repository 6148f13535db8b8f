// SPDX-License-Identifier: Apache-2.0
// Image files. Reads PNG (libdeflate, stb_image), JPEG, BMP, TGA (stb_image), WebP (libwebp),
// binary PGM and PPM, SGI; writes PNG.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "base/file.h"
#include "scene/image.h"

namespace tilegrad::io {

// Pixels; larger headers are refused before allocation.
inline constexpr int kMaxImageSide = 16384;

// The Exif orientation (Exif 2.32, 4.6.4, tag 274) of stored pixels: 1 to 8, from a JPEG's Exif
// segment, a PNG's eXIf or a WebP's EXIF chunk; 1, upright, if missing or invalid. `bytes` may be
// anything.
int OrientationOf(std::span<const std::uint8_t> bytes);

// Rotates and mirrors the image so that it is upright. `orientation` is 1 to 8.
ImageU8 Upright(ImageU8 image, int orientation);

// 1 to 4 channels as in the file (16-bit files become 8-bit, CMYK becomes RGB). Messages call the
// file `name`. DecodeImage, for images embedded in other files, reads no WebP and returns
// kCancelled once StopGuardedBy's flag is set.
Result<ImageU8> DecodeImage(std::span<const std::uint8_t> bytes, const std::string& name);
Result<ImageU8> LoadImage(const Path& path);

// The stored pixels, whose coordinates programs use that ignore the tag, and the orientation.
struct StoredImage {
  ImageU8 image;
  int orientation = 1;
};
Result<StoredImage> LoadStoredImage(const Path& path);

// 3 or 4 channels: grey becomes RGB, grey with alpha RGBA.
ImageU8 ToColor(ImageU8 image);

// 1 to 4 channels, 8 bits. SavePng is atomic.
Result<Bytes> EncodePng(const ImageU8& image);
Status SavePng(const Path& path, const ImageU8& image);

// Pictures found in a folder rather than named.

// By file name extension; sorted.
struct PictureNames {
  std::vector<Path> read;    // PNG, JPEG and WebP
  std::vector<Path> others;  // unsupported formats of cameras and programs

  // "2 pictures not in PNG, JPEG or WebP: a.heic, b.tif"; empty if there are none.
  std::string DescribeOthers() const;
};

// Empty if the folder does not exist. Hidden files do not count.
PictureNames PicturesIn(const Path& folder);

}  // namespace tilegrad::io
