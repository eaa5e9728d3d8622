#include <dlfcn.h>

#include <catch2/catch.hpp>
#include <nlohmann/json.hpp>
#include <set>

#include "command_line.h"

namespace cadmorph {

using namespace testing;

namespace {

const std::string kUnknownProcessor =
    "LD_PRELOAD='" CADMORPH_UNKNOWN_PROCESSOR "' OPENBLAS_CORETYPE=Prescott";

bool has_vector_instructions() {
#if defined(__x86_64__)
  return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
#else
  return false;
#endif
}

nlohmann::json report_of(const Workplace& place, const std::string& job, const std::string& setup) {
  const RunResult run = place.run(job + " --json r.json", setup);
  INFO(job << "\n" << run.err);
  REQUIRE(run.exit_code == 0);
  return nlohmann::json::parse(place.read("r.json"));
}

}  // namespace

TEST_CASE("Every command, method and solver runs the same code of the BLAS", "[apps][blas]") {
  const Workplace place;
  const std::string files = "box.step box_moved.step box.vtu ";
  // That of the program: both are linked alike.
  const bool is_openblas = dlsym(RTLD_DEFAULT, "openblas_get_config") != nullptr;
  for (const std::string& setup :
       {std::string(), std::string("OPENBLAS_CORETYPE=Prescott"), kUnknownProcessor}) {
    INFO(setup);
    std::set<std::string> kernels;
    for (const std::string options : {"", "--solver fast", "--solver lu", "--solver iqr",
                                      "--kernel biharmonic", "--method femwarp"})
      kernels.insert(report_of(place, files + "-o x.vtu " + options, setup)["blas_kernel"]);
    kernels.insert(report_of(place, "field " + files + "-o x.cmf", setup)["blas_kernel"]);
    REQUIRE(kernels.size() == 1);
    const std::string kernel = *kernels.begin();
    CHECK(kernel.empty() != is_openblas);
    if (is_openblas && setup == "OPENBLAS_CORETYPE=Prescott") CHECK(kernel == "Prescott");
    if (is_openblas && setup == kUnknownProcessor)
      CHECK((kernel == "Prescott") != has_vector_instructions());
  }
}

TEST_CASE("The solver that was asked for changes no more of a cache than itself", "[apps][blas]") {
  const Workplace place;
  const std::string job = "box.step box_moved.step box.vtu -o x.vtu --cache box.cache ";
  report_of(place, job + "--solver lu", kUnknownProcessor);
  const auto other = report_of(place, job + "--solver fast", kUnknownProcessor);
  CHECK_THAT(other["cache"]["remark"].get<std::string>(),
             Catch::Matchers::Contains("it is of another solver;"));
  const RunResult batch =
      place.run("batch box.step box.vtu box_moved.step -o out --cache box.cache --solver fast",
                kUnknownProcessor);
  CHECK(batch.exit_code == 0);
  CHECK_THAT(batch.out, Catch::Matchers::Contains("base set-up read from box.cache"));
}

}  // namespace cadmorph
