// SPDX-License-Identifier: Apache-2.0
#include "train/ranks/process_group.h"

#include <chrono>
#include <cstdlib>
#include <thread>

#include "base/file.h"
#include "base/hash.h"
#include "base/simd_target.h"

namespace tilegrad::train {
namespace {

// The time that the leader has to end its step, say what went wrong, and end all ranks.
constexpr auto kPatience = std::chrono::seconds(60);

// What a rank says of itself: host, status code, message, then the values of its traits, each ended
// by a zero byte.
std::string Report(const Transport& ranks, const Status& own, const std::vector<Trait>& traits) {
  std::string text;
  const auto add = [&](const std::string& part) {
    text += part;
    text += '\0';
  };
  add(ranks.host());
  add(std::to_string(static_cast<int>(own.code())));
  add(own.message());
  for (const Trait& trait : traits) add(trait.value);
  return text;
}

std::vector<std::string> PartsOf(const std::string& text) {
  std::vector<std::string> parts;
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t end = text.find('\0', at);
    parts.push_back(text.substr(at, end - at));
    at = end + 1;
  }
  return parts;
}

Status CheckReport(std::size_t rank, const std::string& report, const std::string& host0,
                   const std::vector<Trait>& traits) {
  const std::vector<std::string> parts = PartsOf(report);
  const auto code = static_cast<StatusCode>(std::stoi(parts[1]));
  if (code != StatusCode::kOk)
    return rank == 0 ? Status(code, parts[2])
                     : Status(code, fmt::format("rank {} on {}: {}", rank, parts[0], parts[2]));
  for (std::size_t i = 0; i < traits.size(); ++i) {
    const std::string value = i + 3 < parts.size() ? parts[i + 3] : "none";
    if (value == traits[i].value) continue;
    return InvalidArgument(
        "rank {} on {} has another {} ({}) than rank 0 on {} ({}): all ranks must have the same, "
        "or their results would differ; {}",
        rank, parts[0], traits[i].name, value, host0, traits[i].value, traits[i].advice);
  }
  return {};
}

}  // namespace

ProcessGroup::ProcessGroup(Transport& ranks) : ranks_(ranks) {
  if (!leads()) return;
  const auto followers = static_cast<std::size_t>(ranks.size() - 1);
  errors_.resize(followers);
  reported_.resize(followers);
  for (std::size_t i = 0; i < followers; ++i)
    tickets_.push_back(ranks.Receive({static_cast<int>(i) + 1, MessageKind::kError},
                                     std::as_writable_bytes(std::span(errors_[i]))));
}

Status ProcessGroup::Agree(const Status& own, const std::vector<Trait>& traits) {
  const auto reports = GatherTexts(ranks_, Report(ranks_, own, traits));
  Status verdict;
  for (std::size_t rank = 0; rank < reports.size() && verdict.ok(); ++rank)
    verdict = CheckReport(rank, reports[rank], ranks_.host(), traits);
  std::uint8_t ok = verdict.ok() ? 1 : 0;
  Broadcast(ranks_, std::as_writable_bytes(std::span(&ok, 1)));
  if (leads() || ok != 0) return verdict;
  return Cancelled("rank 0 says why");
}

void ProcessGroup::Share(std::vector<nn::NamedTensor>* tensors) {
  for (nn::NamedTensor& t : *tensors) Broadcast(ranks_, {t.value.raw(), t.value.bytes()});
}

void ProcessGroup::Order(std::int64_t order) {
  for (int peer = 1; peer < ranks_.size(); ++peer)
    SendValue(ranks_, {peer, MessageKind::kControl}, order);
}

std::int64_t ProcessGroup::AwaitOrder() {
  return ReceiveValue<std::int64_t>(ranks_, {0, MessageKind::kControl});
}

void ProcessGroup::TellLeader(const Status& status) {
  ErrorText text{};
  status.message().copy(text.data(), text.size() - 1);
  SendAndWait(ranks_, {0, MessageKind::kError}, std::as_bytes(std::span(text)));
}

void ProcessGroup::ReportError(const Status& status) {
  TellLeader(status);
  std::this_thread::sleep_for(kPatience);
  ranks_.Abort(1);
  std::abort();  // g++ does not see that a virtual function does not return
}

Status ProcessGroup::ReportedError() {
  for (std::size_t i = 0; i < errors_.size(); ++i) {
    if (reported_[i]) continue;
    reported_[i] = ranks_.Done(tickets_[i]);
    if (reported_[i] && errors_[i][0] != 0)
      return InternalError("rank {}: {}", i + 1, std::string(errors_[i].data()));
  }
  return {};
}

void ProcessGroup::Shutdown() {
  if (!leads()) return TellLeader({});
  for (std::size_t i = 0; i < tickets_.size(); ++i) {
    if (!reported_[i]) Await(ranks_, tickets_[i]);
  }
}

std::vector<Trait> CommonTraits(const std::string& settings) {
  Hash program, configuration;
  if (const auto bytes = ReadFile("/proc/self/exe"); bytes.ok())
    program.AddBytes(bytes->data(), bytes->size());
  configuration.Add(settings);
  return {{"build of tilegrad", program.Text(), "install one build everywhere"},
          {"instruction set", ActiveTarget(),
           "set TILEGRAD_TARGET to one that all have, e.g. mpirun -x TILEGRAD_TARGET=AVX2 ..."},
          {"configuration", configuration.Text(), "give all the same file and --set options"}};
}

}  // namespace tilegrad::train
