// SPDX-License-Identifier: Apache-2.0
#include "compat/nvdiffrast/antialias.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <optional>

#include "base/error.h"
#include "base/scalar.h"
#include "compat/nvdiffrast/face_steps.h"
#include "compat/nvdiffrast/face_steps_ref.h"

namespace tilegrad::compat::nvdiffrast {
namespace {

// The crossing of an edge with the segment between the centres of adjacent pixels, and its adjoint.
// S: double, std::complex<double>.
//
// In homogeneous pixel coordinates relative to the first centre, with q along the segment, r across
// it: the edge from i to j meets r = 0 at
//
//     t = q / w = (q_i r_j - q_j r_i) / (w_i r_j - w_j r_i)

// The segment: from the centre of a pixel, one pixel along axis 0 (x) or 1 (y), in either
// direction.
struct PixelStep {
  PixelCentre from;
  int axis;
  int direction;    // 1 or -1
  double scale[2];  // pixels per unit of normalised device coordinates, along x and y
};

// A vertex in the coordinates of the segment.
template <class S>
struct WayPoint {
  S q, r, w;
};

template <class S>
WayPoint<S> PointOnWay(const PixelStep& step, const S* p) {
  const S from_centre[2] = {(p[0] - step.from.x * p[3]) * step.scale[0],
                            (p[1] - step.from.y * p[3]) * step.scale[1]};
  return {from_centre[step.axis] * static_cast<double>(step.direction), from_centre[1 - step.axis],
          p[3]};
}

// Whether the edge crosses the segment before its end, in front of the eye, at an angle that this
// axis handles (exactly 45 degrees belong to x).
template <class S>
bool CrossesWay(const PixelStep& step, const WayPoint<S>& i, const WayPoint<S>& j, S* t) {
  if ((RealPart(i.r) < 0) == (RealPart(j.r) < 0)) return false;
  const S m = i.w * j.r - j.w * i.r, n = i.q * j.r - j.q * i.r;
  if (!(RealPart(m) * (RealPart(j.r) - RealPart(i.r)) > 0)) return false;
  const double along = std::abs(RealPart(m));  // the edge's normal, scaled
  const double across = std::abs(RealPart(i.w) * RealPart(j.q) - RealPart(i.q) * RealPart(j.w));
  if (step.axis == 0 ? along < across : along <= across) return false;
  *t = n / m;
  return RealPart(*t) >= 0 && RealPart(*t) <= 1;
}

// d_p[4] += gradient from d_way.
template <class S>
void PointOnWayAdjoint(const PixelStep& step, const WayPoint<S>& d_way, S* d_p) {
  S d_from[2];
  d_from[step.axis] = d_way.q * static_cast<double>(step.direction) * step.scale[step.axis];
  d_from[1 - step.axis] = d_way.r * step.scale[1 - step.axis];
  d_p[0] += d_from[0];
  d_p[1] += d_from[1];
  d_p[3] += d_way.w - step.from.x * d_from[0] - step.from.y * d_from[1];
}

// d_i[4], d_j[4] += gradient from d_t, by the ends of an edge that crosses at t.
template <class S>
void CrossingAdjoint(const PixelStep& step, const WayPoint<S>& i, const WayPoint<S>& j, S t, S d_t,
                     S* d_i, S* d_j) {
  const S d_n = d_t / (i.w * j.r - j.w * i.r), d_m = -t * d_n;
  PointOnWayAdjoint(step, {d_n * j.r, -(d_n * j.q + d_m * j.w), d_m * j.r}, d_i);
  PointOnWayAdjoint(step, {-(d_n * i.r), d_n * i.q + d_m * i.w, -(d_m * i.r)}, d_j);
}

// Pixel `to` takes `weight` of the difference of `from` to its own colour. Pixel indices are in the
// batch.
struct Blend {
  std::size_t to, from;
  double weight, t;
  double d_weight;  // d(weight)/dt
  PixelStep step;
  std::int32_t ends[2];  // vertices of the edge
};

struct PixelAt {
  int x, y;
};

// Two adjacent pixels along an axis, the one with the nearer face first.
struct PixelPair {
  std::size_t front, back;
  std::int32_t face;  // of `front`
  PixelAt at;
  int axis, direction;
};

// Pixel `at`, the next one along an axis, and their numbers in rast, which differ.
struct PixelPlace {
  std::size_t pixel;
  PixelAt at;
  int axis;
  std::int32_t id, next_id;
};

template <class T>
PixelPair PairAt(const AntialiasInput<T>& input, const PixelPlace& place) {
  const auto& [pixel, at, axis, id, next_id] = place;
  const std::size_t next = pixel + (axis == 0 ? 1 : input.grid.row());
  const T depth = input.rast[4 * pixel + 2], next_depth = input.rast[4 * next + 2];
  if (next_id == 0 || (id != 0 && depth <= next_depth)) {
    return {pixel, next, id - 1, at, axis, 1};
  }
  return {next, pixel, next_id - 1, {at.x + (axis == 0 ? 1 : 0), at.y + axis}, axis, -1};
}

PixelStep StepOf(const PixelGrid& grid, const PixelPair& pair) {
  return {CentreOf(grid, pair.at.x, pair.at.y),
          pair.axis,
          pair.direction,
          {0.5 * grid.width, 0.5 * grid.height}};
}

template <class T>
WayPoint<double> VertexOnWay(const AntialiasInput<T>& input, std::size_t image, std::int32_t vertex,
                             const PixelStep& step) {
  const T* p = input.positions.at(image, vertex);
  const double point[4] = {static_cast<double>(p[0]), static_cast<double>(p[1]),
                           static_cast<double>(p[2]), static_cast<double>(p[3])};
  return PointOnWay(step, point);
}

// The silhouette edges of an image's faces, computed when a face is first met. Scratch of one
// worker.
class Silhouettes {
 public:
  template <class T>
  void Begin(const AntialiasInput<T>& input, std::size_t image) {
    if (image_ == image) return;
    image_ = image;
    edges_.assign(input.faces.size() / 3 + 1, kUnknown);
    edges_[0] = 0;
  }
  // Of the face with a number in rast; none without a face. Bit k: no face in the ring of the edge
  // from corner k continues beyond it.
  template <class T>
  std::uint8_t Of(const AntialiasInput<T>& input, std::int32_t id) {
    std::uint8_t& edges = edges_[static_cast<std::size_t>(id)];
    if (edges == kUnknown) {
      edges = 0;
      for (int k = 0; k < 3; ++k) edges |= IsSilhouette(input, image_, 3 * (id - 1) + k) << k;
    }
    return edges;
  }

