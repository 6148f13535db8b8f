// SPDX-License-Identifier: Apache-2.0
// The destinations of a call's gradients: arrays and records of the caller, which scenes of a batch
// may share as a whole. Lists, checks, sums and saves them.
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "base/aligned.h"
#include "render/scene_fields.h"
#include "tilegrad/status.h"

namespace tilegrad {

// T: float or double. Reuses its memory: the same sizes allocate nothing.
template <class T>
class GradientTargets {
 public:
  // A requested gradient array of a scene.
  struct Target {
    std::span<T> out;
    const char* name;  // d_scene.<name>
    std::size_t scene;
    std::optional<Varying> stream;       // gradient of this stream,
    std::optional<std::size_t> texture;  // of this texture, or (neither) of the sh coefficients
    int width;                           // of the texture
    std::size_t order;                   // position among all requests
    std::span<T> own = {};               // after SplitArrays
  };

  // Lists the requested arrays; valid until the next call. Errors: two arrays that overlap without
  // being the same array for the same gradient, since one would be overwritten or hold a partial
  // sum.
  Status Begin(std::span<const SceneT<T>> scenes, std::span<const SceneGradientsT<T>> wanted);

  // The requests of each scene, with zeroed records of camera, surfaces and lights replacing the
  // caller's.
  std::span<const SceneGradientsT<T>> scenes() const { return scenes_; }
  // The caller's arrays, each once, with the targets that it sums, in scene order.
  std::span<const std::span<const Target>> arrays() const { return arrays_; }

  // For a renderer that does not accumulate: gives each scene separate, zeroed arrays; JoinArrays
  // sums them into the caller's.
  void SplitArrays();
  void JoinArrays() const;

  // GradientMode::kAdd on top of a renderer that overwrites: Save copies the caller's arrays and
  // records; Restore copies them back.
  void Save();
  void Restore() const;
  // Adds the per-scene records to the caller's. With `add` also what Save copied to the arrays;
  // else clears the caller's records first. An error if a sum is not finite.
  Status Join(bool add) const;

  // An error if a gradient overflows, rather than an Inf that spreads.
  Status CheckSums() const;

 private:
  // Of one scene.
  struct Records {
    CameraT<T> camera;
    std::vector<SurfaceT<T>> surfaces;
    std::vector<LightT<T>> lights;
    std::vector<std::span<T>> textures;  // after SplitArrays
  };

  void List(const SceneT<T>& scene, const SceneGradientsT<T>& wanted, std::size_t n);
  void TakeRecords(const SceneGradientsT<T>& wanted, std::size_t n);
  template <class Visit>
  void ForEachDestination(const Visit& visit) const;
  bool AddSaved() const;
  bool JoinRecords() const;

  std::span<const SceneGradientsT<T>> wanted_;
  std::vector<Target> targets_;  // sorted by address
  std::vector<std::span<const Target>> arrays_;
  std::vector<Records> records_;
  std::vector<SceneGradientsT<T>> scenes_;
  AlignedVector<T> values_;  // of SplitArrays
  AlignedVector<T> saved_;   // the caller's arrays and records, concatenated
};

}  // namespace tilegrad
