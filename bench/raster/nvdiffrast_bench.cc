// SPDX-License-Identifier: Apache-2.0
// The functions of compat/nvdiffrast beside the bandwidth of memory: a sphere of 10,000 triangles,
// a texture of 1024 x 1024 x 3, float.
//
// Names: function/direction/pixels along a side/workers, mip levels/direction/workers, and
// memory/read, write and copy. Counters of a function:
//
//     MB      compulsory traffic: every input read once, every result written once; of textures
//             the texels that the image shows
//     GB/s    that traffic by the time that the function took
//     memory  the share of the bandwidth: the time in which the same workers copy as many bytes,
//             half of them read and half written, by the time that the function took
//
// One worker: processor time; all workers: wall time.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <map>
#include <memory>
#include <numbers>
#include <numeric>
#include <string>
#include <vector>

#include "base/aligned.h"
#include "base/clocks.h"
#include "base/parallel.h"
#include "base/rng.h"
#include "compat/nvdiffrast/antialias.h"
#include "compat/nvdiffrast/interpolate.h"
#include "compat/nvdiffrast/rasterize.h"
#include "compat/nvdiffrast/texture.h"

namespace tilegrad::bench {
namespace {

namespace nvdiffrast = compat::nvdiffrast;
using namespace nvdiffrast;  // NOLINT: what is measured
using Numbers = AlignedVector<float>;

constexpr int kRings = 50, kSegments = 100, kTextureSize = 1024;
constexpr std::size_t kChannels = 3;

template <class... Arrays>
double BytesOf(const Arrays&... arrays) {
  return (0.0 + ... + static_cast<double>(arrays.size() * sizeof(arrays[0])));
}

// The triangles of a sphere seen from outside.
struct Sphere {
  Numbers positions, uvs;  // [V,4], [V,2]
  std::vector<std::int32_t> faces;

  Sphere() {
    for (int ring = 0; ring <= kRings; ++ring) {
      for (int segment = 0; segment <= kSegments; ++segment) AddVertex(ring, segment);
    }
    for (int ring = 0; ring < kRings; ++ring) {
      for (int segment = 0; segment < kSegments; ++segment) AddQuad(ring, segment);
    }
  }

 private:
  void AddVertex(int ring, int segment) {
    const double polar = std::numbers::pi * ring / kRings;
    const double turn = 2 * std::numbers::pi * segment / kSegments;
    const double x = std::sin(polar) * std::cos(turn), y = std::cos(polar);
    const double z = std::sin(polar) * std::sin(turn) - 3.2;
    for (const double v : {2.5 * x, 2.5 * y, -51.0 / 49 * z - 100.0 / 49, -z}) {
      positions.push_back(static_cast<float>(v));
    }
    uvs.push_back(static_cast<float>(segment) / kSegments);
    uvs.push_back(static_cast<float>(ring) / kRings);
  }
  void AddQuad(int ring, int segment) {
    const std::int32_t first = ring * (kSegments + 1) + segment, below = first + kSegments + 1;
    faces.insert(faces.end(), {first, below, below + 1, first, below + 1, first + 1});
  }
};

// A texture with its levels, and gradients of these.
struct MipStack {
  std::vector<MipSize> sizes = MipSizes({kTextureSize, kTextureSize}, -1).value();
  std::vector<Numbers> texels, gradients;
  std::vector<TextureLevel<float>> levels;
  std::vector<std::span<float>> d_levels;

