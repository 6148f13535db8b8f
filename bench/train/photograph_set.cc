// SPDX-License-Identifier: Apache-2.0
// Photographs of section 5.4 that anyone can make, in the layout of PASCAL3D+
// (src/train/data/photographs/rendered_set.h):
//
//   photograph_set datasets/cars /usr/share/backgrounds photographs [train] [test] [exact]
//
// `datasets/cars`: of tilegrad dataset --source cars, whose training and test models are taken.
// Backgrounds: every .jpg below the folder. `exact`: training cameras are, too.
#include <fmt/core.h>

#include <algorithm>
#include <cstdlib>
#include <string_view>

#include "base/error.h"
#include "train/data/photographs/rendered_set.h"

namespace tilegrad::train {
namespace {

std::vector<Path> PhotographsBelow(const Path& folder) {
  std::vector<Path> out;
  std::error_code error;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder, error)) {
    if (entry.is_regular_file() && entry.path().extension() == ".jpg") out.push_back(entry.path());
  }
  std::sort(out.begin(), out.end());
  return out;
}

Status Run(int argc, char** argv) {
  if (argc < 4)
    return InvalidArgument("photograph_set DATASET BACKGROUNDS OUT [TRAIN] [TEST] [exact]");
  const Workers workers(0);
  TILEGRAD_ASSIGN(const Dataset dataset, Dataset::Open(argv[1]));
  const auto open = [&](Split split) {
    return OpenTexturedMeshes(dataset, dataset.Select(split), {}, workers, {});
  };
  TILEGRAD_ASSIGN(const MeshCache train, open(Split::kTrain));
  TILEGRAD_ASSIGN(const MeshCache test, open(Split::kTest));
  RenderedSetJob job{train, test, PhotographsBelow(argv[2])};
  if (argc > 4) job.train_count = std::atoi(argv[4]);
  if (argc > 5) job.test_count = std::atoi(argv[5]);
  fmt::print("{} training and {} test models, {} backgrounds\n", job.train.size(), job.test.size(),
             job.backgrounds.size());
  AnnotationNoise noise;
  if (argc > 6 && argv[6] != std::string_view("exact"))
    return InvalidArgument("{}: the last argument is \"exact\" or nothing", argv[6]);
  noise.exact_cameras = argc > 6;
  return MakeRenderedSet(job, noise, argv[3], workers, {});
}

}  // namespace
}  // namespace tilegrad::train

int main(int argc, char** argv) {
  const tilegrad::Status status = tilegrad::train::Run(argc, argv);
  if (!status.ok()) fmt::print(stderr, "photograph_set: {}\n", status.message());
  return status.ok() ? 0 : 1;
}
