// SPDX-License-Identifier: Apache-2.0
#include "nn/named_tensors.h"

#include <algorithm>
#include <cstring>
#include <unordered_map>

#include "base/error.h"

namespace tilegrad::nn {
namespace {

bool IsFloat(const Tensor& t) { return t.dtype() == DType::kF32 || t.dtype() == DType::kF64; }

void CopyValues(const Tensor& from, Tensor& to) {
  if (from.dtype() == to.dtype()) {
    std::memcpy(to.raw(), from.raw(), to.bytes());
    return;
  }
  WithFloatType(from.dtype(), [&]<class From>(From) {
    WithFloatType(to.dtype(), [&]<class To>(To) {
      std::transform(from.data<From>(), from.data<From>() + from.elements(), to.data<To>(),
                     [](From v) { return static_cast<To>(v); });
    });
  });
}

Status CheckFits(const NamedTensor& to, const Tensor* from) {
  if (from == nullptr) return NotFound("no tensor \"{}\"", to.name);
  if (!(from->shape() == to.value.shape())) {
    return InvalidArgument("tensor \"{}\" has shape {}, {} is needed", to.name,
                           from->shape().ToString(), to.value.shape().ToString());
  }
  if (from->dtype() == to.value.dtype() || (IsFloat(*from) && IsFloat(to.value))) return {};
  return InvalidArgument("tensor \"{}\" is {}, {} is needed", to.name, NameOf(from->dtype()),
                         NameOf(to.value.dtype()));
}

}  // namespace

const Tensor* Find(const std::vector<NamedTensor>& tensors, const std::string& name) {
  const auto it = std::find_if(tensors.begin(), tensors.end(),
                               [&](const NamedTensor& t) { return t.name == name; });
  return it == tensors.end() ? nullptr : &it->value;
}

Status CopyByName(const std::vector<NamedTensor>& from, std::vector<NamedTensor> to) {
  std::unordered_map<std::string, const Tensor*> by_name;
  for (const NamedTensor& t : from) by_name.emplace(t.name, &t.value);
  const auto source = [&](const NamedTensor& t) {
    const auto it = by_name.find(t.name);
    return it == by_name.end() ? nullptr : it->second;
  };
  for (const NamedTensor& t : to) TILEGRAD_TRY(CheckFits(t, source(t)));
  for (NamedTensor& t : to) CopyValues(*source(t), t.value);
  return {};
}

}  // namespace tilegrad::nn