  MipStack() {
    Rng rng(5, 1);
    for (const MipSize& size : sizes) {
      texels.emplace_back(TexelsOf(size, 1) * kChannels);
      gradients.emplace_back(texels.back().size());
    }
    for (float& v : texels[0]) v = static_cast<float>(rng.Uniform());
    for (std::size_t l = 0; l < sizes.size(); ++l) {
      levels.push_back({texels[l], sizes[l]});
      d_levels.push_back(gradients[l]);
    }
    Halve(Workers(1));
  }
  void Halve(const Workers& workers) {
    for (std::size_t l = 1; l < sizes.size(); ++l) {
      HalveTexture<float>(levels[l - 1], kChannels, workers, texels[l]);
    }
  }
  void HalveBackward(const Workers& workers) {
    for (std::size_t l = sizes.size(); --l > 0;) {
      HalveTextureBackward<float>({gradients[l], sizes[l]}, sizes[l - 1], kChannels, workers,
                                  gradients[l - 1]);
    }
  }
  double Bytes() const {
    return std::accumulate(texels.begin(), texels.end(), 0.0,
                           [](double sum, const Numbers& t) { return sum + BytesOf(t); });
  }
};

// Images of one size, the gradients of all, and the calls between them.
class Pictures {
 public:
  explicit Pictures(int size) : grid_{1, size, size}, rings_(BuildEdgeRings(sphere_.faces)) {
    const std::size_t pixels = grid_.pixels();
    for (Numbers* image : {&rast_, &rast_db_, &uv_da_, &d_rast_, &d_rast_db_, &d_uv_da_}) {
      image->resize(4 * pixels, 1.0f);
    }
    for (Numbers* image : {&uv_, &d_uv_}) image->resize(2 * pixels, 1.0f);
    for (Numbers* image : {&color_, &smooth_, &d_color_, &d_smooth_}) {
      image->resize(kChannels * pixels, 1.0f);
    }
    d_positions_.resize(sphere_.positions.size());
    d_attributes_.resize(sphere_.uvs.size());
    const Workers one(1);
    ok_ = Rasterize(one).ok() && Interpolate(one).ok();
    linear_texels_ = ShownTexels(Texture(false));
    mip_texels_ = ShownTexels(Texture(true));
    ok_ = ok_ && SampleMipmapped(one).ok();
  }
  bool ok() const { return ok_; }

  Status Rasterize(const Workers& workers) {
    return rasterizer_.Run<float>(Drawing(), workers, {rast_, rast_db_, {}});
  }
  double RasterizeBytes() const { return MeshBytes() + BytesOf(rast_, rast_db_); }
  Status RasterizeBackward(const Workers& workers) {
    return nvdiffrast::RasterizeBackward<float>(Drawing(), {rast_, d_rast_, d_rast_db_}, workers,
                                                d_positions_);
  }
  double RasterizeBackwardBytes() const {
    return MeshBytes() + BytesOf(rast_, d_rast_, d_rast_db_, d_positions_);
  }

  Status Interpolate(const Workers& workers) {
    return nvdiffrast::Interpolate<float>(Attributes(), workers, {uv_, uv_da_});
  }
  double InterpolateBytes() const {
    return BytesOf(sphere_.faces, sphere_.uvs, rast_, rast_db_, uv_, uv_da_);
  }
  Status InterpolateBackward(const Workers& workers) {
    return nvdiffrast::InterpolateBackward<float>(Attributes(), {d_uv_, d_uv_da_}, workers,
                                                  {d_attributes_, d_rast_, d_rast_db_});
  }
  double InterpolateBackwardBytes() const {
    return InterpolateBytes() + BytesOf(sphere_.uvs, d_rast_, d_rast_db_);
  }

  Status SampleLinear(const Workers& workers) { return Sample(false, workers); }
  double SampleLinearBytes() const { return linear_texels_ + BytesOf(uv_, color_); }
  Status SampleLinearBackward(const Workers& workers) { return SampleBackward(false, workers); }
  double SampleLinearBackwardBytes() const {
    return linear_texels_ + BytesOf(uv_, d_color_, d_uv_, mips_.gradients[0]);
  }
  Status SampleMipmapped(const Workers& workers) { return Sample(true, workers); }
  double SampleMipmappedBytes() const { return mip_texels_ + BytesOf(uv_, uv_da_, color_); }
  Status SampleMipmappedBackward(const Workers& workers) { return SampleBackward(true, workers); }
  double SampleMipmappedBackwardBytes() const {
    return mip_texels_ + BytesOf(uv_, uv_da_, d_color_, d_uv_, d_uv_da_) + mips_.Bytes();
  }

  Status Halve(const Workers& workers) {
    mips_.Halve(workers);
    return {};
  }
  double HalveBytes() const { return mips_.Bytes(); }
  Status HalveBackward(const Workers& workers) {
    mips_.HalveBackward(workers);
    return {};
  }
  double HalveBackwardBytes() const { return mips_.Bytes() + BytesOf(mips_.texels[0]); }

  Status Antialias(const Workers& workers) {
    return nvdiffrast::Antialias<float>(Smoothing(), workers, smooth_);
  }
  double AntialiasBytes() const { return MeshBytes() + BytesOf(rast_, color_, smooth_); }
  Status AntialiasBackward(const Workers& workers) {
    return nvdiffrast::AntialiasBackward<float>(Smoothing(), d_smooth_, workers,
                                                {d_color_, d_positions_});
  }
  double AntialiasBackwardBytes() const {
    return MeshBytes() + BytesOf(rast_, d_smooth_, d_color_, d_positions_);
  }

