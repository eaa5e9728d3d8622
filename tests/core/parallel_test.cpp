#include "core/parallel.h"

#include <atomic>
#include <catch2/catch.hpp>
#include <chrono>
#include <stdexcept>
#include <thread>

namespace cadmorph {

TEST_CASE("A loop runs all its chunks although the loop around it has failed", "[core]") {
  using namespace std::chrono_literals;
  std::atomic<bool> has_begun = false;
  std::atomic<int> done = 0;
  const auto outer = [&](Index begin, Index) {
    if (begin == 0) {
      for (int i = 0; i < 200 && !has_begun; ++i) std::this_thread::sleep_for(10ms);
      throw std::runtime_error("failed");
    }
    has_begun = true;
    std::this_thread::sleep_for(100ms);  // until the failure has cancelled the loop
    parallel_for(1000, 1, [&](Index, Index) { ++done; });
  };
  CHECK_THROWS_AS(parallel_for(2, 1, outer), std::runtime_error);
  if (has_begun) CHECK(done == 1000);  // on one thread it never is
}

}  // namespace cadmorph
