// SPDX-License-Identifier: Apache-2.0
#include "cli/match_file.h"

#include <nlohmann/json.hpp>

namespace tilegrad::cli {
namespace {

nlohmann::ordered_json CameraRecord(const Camera& camera) {
  return {{"size", train::kRefineSize},
          {"rotation", camera.rotation},
          {"translation", camera.translation},
          {"fx", camera.fx},
          {"fy", camera.fy},
          {"cx", camera.cx},
          {"cy", camera.cy}};
}

}  // namespace

nlohmann::ordered_json ScoresOf(const train::RefinedMesh& refined) {
  const train::PictureMatch &before = refined.before, &after = refined.after;
  return {{"silhouette_iou", {before.silhouette_iou, after.silhouette_iou}},
          {"color_l1", {before.color_l1, after.color_l1}},
          {"camera_doubtful", refined.rival < train::kDoubtfulRival}};
}

Status WriteMatch(const train::RefinedMesh& refined, const Path& file) {
  nlohmann::ordered_json record = ScoresOf(refined);
  record["camera"] = CameraRecord(refined.camera);
  return WriteTextAtomic(file, record.dump(1) + "\n");
}

}  // namespace tilegrad::cli
