#include "core/parallel.h"

#include <oneapi/tbb/task_arena.h>

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
  set_thread_count(2);
  tbb::task_arena two(2);  // also where there is but one processor
  CHECK_THROWS_AS(two.execute([&] { parallel_for(2, 1, outer); }), std::runtime_error);
  set_thread_count(0);
  REQUIRE(has_begun);
  CHECK(done == 1000);
}

TEST_CASE("A pipeline works on each item once, in a slot of its own", "[core]") {
  constexpr Index kItems = 200, kSlots = 3;
  for (const PipelineOrder order : {PipelineOrder::Kept, PipelineOrder::Any}) {
    std::array<Index, kSlots> items{};
    std::array<std::atomic<int>, kSlots> users{};
    std::atomic<bool> is_shared = false;
    std::vector<Index> taken;
    Index next = 0;
    const auto read = [&](Index slot) {
      if (next == kItems) return false;
      is_shared = is_shared || ++users[slot] != 1;
      items[slot] = next++;
      return true;
    };
    const auto take = [&](Index slot) {
      taken.push_back(items[slot]);
      --users[slot];
    };
    parallel_pipeline(
        kSlots, read, [&](Index slot) { items[slot] = 7 * items[slot]; }, take, order);
    CHECK_FALSE(is_shared);
    if (order == PipelineOrder::Any) std::ranges::sort(taken);
    REQUIRE(std::ssize(taken) == kItems);
    for (Index i = 0; i < kItems; ++i) CHECK(taken[i] == 7 * i);
  }
}

TEST_CASE("A loop in the background runs all its items and tells what went wrong", "[core]") {
  std::atomic<int> done = 0;
  BackgroundLoop loop;
  for (int round = 1; round <= 3; ++round) {
    loop.start(1000, [&](Index item) { done += int(item); });
    loop.wait();
    CHECK(done == round * 999 * 500);
  }
  loop.start(10, [](Index item) {
    if (item == 5) throw std::runtime_error("failed");
  });
  CHECK_THROWS_AS(loop.wait(), std::runtime_error);
  loop.start(1, [&](Index) { done = 0; });
  loop.wait();
  CHECK(done == 0);
}

TEST_CASE("A loop in the background that nobody waits for has ended with its owner", "[core]") {
  std::atomic<bool> is_over = false;
  std::atomic<int> late = 0;
  {
    BackgroundLoop loop;
    loop.start(100, [&](Index) {
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
      if (is_over) ++late;
    });
  }
  is_over = true;
  std::this_thread::sleep_for(std::chrono::milliseconds(20));
  CHECK(late == 0);
}

}  // namespace cadmorph
