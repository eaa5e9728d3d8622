#include "apps/batch/batch.h"

#include <algorithm>
#include <map>
#include <optional>
#include <utility>

#include "apps/batch/step_readers.h"
#include "apps/pipeline/exit_code.h"
#include "apps/pipeline/likely_mistake.h"
#include "apps/pipeline/output_file.h"
#include "apps/pipeline/write_result.h"
#include "apps/summary/summary.h"
#include "cad/packed_model.h"
#include "cad/step_reader.h"
#include "core/content_hash.h"
#include "core/formats/folder_copy.h"
#include "core/formats/mesh_format.h"
#include "core/parallel.h"
#include "core/stopwatch.h"

namespace cadmorph {
namespace {

namespace fs = std::filesystem;

// Variants solved together: more take little less time and more memory.
constexpr std::size_t kBlock = 6;
// Of a variant under way: positions, displacements, quality, and the solver's vectors.
constexpr double kBytesPerNode = 400, kBytesPerCell = 64;

// A variant on its way.
struct Work {
  StepRead read;
  double seconds = 0;
  std::optional<MorphResult> result;
  ResultRow row;
};

using WorkPointer = std::shared_ptr<Work>;
using Block = std::vector<WorkPointer>;

Block work_on(std::vector<StepRead> files) {
  Block block;
  for (StepRead& file : files) {
    auto work = std::make_shared<Work>();
    work->seconds = file.seconds;
    work->read = std::move(file);
    block.push_back(std::move(work));
  }
  return block;
}

// A request to stop while the base is set up.
struct Interrupted {};

BatchIdentity identity_of(const BatchOptions& options) {
  return {.program = options.program,
          .base = options.base_cad.string(),
          .base_hash = file_hash(options.base_cad),
          .mesh = options.mesh.string(),
          .mesh_hash = mesh_hash(options.mesh),
          .options = options.options_text};
}

fs::path failed_out(const fs::path& out) { return failed_path(out).lexically_normal(); }

std::string joined(const std::vector<std::string>& lines) {
  std::string text;
  for (const std::string& line : lines) text += (text.empty() ? "" : "; ") + line;
  return text;
}

ResultFigures figures_of(const PipelineReport& report) {
  const auto height = [&](double ratio) {
    return report.layers.are_growing() ? std::optional(ratio) : std::nullopt;
  };
  return {.min_scaled_jacobian_before = report.before.min_scaled_jacobian,
          .min_scaled_jacobian_after = report.after.min_scaled_jacobian,
          .mean_scaled_jacobian_before = report.before.mean_scaled_jacobian,
          .mean_scaled_jacobian_after = report.after.mean_scaled_jacobian,
          .worst_twentieth_before = report.before.worst_twentieth,
          .worst_twentieth_after = report.after.worst_twentieth,
          .least_layer_height = height(report.layers.least),
          .most_layer_height = height(report.layers.most),
          .inverted = report.after.invalid,
          .cad_deviation_mm = report.after.max_distance};
}

// Whether a row of an earlier run is what a run of its own would give now.
bool is_finished(const Variant& variant, const ResultRow& row, const BatchFolder& folder) {
  if (row.exit_code == static_cast<int>(ExitCode::Resources) || row.step_hash.empty()) return false;
  std::error_code error;
  if (!fs::is_regular_file(variant.step, error) || file_hash(variant.step) != row.step_hash)
    return false;
  if (row.out.empty()) return true;
  return row.out == (row.exit_code == 0 ? variant.out : failed_out(variant.out)) &&
         folder.holds_mesh(row);
}

// Stands for a variant until it is done again, so that no older row does, nor its mesh.
ResultRow begun_again(const Variant& variant, const ResultRow& old) {
  ResultRow row;
  row.id = variant.id;
  row.step = variant.step;
  row.exit_code = static_cast<int>(ExitCode::Resources);
  row.message = "begun again and not finished; go on with --resume";
  row.revision = old.revision + 1;
  return row;
}

class BatchRun {
 public:
  BatchRun(const BatchOptions& options, const std::atomic<bool>& is_stopped,
           const BatchProgress& progress)
      : options_(options),
        is_stopped_(is_stopped),
        progress_(progress),
        folder_(options.folder, options.shard) {}

  BatchCount run() {
    prepare();
    if (!todo_.empty() && !is_stopped_) {
      try {
        set_up_base();
        morph_all();
      } catch (const Interrupted&) {
      } catch (const OutputError& error) {
        throw OutputError(std::string(error.what()) +
                          ". What was finished is kept: mend this and go on with --resume.");
      }
    }
    count_.is_stopped = is_stopped_ && count_.done + count_.failed < count_.total;
    folder_.write_rows(options_.list, rows_);
    return count_;
  }

