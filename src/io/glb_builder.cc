// SPDX-License-Identifier: Apache-2.0
#include "io/glb_builder.h"

namespace tilegrad::io {
namespace {

using Json = GlbBuilder::Json;

void AppendChunk(Bytes& out, const char type[5], const std::uint8_t* data, std::size_t size,
                 std::uint8_t padding) {
  const auto padded = static_cast<std::uint32_t>((size + 3) / 4 * 4);
  const auto* length = reinterpret_cast<const std::uint8_t*>(&padded);
  out.insert(out.end(), length, length + 4);
  out.insert(out.end(), type, type + 4);
  out.insert(out.end(), data, data + size);
  out.resize(out.size() + padded - size, padding);
}

}  // namespace

Result<Bytes> AssembleGlb(GlbBuilder& glb) {
  glb.json["buffers"] = Json::array({{{"byteLength", glb.binary.size()}}});
  // Names come from files and may not be UTF-8: replace what is not.
  const std::string text = glb.json.dump(-1, ' ', false, Json::error_handler_t::replace);
  const std::size_t total =
      12 + 8 + (text.size() + 3) / 4 * 4 + 8 + (glb.binary.size() + 3) / 4 * 4;
  if (total > 0xFFFFFFFFu)
    return ResourceExhausted("a GLB file holds at most 4 GiB, this mesh needs {}", total);
  Bytes out = {'g', 'l', 'T', 'F', 2, 0, 0, 0};
  out.reserve(total);
  const auto total32 = static_cast<std::uint32_t>(total);
  const auto* length = reinterpret_cast<const std::uint8_t*>(&total32);
  out.insert(out.end(), length, length + 4);
  AppendChunk(out, "JSON", reinterpret_cast<const std::uint8_t*>(text.data()), text.size(), ' ');
  AppendChunk(out, "BIN\0", glb.binary.data(), glb.binary.size(), 0);
  return out;
}

}  // namespace tilegrad::io