 private:
  static constexpr std::uint8_t kUnknown = 8;
  static constexpr std::size_t kNoImage = std::numeric_limits<std::size_t>::max();

  // The side of the line through the ends of an edge on which its face lies, as a sign. In
  // homogeneous coordinates, so that it holds for corners behind the eye.
  template <class T>
  static double SideOf(const T* a, const T* b, const T* c) {
    const double ax = a[0], ay = a[1], aw = a[3], bx = b[0], by = b[1], bw = b[3];
    return (ax * by - bx * ay) * c[3] + (bx * aw - ax * bw) * c[1] + (ay * bw - by * aw) * c[0];
  }
  template <class T>
  static bool IsSilhouette(const AntialiasInput<T>& input, std::size_t image, std::int32_t side) {
    const auto vertex = [&](std::int32_t s, int k) {
      return input.faces[static_cast<std::size_t>(s - s % 3 + (s + k) % 3)];
    };
    const auto next = [&](std::int32_t s) {
      return input.rings->next[static_cast<std::size_t>(s)];
    };
    const std::int32_t ends[2] = {vertex(side, 0), vertex(side, 1)};
    const T *a = input.positions.at(image, ends[0]), *b = input.positions.at(image, ends[1]);
    const double own = SideOf(a, b, input.positions.at(image, vertex(side, 2)));
    for (std::int32_t other = next(side); other != side; other = next(other)) {
      const std::int32_t third = vertex(other, 2);
      // For a face without area rounding would choose the side.
      if (third == ends[0] || third == ends[1]) continue;
      if (own * SideOf(a, b, input.positions.at(image, third)) < 0) return false;
    }
    return true;
  }

