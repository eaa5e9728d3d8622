#pragma once

#include <cstddef>
#include <string>

namespace cadmorph {

/// A share of a batch: shard `index` of `count`, from 1, has every count-th variant.
struct Shard {
  int index = 1;
  int count = 1;

  bool has(std::size_t variant) const {
    return variant % static_cast<std::size_t>(count) == static_cast<std::size_t>(index - 1);
  }
};

/// Reads "i/n". Throws UsageError.
Shard parse_shard(const std::string& text);

/// The share of this task of a job array, from the variables of its scheduler: Slurm's
/// SLURM_ARRAY_TASK_ID, _MIN, _STEP and _COUNT; Grid Engine's SGE_TASK_ID, _FIRST, _LAST and
/// _STEPSIZE; PBS's PBS_ARRAY_INDEX (PBS Pro, OpenPBS) or PBS_ARRAYID (Torque), which count from 1
/// and come with no count: that is `pbs_count`, without which it throws UsageError. 1/1 outside of
/// arrays.
Shard shard_of_environment(int pbs_count = 0);

}  // namespace cadmorph
