#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <csignal>
#include <cstdio>
#include <memory>
#include <set>

#include "apps/batch/batch.h"
#include "apps/batch/step_worker.h"
#include "apps/batch/variant_pictures.h"
#include "apps/commands/command.h"
#include "apps/commands/help_format.h"
#include "apps/commands/number_checks.h"
#include "apps/commands/options.h"
#include "apps/pipeline/output_file.h"
#include "apps/report/overview_page.h"
#include "apps/summary/progress_bar.h"
#include "apps/summary/summary.h"
#include "apps/summary/text_table.h"
#include "apps/summary/whole_progress.h"
#include "apps/version.h"
#include "core/content_hash.h"
#include "core/formats/mesh_format.h"
#include "core/parallel.h"

namespace cadmorph {
namespace {

namespace fs = std::filesystem;

constexpr int kListed = 10;  // failed or missing variants named at the end

struct BatchCommand {
  fs::path base, mesh, folder, manifest, collected, report;
  std::vector<fs::path> steps;
  MorphOptions options;
  std::string shard;
  int shards = 0;
  double timeout_s = 300;
  bool is_resumed = false, has_diagnostics = false, is_quiet = false;
  int threads = 0;  ///< 0: all
};

std::atomic<int> interrupt = 0;
std::atomic<bool> is_interrupted = false;

// The first request ends the batch in order, the second at once.
void take_interrupts() {
  struct sigaction action = {};
  action.sa_handler = [](int signal) {
    interrupt = signal;
    is_interrupted = true;
  };
  action.sa_flags = static_cast<int>(SA_RESETHAND);
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);
}

void add_options(CLI::App& app, BatchCommand& command) {
  app.add_option("BASE", command.base, "STEP file the mesh was made for");
  app.add_option("MESH", command.mesh, "mesh of BASE, of any format of 'cadmorph help formats'");
  app.add_option("VARIANT", command.steps, "STEP files to move the mesh onto");
  app.add_option("-o,--output", command.folder, "folder of the meshes and results")
      ->type_name("DIR");
  app.add_option("--manifest", command.manifest,
                 "variants as a table: id, step, optional out, further columns are carried")
      ->type_name("FILE.csv");
  app.add_flag("--resume", command.is_resumed, "keep what an earlier run finished in DIR");
  app.add_option(
         "--shard", command.shard,
         "the i-th of n shares (default: the task of a Slurm, Grid Engine or PBS job array)")
      ->type_name("i/n");
  app.add_option("--shards", command.shards, "number of shares under PBS, which does not tell")
      ->check(positive_number())
      ->type_name("N");
  app.add_option("--collect", command.collected,
                 "merge the results of all shares in DIR and name the missing variants")
      ->type_name("DIR");
  app.add_option("--timeout", command.timeout_s, "seconds to wait for the reading of one STEP file")
      ->check(check_timeout)
      ->capture_default_str();
  app.add_flag("--diagnostics", command.has_diagnostics,
               "add displacement, CAD entity, (u,v) and scaled Jacobian to the meshes");
  app.add_flag("--quiet", command.is_quiet, "print errors only");
  app.add_option("--report", command.report,
                 "write a page to look at: all variants with pictures, quality, time and errors")
      ->type_name("FILE.html");
  add_threads_option(app, command.threads);
  add_morph_options(app, command.options);
}

// The options given, but for those that leave the results as they are.
std::string options_text(const CLI::App& parser, const BatchCommand& command) {
  static const std::set<std::string> ignored = {
      "BASE",    "MESH",  "VARIANT", "output", "manifest", "resume", "shard", "shards",
      "timeout", "quiet", "threads", "help",   "map",      "cache",  "report"};
  std::string text;
  for (const CLI::Option* option : parser.get_options()) {
    const std::string name = option->get_single_name();
    if (option->count() == 0 || ignored.contains(name)) continue;
    text += (text.empty() ? "--" : " --") + name;
    if (option->get_items_expected_max() > 0)
      for (const std::string& value : option->results()) text += " " + value;
  }
  const std::string& map = command.options.face_map;
  if (!map.empty()) text += (text.empty() ? "" : " ") + std::string("--map ") + file_hash(map);
  return text;
}

// The mesh may stand elsewhere than after BASE.
void put_in_order(BatchCommand& command) {
  std::vector<fs::path> files = {command.base, command.mesh};
  files.insert(files.end(), command.steps.begin(), command.steps.end());
  if (!order_inputs(files, 1)) return;
  command.base = files[0];
  command.mesh = files[1];
  command.steps.assign(files.begin() + 2, files.end());
}

void check_files(const BatchCommand& command) {
  const char* usage = "; usage: cadmorph batch BASE.step MESH VARIANT.step... -o DIR (see --help)";
  const char* missing = command.base.empty()     ? "BASE.step, MESH and VARIANT.step"
                        : command.mesh.empty()   ? "MESH and VARIANT.step"
                        : command.folder.empty() ? "-o DIR"
                                                 : nullptr;
  if (missing) throw UsageError("missing " + std::string(missing) + usage);
  if (command.steps.empty() == command.manifest.empty())
    throw UsageError("give either VARIANT.step files or --manifest" + std::string(usage));
}

std::string line_of(const ResultRow& row) {
  return "  " + row.id + format(" (%d): ", row.exit_code) + row.message + "\n";
}

// Shows progress and remembers what failed.
class BatchDisplay {
 public:
  explicit BatchDisplay(bool is_quiet) : bar_(!is_quiet) {}

