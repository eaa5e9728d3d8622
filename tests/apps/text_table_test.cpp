#include "apps/summary/text_table.h"

#include <catch2/catch.hpp>

namespace cadmorph {

TEST_CASE("Counts get separators of thousands", "[apps][text]") {
  CHECK(with_commas(0) == "0");
  CHECK(with_commas(999) == "999");
  CHECK(with_commas(1000) == "1,000");
  CHECK(with_commas(-1234567) == "-1,234,567");
}

TEST_CASE("Columns are as wide as their widest cell", "[apps][text]") {
  CHECK(align({{"a", "1"}, {"long", "22", "x"}, {}}) == "a      1\nlong  22  x\n\n");
}

}  // namespace cadmorph
