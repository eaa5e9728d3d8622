#include "core/formats/number_table.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <limits>
#include <vector>

namespace cadmorph::test {
namespace {

constexpr Index kLeast = std::numeric_limits<Index>::min();
constexpr Index kMost = std::numeric_limits<Index>::max();

void require_found(const std::vector<Index>& numbers) {
  const NumberTable table(numbers);
  for (const Index number : numbers) {
    const Index first = std::ranges::find(numbers, number) - numbers.begin();
    CHECK(table.find(number) == first);
    for (const Index beside : {number - (number > kLeast), number + (number < kMost)}) {
      const auto found = std::ranges::find(numbers, beside);
      CHECK(table.find(beside) == (found == numbers.end() ? -1 : found - numbers.begin()));
    }
  }
}

}  // namespace

TEST_CASE("Items are found by consecutive, scattered and wild numbers", "[core][formats]") {
  require_found({7, 8, 9, 10});
  require_found({10, 9, 7, 3});
  require_found({-5, 0, 100, -4});
  require_found({Index{1} << 40, 3, (Index{1} << 40) + 1, 1 << 30});
  require_found({kLeast, kMost, 0});
  require_found({kMost, kLeast});
  require_found({kMost - 1, kMost});
  CHECK(NumberTable().find(0) == -1);
  CHECK(NumberTable(std::vector<Index>{}).find(-1) == -1);
}

TEST_CASE("Of items with one number the first counts, and a later one is told", "[core][formats]") {
  const std::vector<Index> near{4, 2, 7, 2, 9}, far{4, Index{1} << 40, 7, Index{1} << 40};
  CHECK(NumberTable(near).find(2) == 1);
  CHECK(NumberTable(near).double_item() == 3);
  CHECK(NumberTable(far).find(Index{1} << 40) == 1);
  CHECK(NumberTable(far).double_item() == 3);
  CHECK(NumberTable(std::vector<Index>{5, 6, 7}).double_item() == -1);
  CHECK(NumberTable(std::vector<Index>{5, 7, 6}).double_item() == -1);
}

}  // namespace cadmorph::test