 private:
  RasterizeInput<float> Drawing() const { return {Positions(), sphere_.faces, {}, grid_}; }
  VertexRows<float> Positions() const {
    return {sphere_.positions, sphere_.positions.size() / 4, 4, false};
  }
  InterpolateInput<float> Attributes() const {
    static constexpr std::int32_t kBoth[] = {0, 1};
    return {{sphere_.uvs, sphere_.uvs.size() / 2, 2, false},
            sphere_.faces,
            grid_,
            rast_,
            rast_db_,
            kBoth};
  }
  TextureInput<float> Texture(bool mipmapped) const {
    const auto levels = std::span(mips_.levels).first(mipmapped ? mips_.levels.size() : 1);
    TextureInput<float> out;
    out.levels = levels;
    out.channels = kChannels;
    out.grid = grid_;
    out.uv = uv_;
    if (!mipmapped) return out;
    out.filter = TextureFilter::kLinearMipmapLinear;
    out.uv_da = uv_da_;
    return out;
  }
  AntialiasInput<float> Smoothing() const {
    return {Positions(), sphere_.faces, &rings_, grid_, rast_, color_, kChannels};
  }
  Status Sample(bool mipmapped, const Workers& workers) {
    SampleTexture<float>(Texture(mipmapped), workers, color_);
    return {};
  }
  Status SampleBackward(bool mipmapped, const Workers& workers) {
    const TextureInput<float> input = Texture(mipmapped);
    const auto d_levels = std::span(mips_.d_levels).first(input.levels.size());
    const std::span<float> d_uv_da = mipmapped ? std::span<float>(d_uv_da_) : std::span<float>();
    SampleTextureBackward<float>(input, d_color_, workers, {d_levels, d_uv_, d_uv_da, {}});
    return {};
  }
  double MeshBytes() const { return BytesOf(sphere_.positions, sphere_.faces); }
  // Bytes of the texels that have a gradient.
  double ShownTexels(const TextureInput<float>& input) {
    const auto d_levels = std::span(mips_.d_levels).first(input.levels.size());
    SampleTextureBackward<float>(input, d_color_, Workers(1), {d_levels, {}, {}, {}});
    double bytes = 0;
    for (const std::span<float> level : d_levels) {
      bytes += sizeof(float) * static_cast<double>(level.size()) -
               sizeof(float) * static_cast<double>(std::count(level.begin(), level.end(), 0.0f));
    }
    return bytes;
  }

  PixelGrid grid_;
  Sphere sphere_;
  EdgeRings rings_;
  MipStack mips_;
  Rasterizer rasterizer_;
  Numbers rast_, rast_db_, uv_, uv_da_, color_, smooth_;
  Numbers d_rast_, d_rast_db_, d_uv_, d_uv_da_, d_color_, d_smooth_, d_positions_, d_attributes_;
  double linear_texels_ = 0, mip_texels_ = 0;  // bytes
  bool ok_ = false;
};

Pictures& PicturesOf(int size) {
  static std::map<int, std::unique_ptr<Pictures>> all;
  auto& of_size = all[size];
  if (of_size == nullptr) of_size = std::make_unique<Pictures>(size);
  return *of_size;
}

// Passes over memory. Plain loops, which the compiler makes vectors of: the library's copy of large
// blocks is slower where it is one instruction.
class Memory {
 public:
  explicit Memory(std::size_t bytes) : from_(bytes / 8, 1), to_(bytes / 8) {}

  void Read(const Workers& workers) {
    workers.ForRanges(from_.size(), kGrain, [&](std::size_t begin, std::size_t end, std::size_t) {
      std::uint64_t sum = 0;
      for (std::size_t i = begin; i < end; ++i) sum += from_[i];
      benchmark::DoNotOptimize(sum);
    });
  }
  void Write(const Workers& workers) {
    workers.ForRanges(to_.size(), kGrain, [&](std::size_t begin, std::size_t end, std::size_t) {
      for (std::size_t i = begin; i < end; ++i) to_[i] = i;
    });
  }
  // Adds one on the way, so that it stays a loop.
  void Copy(const Workers& workers) {
    workers.ForRanges(to_.size(), kGrain, [&](std::size_t begin, std::size_t end, std::size_t) {
      for (std::size_t i = begin; i < end; ++i) to_[i] = from_[i] + 1;
    });
  }

