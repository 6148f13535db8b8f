// SPDX-License-Identifier: Apache-2.0
#include "nn/optim.h"

#include <cstddef>
#include <functional>
#include <limits>
#include <string_view>
#include <utility>

#include "base/error.h"
#include "base/parallel.h"

namespace tilegrad::nn {
namespace {

Status CheckGradient(const NamedVar& parameter, const Gradient& gradient) {
  const Tensor& p = parameter.value.value();
  if (gradient.valid() && gradient.shape() == p.shape() && gradient.dtype() == p.dtype()) return {};
  return InvalidArgument("adam: parameter \"{}\" is {} of shape {}, its gradient {} of shape {}",
                         parameter.name, NameOf(p.dtype()), p.shape(),
                         gradient.valid() ? NameOf(gradient.dtype()) : "invalid", gradient.shape());
}

constexpr std::size_t kPiece = 16384;  // numbers to a task of a loop over many tensors

// Calls add(begin, end) for pieces of [0, n).
template <class Add>
void ForPieces(std::size_t n, const Add& add) {
  for (std::size_t begin = 0; begin < n; begin += kPiece) add(begin, std::min(n, begin + kPiece));
}

double DecayOf(const Tensor& parameter, double weight_decay) {
  return parameter.shape().rank() > 1 ? weight_decay : 0.0;
}

double SquaresOf(const Context& context, const Var& x) {
  if (!x.valid()) return 0;
  return WithFloatType(x.dtype(), [&]<class T>(T) {
    return SumOfSquares(x.value().data<T>(), x.value().elements(), context.workers());
  });
}

// |a_i . b_j| <= |a_i| |b_j| <= |a| |b|, and so is every partial sum but for rounding.
bool IsSurelyFinite(DType dtype, double squares_a, double squares_b) {
  const double bound = std::sqrt(squares_a) * std::sqrt(squares_b);
  return WithFloatType(dtype, [&]<class T>(T) {
    return bound < 0.5 * static_cast<double>(std::numeric_limits<T>::max());
  });
}

// Adds those of factors of type T.
template <class T>
void AddSquares(const Context& context, std::span<const Gradient> gradients,
                std::vector<double>* sums) {
  std::vector<std::span<const T>> factors;
  for (const Gradient& g : gradients) {
    for (const Var* factor : {&g.a(), &g.b()}) {
      const bool counts = factor->valid() && factor->dtype() == kDTypeOf<T>;
      factors.push_back(counts ? factor->value().template span<T>() : std::span<const T>());
    }
  }
  const auto more = SumsOfSquares(std::span<const std::span<const T>>(factors), context.workers());
  std::transform(more.begin(), more.end(), sums->begin(), sums->begin(), std::plus());
}

// Of a and b of each gradient, in one loop; 0 of what is not valid.
std::vector<double> SquaresOfFactors(const Context& context, std::span<const Gradient> gradients) {
  std::vector<double> sums(2 * gradients.size());
  AddSquares<float>(context, gradients, &sums);
  AddSquares<double>(context, gradients, &sums);
  return sums;
}

constexpr std::string_view kPrefix = "ema.";
// y = decay y + (1 - decay) x. Memory bounds it, and every compiler vectorises it.
template <class T>
void Blend(double decay, std::span<const T> x, std::span<T> y) {
  const auto old = static_cast<T>(decay), rest = static_cast<T>(1 - decay);
  for (std::size_t i = 0; i < x.size(); ++i) y[i] = old * y[i] + rest * x[i];
}

}  // namespace

Adam::Adam(Context& context, std::vector<NamedVar> parameters, const AdamOptions& options)
    : context_(context), options_(options) {
  for (NamedVar& p : parameters) {
    const Tensor& value = p.value.value();
    const auto zeros = [&] { return context.Zeros(value.shape(), value.dtype()); };
    slots_.push_back({p, {zeros(), zeros()}});
    parameters_.push_back(p.value);
  }
}

Status Adam::Step(std::span<const Var> gradients) {
  StepVector<Gradient> as_they_are(context_.allocator<Gradient>());
  as_they_are.reserve(gradients.size());
  for (const Var& g : gradients) as_they_are.emplace_back(g);
  return Step(as_they_are);
}

Status Adam::Check(std::span<const Gradient> gradients) const {
  TILEGRAD_TRY(context_.status());
  if (gradients.size() != slots_.size())
    return InvalidArgument("adam: {} gradients for {} parameters", gradients.size(), slots_.size());
  for (std::size_t i = 0; i < slots_.size(); ++i) {
    TILEGRAD_TRY(CheckGradient(slots_[i].parameter, gradients[i]));
    if (options_.map != nullptr && gradients[i].dtype() != DType::kF32)
      return InvalidArgument("adam: steps that go through a map are of F32");
  }
  return {};
}

Status Adam::Step(std::span<const Gradient> gradients, UpdateShare* share) {
  if (share == nullptr) return Step(gradients);
  TILEGRAD_TRY(Check(gradients));
  ++steps_;
  BeginStep();
  share->Begin(*this);
  context_.workers().For(share->pieces(), [&](std::size_t k) {
    const UpdateShare::Piece piece = share->piece(k);
    Update(slots_[piece.parameter], gradients[piece.parameter].a().value(),
           {piece.begin, piece.end});
    share->Updated(k);
  });
  return share->Finish();
}

Status Adam::Step(std::span<const Gradient> gradients) {
  TILEGRAD_TRY(Check(gradients));
  ++steps_;
  BeginStep();
  pieces_.clear();
  for (std::size_t i = 0; i < slots_.size(); ++i) {
    if (options_.map != nullptr) {
      UpdateThroughMap(slots_[i], gradients[i].Value().value());
    } else if (gradients[i].is_product()) {
      AddProduct(slots_[i], gradients[i]);
    } else {
      ForPieces(gradients[i].a().value().elements(), [&](std::size_t begin, std::size_t end) {
        pieces_.push_back({i, {begin, end}});
      });
    }
  }
  UpdateProducts();
  UpdatePieces(gradients);
  return {};
}

std::vector<NamedTensor> Adam::State() const {
  std::vector<NamedTensor> state;
  for (const Slot& slot : slots_) {
    state.push_back({"adam.m." + slot.parameter.name, slot.moments[0]});
    state.push_back({"adam.v." + slot.parameter.name, slot.moments[1]});
  }
  Tensor steps = context_.Empty({1}, DType::kI64);
  *steps.data<std::int64_t>() = steps_;
  state.push_back({"adam.steps", steps});
  return state;
}

Status Adam::LoadState(const std::vector<NamedTensor>& state) {
  std::vector<NamedTensor> own = State(), count = {own.back()};
  TILEGRAD_TRY(CopyByName(state, count));
  const std::int64_t steps = *count[0].value.data<std::int64_t>();
  if (steps < 0) return DataLoss("{}: an optimizer has not taken {} steps", count[0].name, steps);
  TILEGRAD_TRY(CopyByName(state, own));
  steps_ = steps;
  return {};
}

void Adam::BeginStep() {
  const auto t = static_cast<double>(steps());
  coefficients_ = {options_.beta1, options_.beta2, options_.epsilon};
  coefficients_.step = options_.learning_rate / (1.0 - std::pow(options_.beta1, t));
  coefficients_.inverse_root = 1.0 / std::sqrt(1.0 - std::pow(options_.beta2, t));
}

template <class T>
AdamProblem<T> Adam::Problem(Slot& slot, Numbers numbers) const {
  Tensor& p = slot.parameter.value.value();
  AdamCoefficients coefficients = coefficients_;
  coefficients.keep = 1.0 - options_.learning_rate * DecayOf(p, options_.weight_decay);
  return {.n = numbers.end - numbers.begin,
          .parameter = p.data<T>() + numbers.begin,
          .m = slot.moments[0].data<T>() + numbers.begin,
          .v = slot.moments[1].data<T>() + numbers.begin,
          .coefficients = coefficients};
}

void Adam::Update(Slot& slot, const Tensor& gradient, Numbers numbers) {
  WithFloatType(gradient.dtype(), [&]<class T>(T) {
    AdamProblem<T> problem = Problem<T>(slot, numbers);
    problem.gradient = gradient.data<T>() + numbers.begin;
    AdamStep(problem, context_.workers());
  });
}

void Adam::UpdatePieces(std::span<const Gradient> gradients) {
  double bytes = 0;
  for (const Piece& piece : pieces_) {
    const std::size_t numbers = piece.numbers.end - piece.numbers.begin;
    bytes += static_cast<double>(numbers * 7 * BytesOf(gradients[piece.slot].dtype()));
  }
  context_.workers().NoteTraffic(bytes);
  context_.workers().For(pieces_.size(), [&](std::size_t i) {
    const Piece& piece = pieces_[i];
    Update(slots_[piece.slot], gradients[piece.slot].a().value(), piece.numbers);
  });
}

void Adam::AddProduct(Slot& slot, const Gradient& product) {
  const Tensor &a = product.a().value(), &b = product.b().value();
  const auto steps = static_cast<std::size_t>(a.shape()[0]);
  if (a.dtype() != DType::kF32 || steps == 0 || steps > kMostProductAdamSteps)
    return Update(slot, product.Value().value(), {0, slot.parameter.value.value().elements()});
  GemmProblem<float> gradient;
  gradient.m = static_cast<std::size_t>(a.shape()[1]);
  gradient.k = steps;
  gradient.n = static_cast<std::size_t>(b.shape()[1]);
  gradient.a = a.data<float>();
  gradient.lda = gradient.m;
  gradient.transpose_a = true;
  gradient.b = b.data<float>();
  gradient.ldb = gradient.n;
  const Numbers all{0, slot.parameter.value.value().elements()};
  if (all.end == 0) return;
  products_.push_back(
      {gradient, Problem<float>(slot, all), static_cast<std::size_t>(product.portions())});
}

void Adam::UpdateProducts() {
  std::span<const ProductAdamProblem> all = products_;
  while (!all.empty()) {
    const std::size_t count = std::min(all.size(), kMostProductAdams);
    ProductAdamSteps(all.first(count), context_.kernels());
    all = all.subspan(count);
  }
  products_.clear();
}

void Adam::UpdateThroughMap(Slot& slot, const Tensor& gradient) {
  Tensor step = context_.Copy(gradient);
  const std::span<float> x = step.span<float>();
  options_.map->Apply(x);
  float *const m = slot.moments[0].data<float>(), *const v = slot.moments[1].data<float>();
  const auto beta1 = static_cast<float>(options_.beta1);
  const auto beta2 = static_cast<float>(options_.beta2);
  const auto rest1 = static_cast<float>(1 - options_.beta1);
  const auto rest2 = static_cast<float>(1 - options_.beta2);
  float largest = 0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    m[i] = beta1 * m[i] + rest1 * x[i];
    v[i] = beta2 * v[i] + rest2 * (x[i] * x[i]);
    largest = std::max(largest, v[i]);
  }
  const double root = std::sqrt(static_cast<double>(largest)) * coefficients_.inverse_root;
  if (!(root > 0)) return;
  const auto factor = static_cast<float>(coefficients_.step / root);
  for (std::size_t i = 0; i < x.size(); ++i) x[i] = factor * m[i];
  options_.map->Apply(x);
  float* const p = slot.parameter.value.value().data<float>();
  for (std::size_t i = 0; i < x.size(); ++i) p[i] -= x[i];
}

