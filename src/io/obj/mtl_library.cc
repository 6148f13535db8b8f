// SPDX-License-Identifier: Apache-2.0
#include "io/obj/mtl_library.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <utility>

#include "base/error.h"
#include "base/text.h"
#include "io/obj/obj_text.h"
#include "io/text_scan.h"

namespace tilegrad::io {
namespace {

// What only other ways of lighting use.
bool IsOfOtherLighting(std::string_view keyword) {
  constexpr std::array<std::string_view, 14> kKeywords = {
      "ka", "ks", "ns", "ni", "tf",  "illum", "sharpness",
      "pr", "pm", "ps", "pc", "pcr", "aniso", "anisor"};
  return std::find(kKeywords.begin(), kKeywords.end(), keyword) != kKeywords.end();
}

// Options of images that are skipped, and how many words follow each.
struct SkippedOption {
  std::string_view name;
  int least, most;     // those after `least` are numbers
  bool changes_image;  // beyond how it is filtered
};
constexpr std::array<SkippedOption, 10> kSkippedOptions = {{{"-blendu", 1, 1, false},
                                                            {"-blendv", 1, 1, false},
                                                            {"-boost", 1, 1, false},
                                                            {"-texres", 1, 1, false},
                                                            {"-cc", 1, 1, true},
                                                            {"-bm", 1, 1, true},
                                                            {"-imfchan", 1, 1, true},
                                                            {"-type", 1, 1, true},
                                                            {"-mm", 1, 2, true},
                                                            {"-t", 1, 3, true}}};

class MtlParser {
 public:
  MtlParser(std::string_view text, const std::string& place) : lines_(text), place_(place) {}

  Status Parse() {
    for (std::string_view keyword, rest; lines_.Next(keyword, rest);)
      TILEGRAD_TRY(Statement(LowerCase(keyword), rest));
    return {};
  }

  MtlLibrary out;

 private:
  Status Statement(const std::string& keyword, std::string_view rest) {
    if (keyword == "newmtl") {
      out.materials.push_back({.name = std::string(WholeName(rest))});
      has_d_ = false;
      return {};
    }
    if (out.materials.empty()) return {};  // belongs to no material
    if (keyword == "kd") return Diffuse(rest);
    if (keyword == "d") return Opacity(rest);
    if (keyword == "tr") return Transparency(rest);
    if (keyword == "map_kd") return Image(rest);
    if (keyword == "ke" ? IsBlack(rest) : IsOfOtherLighting(keyword)) return {};
    out.not_read.insert(keyword);
    return {};
  }

  MtlMaterial& material() { return out.materials.back(); }

  Status Error(std::string_view keyword, std::string_view got) const {
    return DataLoss("{}: line {}: {} needs finite numbers, got \"{}\"", place_, lines_.Number(),
                    keyword, got.substr(0, 80));
  }

  // Numbers at the beginning, `most` at the most, taken off `rest`.
  static int TakeNumbers(std::string_view& rest, float* values, int most) {
    int count = 0;
    for (std::string_view after = rest; count < most; rest = after) {
      if (!ParseNumber(NextToken(after), values[count])) break;
      ++count;
    }
    return count;
  }

  static bool IsBlack(std::string_view rest) {
    std::array<float, 3> n = {};
    TakeNumbers(rest, n.data(), 3);
    return n == std::array<float, 3>{};
  }

  // r g b, or r alone for all three.
  Status Diffuse(std::string_view rest) {
    if (rest.starts_with("spectral") || rest.starts_with("xyz")) {
      out.not_read.insert("Kd " + std::string(NextToken(rest)));
      return {};
    }
    std::array<float, 3> n;
    const std::string_view whole = rest;
    const int count = TakeNumbers(rest, n.data(), 3);
    if (count != 3 && (count != 1 || !NextToken(rest).empty())) return Error("Kd", whole);
    if (count == 1) n[1] = n[2] = n[0];
    material().diffuse = {n[0], n[1], n[2]};
    return {};
  }

  Status Opacity(std::string_view rest) {
    if (rest.starts_with("-halo")) {
      NextToken(rest);
      out.not_read.insert("d -halo");
    }
    has_d_ = true;
    return TakeNumbers(rest, &material().opacity, 1) == 1 ? Status() : Error("d", rest);
  }

  // Files that have both mean the same; some write "Tr 1" beside "d 1", so d counts.
  Status Transparency(std::string_view rest) {
    float transparency = 0;
    if (TakeNumbers(rest, &transparency, 1) != 1) return Error("Tr", rest);
    if (!has_d_) material().opacity = 1 - transparency;
    return {};
  }

  // Options, then a name that may contain spaces.
  Status Image(std::string_view rest) {
    MtlImage image;
    while (rest.starts_with('-')) {
      std::string_view after = rest;
      const std::string option = LowerCase(NextToken(after));
      if (!Option(option, after, image)) break;  // then it is a name
      rest = Trimmed(after);
    }
    image.name = WholeName(rest);
    material().image = std::move(image);
    return {};
  }

  // Takes the option's values off `rest`; false if there is no such option.
  bool Option(const std::string& option, std::string_view& rest, MtlImage& image) {
    std::array<float, 3> n;
    if (option == "-s" || option == "-o") {
      glm::vec2& to = option == "-s" ? image.scale : image.offset;
      const int count = TakeNumbers(rest, n.data(), 3);
      for (int c = 0; c < std::min(count, 2); ++c) to[c] = n[static_cast<std::size_t>(c)];
      return true;
    }
    if (option == "-clamp") {
      image.clamp = LowerCase(NextToken(rest)) == "on";
      return true;
    }
    const auto* skipped = std::find_if(kSkippedOptions.begin(), kSkippedOptions.end(),
                                       [&](const auto& row) { return row.name == option; });
    if (skipped == kSkippedOptions.end()) return false;
    for (int i = 0; i < skipped->least; ++i) NextToken(rest);
    TakeNumbers(rest, n.data(), skipped->most - skipped->least);
    if (skipped->changes_image) out.not_read.insert("map_Kd " + option);
    return true;
  }

  ObjLines lines_;
  const std::string& place_;
  bool has_d_ = false;
};

}  // namespace

Result<MtlLibrary> ParseMtl(std::string_view text, const std::string& place) {
  TILEGRAD_TRY(CheckTextEncoding(text, place));
  MtlParser parser(text, place);
  TILEGRAD_TRY(parser.Parse());
  return std::move(parser.out);
}

}  // namespace tilegrad::io
