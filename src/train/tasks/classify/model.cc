// SPDX-License-Identifier: Apache-2.0
#include "train/tasks/classify/model.h"

#include <algorithm>
#include <cstring>

#include "base/error.h"
#include "train/tasks/classify/pictures.h"

namespace tilegrad::train {
namespace {

constexpr const char* kClasses = "classes";  // their names, a line each

}  // namespace

nn::NamedTensor ClassNames(nn::Context& context, const std::vector<std::string>& classes) {
  std::string text;
  for (const std::string& name : classes) text += name + "\n";
  nn::Tensor bytes = context.Empty({static_cast<std::int64_t>(text.size())}, nn::DType::kU8);
  std::memcpy(bytes.raw(), text.data(), text.size());
  return {kClasses, bytes};
}

Result<std::vector<std::string>> ReadClassNames(const std::vector<nn::NamedTensor>& state) {
  const nn::Tensor* bytes = nn::Find(state, kClasses);
  if (bytes == nullptr || bytes->dtype() != nn::DType::kU8)
    return DataLoss("no tensor \"{}\" of bytes with the names of its classes", kClasses);
  std::vector<std::string> out(1);
  for (std::size_t i = 0; i < bytes->bytes(); ++i) {
    const char c = static_cast<char>(bytes->raw()[i]);
    if (c == '\n')
      out.emplace_back();
    else
      out.back() += c;
  }
  out.pop_back();
  if (out.size() < 2) return DataLoss("tensor \"{}\" names {} classes", kClasses, out.size());
  return out;
}

std::vector<int> MostLikely(const nn::Tensor& scores) {
  const auto classes = static_cast<std::ptrdiff_t>(scores.shape()[1]);
  std::vector<int> out;
  nn::WithFloatType(scores.dtype(), [&]<class T>(T) {
    for (std::int64_t i = 0; i < scores.shape()[0]; ++i) {
      const T* row = scores.data<T>() + i * classes;
      out.push_back(static_cast<int>(std::max_element(row, row + classes) - row));
    }
  });
  return out;
}

ClassifierModel::ClassifierModel(nn::Context& context, const ClassifierConfig& config,
                                 std::vector<std::string> classes, int image_size)
    : context_(context),
      classes_(std::move(classes)),
      image_size_(image_size),
      network_(context, config, static_cast<std::int64_t>(classes_.size()), /*seed=*/0) {}

Result<std::unique_ptr<ClassifierModel>> ClassifierModel::Load(nn::Context& context,
                                                               const ClassifierConfig& config,
                                                               const Checkpoint& checkpoint) {
  TILEGRAD_ASSIGN(std::vector<std::string> classes, ReadClassNames(checkpoint.tensors));
  std::unique_ptr<ClassifierModel> model(new ClassifierModel(
      context, config, std::move(classes), static_cast<int>(checkpoint.info.image_size)));
  TILEGRAD_TRY(context.TakeStatus());
  TILEGRAD_TRY(model->LoadWeights(model->network_, checkpoint.tensors));
  model->weights_.push_back(ClassNames(context, model->classes_));
  return model;
}

Result<std::vector<int>> ClassifierModel::Classify(std::span<const std::uint8_t> images) {
  const nn::NoGrad off(context_);
  const nn::Var scores = network_.Forward(
      nn::Constant(context_, ColorsOf(context_, images, image_size_)), nn::Mode::kEval);
  TILEGRAD_TRY(context_.TakeStatus());
  return MostLikely(scores.value());
}

}  // namespace tilegrad::train
