#include "core/formats/child_process.h"

#include <catch2/catch.hpp>
#include <csignal>
#include <stdexcept>
#include <string>

namespace cadmorph {
namespace {

TEST_CASE("A child process answers until it is no longer needed", "[core][formats]") {
  const ChildProcess child(60, [](const Socket& socket) {
    for (int number = 0; socket.receive(&number, sizeof number);) {
      number *= 2;
      socket.send(&number, sizeof number);
    }
  });
  for (const int number : {1, 21}) {
    REQUIRE(child.socket().send(&number, sizeof number));
    int answer = 0;
    REQUIRE(child.socket().receive(&answer, sizeof answer));
    CHECK(answer == 2 * number);
  }
}

TEST_CASE("A child process that fails is noticed", "[core][formats]") {
  const auto gets_answer = [](const std::function<void()>& work) {
    const ChildProcess child(60, [&](const Socket& socket) {
      work();
      socket.send("a", 1);
    });
    char answer = 0;
    return child.socket().receive(&answer, 1);
  };
  CHECK(gets_answer([] {}));
  CHECK_FALSE(gets_answer([] { std::raise(SIGSEGV); }));
  CHECK_FALSE(gets_answer([] { throw std::runtime_error("no memory"); }));
}

TEST_CASE("One may wait for a child process", "[core][formats]") {
  const ChildProcess answers(60, [](const Socket& socket) { socket.send("a", 1); });
  CHECK(answers.has_started());
  CHECK(answers.socket().waits(60));
  const ChildProcess ends(60, [](const Socket&) {});
  CHECK(ends.socket().waits(60));
  const ChildProcess is_silent(60, [](const Socket&) {
    for (;;) std::raise(SIGSTOP);
  });
  CHECK_FALSE(is_silent.socket().waits(0));
}

TEST_CASE("A child process at work is ended", "[core][formats]") {
  const ChildProcess child(60, [](const Socket&) {
    for (;;) std::raise(SIGSTOP);
  });
}

}  // namespace
}  // namespace cadmorph
