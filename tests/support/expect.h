// SPDX-License-Identifier: Apache-2.0
// Common expectations: a result without error, a text with certain parts, and the same on every
// instruction set.
#pragma once

#include <gtest/gtest.h>

#include <optional>
#include <string>
#include <vector>

#include "base/simd_target.h"
#include "tilegrad/status.h"

namespace tilegrad {

// Ends the test at the caller's line; the failure has the message and the traces around it.
[[noreturn]] inline void EndTest(const std::string& message, const char* file, int line) {
  ADD_FAILURE_AT(file, line) << message;
  using testing::TestPartResult;
  throw testing::AssertionException(
      TestPartResult(TestPartResult::kFatalFailure, file, line, message.c_str()));
}

// The result; an error ends the test with its message.
template <class T>
Result<T> Ok(Result<T> result, const char* file = __builtin_FILE(), int line = __builtin_LINE()) {
  if (!result.ok()) EndTest(result.status().message(), file, line);
  return result;
}
inline void Ok(const Status& status, const char* file = __builtin_FILE(),
               int line = __builtin_LINE()) {
  if (!status.ok()) EndTest(status.message(), file, line);
}

// The text has all of these.
template <class... Parts>
void ExpectIn(const std::string& text, const Parts&... parts) {
  for (const std::string& part : {std::string(parts)...})
    EXPECT_NE(text.find(part), std::string::npos) << "\"" << part << "\" is not in: " << text;
}

// The text has none of these.
template <class... Parts>
void ExpectNotIn(const std::string& text, const Parts&... parts) {
  for (const std::string& part : {std::string(parts)...})
    EXPECT_EQ(text.find(part), std::string::npos) << "\"" << part << "\" is in: " << text;
}

// It is an error whose message has all of these.
template <class... Parts>
void ExpectMessage(const Status& status, const Parts&... parts) {
  EXPECT_FALSE(status.ok());
  ExpectIn(status.message(), parts...);
}

// There is one text, and it has all of these.
template <class... Parts>
void ExpectOnly(const std::vector<std::string>& texts, const Parts&... parts) {
  ASSERT_EQ(texts.size(), 1u);
  ExpectIn(texts[0], parts...);
}

// for (const std::string target : EveryTarget()): each instruction set of this machine in turn is
// in use during its pass, and named in what fails there.
class EveryTarget {
 public:
  class Iterator {
   public:
    Iterator() { Use(); }
    std::string operator*() const { return targets_[at_]; }
    void operator++() {
      ++at_;
      Use();
    }
    bool operator!=(const EveryTarget& /*end*/) const { return at_ < targets_.size(); }

   private:
    void Use() {
      trace_.reset();
      scope_.reset();
      if (at_ == targets_.size()) return;
      scope_.emplace(targets_[at_]);
      EXPECT_TRUE(scope_->status().ok()) << scope_->status().message();
      trace_.emplace(__FILE__, __LINE__, targets_[at_]);
    }

    std::vector<std::string> targets_ = RunnableTargets();
    std::size_t at_ = 0;
    std::optional<TargetScope> scope_;
    std::optional<testing::ScopedTrace> trace_;
  };
  Iterator begin() const { return {}; }
  EveryTarget end() const { return {}; }
};

}  // namespace tilegrad
