// SPDX-License-Identifier: Apache-2.0
#include "base/own_binary.h"

#include <dlfcn.h>
#include <link.h>

namespace tilegrad {

Path OwnBinary() {
  Dl_info info{};
  void* map = nullptr;
  const auto* const here = reinterpret_cast<const void*>(&OwnBinary);
  const bool known = ::dladdr1(here, &info, &map, RTLD_DL_LINKMAP) != 0;
  const char* const name = known ? static_cast<const link_map*>(map)->l_name : "";
  if (*name != '\0') return name;
  // The loader has no name for the program itself.
  std::error_code error;
  return std::filesystem::read_symlink("/proc/self/exe", error);
}

}  // namespace tilegrad
