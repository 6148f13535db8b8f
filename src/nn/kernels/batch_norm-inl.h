// SPDX-License-Identifier: Apache-2.0
// Vector body of batch_norm.h. Two layouts: if channels have several pixels, lanes run along them
// and a channel is a task (its statistics, then its values, still in the cache); if they have one,
// each lane is a channel.

#include <hwy/highway.h>

#include "nn/kernels/batch_norm_ref.h"
#include "nn/kernels/vector-inl.h"

HWY_BEFORE_NAMESPACE();
namespace tilegrad::nn::HWY_NAMESPACE {

// y = scale x + shift of one channel (in all lanes), or of one channel per lane.
struct Normalise {
  VF mean, inverse, scale, shift;

  HWY_INLINE Normalise(DF d, const BatchNormParameters<float>& p, VF channel_mean, VF variance,
                       VF gamma, VF beta) {
    const VF root = hn::Sqrt(hn::Add(variance, hn::Set(d, static_cast<float>(p.epsilon))));
    mean = channel_mean;
    inverse = hn::Div(hn::Set(d, 1.0f), root);
    scale = hn::Mul(gamma, inverse);
    shift = hn::NegMulAdd(mean, scale, beta);
  }
  HWY_INLINE VF Apply(VF x) const { return hn::MulAdd(x, scale, shift); }
  HWY_INLINE VF Standard(VF x) const { return hn::Mul(hn::Sub(x, mean), inverse); }
  // d_y where relu passed y: evaluates the same expression as Apply, so signs agree.
  HWY_INLINE VF Mask(DF d, bool relu, VF x, VF dy) const {
    return relu ? hn::IfThenElseZero(hn::Gt(Apply(x), hn::Zero(d)), dy) : dy;
  }
};

HWY_INLINE VF Rectify(DF d, bool relu, VF y) {
  return relu ? hn::IfThenElse(hn::Le(y, hn::Zero(d)), hn::Zero(d), y) : y;
}

// x, d_x, ... of channel c and image n.
HWY_INLINE std::size_t PlaneOf(const BatchNormShape& s, std::size_t c, std::size_t n) {
  return (n * s.channels + c) * s.pixels;
}

// ---- Lanes along the pixels of one channel ----

HWY_INLINE float MeanOfChannel(const BatchNormForwardProblem<float>& p, std::size_t c) {
  RowSum sum{DF()};
  for (std::size_t n = 0; n < p.shape.batch; ++n) {
    sum.AddRow(p.x + PlaneOf(p.shape, c, n), p.shape.pixels);
  }
  return sum.Total() / static_cast<float>(p.shape.count());
}

HWY_INLINE float VarianceOfChannel(const BatchNormForwardProblem<float>& p, std::size_t c,
                                   float mean) {
  const DF d;
  const std::size_t lanes = hn::Lanes(d), pixels = p.shape.pixels;
  const VF centre = hn::Set(d, mean);
  VF even = hn::Zero(d), odd = hn::Zero(d);
  for (std::size_t n = 0; n < p.shape.batch; ++n) {
    const float* x = p.x + PlaneOf(p.shape, c, n);
    std::size_t i = 0;
    for (; i + 2 * lanes <= pixels; i += 2 * lanes) {
      const VF a = hn::Sub(hn::LoadU(d, x + i), centre);
      const VF b = hn::Sub(hn::LoadU(d, x + i + lanes), centre);
      even = hn::MulAdd(a, a, even);
      odd = hn::MulAdd(b, b, odd);
    }
    for (; i < pixels; i += lanes) {
      const std::size_t count = HWY_MIN(lanes, pixels - i);
      const VF a = hn::Sub(LoadSome(d, x + i, count), centre);
      const VF inside = hn::IfThenElseZero(hn::FirstN(d, count), a);
      even = hn::MulAdd(inside, inside, even);
    }
  }
  return SumLanes(d, hn::Add(even, odd)) / static_cast<float>(p.shape.count());
}

void ForwardChannel(const BatchNormForwardProblem<float>& p, std::size_t c) {
  const DF d;
  const std::size_t lanes = hn::Lanes(d), pixels = p.shape.pixels;
  const float mean = MeanOfChannel(p, c), variance = VarianceOfChannel(p, c, mean);
  p.mean[c] = mean;
  p.variance[c] = variance;
  const Normalise map(d, p.parameters, hn::Set(d, mean), hn::Set(d, variance),
                      hn::Set(d, p.parameters.gamma[c]), hn::Set(d, p.parameters.beta[c]));
  for (std::size_t n = 0; n < p.shape.batch; ++n) {
    const std::size_t plane = PlaneOf(p.shape, c, n);
    for (std::size_t i = 0; i < pixels; i += lanes) {
      const std::size_t count = HWY_MIN(lanes, pixels - i);
      const VF y = map.Apply(LoadSome(d, p.x + plane + i, count));
      StoreSome(Rectify(d, p.parameters.relu, y), d, p.y + plane + i, count);
    }
  }
}

void BackwardChannel(const BatchNormBackwardProblem<float>& p, std::size_t c) {
  const DF d;
  const std::size_t lanes = hn::Lanes(d), pixels = p.shape.pixels;
  const bool relu = p.parameters.relu;
  const Normalise map(d, p.parameters, hn::Set(d, p.mean[c]), hn::Set(d, p.variance[c]),
                      hn::Set(d, p.parameters.gamma[c]), hn::Set(d, p.parameters.beta[c]));
  VF gamma_lanes = hn::Zero(d), beta_lanes = hn::Zero(d);
  for (std::size_t n = 0; n < p.shape.batch; ++n) {
    const std::size_t plane = PlaneOf(p.shape, c, n);
    for (std::size_t i = 0; i < pixels; i += lanes) {
      const std::size_t count = HWY_MIN(lanes, pixels - i);
      const VF x = LoadSome(d, p.x + plane + i, count);
      // Lanes beyond the tail hold d_y = 0 and add nothing.
      const VF dy = map.Mask(d, relu, x, LoadSome(d, p.d_y + plane + i, count));
      gamma_lanes = hn::MulAdd(dy, map.Standard(x), gamma_lanes);
      beta_lanes = hn::Add(dy, beta_lanes);
    }
  }
  p.d_gamma[c] = SumLanes(d, gamma_lanes);
  p.d_beta[c] = SumLanes(d, beta_lanes);
  const float share = 1.0f / static_cast<float>(p.shape.count());
  const VF gamma_share = hn::Set(d, p.d_gamma[c] * share);
  const VF beta_share = hn::Set(d, p.d_beta[c] * share);
  for (std::size_t n = 0; n < p.shape.batch; ++n) {
    const std::size_t plane = PlaneOf(p.shape, c, n);
    for (std::size_t i = 0; i < pixels; i += lanes) {
      const std::size_t count = HWY_MIN(lanes, pixels - i);
      const VF x = LoadSome(d, p.x + plane + i, count);
      const VF dy = map.Mask(d, relu, x, LoadSome(d, p.d_y + plane + i, count));
      const VF spread = hn::NegMulAdd(map.Standard(x), gamma_share, hn::Sub(dy, beta_share));
      StoreSome(hn::Mul(map.scale, spread), d, p.d_x + plane + i, count);
    }
  }
}

// ---- One channel per lane: pixels = 1, channels [c, c + count) ----

void ForwardLanes(const BatchNormForwardProblem<float>& p, std::size_t c, std::size_t count) {
  const DF d;
  const std::size_t step = p.shape.channels;
  const VF share = hn::Set(d, 1.0f / static_cast<float>(p.shape.count()));
  VF sum = hn::Zero(d), squares = hn::Zero(d);
  for (std::size_t n = 0; n < p.shape.batch; ++n) {
    sum = hn::Add(sum, LoadSome(d, p.x + n * step + c, count));
  }
  const VF mean = hn::Mul(sum, share);
  for (std::size_t n = 0; n < p.shape.batch; ++n) {
    const VF a = hn::Sub(LoadSome(d, p.x + n * step + c, count), mean);
    squares = hn::MulAdd(a, a, squares);
  }
  const VF variance = hn::Mul(squares, share);
  StoreSome(mean, d, p.mean + c, count);
  StoreSome(variance, d, p.variance + c, count);
  const Normalise map(d, p.parameters, mean, variance, LoadSome(d, p.parameters.gamma + c, count),
                      LoadSome(d, p.parameters.beta + c, count));
  for (std::size_t n = 0; n < p.shape.batch; ++n) {
    const VF y = map.Apply(LoadSome(d, p.x + n * step + c, count));
    StoreSome(Rectify(d, p.parameters.relu, y), d, p.y + n * step + c, count);
  }
}

void BackwardLanes(const BatchNormBackwardProblem<float>& p, std::size_t c, std::size_t count) {
  const DF d;
  const std::size_t step = p.shape.channels;
  const bool relu = p.parameters.relu;
  const Normalise map(
      d, p.parameters, LoadSome(d, p.mean + c, count), LoadSome(d, p.variance + c, count),
      LoadSome(d, p.parameters.gamma + c, count), LoadSome(d, p.parameters.beta + c, count));
  VF d_gamma = hn::Zero(d), d_beta = hn::Zero(d);
  for (std::size_t n = 0; n < p.shape.batch; ++n) {
    const VF x = LoadSome(d, p.x + n * step + c, count);
    const VF dy = map.Mask(d, relu, x, LoadSome(d, p.d_y + n * step + c, count));
    d_gamma = hn::MulAdd(dy, map.Standard(x), d_gamma);
    d_beta = hn::Add(dy, d_beta);
  }
  StoreSome(d_gamma, d, p.d_gamma + c, count);
  StoreSome(d_beta, d, p.d_beta + c, count);
  const VF share = hn::Set(d, 1.0f / static_cast<float>(p.shape.count()));
  const VF gamma_share = hn::Mul(d_gamma, share), beta_share = hn::Mul(d_beta, share);
  for (std::size_t n = 0; n < p.shape.batch; ++n) {
    const VF x = LoadSome(d, p.x + n * step + c, count);
    const VF dy = map.Mask(d, relu, x, LoadSome(d, p.d_y + n * step + c, count));
    const VF spread = hn::NegMulAdd(map.Standard(x), gamma_share, hn::Sub(dy, beta_share));
    StoreSome(hn::Mul(map.scale, spread), d, p.d_x + n * step + c, count);
  }
}

// Channels [begin, end) of either layout: one by one, or a vector of them at a time.
template <class Channel, class Channels>
HWY_INLINE void ForChannels(const BatchNormShape& shape, std::size_t begin, std::size_t end,
                            const Channel& channel, const Channels& channels) {
  if (shape.pixels != 1) {
    for (std::size_t c = begin; c < end; ++c) channel(c);
    return;
  }
  const std::size_t lanes = hn::Lanes(DF());
  for (std::size_t c = begin; c < end; c += lanes) channels(c, HWY_MIN(lanes, end - c));
}

void BatchNormForwardRange(const BatchNormForwardProblem<float>& p, std::size_t begin,
                           std::size_t end) {
  ForChannels(
      p.shape, begin, end, [&](std::size_t c) HWY_ATTR { ForwardChannel(p, c); },
      [&](std::size_t c, std::size_t count) HWY_ATTR { ForwardLanes(p, c, count); });
}

void BatchNormBackwardRange(const BatchNormBackwardProblem<float>& p, std::size_t begin,
                            std::size_t end) {
  ForChannels(
      p.shape, begin, end, [&](std::size_t c) HWY_ATTR { BackwardChannel(p, c); },
      [&](std::size_t c, std::size_t count) HWY_ATTR { BackwardLanes(p, c, count); });
}

}  // namespace tilegrad::nn::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
