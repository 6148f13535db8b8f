// SPDX-License-Identifier: Apache-2.0
// The commands of the program and their options, as plain records. Each command lives in its own
// file cmd_<name>.cc; command_line.cc declares it to CLI11. Its action returns a Status, whose
// message the program prints; only main.cc maps it to an exit code.
#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <tuple>
#include <utility>
#include <variant>
#include <vector>

#include "base/text.h"
#include "tilegrad/status.h"

namespace tilegrad::cli {

// Parses a whole word as a number, as CLI11 reads options: also "+.5", "0x10", "inf" and "nan".
std::optional<double> RealNumber(const std::string& word);

// Splits "a,b" into a and b.
std::vector<std::string> PartsBetweenCommas(const std::string& text);

// Checks a word of an option. Returns what is wrong with it, or an empty text.
struct WordCheck {
  std::function<std::string(const std::string& word)> fault;
  std::string description;  // in the help, after the type; empty: none
};
WordCheck AboveZero();
WordCheck NotNegative();
// Refuses names with another ending: programs would misread a PNG named pic.jpg. Names without an
// ending, such as devices, are fine.
WordCheck EndsIn(const std::string& ending);

// Further traits of an option.
struct Required {};
struct Hidden {};         // not in the help
struct NoDefault {};      // the help does not show the default
struct SplitAtCommas {};  // for a vector: a word with commas is several values
struct Numbers {          // of a vector: "0 -.5 4" or, as one word, "0,-.5,4"
  int count;
};
struct Range {
  double low, high;  // included
};
struct OneOf {
  std::vector<std::string> words;
};
struct TypeName {
  std::string name;  // in the help
};
struct ValueMayLack {
  std::string value, text;  // the value if it is missing; what the help shows for that
};
struct Needs {
  std::string option;  // that is added before
};
struct Excludes {
  std::vector<std::string> options;  // that are added before
};
using Trait = std::variant<Required, Hidden, NoDefault, SplitAtCommas, Numbers, Range, OneOf,
                           TypeName, ValueMayLack, Needs, Excludes, WordCheck>;

// Where an option's values are stored. A bool makes it a flag, a vector makes it repeatable; a
// WordCheck stores the word itself.
using Target =
    std::variant<bool*, int*, std::int64_t*, std::uint64_t*, float*, double*, std::string*,
                 std::vector<float>*, std::vector<double>*, std::vector<std::string>*,
                 std::vector<std::tuple<float, float, float, float>>*, WordCheck>;

// Sets an enumeration by name, in upper or lower case.
template <class T>
WordCheck Choice(T* target, const std::map<std::string, T>& values) {
  std::string names;
  for (const auto& [name, _] : values) names += (names.empty() ? "" : ",") + name;
  const auto take = [target, values, names](const std::string& word) {
    const auto found = values.find(LowerCase(word));
    if (found == values.end()) return word + " is not one of " + names;
    *target = found->second;
    return std::string();
  };
  return {take, "{" + names + "}"};
}

struct Option {
  std::string names;  // "--start,--mesh"; "run": a positional argument
  Target target;
  std::string help;
  std::vector<Trait> traits = {};
  // After parsing: the words given, and the default that counts if there are none.
  std::vector<std::string> words = {};
  std::string initial = {};

  std::string FirstName() const { return names.substr(0, names.find(',')); }
};

// The action of a chosen command, after options are parsed.
using Action = std::function<Status()>;

struct Command {
  std::string name, help;
  std::vector<Option> options = {};
  Action action = {};

  void Add(const std::string& names, const Target& target, const std::string& text,
           const std::vector<Trait>& traits = {});
  // Whether the parsed command line has the option with this first name.
  bool Given(const std::string& option) const;
};
// A reference to a command stays valid when others are added.
using CommandList = std::deque<Command>;

// Adds a command that calls `run` with the returned options, to which the command line's are to be
// written.
template <class Options>
std::pair<Command*, Options*> AddCommand(CommandList* list, const char* name, const char* help,
                                         Status (*run)(const Options&)) {
  const auto options = std::make_shared<Options>();
  Command& command = list->emplace_back(Command{name, help});
  command.action = [options, run] { return run(*options); };
  return {&command, options.get()};
}

// Each adds a command.
void AddCompletion(CommandList* list);
void AddConfigs(CommandList* list);
void AddDataset(CommandList* list);
void AddDatasetView(CommandList* list);
void AddEval(CommandList* list);
void AddExport(CommandList* list);
void AddFit(CommandList* list);
void AddInfo(CommandList* list);
void AddLive(CommandList* list);
void AddMan(CommandList* list);
void AddPredict(CommandList* list);
void AddProfile(CommandList* list);
void AddRender(CommandList* list);
void AddReport(CommandList* list);
void AddSample(CommandList* list);
void AddSelftest(CommandList* list);
void AddTimelapse(CommandList* list);
void AddTradeoff(CommandList* list);
void AddTrain(CommandList* list);
void AddViews(CommandList* list);

}  // namespace tilegrad::cli
