#include "core/remedies.h"

#include <catch2/catch.hpp>
#include <set>

namespace cadmorph {
namespace {

TEST_CASE("each remedy has words, until a program gives it its own", "[core][remedies]") {
  constexpr int kCount = static_cast<int>(Remedy::Count);
  std::set<std::string> all;
  for (int i = 0; i < kCount; ++i) {
    const std::string words = words_for(static_cast<Remedy>(i));
    CHECK_FALSE(words.empty());
    CHECK(words.find("--") == std::string::npos);
    all.insert(words);
  }
  CHECK(all.size() == kCount);

  const std::string plain = words_for(Remedy::Via), other = words_for(Remedy::AutomaticSteps);
  set_remedy_words({{Remedy::Via, "by way of"}});
  CHECK(words_for(Remedy::Via) == "by way of");
  CHECK(words_for(Remedy::AutomaticSteps) == other);
  set_remedy_words({{Remedy::Via, plain}});
}

}  // namespace
}  // namespace cadmorph
