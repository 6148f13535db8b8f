// SPDX-License-Identifier: Apache-2.0
#include "cli/command_line.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <memory>
#include <sstream>
#include <string_view>

#include "base/error.h"
#include "base/text.h"
#include "cli/render_job.h"
#include "tilegrad/version.h"
#include "train/config.h"

namespace tilegrad::cli {
namespace {

bool IsNumber(const std::string& word) { return RealNumber(word).has_value(); }

bool IsOutput(const std::string& word) {
  return std::find(kOutputNames.begin(), kOutputNames.end(), word) != kOutputNames.end();
}

// NAME=NUMBER
bool IsRate(const std::string& word) {
  const std::size_t equals = word.find('=');
  return equals != std::string::npos && IsNumber(word.substr(equals + 1));
}

struct List {
  std::string_view option;
  bool (*is_value)(const std::string& word);
  std::size_t count;  // expected words; 0: any number
};
constexpr std::array kLists = {
    List{"--up", IsNumber, 3},      List{"--errors", IsNumber, 0},
    List{"--deltas", IsNumber, 0},  List{"--training-errors", IsNumber, 0},
    List{"--outputs", IsOutput, 0}, List{"--rate", IsRate, 0},
};

// How many of the words from `first` on are values of the list.
template <class Word>
std::size_t CountValues(const List& list, Word first, Word end) {
  const auto last = std::find_if_not(first, end, list.is_value);
  const auto count = static_cast<std::size_t>(last - first);
  return list.count == 0 ? count : count < list.count ? 0 : list.count;
}

// CLI11 chooses the type's name and how words are read by the target's type.
struct Declare {
  CLI::App* app;
  const Option& option;

  CLI::Option* operator()(const WordCheck& keeper) const {
    const auto keep_nothing = [](const std::string&) {};
    return app->add_option_function<std::string>(option.names, keep_nothing, option.help)
        ->check(keeper.fault, keeper.description);
  }
  CLI::Option* operator()(bool* flag) const {
    return app->add_flag(option.names, *flag, option.help)->disable_flag_override();
  }
  template <class T>
  CLI::Option* operator()(T* value) const {
    return app->add_option(option.names, *value, option.help);
  }
};

// A check of CLI11's, and what is wrong with a word that it refuses.
CLI::Validator Saying(const std::string& fault, const CLI::Validator& check) {
  const auto look = [fault, check](std::string& word) {
    return check(word).empty() ? std::string() : word + fault;
  };
  return {look, check.get_description()};
}

struct Apply {
  CLI::App* app;
  CLI::Option* option;
  bool whole;  // its value is an integer