  Progress phases() {
    return [this](std::string_view phase, double fraction) {
      bar_.show(phase, kSetUpShare * whole_(phase, fraction));
    };
  }

  void take(const ResultRow& row, const BatchCount& count) {
    if (row.exit_code != 0 && failed_.size() < kListed) failed_.push_back(row);
    const Index finished = count.done + count.failed;
    const double rate = static_cast<double>(finished - count.kept) / std::max(count.seconds, 1e-9);
    const double left = static_cast<double>(count.total - finished) / rate;
    bar_.show(format("%lld of %lld variants, %.3g/s, %.0f s left", static_cast<long long>(finished),
                     static_cast<long long>(count.total), rate, left),
              kSetUpShare + (1 - kSetUpShare) * static_cast<double>(finished) /
                                static_cast<double>(count.total));
  }

  void end(const BatchCommand& command, const BatchCount& count) {
    bar_.erase();
    const Index missing = count.total - count.done - count.failed;
    if (!command.is_quiet) print(summary(command, count));
    std::string text;
    if (!count.cache.remark.empty() && !command.is_quiet)
      text += "cadmorph: warning: " + count.cache.remark + "\n";
    if (count.failed > 0) {
      text += "cadmorph: error: " + with_commas(count.failed) + " of " + with_commas(count.total) +
              " variants failed; results.csv in " + command.folder.string() + " tells why\n";
      for (const ResultRow& row : failed_) text += line_of(row);
      if (const Index more = count.failed - std::ssize(failed_); more > 0 && !failed_.empty())
        text += "  and " + with_commas(more) + " more\n";
    }
    if (count.is_stopped)
      text += "cadmorph: error: interrupted with " + with_commas(missing) +
              " variants to go; go on with the same command and --resume\n";
    std::fputs(text.c_str(), stderr);
  }

 private:
  static std::string summary(const BatchCommand& command, const BatchCount& count) {
    const Index fresh = count.done + count.failed - count.kept;
    std::string text = with_commas(count.done) + " of " + with_commas(count.total) +
                       " variants done in " + command.folder.string();
    if (count.kept > 0) text += "; " + with_commas(count.kept) + " kept from before";
    const double seconds = process_seconds();
    text += format("; %.3g s", seconds);
    if (fresh > 0)
      text += format(", %.3g s of them before the first variant and %.3g s a variant",
                     seconds - count.seconds, count.seconds / static_cast<double>(fresh));
    if (count.cache.use != CacheUse::None) text += "; base set-up " + cache_text(count.cache);
    text += "\n";
    return command.report.empty() ? text : text + "report: " + command.report.string() + "\n";
  }

  static constexpr double kSetUpShare = 0.1;  // of the bar; roughly, for variants take the most

