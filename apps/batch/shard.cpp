#include "apps/batch/shard.h"

#include <charconv>
#include <cstdlib>
#include <optional>
#include <string_view>

#include "apps/pipeline/exit_code.h"

namespace cadmorph {
namespace {

std::optional<int> to_int(std::string_view text) {
  int value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size()) return {};
  return value;
}

// Grid Engine says "undefined" outside of arrays.
std::optional<int> variable(const char* name) {
  const char* text = std::getenv(name);
  return text ? to_int(text) : std::nullopt;
}

Shard checked(Shard shard, const std::string& origin) {
  if (shard.index < 1 || shard.count < shard.index)
    throw UsageError(origin + ": there is no shard " + std::to_string(shard.index) + " of " +
                     std::to_string(shard.count) + "; give --shard i/n with i from 1 to n");
  return shard;
}

// Task ids run from first in steps.
Shard of_range(int id, int first, int step, int count, const std::string& origin) {
  return checked({(id - first) / (step > 0 ? step : 1) + 1, count}, origin);
}

}  // namespace

Shard parse_shard(const std::string& text) {
  const std::size_t slash = text.find('/');
  const auto index = to_int(std::string_view(text).substr(0, slash));
  const auto count =
      slash == std::string::npos ? std::nullopt : to_int(std::string_view(text).substr(slash + 1));
  if (!index || !count)
    throw UsageError("--shard " + text + ": give i/n, such as 3/8 for the third of eight");
  return checked({*index, *count}, "--shard " + text);
}

Shard shard_of_environment(int pbs_count) {
  if (const char* text = std::getenv("SLURM_ARRAY_TASK_ID"); text && !to_int(text))
    throw UsageError(std::string("SLURM_ARRAY_TASK_ID is \"") + text +
                     "\", no number: give --shard i/n (1/1 for all)");
  if (const auto id = variable("SLURM_ARRAY_TASK_ID"))
    return of_range(*id, variable("SLURM_ARRAY_TASK_MIN").value_or(1),
                    variable("SLURM_ARRAY_TASK_STEP").value_or(1),
                    variable("SLURM_ARRAY_TASK_COUNT").value_or(1), "SLURM_ARRAY_TASK_ID");
  if (const auto id = variable("SGE_TASK_ID")) {
    const int first = variable("SGE_TASK_FIRST").value_or(1);
    const int step = variable("SGE_TASK_STEPSIZE").value_or(1);
    const int last = variable("SGE_TASK_LAST").value_or(*id);
    return of_range(*id, first, step, (last - first) / (step > 0 ? step : 1) + 1, "SGE_TASK_ID");
  }
  for (const char* name : {"PBS_ARRAY_INDEX", "PBS_ARRAYID"})
    if (const auto id = variable(name)) {
      if (pbs_count > 0) return checked({*id, pbs_count}, name);
      throw UsageError(std::string(name) + " is set, but PBS does not tell how many tasks there " +
                       "are: add --shards N, or give --shard $" + name + "/N (1/1 for all)");
    }
  return {};
}

}  // namespace cadmorph