  void operator()(Required) const { option->required(); }
  void operator()(Hidden) const { option->group(""); }
  void operator()(NoDefault) const { option->default_str(""); }
  void operator()(SplitAtCommas) const { option->delimiter(','); }
  void operator()(Numbers numbers) const {
    option->type_size(numbers.count)->expected(1)->delimiter(',');
    option->option_text("FLOAT x " + std::to_string(numbers.count));
  }
  void operator()(Range range) const {
    const auto check = whole ? CLI::Range(std::llround(range.low), std::llround(range.high))
                             : CLI::Range(range.low, range.high);
    option->check(
        Saying(fmt::format(" is not in {:.15g} to {:.15g}", range.low, range.high), check));
  }
  void operator()(const OneOf& choice) const {
    const std::string fault = fmt::format(" is not one of {}", fmt::join(choice.words, ","));
    option->check(Saying(fault, CLI::IsMember(choice.words)));
  }
  void operator()(const TypeName& type) const { option->type_name(type.name); }
  void operator()(const ValueMayLack& lacking) const {
    option->expected(0, 1)->default_str(lacking.value)->option_text(lacking.text);
  }
  void operator()(const Needs& other) const { option->needs(app->get_option(other.option)); }
  void operator()(const Excludes& others) const {
    for (const std::string& other : others.options) option->excludes(app->get_option(other));
  }
  void operator()(const WordCheck& check) const { option->check(check.fault, check.description); }
};

// Where files may follow, an option takes no word more than it needs. CLI11 would also take the
// following words: of `--eye 0 0 4 --size 64 mesh.obj` with `--eye` last, the mesh would be a
// fourth number. Lists then need commas (JoinLists adds them) or their option again.
void AddOptions(const std::vector<Option>& options, CLI::App* app) {
  const auto is_word = [](const Option& option) { return !option.names.starts_with('-'); };
  const bool has_files = std::any_of(options.begin(), options.end(), is_word);
  for (const Option& option : options) {
    CLI::Option* const out = std::visit(Declare{app, option}, option.target);
    out->capture_default_str();
    if (out->get_default_str() == "[]") out->default_str("");  // an empty list
    const bool whole = std::holds_alternative<int*>(option.target) ||
                       std::holds_alternative<std::int64_t*>(option.target);
    for (const Trait& trait : option.traits) std::visit(Apply{app, out, whole}, trait);
    if (has_files && !is_word(option)) out->allow_extra_args(false);
  }
}

// The first unrecognised word: what follows an unknown option is its value.
std::string ExplainExtra(const CLI::App& command) {
  const std::string word = command.remaining().front();
  if (!word.starts_with('-')) return fmt::format("unexpected argument \"{}\"", word);
  std::vector<std::string> known;
  for (const CLI::Option* option : command.get_options()) {
    for (const std::string& name : option->get_lnames()) known.push_back("--" + name);
  }
  const std::string name = word.substr(0, word.find('='));
  return fmt::format("unknown option {}{}", name, DidYouMean(name, known));
}

// Our text for a sentence of CLI11's: {0} is its part between `before` and `mark`, {1} the rest.
struct Sentence {
  std::string_view before, mark, ours;
};
constexpr Sentence kSentences[] = {
    {"Could not convert: ", " = ", "{0}: invalid value {1}"},
    {"A subcommand is required", "", "no command given"},
    {"", " was given a disallowed flag override", "--{0} takes no value"},
    {"", ": At Most 1 required but received ", "{0} was given {1} times"},
    {"", ": At Most ", "{0}: too many values"},
    {"", ": 1 required ", "{0} needs a value"},
    {"", " required ", "{0} values are needed"},  // "--eye: 3" of them
    {"", " excludes ", "{0} and {1} exclude each other"},
};

std::string InOurWords(const CLI::Error& error) {
  const std::string theirs = error.what();
  if (dynamic_cast<const CLI::ValidationError*>(&error) != nullptr) return theirs;  // of a check
  for (const Sentence& s : kSentences) {
    const std::size_t at = theirs.find(s.mark, s.before.size());
    if (!theirs.starts_with(s.before) || at == std::string::npos) continue;
    return fmt::format(fmt::runtime(s.ours), theirs.substr(s.before.size(), at - s.before.size()),
                       theirs.substr(at + s.mark.size()));
  }
  return theirs;
}

// The command that was chosen, what is wrong, and where its options are listed.
std::string Explain(const CLI::App* app, const CLI::Error& error) {
  const auto chosen = app->get_subcommands();
  const CLI::App& command = chosen.empty() ? *app : *chosen[0];
  const std::string name = chosen.empty() ? "" : command.get_name();
  const bool extra = error.get_exit_code() == static_cast<int>(CLI::ExitCodes::ExtrasError) &&
                     !command.remaining().empty();
  return fmt::format("tilegrad: {}{}; see tilegrad {}--help\n", name.empty() ? "" : name + ": ",
                     extra ? ExplainExtra(command) : InOurWords(error),
                     name.empty() ? "" : name + " ");
}

// Writes to the options' targets when it parses.
std::unique_ptr<CLI::App> MakeApp(const CommandList& commands) {
  auto app = std::make_unique<CLI::App>(
      "tilegrad: a differentiable rasterizer for CPUs, and the training system around it",
      "tilegrad");
  app->footer(
      "tilegrad help COMMAND shows the options of a command; tilegrad configs lists the networks "
      "that train knows by name.");
  app->set_version_flag("--version", TILEGRAD_VERSION);
  app->require_subcommand(1);
  for (const Command& command : commands) {
    CLI::App* const out = app->add_subcommand(command.name, command.help);
    AddOptions(command.options, out);
  }
  app->failure_message(Explain);
  return app;
}

}  // namespace

std::vector<std::string> JoinLists(std::vector<std::string> words) {
  for (std::size_t i = 0; i + 2 < words.size(); ++i) {
    const auto list = std::find_if(kLists.begin(), kLists.end(),
                                   [&](const List& l) { return l.option == words[i]; });
    if (list == kLists.end()) continue;
    const auto first = words.begin() + static_cast<std::ptrdiff_t>(i) + 1;
    const auto end = first + static_cast<std::ptrdiff_t>(CountValues(*list, first, words.end()));
    if (end - first < 2) continue;
    for (auto word = first + 1; word != end; ++word) *first += "," + *word;
    words.erase(first + 1, end);
  }
  return words;
}

ParsedLine ParseLine(std::vector<std::string> words, CommandList* commands) {
  const auto app = MakeApp(*commands);
  try {
    std::reverse(words.begin(), words.end());  // as CLI11 takes them
    app->parse(std::move(words));
  } catch (const CLI::ParseError& error) {
    std::ostringstream out, note;
    const int code = app->exit(error, out, note);
    return {nullptr, code == 0 ? 0 : 2, out.str(), note.str()};
  }
  const CLI::App& chosen = *app->get_subcommands().front();
  const auto command = std::find_if(commands->begin(), commands->end(),
                                    [&](const Command& c) { return c.name == chosen.get_name(); });
  for (Option& option : command->options) {
    const CLI::Option* const read = chosen.get_option(option.FirstName());
    option.words = read->results();
    option.initial = read->get_default_str();
  }
  return {&*command};
}

namespace {

// The part in braces of "TEXT:{none,lambert}".
std::vector<std::string> ChoicesOf(const std::string& type) {
  const auto open = type.find('{'), close = type.find('}');
  if (open == std::string::npos || close == std::string::npos) return {};
  return PartsBetweenCommas(type.substr(open + 1, close - open - 1));
}

// What a value is called: option_text "FLOAT x 3", or the type without its range or choices.
std::string ValueOf(const CLI::Option& option) {
  if (option.get_type_size_max() == 0 || option.get_expected_max() == 0) return "";
  const std::string text =
      option.get_option_text().empty() ? option.get_type_name() : option.get_option_text();
  return text.substr(0, text.find(':'));
}

OptionNode NodeOf(const CLI::Option& option) {
  OptionNode node;
  node.positional = option.get_positional();
  if (node.positional) node.names = {option.get_single_name()};
  for (const auto& name : option.get_snames()) node.names.push_back("-" + name);
  for (const auto& name : option.get_lnames()) node.names.push_back("--" + name);
  node.required = option.get_required();
  node.many = option.get_items_expected_max() > 1000;  // CLI11's "any number"
  node.value = ValueOf(option);
  node.choices = ChoicesOf(option.get_type_name());
  node.path = node.choices.empty() && node.value == "TEXT";
  if (node.names.back() == "--config") node.choices = ConfigNames();
  node.initial = option.get_default_str();
  node.help = option.get_description();
  return node;
}

CommandNode NodeOf(const CLI::App& command) {
  CommandNode node{command.get_name(), command.get_description(), {}};
  for (const CLI::Option* option : command.get_options()) {
    if (!option->get_group().empty()) node.options.push_back(NodeOf(*option));  // else: hidden
  }
  return node;
}

}  // namespace

std::vector<std::string> ConfigNames() {
  std::vector<std::string> names;
  for (const auto& config : train::NamedConfigs()) names.emplace_back(config.name);
  return names;
}

std::vector<CommandNode> ReadCommandTree(const CommandList& commands) {
  const auto app = MakeApp(commands);
  std::vector<CommandNode> tree = {NodeOf(*app)};
  for (const CLI::App* command :
       std::as_const(*app).get_subcommands([](const CLI::App*) { return true; }))
    tree.push_back(NodeOf(*command));
  return tree;
}

namespace {

constexpr const char* kGivenHead = "# Options of this run; --resume uses them again.\n";
constexpr const char* kGivenIs = " = ";

// A line break and the backslash itself.
std::string Escaped(const std::string& text) {
  std::string out;
  for (const char c : text) {
    if (c == '\n' || c == '\\') out += '\\';
    out += c == '\n' ? 'n' : c;
  }
  return out;
}

std::string Unescaped(const std::string& text) {
  std::string out;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const bool escape = text[i] == '\\' && i + 1 < text.size();
    if (escape) ++i;
    out += escape && text[i] == 'n' ? '\n' : text[i];
  }
  return out;
}

// Also 1 and 1.0, and two names of a file.
bool IsSame(const std::string& a, const std::string& b) {
  const auto x = RealNumber(a), y = RealNumber(b);
  std::error_code error;
  return a == b || (x && y && *x == *y) || std::filesystem::equivalent(a, b, error);
}

Status CheckSame(const Continuation& before, const Option& option, const std::string& now) {
  const auto then = before.then.find(option.FirstName());
  const std::string was = then != before.then.end() ? then->second : option.initial;
  if (before.may_differ.contains(option.FirstName()) || IsSame(was, now)) return {};
  return InvalidArgument("{}: was {}, is {}; leave it out to resume, or start anew with --force",
                         option.FirstName(), was.empty() ? "not given" : was, now);
}

}  // namespace