  ProgressBar bar_;
  WholeProgress whole_;
  std::vector<ResultRow> failed_;
};

// The page of all variants, from the rows that the folder holds, those of all shards.
void write_overview(const fs::path& page, const BatchFolder& folder,
                    const VariantPictures& pictures) {
  const BatchIdentity identity = folder.read_identity();
  const VariantList list = folder.read_list();
  const std::map<std::string, ResultRow> rows = folder.read_rows();
  Overview overview{.base = identity.base,
                    .mesh = identity.mesh,
                    .carried_columns = list.carried_columns,
                    .variants = {},
                    .no_picture = pictures.failure()};
  for (const Variant& variant : list.variants) {
    const auto row = rows.find(variant.id);
    const bool is_done = row != rows.end();
    const bool has_result = is_done && row->second.figures;
    overview.variants.push_back({.id = variant.id,
                                 .carried = variant.carried,
                                 .row = is_done ? std::optional(row->second) : std::nullopt,
                                 .picture = has_result ? pictures.read(variant.id) : ""});
  }
  write_text(page, overview_page(overview));
}

ExitCode code_of(const BatchCount& count) {
  if (count.is_stopped) return static_cast<ExitCode>(128 + interrupt);
  return count.failed > 0 ? ExitCode::PartialFailure : ExitCode::Done;
}

ExitCode run(const BatchCommand& command, BatchOptions options) {
  set_thread_count(command.threads);
  take_interrupts();
  BatchDisplay display(command.is_quiet);
  options.pipeline.progress = display.phases();
  VariantPictures pictures(command.folder);
  if (!command.report.empty())
    options.on_result = [&](const Variant& variant, const MorphResult& result) {
      pictures.draw(variant.id, result);
    };
  const BatchCount count =
      run_batch(options, is_interrupted,
                [&](const ResultRow& row, const BatchCount& c) { display.take(row, c); });
  if (!command.report.empty()) {
    pictures.finish();
    // Those of one shard don't make the page: --collect does, of all.
    if (options.shard.count == 1)
      write_overview(command.report, BatchFolder(command.folder, {}), pictures);
  }
  display.end(command, count);
  if (!pictures.failure().empty() && !command.is_quiet)
    std::fprintf(stderr, "cadmorph: warning: there is no picture: %s\n",
                 pictures.failure().c_str());
  return code_of(count);
}

// Merges the rows of all shards and names the variants without one.
ExitCode collect(const BatchCommand& command) {
  BatchFolder folder(command.collected, {});
  const VariantList list = folder.read_list();
  const std::map<std::string, ResultRow> rows = folder.read_rows();
  folder.write_rows(list, rows);
  if (!command.report.empty())
    write_overview(command.report, folder, VariantPictures(command.collected));
  BatchCount count{.total = static_cast<Index>(list.variants.size())};
  std::string missing, failed;
  Index missing_count = 0, failed_count = 0;
  for (const Variant& variant : list.variants) {
    const auto row = rows.find(variant.id);
    const bool is_done = row != rows.end() && row->second.exit_code == 0;
    if (row == rows.end() || (is_done && !folder.holds_mesh(row->second))) {
      if (++missing_count <= kListed) missing += "  " + variant.id + "\n";
    } else if (row->second.exit_code != 0 && ++failed_count <= kListed) {
      failed += line_of(row->second);
    }
  }
  count.done = count.total - missing_count - failed_count;
  if (!command.is_quiet)
    print(with_commas(count.done) + " of " + with_commas(count.total) + " variants done in " +
          command.collected.string() + (missing_count > 0 ? "\n" : "; results.csv has them all\n"));
  if (failed_count > 0)
    std::fprintf(stderr, "cadmorph: error: %s failed\n%s", with_commas(failed_count).c_str(),
                 failed.c_str());
  if (missing_count > 0)
    std::fprintf(stderr, "cadmorph: error: %s missing; run their shards again with --resume\n%s",
                 with_commas(missing_count).c_str(), missing.c_str());
  return missing_count + failed_count > 0 ? ExitCode::PartialFailure : ExitCode::Done;
}

BatchOptions options_of(const CLI::App& parser, const BatchCommand& command) {
  check_files(command);
  const std::string extension = mesh_extension(command.mesh);
  BatchOptions options;
  options.base_cad = command.base;
  options.mesh = command.mesh;
  options.folder = command.folder;
  options.list = command.manifest.empty() ? list_variants(command.steps, extension)
                                          : read_manifest(command.manifest, extension);
  options.shard =
      command.shard.empty() ? shard_of_environment(command.shards) : parse_shard(command.shard);
  options.is_resumed = command.is_resumed;
  options.has_diagnostics = command.has_diagnostics;
  options.timeout_s = command.timeout_s;
  options.pipeline = resolve(command.options);
  options.program = std::string("cadmorph ") + kVersion;
  options.options_text = options_text(parser, command);
  return options;
}

// The reader processes of a batch are this program, too.
void add_step_reader(CLI::App& app, Action& action) {
  CLI::App* parser = app.add_subcommand("read-step", "")->group("");
  parser->callback([&action] {
    action.run = [] {
      serve_step_files();
      return ExitCode::Done;
    };
  });
}

}  // namespace

void add_batch_command(CLI::App& app, Action& action) {
  const auto command = std::make_shared<BatchCommand>();
  CLI::App* parser = app.add_subcommand("batch", "morph onto many variants");
  parser->footer(
      help_end({"batch wing.step wing.vtu variants/*.step -o out --report out/overview.html",
                "batch wing.step wing.vtu --manifest variants.csv -o out --resume"},
               {0, 1, 2, 4, 6, 8}));
  add_options(*parser, *command);
  parser->callback([parser, &action, command] {
    check_extension("--report", command->report, {".html", ".htm"});
    check_outputs({{"--report", command->report}}, {command->base, command->mesh});
    if (!command->collected.empty()) {
      if (!command->base.empty() || !command->folder.empty() || !command->manifest.empty())
        throw UsageError("--collect takes the folder of a batch alone, and --report");
      action.run = [command] { return collect(*command); };
      return;
    }
    put_in_order(*command);
    const BatchOptions options = options_of(*parser, *command);
    action.run = [command, options] { return run(*command, options); };
  });
  add_step_reader(app, action);
}

}  // namespace cadmorph
