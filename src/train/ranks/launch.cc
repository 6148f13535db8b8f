// SPDX-License-Identifier: Apache-2.0
#include "train/ranks/launch.h"

#include <dlfcn.h>

#include <algorithm>
#include <charconv>
#include <cstdlib>
#include <cstring>
#include <initializer_list>

#include "base/error.h"
#include "base/own_binary.h"
#include "base/parallel.h"
#include "train/ranks/plugin_folder.h"

namespace tilegrad::train {
namespace {

constexpr const char* kPlugin = "libtilegrad_mpi.so";

// The first of these variables that holds a number; 0 if none does.
int NumberFrom(std::initializer_list<const char*> names) {
  for (const char* name : names) {
    const char* text = std::getenv(name);
    int number = 0;
    if (text == nullptr) continue;
    const char* end = text + std::strlen(text);
    const auto [at, error] = std::from_chars(text, end, number);
    if (error == std::errc() && at == end && number > 0) return number;
  }
  return 0;
}

Result<Path> FindPlugin() {
  const Path folder_of_program = OwnBinary().parent_path();
  for (const Path& folder : {folder_of_program, folder_of_program / kPluginFolder}) {
    if (PathExists(folder / kPlugin)) return folder / kPlugin;
  }
  return NotFound(
      "started as one of {} processes, but this tilegrad was built without MPI: install "
      "libopenmpi-dev (or libmpich-dev), configure and build again, so that there is a {} beside "
      "the program; or start it without mpirun",
      LaunchedRanks(), kPlugin);
}

// "0-3,8-11": empty if it is not of that form.
Cores CoresIn(std::string_view list) {
  Cores out;
  const char *at = list.data(), *const end = at + list.size();
  while (at < end && *at != '\n') {
    int first = 0, last = 0;
    auto number = std::from_chars(at, end, first);
    if (number.ec != std::errc()) return {};
    last = first;
    if (number.ptr < end && *number.ptr == '-') {
      number = std::from_chars(number.ptr + 1, end, last);
      if (number.ec != std::errc()) return {};
    }
    if (first < 0 || last < first || last >= kMostCores) return {};
    for (int core = first; core <= last; ++core) out.push_back(core);
    at = number.ptr < end && *number.ptr == ',' ? number.ptr + 1 : number.ptr;
    if (at == number.ptr && at < end && *at != '\n') return {};
  }
  return out;
}

}  // namespace

int LaunchedRanks() {
  // Slurm sets its variable for every step, also where no MPI is meant.
  const int by_launcher = NumberFrom({"OMPI_COMM_WORLD_SIZE", "PMI_SIZE"});
  const int by_slurm = std::getenv("PMIX_RANK") ? NumberFrom({"SLURM_STEP_NUM_TASKS"}) : 0;
  return std::max({1, by_launcher, by_slurm});
}

Result<std::unique_ptr<Transport>> ConnectRanks() {
  TILEGRAD_ASSIGN(const Path plugin, FindPlugin());
  // Global: Open MPI loads its own plugins, which need its symbols.
  void* library = ::dlopen(plugin.c_str(), RTLD_NOW | RTLD_GLOBAL);
  void* connect = library ? ::dlsym(library, kConnectRanksName) : nullptr;
  if (connect == nullptr) return IoError("{}: {}", plugin.string(), ::dlerror());
  const char* error = "MPI did not start";
  Transport* ranks = reinterpret_cast<ConnectRanksFunction>(connect)(&error);
  if (ranks == nullptr) return InternalError("{}: {}", plugin.string(), error);
  return std::unique_ptr<Transport>(ranks);
}

int PlaceRank(int asked) {
  const int own = AvailableCores();
  const auto or_own = [&](int workers) { return asked > 0 ? asked : workers; };
  const int here = NumberFrom({"OMPI_COMM_WORLD_LOCAL_SIZE", "MPI_LOCALNRANKS"});
  const int local = NumberFrom({"OMPI_COMM_WORLD_LOCAL_RANK", "MPI_LOCALRANKID"});
  if (here < 2 || local >= here || own < MachineCores()) return or_own(own);
  const std::vector<Cores> nodes = NumaNodes();
  if (nodes.size() < 2) return or_own(std::max(1, own / here));
  const RankPlace place = PlaceOf(nodes, local, here);
  if (asked <= place.workers) KeepToCores(place.cores);
  return or_own(place.workers);
}

std::vector<Cores> NumaNodes(const Path& folder) {
  std::vector<Cores> nodes;
  for (int node = 0;; ++node) {
    const auto list = ReadText(folder / fmt::format("node{}", node) / "cpulist");
    if (!list.ok()) return nodes;
    Cores cores = CoresIn(*list);
    if (!cores.empty()) nodes.push_back(std::move(cores));  // a node may be memory alone
  }
}

RankPlace PlaceOf(std::span<const Cores> nodes, int local, int ranks) {
  const int count = static_cast<int>(nodes.size());
  const auto first_node = [&](int rank) { return rank * count / ranks; };
  const int first = first_node(local), end = std::max(first + 1, first_node(local + 1));
  RankPlace out;
  for (int node = first; node < end; ++node) {
    const Cores& cores = nodes[static_cast<std::size_t>(node)];
    out.cores.insert(out.cores.end(), cores.begin(), cores.end());
  }
  int sharing = 0;
  for (int rank = 0; rank < ranks; ++rank) sharing += first_node(rank) == first ? 1 : 0;
  out.workers = std::max(1, static_cast<int>(out.cores.size()) / sharing);
  return out;
}

}  // namespace tilegrad::train