GivenOptions GivenOf(const Command& command) {
  GivenOptions out;
  for (const Option& option : command.options) {
    if (!option.words.empty())
      out[option.FirstName()] = fmt::format("{}", fmt::join(option.words, ","));
  }
  return out;
}

Status WriteGiven(const Path& file, const GivenOptions& given) {
  std::string text = kGivenHead;
  for (const auto& [name, value] : given) text += name + kGivenIs + Escaped(value) + "\n";
  return WriteTextAtomic(file, text);
}

Result<GivenOptions> ReadGiven(const Path& file) {
  TILEGRAD_ASSIGN(const std::string text, ReadText(file));
  std::istringstream lines(text);
  GivenOptions out;
  for (std::string line; std::getline(lines, line);) {
    if (line.empty() || line.starts_with('#')) continue;
    const std::size_t is = line.find(kGivenIs);
    if (is == std::string::npos)
      return DataLoss("{}: \"{}\" is not of the form option = value", file.string(), line);
    out[line.substr(0, is)] = Unescaped(line.substr(is + std::string(kGivenIs).size()));
  }
  return out;
}

Status ContinueWith(const Continuation& before, Command* command, CommandList* list) {
  GivenOptions all = GivenOf(*command);
  for (const Option& option : command->options) {
    if (!option.words.empty()) TILEGRAD_TRY(CheckSame(before, option, all.at(option.FirstName())));
  }
  const bool instead = std::ranges::any_of(
      before.instead, [&](const std::string& name) { return all.contains(name); });
  for (const auto& [name, value] : before.then) {
    if (!instead || !before.instead.contains(name)) all.emplace(name, value);
  }
  std::vector<std::string> words = {command->name};
  for (const auto& [name, value] : all)
    words.push_back(name.starts_with('-') ? name + "=" + value : value);
  const ParsedLine line = ParseLine(std::move(words), list);
  return line.command != nullptr ? Status() : InvalidArgument("--resume: {}", line.note);
}

}  // namespace tilegrad::cli