 private:
  void prepare() {
    check_outputs();
    folder_.begin(identity_of(options_), options_.list, options_.is_resumed);
    const auto old = folder_.read_rows();
    const auto& variants = options_.list.variants;
    for (std::size_t i = 0; i < variants.size(); ++i) {
      if (!options_.shard.has(i)) continue;
      ++count_.total;
      const auto row = old.find(variants[i].id);
      const bool is_known = row != old.end();
      if (options_.is_resumed && is_known && is_finished(variants[i], row->second, folder_)) {
        ++count_.kept;
        count(row->second);
        continue;
      }
      todo_.push_back(&variants[i]);
      if (is_known) rows_[variants[i].id] = begun_again(variants[i], row->second);
    }
    folder_.write_rows(options_.list, rows_);
    remove_old_meshes();
  }

  // A mesh of an earlier run, good or refused, would outlive another outcome.
  void remove_old_meshes() const {
    for (const Variant* variant : todo_)
      if (options_.is_resumed || rows_.contains(variant->id))
        for (const fs::path& out : {variant->out, failed_out(variant->out)})
          remove_mesh(folder_.path_of(out));
  }

  // A folder only where it holds nothing but a copy of the mesh: results of a solver stay.
  void remove_mesh(const fs::path& path) const {
    std::error_code ignored;
    if (is_mesh_folder(path)) {
      check_replaceable(path, options_.mesh);
      fs::remove_all(path, ignored);
    } else {
      fs::remove(path, ignored);
    }
  }

  void check_outputs() const {
    std::error_code error;
    for (std::size_t i = 0; i < options_.list.variants.size(); ++i) {
      if (!options_.shard.has(i)) continue;
      const Variant& variant = options_.list.variants[i];
      const fs::path out = folder_.path_of(variant.out);
      fs::create_directories(out.parent_path(), error);
      check_mesh_output(out, {options_.base_cad, options_.mesh, variant.step});
    }
  }

  void count(const ResultRow& row) {
    rows_[row.id] = row;
    ++(row.exit_code == 0 ? count_.done : count_.failed);
  }

  void set_up_base() {
    PipelineOptions options = options_.pipeline;
    // The phases of variants, several at a time, are not announced, nor are variants broken off.
    const auto is_set_up = std::make_shared<std::atomic<bool>>(false);
    options.progress = [this, is_set_up, announce = options.progress](auto phase, double fraction) {
      if (*is_set_up) return;
      if (is_stopped_) throw Interrupted();
      if (announce) announce(phase, fraction);
    };
    const auto base = std::make_shared<const CadModel>(read_step(options_.base_cad));
    const auto mesh = std::make_shared<const MeshFile>(options_.mesh);
    try {
      job_.emplace(base, mesh, options);
    } catch (const AssociationError& error) {
      const double given = options.surface.association.mesh_unit_mm;
      throw AssociationError(likely_mistake(*base, mesh->mesh(), given) + error.what());
    }
    check_folders(*mesh);
    *is_set_up = true;
    count_.cache = job_->base().report.run.cache;
  }

  // The files that a deck includes have the same names for all variants.
  void check_folders(const MeshFile& mesh) const {
    std::map<fs::path, std::string> owner;
    for (const Variant& variant : options_.list.variants) {
      if (!mesh.needs_folder(variant.out)) continue;
      const auto [other, is_new] = owner.emplace(variant.out.parent_path(), variant.id);
      if (is_new && variant.out.has_parent_path()) continue;
      throw InvalidInputError(
          options_.mesh.string() +
          " includes files that hold nodes: give each variant a folder of its own, "
          "by a column out in a --manifest, such as " +
          (fs::path(variant.id) / options_.mesh.filename()).string());
    }
  }

  void morph_all() {
    since_start_ = Stopwatch();
    const std::size_t under_way = variants_under_way();
    const std::size_t most = std::min(kBlock, under_way);
    // A block's worth read ahead, what the readers themselves hold included.
    const auto held = static_cast<std::size_t>(thread_count());
    StepReaders readers(todo_, options_.timeout_s, most > held ? most - held : 1, is_stopped_);
    std::vector<Block> blocks(under_way / most);
    const auto next = [&](Index slot) {
      blocks[slot] = work_on(readers.next(most));
      return !blocks[slot].empty();
    };
    const auto finish_block = [&](Index slot) {
      for (const WorkPointer& work : std::exchange(blocks[slot], {})) finish(*work);
    };
    parallel_pipeline(
        std::ssize(blocks), next, [&](Index slot) { morph_block(blocks[slot]); }, finish_block,
        PipelineOrder::Any);
  }

  // As many as keep the threads busy and fit into the memory allowed.
  std::size_t variants_under_way() const {
    const double each = kBytesPerNode * static_cast<double>(job_->base().mesh().node_count()) +
                        kBytesPerCell * static_cast<double>(job_->base().mesh().cell_count());
    const double fitting = options_.pipeline.volume.rbf.memory_limit / std::max(each, 1.0);
    const auto wanted = kBlock * static_cast<std::size_t>(thread_count());
    return static_cast<std::size_t>(std::clamp(fitting, 1.0, static_cast<double>(wanted)));
  }

