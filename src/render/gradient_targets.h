// SPDX-License-Identifier: Apache-2.0
// Where the gradients of a call go: arrays and records of the caller, which scenes of a batch may
// share whole. Everything that lists, checks, adds up or keeps them does so here.
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "base/aligned.h"
#include "render/scene_fields.h"
#include "tilegrad/status.h"

namespace tilegrad {

// T: float or double. Keeps its memory: the same sizes allocate nothing.
template <class T>
class GradientTargets {
 public:
  // A requested gradient array of a scene.
  struct Target {
    std::span<T> out;
    const char* name;  // d_scene.<name>
    std::size_t scene;
    std::optional<Varying> stream;       // the gradient of this stream,
    std::optional<std::size_t> texture;  // of this texture, or of the coefficients
    int width;                           // of the texture
    std::size_t order;                   // among all
    std::span<T> own = {};               // after SplitArrays
  };

  // Lists the requested arrays, until the next call. Errors: two arrays that overlap without being
  // the same array for the same gradient, since one would be overrun or hold a partial sum.
  Status Begin(std::span<const SceneT<T>> scenes, std::span<const SceneGradientsT<T>> wanted);

  // The requests of each scene, with zeroed records of camera, surfaces and lights in place of the
  // caller's.
  std::span<const SceneGradientsT<T>> scenes() const { return scenes_; }
  // The caller's arrays, each once, with what it holds the sum of: in the order of scenes.
  std::span<const std::span<const Target>> arrays() const { return arrays_; }

  // For a renderer that does not accumulate: gives each scene separate, zeroed arrays, and sums
  // them into the caller's.
  void SplitArrays();
  void JoinArrays() const;
  // Adds the scenes' own records to the caller's, which are cleared first unless told.
  void JoinRecords(bool add) const;

  // GradientMode::kAdd over a renderer that overwrites: keeps aside what the arrays hold; puts it
  // back; adds it. False, and it is put back, if a sum is not finite.
  void Save();
  void Restore() const;
  bool AddSaved() const;

  // Gradients that overflow are an error, not an Inf that spreads.
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

  std::span<const SceneGradientsT<T>> wanted_;
  std::vector<Target> targets_;  // in the order of their memory
  std::vector<std::span<const Target>> arrays_;
  std::vector<Records> records_;
  std::vector<SceneGradientsT<T>> scenes_;
  AlignedVector<T> values_;  // of SplitArrays
  AlignedVector<T> saved_;   // array after array
};

}  // namespace tilegrad
