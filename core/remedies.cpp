#include "core/remedies.h"

#include <array>

namespace cadmorph {
namespace {

// In the order of Remedy.
auto& all_words() {
  static std::array<std::string, static_cast<std::size_t>(Remedy::Count)> words = {
      "the mesh's unit",
      "the tolerance of association",
      "snapping",
      "the setting of unmatched patches",
      "have unmatched patches fixed",
      "have unmatched patches slide",
      "have unmatched patches fixed or slide",
      "another method",
      "the RBF method",
      "the list of pairs",
      "a face map",
      "in a series of morphs",
      "improve below",
      "several steps",
      "keeping layers",
      "accepting what is inverted in the input",
      "automatic repair",
      "automatic steps",
      "another cache file",
      "the whole report",
  };
  return words;
}

}  // namespace

std::string words_for(Remedy remedy) { return all_words()[static_cast<std::size_t>(remedy)]; }

void set_remedy_words(const std::vector<std::pair<Remedy, std::string_view>>& own) {
  for (const auto& [remedy, text] : own) all_words()[static_cast<std::size_t>(remedy)] = text;
}

}  // namespace cadmorph