  std::size_t image_ = kNoImage;
  std::vector<std::uint8_t> edges_;  // [F + 1]
};

// The blend of two pixels due to one of the silhouette edges (Silhouettes::Of) of the nearer face
// of the pair, where that ends.
template <class T>
std::optional<Blend> BlendOf(const AntialiasInput<T>& input, std::size_t image,
                             const PixelPair& pair, unsigned edges) {
  if (edges == 0) return std::nullopt;
  const PixelStep step = StepOf(input.grid, pair);
  const std::int32_t* v = &input.faces[3 * static_cast<std::size_t>(pair.face)];
  WayPoint<double> corner[3];
  for (int k = 0; k < 3; ++k) corner[k] = VertexOnWay(input, image, v[k], step);
  for (int k = 0; k < 3; ++k) {
    double t;
    const int n = (k + 1) % 3;
    if ((edges >> k & 1) == 0 || !CrossesWay(step, corner[k], corner[n], &t)) continue;
    const bool own = t < 0.5;
    return Blend{own ? pair.front : pair.back,
                 own ? pair.back : pair.front,
                 own ? 0.5 - t : t - 0.5,
                 t,
                 own ? -1.0 : 1.0,
                 step,
                 {v[k], v[n]}};
  }
  return std::nullopt;
}

using BlendLists = std::vector<std::vector<Blend>>;  // of bands

std::size_t ReadRow(std::span<const float> rast, std::size_t faces, FaceRow* out) {
  return ReadFaceRow(rast, faces, out);
}
std::size_t ReadRow(std::span<const double> rast, std::size_t faces, FaceRow* out) {
  return ReadFaceRowRef(rast, faces, out);
}

// Finds the blends of bands. Scratch of one worker.
template <class T>
class BlendFinder {
 public:
  explicit BlendFinder(const AntialiasInput<T>& input)
      : input_(input),
        row_(input.grid.row()),
        above_(input.grid.row()),
        steps_((input.grid.row() + kStepBits - 1) / kStepBits) {}

  // Appends to *out. Returns the first pixel with a face that does not exist, or kNoPixel.
  std::size_t Find(const Band& band, std::vector<Blend>* out) {
    silhouettes_.Begin(input_, band.image);
    std::size_t bad = Read(band.image, band.row_begin, &above_);
    for (int y = band.row_begin; y < band.row_end; ++y) {
      std::swap(row_, above_);
      const bool last = y + 1 == input_.grid.height;
      if (!last) bad = std::min(bad, Read(band.image, y + 1, &above_));
      FindSteps(row_, last ? row_ : above_, input_.grid.row(), steps_);
      for (std::size_t word = 0; word < steps_.size(); ++word) {
        const int first = static_cast<int>(word * kStepBits);
        for (std::uint64_t left = steps_[word]; left != 0; left &= left - 1) {
          FindAt(band.image, {first + std::countr_zero(left), y}, last, out);
        }
      }
    }
    return bad;
  }

 private:
  std::size_t Read(std::size_t image, int y, FaceRow* out) {
    const std::size_t first = input_.grid.first(image, y);
    const auto rast = input_.rast.subspan(4 * first, 4 * input_.grid.row());
    const std::size_t bad = ReadRow(rast, input_.faces.size() / 3, out);
    return bad == kNoPixel ? kNoPixel : first + bad;
  }
  void FindAt(std::size_t image, const PixelAt& at, bool last_row, std::vector<Blend>* out) {
    const auto x = static_cast<std::size_t>(at.x);
    const std::int32_t id = row_.ids[x], next[2] = {row_.ids[x + 1], last_row ? id : above_.ids[x]};
    const unsigned edges = silhouettes_.Of(input_, id);
    for (int axis = 0; axis < 2; ++axis) {
      if (id == next[axis]) continue;
      // Which one is nearer is a guess for the processor, and mostly neither has a silhouette.
      const unsigned next_edges = silhouettes_.Of(input_, next[axis]);
      if ((edges | next_edges) == 0) continue;
      const std::size_t pixel = input_.grid.first(image, at.y) + x;
      const PixelPair pair = PairAt(input_, {pixel, at, axis, id, next[axis]});
      const auto blend = BlendOf(input_, image, pair, pair.front == pixel ? edges : next_edges);
      if (blend) out->push_back(*blend);
    }
  }

