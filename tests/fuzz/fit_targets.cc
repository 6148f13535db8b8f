// SPDX-License-Identifier: Apache-2.0
// tilegrad fit, of any cameras and masks: three steps, or an error that says why not.
#include <cmath>

#include "fit/poses/start_cameras.h"
#include "fuzz/numbers.h"
#include "fuzz/target.h"
#include "io/mesh_file.h"

namespace tilegrad::fuzz::fit_targets {

using train::FitInput;
using train::FitJob;

// In [-1, 1].
float Unit(Numbers* n) { return static_cast<float>(n->Take<std::int16_t>()) / 32767; }

// Of any size that floats have.
float AnySize(Numbers* n) {
  return Unit(n) * std::pow(10.0f, static_cast<float>(n->Below(78)) - 40);
}

void TurnAnyWay(Numbers* n, Camera* camera) {
  ColmapCamera pose;
  for (double& q : pose.quaternion) q = static_cast<double>(Unit(n));
  pose.quaternion[0] += 1e-3;
  const auto turned = FromColmap(pose);
  if (!turned.ok()) return;
  for (int i = 0; i < 9; ++i) camera->rotation[i] = static_cast<float>(turned->rotation[i]);
}

// Mostly such as look at the origin, so that fits begin at all; each other kind is wrong in its
// way.
Camera AnyCamera(const Camera& before, int size, Numbers* n) {
  const double azimuth = 180 * static_cast<double>(Unit(n)),
               elevation = 80 * static_cast<double>(Unit(n));
  Camera camera =
      OrbitCamera({50, size, size}, azimuth, elevation, 1.5 + static_cast<double>(Unit(n)));
  switch (n->Below(12)) {
    case 0:
      TurnAnyWay(n, &camera);
      break;
    case 1:
      for (float& t : camera.translation) t = AnySize(n);
      break;
    case 2:
      camera.fx = AnySize(n);
      camera.fy = n->Below(2) == 0 ? camera.fx : AnySize(n);
      break;
    case 3:
      camera.cx = AnySize(n);
      break;
    case 4:
      camera.near_plane = std::abs(AnySize(n));
      break;
    case 5:
      for (float& r : camera.rotation) r = n->Take<float>();
      break;
    case 6:
      return before;
    case 7:  // on a rail
      camera = before;
      camera.translation[0] += Unit(n);
      break;
    default:
      break;
  }
  return camera;
}

float AnyAlpha(std::uint32_t kind, double x, double y, Numbers* n) {
  switch (kind) {
    case 0:
      return 0;
    case 1:
      return 1;
    case 2:
      return static_cast<float>(n->Take<std::uint8_t>()) / 255;
    default:
      return std::hypot(x, y) < 0.5 ? 1.0f : 0.0f;
  }
}

void AddView(Numbers* n, FitInput* input) {
  train::TargetImages& all = input->images;
  const Camera before = input->cameras.empty() ? Camera() : input->cameras.back();
  input->names.push_back("view " + std::to_string(input->names.size()));
  input->cameras.push_back(AnyCamera(before, std::max(all.width, all.height), n));
  const std::uint32_t kind = n->Below(10);
  for (int y = 0; y < all.height; ++y) {
    for (int x = 0; x < all.width; ++x) {
      all.alpha.push_back(
          AnyAlpha(kind, 2 * (x + 0.5) / all.width - 1, 2 * (y + 0.5) / all.height - 1, n));
      for (int c = 0; c < 3; ++c) all.color.push_back(0.5f);
    }
  }
}

FitJob AnyJob(Numbers* n) {
  FitJob job;
  job.input.images.width = 1 + static_cast<int>(n->Below(24));
  job.input.images.height =
      n->Below(3) == 0 ? 1 + static_cast<int>(n->Below(24)) : job.input.images.width;
  for (std::uint32_t views = 1 + n->Below(7); views-- > 0;) AddView(n, &job.input);
  job.config.steps = 3;
  job.config.timelapse = 0;
  job.config.template_level = 1;
  job.config.texture_size = 16 << n->Below(3);
  job.config.start = static_cast<train::StartShape>(n->Below(3));
  job.config.mask_tolerance = n->Below(2) == 0 ? 0 : 0.3;
  job.config.levels = static_cast<int>(n->Below(4));
  job.config.vertex_colors = n->Below(4) == 0;
  if (n->Below(8) == 0) job.config.perturb_cameras = 10;
  job.out = ScratchFolder() / "fit";
  return job;
}

Status Run(FitJob* job, const train::InputOptions& options) {
  static const Workers two(2);
  static const StopFlag stop = false;
  TILEGRAD_TRY(train::FinishInput(options, &job->input));
  TILEGRAD_TRY(train::StartCameras({}, job, two, {}, stop));
  return train::RunFit(*job, two, {}, stop).status();
}

void CheckMesh(const Path& file) {
  const auto mesh = io::LoadMesh(file);
  Require(mesh.ok(), "the mesh can be read");
  for (const glm::vec3& p : mesh->mesh.positions)
    for (int i = 0; i < 3; ++i) Require(std::isfinite(p[i]), "the mesh is finite");
}

void Fit(Input input) {
  Numbers n(input);
  FitJob job = AnyJob(&n);
  train::InputOptions options;
  options.hold_out = static_cast<int>(n.Below(4));
  const Status status = Run(&job, options);
  Require(status.ok() || status.message().size() > 20, "an error says why");
  Require(status.code() != StatusCode::kInternal, "and is not ours");
  if (status.ok()) CheckMesh(job.out / "mesh.glb");
  std::filesystem::remove_all(job.out);
}

const Registration kTarget({"fit", Fit, RandomSeeds<12, 4000>, nullptr, 2});

}  // namespace tilegrad::fuzz::fit_targets