  void morph_block(const Block& block) const {
    const Stopwatch watch;
    std::vector<CadModel> variants;
    Block good;
    for (const WorkPointer& work : block) {
      begin_row(*work);
      if (work->row.exit_code == 0)
        call_for(work->row, [&] {
          variants.push_back(unpack_model(std::exchange(work->read.reply.model, {})));
          good.push_back(work);
        });
    }
    std::vector<MorphAttempt> attempts = job_->morph_each(variants);
    for (std::size_t i = 0; i < good.size(); ++i)
      call_for(good[i]->row, [&] {
        if (attempts[i].error) std::rethrow_exception(attempts[i].error);
        good[i]->result = std::move(attempts[i].result);
      });
    for (const WorkPointer& work : block)
      work->seconds += watch.seconds() / static_cast<double>(block.size());
  }

  static void begin_row(Work& work) {
    ResultRow& row = work.row;
    const StepReply& reply = work.read.reply;
    row.id = work.read.variant->id;
    row.step = work.read.variant->step;
    row.exit_code = reply.exit_code;
    row.message = reply.message;
    row.step_hash = reply.is_lost ? "" : reply.hash;
  }

  // What a call throws becomes the row's.
  template <class Call>
  static void call_for(ResultRow& row, Call&& call) {
    try {
      call();
    } catch (const std::bad_alloc&) {
      row.exit_code = static_cast<int>(ExitCode::Resources);
      row.message = "out of memory; free some, or use fewer --threads";
    } catch (const std::exception& error) {
      row.exit_code = static_cast<int>(exit_code_of(error));
      row.message = error.what();
    }
  }

  // VTK writes one mesh at a time.
  void finish(Work& work) {
    const Stopwatch watch;
    ResultRow& row = work.row;
    if (work.result) write(work);
    row.seconds = work.seconds + watch.seconds();
    if (const auto begun = rows_.find(row.id); begun != rows_.end())
      row.revision = begun->second.revision + 1;
    folder_.append(*work.read.variant, row);
    count(row);
    count_.seconds = since_start_.seconds();
    if (progress_) progress_(row, count_);
  }

  void write(Work& work) const {
    ResultRow& row = work.row;
    PipelineReport& report = work.result->report;
    const bool is_done = report.outcome == Outcome::Done;
    row.out = is_done ? work.read.variant->out : failed_out(work.read.variant->out);
    const fs::path staging = folder_.staging() / work.read.variant->id;
    std::error_code told_by_writing;
    fs::create_directory(staging, told_by_writing);
    const WrittenMesh staged = write_result(
        *work.result, staging / work.read.variant->out.filename(), options_.has_diagnostics);
    row.out_bytes = size_of(staged.path);
    publish_others(staging, staged.path, row.out.parent_path());
    folder_.publish(staged.path, row.out);
    report.run.written = folder_.path_of(row.out);
    report.run.rounding = staged.rounding;
    row.figures = figures_of(report);
    if (options_.on_result) options_.on_result(*work.read.variant, *work.result);
    std::vector<std::string> remarks = report.run.warnings;
    for (std::string& hint : hints(report, HintsOn::Losses)) remarks.push_back(std::move(hint));
    row.message = joined(remarks);
    if (is_done) return;
    row.exit_code = static_cast<int>(ExitCode::Quality);
    row.message = refusal_text(report);
  }

  // What was written beside a mesh: arrays for diagnosis, files that a deck includes.
  void publish_others(const fs::path& staging, const fs::path& mesh, const fs::path& folder) const {
    std::vector<fs::path> others;
    for (auto entry = fs::recursive_directory_iterator(staging); entry != fs::end(entry); ++entry) {
      if (entry->path() == mesh) entry.disable_recursion_pending();  // may be a folder
      if (entry->path() != mesh && entry->is_regular_file()) others.push_back(entry->path());
    }
    for (const fs::path& other : others) {
      const fs::path out = folder / other.lexically_relative(staging);
      std::error_code told_by_publishing;
      fs::create_directories(folder_.path_of(out).parent_path(), told_by_publishing);
      folder_.publish(other, out);
    }
  }

  const BatchOptions& options_;
  const std::atomic<bool>& is_stopped_;
  const BatchProgress& progress_;
  BatchFolder folder_;
  std::vector<const Variant*> todo_;
  std::map<std::string, ResultRow> rows_;
  std::optional<MorphJob> job_;
  BatchCount count_;
  Stopwatch since_start_;
};

}  // namespace

BatchCount run_batch(const BatchOptions& options, const std::atomic<bool>& is_stopped,
                     const BatchProgress& progress) {
  return BatchRun(options, is_stopped, progress).run();
}

}  // namespace cadmorph