  const AntialiasInput<T>& input_;
  Silhouettes silhouettes_;
  FaceRow row_, above_;
  std::vector<std::uint64_t> steps_;
};

// The colours that a pass starts from, and where to; `to` may be empty.
template <class T>
struct ColorCopy {
  std::span<const T> from;
  std::span<T> to;

  void OfBand(const AntialiasInput<T>& input, const Band& band) const {
    if (to.empty()) return;
    const std::size_t begin = input.grid.first(band.image, band.row_begin) * input.channels;
    const std::size_t end = input.grid.first(band.image, band.row_end) * input.channels;
    std::copy(from.data() + begin, from.data() + end, to.data() + begin);
  }
};

template <class T>
Result<BlendLists> FindBlends(const AntialiasInput<T>& input, const Workers& workers,
                              const ColorCopy<T>& copy) {
  const PixelGrid& grid = input.grid;
  BlendLists out(grid.bands());
  if (grid.pixels() == 0) return out;
  std::vector<std::size_t> bad(grid.bands());
  std::vector<BlendFinder<T>> finders(workers.size(), BlendFinder<T>(input));
  workers.For(grid.bands(), [&](std::size_t index, std::size_t worker) {
    copy.OfBand(input, grid.band(index));
    bad[index] = finders[worker].Find(grid.band(index), &out[index]);
  });
  TILEGRAD_TRY(CheckNoPixel<T>(bad, input.rast, input.faces.size() / 3));
  return out;
}

// Calls visit(blend) for those of an image, in order.
template <class Visit>
void ForBlendsOf(const BlendLists& blends, const PixelGrid& grid, std::size_t image,
                 const Visit& visit) {
  const std::size_t count = grid.bands_of_image();
  for (std::size_t b = image * count; b < (image + 1) * count; ++b) {
    for (const Blend& blend : blends[b]) visit(blend);
  }
}

template <class T>
Status CheckInput(const AntialiasInput<T>& input) {
  if (input.rings->next.size() != input.faces.size()) {
    return InvalidArgument("the topology hash is that of {} triangles, but tri has {}",
                           input.rings->next.size() / 3, input.faces.size() / 3);
  }
  return CheckFaces(input.faces, input.positions.vertices);
}

// dL/dt of a blend.
template <class T>
double PullCrossing(const AntialiasInput<T>& input, const Blend& blend, const T* d_out) {
  const T* to = &input.color[blend.to * input.channels];
  const T* from = &input.color[blend.from * input.channels];
  double sum = 0;
  for (std::size_t c = 0; c < input.channels; ++c) {
    sum +=
        static_cast<double>(d_out[c]) * (static_cast<double>(from[c]) - static_cast<double>(to[c]));
  }
  return sum * blend.d_weight;
}

template <class T>
void PullEdge(const AntialiasInput<T>& input, std::size_t image, const Blend& blend, double d_t,
              BandSums::Adder* adder) {
  double d[2][4] = {};
  CrossingAdjoint(blend.step, VertexOnWay(input, image, blend.ends[0], blend.step),
                  VertexOnWay(input, image, blend.ends[1], blend.step), blend.t, d_t, d[0], d[1]);
  for (int end = 0; end < 2; ++end) {
    double* row = adder->Row(input.positions.row(image, blend.ends[end]));
    for (int i = 0; i < 4; ++i) row[i] += d[end][i];
  }
}

template <class T>
void PullColor(const AntialiasInput<T>& input, const Blend& blend, const T* d_out,
               std::span<T> d_color) {
  for (std::size_t c = 0; c < input.channels; ++c) {
    const T share = static_cast<T>(blend.weight) * d_out[c];
    d_color[blend.to * input.channels + c] -= share;
    d_color[blend.from * input.channels + c] += share;
  }
}

// Vertices of an edge, the lower one first, and one of its sides. Sorting brings those of one edge
// together.
struct Side {
  std::uint64_t edge;
  std::int32_t side;
  bool operator<(const Side& other) const {
    return edge != other.edge ? edge < other.edge : side < other.side;
  }
};

std::vector<Side> SortedSides(FaceList faces) {
  std::vector<Side> sides(faces.size());
  for (std::size_t i = 0; i < faces.size(); ++i) {
    const std::size_t next = i % 3 == 2 ? i - 2 : i + 1;
    const auto [a, b] = std::minmax(faces[i], faces[next]);
    sides[i] = {static_cast<std::uint64_t>(a) << 32 | static_cast<std::uint64_t>(b),
                static_cast<std::int32_t>(i)};
  }
  std::sort(sides.begin(), sides.end());
  return sides;
}

}  // namespace

template <class T>
Status Antialias(const AntialiasInput<T>& input, const Workers& workers, std::span<T> out) {
  TILEGRAD_TRY(CheckInput(input));
  TILEGRAD_ASSIGN(const BlendLists blends, FindBlends(input, workers, {input.color, out}));
  workers.For(input.grid.images, [&](std::size_t image) {
    ForBlendsOf(blends, input.grid, image, [&](const Blend& blend) {
      for (std::size_t c = 0; c < input.channels; ++c) {
        const T to = input.color[blend.to * input.channels + c];
        const T from = input.color[blend.from * input.channels + c];
        out[blend.to * input.channels + c] += static_cast<T>(blend.weight) * (from - to);
      }
    });
  });
  return {};
}

template <class T>
Status AntialiasBackward(const AntialiasInput<T>& input, std::span<const T> d_out,
                         const Workers& workers, const AntialiasGradients<T>& out) {
  TILEGRAD_TRY(CheckInput(input));
  TILEGRAD_ASSIGN(const BlendLists blends, FindBlends(input, workers, {d_out, out.d_color}));
  BandSums sums(input.positions.rows(), 4, input.grid.images, workers);
  workers.For(input.grid.images, [&](std::size_t image, std::size_t worker) {
    BandSums::Adder adder(&sums, image, worker);
    ForBlendsOf(blends, input.grid, image, [&](const Blend& blend) {
      const T* d = &d_out[blend.to * input.channels];
      if (!out.d_color.empty()) PullColor(input, blend, d, out.d_color);
      if (out.d_positions.empty()) return;
      PullEdge(input, image, blend, PullCrossing(input, blend, d), &adder);
    });
  });
  if (out.d_positions.empty()) return {};
  std::fill(out.d_positions.begin(), out.d_positions.end(), T(0));
  sums.AddTo(out.d_positions, workers);
  return {};
}

TILEGRAD_INSTANTIATE(Antialias);
TILEGRAD_INSTANTIATE(AntialiasBackward);

EdgeRings BuildEdgeRings(FaceList faces) {
  const std::vector<Side> sides = SortedSides(faces);
  EdgeRings out;
  out.next.resize(sides.size());
  for (std::size_t begin = 0, end; begin < sides.size(); begin = end) {
    for (end = begin + 1; end < sides.size() && sides[end].edge == sides[begin].edge;) ++end;
    for (std::size_t i = begin; i < end; ++i) {
      const Side& next = sides[i + 1 < end ? i + 1 : begin];
      out.next[static_cast<std::size_t>(sides[i].side)] = next.side;
    }
  }
  return out;
}

}  // namespace tilegrad::compat::nvdiffrast