double GlobalNorm(Context& context, std::span<const Var> gradients) {
  double sum = 0;
  for (const Var& g : gradients) sum += SquaresOf(context, g);
  return std::sqrt(sum);
}

double GlobalNorm(Context& context, std::span<const Gradient> gradients) {
  double sum = 0;
  for (const Gradient& g : gradients) sum += SquaresOf(context, g.Value());
  return std::sqrt(sum);
}

bool IsFinite(Context& context, std::span<const Gradient> gradients) {
  const std::vector<double> squares = SquaresOfFactors(context, gradients);
  for (std::size_t i = 0; i < gradients.size(); ++i) {
    const Gradient& g = gradients[i];
    const double own = squares[2 * i];
    if (g.is_product() && IsSurelyFinite(g.dtype(), own, squares[2 * i + 1])) continue;
    if (!std::isfinite(g.is_product() ? SquaresOf(context, g.Value()) : own)) return false;
  }
  return true;
}

MovingAverage::MovingAverage(Context& context, std::vector<NamedTensor> tensors, double decay)
    : context_(context), decay_(decay), tensors_(std::move(tensors)) {
  for (const NamedTensor& t : tensors_) averages_.push_back({t.name, context.Copy(t.value)});
  for (std::size_t i = 0; i < tensors_.size(); ++i) {
    ForPieces(tensors_[i].value.elements(), [&](std::size_t begin, std::size_t end) {
      pieces_.push_back({i, begin, end});
    });
  }
}

void MovingAverage::Update() {
  double bytes = 0;
  for (const NamedTensor& t : tensors_) bytes += 3 * static_cast<double>(t.value.bytes());
  context_.workers().NoteTraffic(bytes);
  context_.workers().For(pieces_.size(), [&](std::size_t i) {
    const Piece& piece = pieces_[i];
    const Tensor& from = tensors_[piece.tensor].value;
    const std::size_t count = piece.end - piece.begin;
    WithFloatType(from.dtype(), [&]<class T>(T) {
      Blend<T>(decay_, from.span<T>().subspan(piece.begin, count),
               averages_[piece.tensor].value.span<T>().subspan(piece.begin, count));
    });
  });
}

std::vector<NamedTensor> MovingAverage::State() const {
  std::vector<NamedTensor> state = averages_;
  for (NamedTensor& t : state) t.name = std::string(kPrefix) + t.name;
  return state;
}

std::vector<NamedTensor> Averages(const std::vector<NamedTensor>& state) {
  std::vector<NamedTensor> averages;
  for (const NamedTensor& t : state) {
    if (t.name.starts_with(kPrefix)) averages.push_back({t.name.substr(kPrefix.size()), t.value});
  }
  return averages;
}

}  // namespace tilegrad::nn
