// SPDX-License-Identifier: Apache-2.0
#include "fit/colmap_run.h"

#include <fcntl.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <cstring>
#include <sstream>
#include <thread>

#include "base/error.h"
#include "base/text.h"
#include "io/camera_file.h"
#include "io/image_file.h"

namespace tilegrad::train {
namespace {

constexpr std::size_t kLeastPictures = 3;
constexpr const char* kProgram = "colmap";

struct Pictures {
  Path folder;
  std::vector<std::string> names;
};

Pictures PicturesOf(const Path& folder) {
  for (const Path& place : {folder / "images", folder}) {
    Pictures out{place, {}};
    for (const Path& name : io::PicturesIn(place).read) out.names.push_back(name.string());
    if (!out.names.empty()) return out;
  }
  return {};
}

bool IsOnPath(const char* program) {
  const char* path = std::getenv("PATH");
  std::istringstream folders(path == nullptr ? "" : path);
  for (std::string folder; std::getline(folders, folder, ':');)
    if (::access((Path(folder) / program).c_str(), X_OK) == 0) return true;
  return false;
}

using Command = std::vector<std::string>;

// Those of the documentation, with a list of pictures: masks may lie beside them.
std::vector<Command> CommandsFor(const Path& work, const Path& images) {
  const std::string database = (work / "database.db").string();
  return {
      {kProgram, "feature_extractor", "--database_path", database, "--image_path", images.string(),
       "--image_list_path", (work / "pictures.txt").string(), "--ImageReader.single_camera", "1",
       "--ImageReader.camera_model", "SIMPLE_RADIAL", "--SiftExtraction.use_gpu", "0"},
      {kProgram, "exhaustive_matcher", "--database_path", database, "--SiftMatching.use_gpu", "0"},
      {kProgram, "mapper", "--database_path", database, "--image_path", images.string(),
       "--output_path", (work / "sparse").string()}};
}

// As a shell reads it.
std::string TextOf(const Command& command) {
  std::string out;
  for (const std::string& word : command) out += (out.empty() ? "" : " ") + ShellWord(word);
  return out;
}

// Null-terminated pointers to the strings.
std::vector<char*> PointersTo(std::vector<std::string>* words) {
  std::vector<char*> out;
  for (std::string& word : *words) out.push_back(word.data());
  out.push_back(nullptr);
  return out;
}

// That of this process; COLMAP wants a screen otherwise.
std::vector<std::string> Environment() {
  std::vector<std::string> out = {"QT_QPA_PLATFORM=offscreen"};
  for (char** at = environ; *at != nullptr; ++at) out.emplace_back(*at);
  return out;
}

Result<pid_t> Start(Command command, const Path& log) {
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, 1, log.c_str(), O_WRONLY | O_CREAT | O_APPEND, 0644);
  posix_spawn_file_actions_adddup2(&actions, 1, 2);
  std::vector<std::string> environment = Environment();
  pid_t child = 0;
  const int failed = ::posix_spawnp(&child, kProgram, &actions, nullptr,
                                    PointersTo(&command).data(), PointersTo(&environment).data());
  posix_spawn_file_actions_destroy(&actions);
  if (failed != 0) return IoError("{}: cannot be started: {}", kProgram, std::strerror(failed));
  return child;
}

// Its exit status; ends it where the work is to end.
Result<int> WaitFor(pid_t child, const Progress& now, const Watch& watch) {
  constexpr auto kPause = std::chrono::milliseconds(50);
  int status = 0;
  while (::waitpid(child, &status, WNOHANG) == 0) {
    const Status going = watch.At(now);
    if (!going.ok()) {
      ::kill(child, SIGTERM);
      ::waitpid(child, &status, 0);
      return going;
    }
    std::this_thread::sleep_for(kPause);
  }
  return status;
}

Result<ColmapOutcome> OutcomeOf(const Path& folder, const std::vector<std::string>& names) {
  ColmapOutcome out;
  out.missing = names;
  const auto model = io::FindColmapModel(folder);
  if (!model) return out;
  TILEGRAD_ASSIGN(const auto views, io::LoadColmapCameras(model->folder, {.bent = true}));
  for (const io::CameraView& view : views) {
    std::erase(out.missing, view.name);
    out.placed.push_back(view.name);
  }
  out.error = io::ColmapPointError(model->folder);
  return out;
}

Status SetAside(const Path& sparse) {
  std::error_code error;
  std::filesystem::rename(sparse, sparse.string() + "_partial", error);
  if (!error) return {};
  return IoError("{}: cannot be renamed: {}", sparse.string(), error.message());
}

}  // namespace

bool MayRunColmap(const Path& folder) {
  for (const char* name : {"transforms.json", "transforms_train.json", "colmap"})
    if (PathExists(folder / name)) return false;
  return !io::FindColmapModel(folder) && PicturesOf(folder).names.size() >= kLeastPictures &&
         IsOnPath(kProgram);
}

Result<ColmapOutcome> RunColmap(const Path& folder, const WarningSink& tell, const Watch& watch) {
  const Path work = folder / "colmap";
  const Pictures pictures = PicturesOf(folder);
  TILEGRAD_TRY(MakeFolder(work / "sparse"));
  TILEGRAD_TRY(WriteTextAtomic(folder / kColmapPictures,
                               fmt::format("{}\n", fmt::join(pictures.names, "\n"))));
  const std::vector<Command> commands = CommandsFor(work, pictures.folder);
  for (std::size_t i = 0; i < commands.size(); ++i) {
    if (tell) tell(TextOf(commands[i]));
    TILEGRAD_ASSIGN(const pid_t child, Start(commands[i], work / "log.txt"));
    const Progress now = {"finding cameras by COLMAP", i, commands.size(), commands[i][1]};
    TILEGRAD_ASSIGN(const int status, WaitFor(child, now, watch));
    if (status == 0) continue;
    return IoError("colmap {} failed; see {}", commands[i][1], (work / "log.txt").string());
  }
  TILEGRAD_ASSIGN(ColmapOutcome outcome, OutcomeOf(folder, pictures.names));
  if (!outcome.useful()) TILEGRAD_TRY(SetAside(work / "sparse"));
  return outcome;
}

}  // namespace tilegrad::train
