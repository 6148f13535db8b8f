// SPDX-License-Identifier: Apache-2.0
// What predict draws of its meshes.
#pragma once

#include <cstdint>
#include <span>

#include "base/file.h"
#include "base/parallel.h"
#include "base/progress.h"
#include "fit/refine.h"
#include "scene/mesh.h"
#include "tilegrad/status.h"

namespace tilegrad::cli {

// Eight views around the mesh in one PNG, from where cameras of datasets stand.
Status DrawTurntable(const Mesh& mesh, const Path& file, const Workers& workers);
// The mesh turning once around in 36 frames, as an animated WebP that loops.
Status AnimateTurntable(const Mesh& mesh, const Path& file, const Workers& workers,
                        const Watch& watch);

// What the picture, planar RGBA of kRefineSize, shows; the network's mesh and the refined one, from
// where it was taken.
Status DrawMatch(std::span<const std::uint8_t> picture, const Mesh& prediction,
                 const train::RefinedMesh& refined, const Path& file, const Workers& workers);

}  // namespace tilegrad::cli