 private:
  static constexpr std::size_t kGrain = std::size_t{1} << 15;
  AlignedVector<std::uint64_t> from_, to_;
};

// The least time, in seconds, in which the workers read half of so many bytes and write the others.
double CopySeconds(double bytes, const Workers& workers) {
  Memory memory(static_cast<std::size_t>(bytes / 2) / 8 * 8);
  double least = 1e9;
  for (int round = 0; round < 10; ++round) {
    const auto start = std::chrono::steady_clock::now();
    const double processor = ThreadSeconds();
    memory.Copy(workers);
    const double own = ThreadSeconds() - processor;
    if (round > 0) least = std::min(least, workers.count() == 1 ? own : SecondsSince(start));
  }
  return least;
}

struct Function {
  const char* name;
  Status (Pictures::*call)(const Workers&);
  double (Pictures::*bytes)() const;
};

constexpr Function kFunctions[] = {
    {"rasterize/forward", &Pictures::Rasterize, &Pictures::RasterizeBytes},
    {"rasterize/backward", &Pictures::RasterizeBackward, &Pictures::RasterizeBackwardBytes},
    {"interpolate/forward", &Pictures::Interpolate, &Pictures::InterpolateBytes},
    {"interpolate/backward", &Pictures::InterpolateBackward, &Pictures::InterpolateBackwardBytes},
    {"texture linear/forward", &Pictures::SampleLinear, &Pictures::SampleLinearBytes},
    {"texture linear/backward", &Pictures::SampleLinearBackward,
     &Pictures::SampleLinearBackwardBytes},
    {"texture mipmapped/forward", &Pictures::SampleMipmapped, &Pictures::SampleMipmappedBytes},
    {"texture mipmapped/backward", &Pictures::SampleMipmappedBackward,
     &Pictures::SampleMipmappedBackwardBytes},
    {"antialias/forward", &Pictures::Antialias, &Pictures::AntialiasBytes},
    {"antialias/backward", &Pictures::AntialiasBackward, &Pictures::AntialiasBackwardBytes},
};

// Of the texture alone.
constexpr Function kMipLevels[] = {
    {"mip levels/forward", &Pictures::Halve, &Pictures::HalveBytes},
    {"mip levels/backward", &Pictures::HalveBackward, &Pictures::HalveBackwardBytes},
};

void Measure(benchmark::State& state, const Function& function, int size, int count) {
  const Workers workers(count);
  Pictures& pictures = PicturesOf(size);
  if (!pictures.ok()) return state.SkipWithError("the pictures could not be made");
  for (auto _ : state) {
    if (!(pictures.*function.call)(workers).ok()) return state.SkipWithError("the call failed");
  }
  const double bytes = (pictures.*function.bytes)();
  state.counters["MB"] = 1e-6 * bytes;
  state.counters["GB/s"] =
      benchmark::Counter(1e-9 * bytes, benchmark::Counter::kIsIterationInvariantRate);
  state.counters["memory"] = benchmark::Counter(CopySeconds(bytes, workers),
                                                benchmark::Counter::kIsIterationInvariantRate);
}

void MeasureMemory(benchmark::State& state, void (Memory::*pass)(const Workers&), double megabytes,
                   int count) {
  const Workers workers(count);
  Memory memory(static_cast<std::size_t>(megabytes * 1e6));
  const double passes = pass == &Memory::Copy ? 2 : 1;
  for (auto _ : state) (memory.*pass)(workers);
  state.counters["GB/s"] =
      benchmark::Counter(1e-3 * megabytes * passes, benchmark::Counter::kIsIterationInvariantRate);
}

template <class... Arguments>
void Register(const std::string& name, int count, const Arguments&... arguments) {
  const std::string workers = count == 1 ? "/1 worker" : "/" + std::to_string(count) + " workers";
  auto* made = benchmark::RegisterBenchmark((name + workers).c_str(), arguments..., count);
  made->Unit(benchmark::kMillisecond);
  if (count > 1) made->UseRealTime();
}

// Registers the rows of so many workers.
void RegisterAll(int count) {
  for (const double megabytes : {8.0, 128.0}) {
    const std::string size = "/" + std::to_string(static_cast<int>(megabytes)) + " MB";
    Register("memory/read" + size, count, MeasureMemory, &Memory::Read, megabytes);
    Register("memory/write" + size, count, MeasureMemory, &Memory::Write, megabytes);
    Register("memory/copy" + size, count, MeasureMemory, &Memory::Copy, megabytes);
  }
  for (const Function& function : kMipLevels) {
    Register(function.name, count, Measure, function, 512);
  }
  for (const int size : {512, 2048}) {
    for (const Function& function : kFunctions) {
      Register(function.name + ("/" + std::to_string(size)), count, Measure, function, size);
    }
  }
}

const bool kRegistered = [] {
  RegisterAll(1);
  if (AvailableCores() > 1) RegisterAll(AvailableCores());
  return true;
}();

}  // namespace
}  // namespace tilegrad::bench
