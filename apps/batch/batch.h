#pragma once

#include <atomic>
#include <filesystem>
#include <functional>
#include <string>

#include "apps/batch/batch_results.h"
#include "apps/pipeline/morph_job.h"

namespace cadmorph {

struct BatchOptions {
  std::filesystem::path base_cad, mesh, folder;
  VariantList list;
  Shard shard;
  bool is_resumed = false;
  bool has_diagnostics = false;
  double timeout_s = 300;  ///< for reading one STEP file
  PipelineOptions pipeline;
  std::string program;  ///< name and version, for batch.json
  /// Called with the result of each variant that has one, from one thread at a time.
  std::function<void(const Variant&, const MorphResult&)> on_result = {};
  std::string options_text;  ///< all options that bear on the results
};

/// How far a batch has come.
struct BatchCount {
  Index total = 0;             ///< variants of the shard
  Index kept = 0;              ///< of these, finished in an earlier run
  Index done = 0, failed = 0;  ///< the kept ones included
  double seconds = 0;          ///< since the first variant was begun
  bool is_stopped = false;     ///< by request: variants may be missing
  CacheReport cache = {};      ///< what came of PipelineOptions::cache
};

/// Called with each row as it is finished; from one thread at a time.
using BatchProgress = std::function<void(const ResultRow&, const BatchCount&)>;

/// Morphs the variants of a batch: the base side once, STEP files in processes of their own, the
/// numerics of several variants at a time, meshes and results into the folder as they are finished
/// (see BatchFolder). A variant that fails has its row and stops no other. Memory does not depend
/// on the number of variants. When `is_stopped` becomes true, variants under way are finished and
/// no others begun. Throws what MorphJob and BatchFolder throw, and OutputError when a mesh can't
/// be written; what was finished is kept.
BatchCount run_batch(const BatchOptions& options, const std::atomic<bool>& is_stopped,
                     const BatchProgress& progress = {});

}  // namespace cadmorph
