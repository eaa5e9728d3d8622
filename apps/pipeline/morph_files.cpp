#include "apps/pipeline/morph_files.h"

#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <ctime>
#include <fstream>
#include <future>
#include <numeric>
#include <sstream>

#include "apps/pipeline/likely_mistake.h"
#include "apps/pipeline/output_file.h"
#include "cad/step_reader.h"
#include "core/stopwatch.h"

namespace cadmorph {
namespace {

namespace fs = std::filesystem;

// Adds times to those of phases of the same names.
void add_phases(std::vector<PhaseTime>& all, const std::vector<PhaseTime>& more) {
  for (const PhaseTime& phase : more) {
    const auto known = std::ranges::find(all, phase.name, &PhaseTime::name);
    if (known == all.end())
      all.push_back(phase);
    else
      known->seconds += phase.seconds;
  }
}

double sum(const std::vector<PhaseTime>& phases) {
  return std::accumulate(phases.begin(), phases.end(), 0.0,
                         [](double total, const PhaseTime& p) { return total + p.seconds; });
}

// The morphs of one trip, one after the other.
class Trip {
 public:
  Trip(const MorphFiles& files, const PipelineOptions& options)
      : files_(files), options_(options), targets_(files.via) {
    targets_.push_back(files.variant_cad);
  }

  PipelineReport run() {
    read();
    for (leg_ = 0; leg_ < targets_.size(); ++leg_) {
      run_leg();
      if (result_.report.outcome != Outcome::Done) break;
    }
    return write();
  }

 private:
  bool is_series() const { return targets_.size() > 1; }

  // STEP is read by one thread at a time, each variant while the side before it is at work. The
  // mesh is read beside them by this thread, whose part of the heap may have huge pages
  // (apps/main.cpp).
  void read() {
    PhaseClock clock(options_.progress);
    clock.start("reading");
    for (const fs::path& target : targets_) check_step_file(target);
    auto base = std::async(std::launch::async, [&] {
      auto model = std::make_shared<const CadModel>(read_cad(files_.base_cad));
      read_ahead(0);
      return model;
    });
    try {
      mesh_ = std::make_shared<const MeshFile>(files_.mesh);
    } catch (...) {
      base.get();  // what is wrong with it is said first
      throw;
    }
    base_ = base.get();
    if (!files_.write) mesh_->check_target(files_.output);
    phases_ = clock.phases();
  }

  void read_ahead(std::size_t leg) {
    if (leg < targets_.size())
      variant_ = std::async(std::launch::async, [this, leg] { return read_cad(targets_[leg]); });
  }

  CadModel read_cad(const fs::path& path) const {
    return files_.read_cad ? files_.read_cad(path) : read_step(path);
  }

  PipelineOptions leg_options() const {
    PipelineOptions options = options_;
    if (leg_ > 0) options.surface.association.mesh_unit_mm = whole_.mesh.unit_mm;
    if (leg_ + 1 == targets_.size()) return options;
    options.min_scaled_jacobian.reset();
    // Nodes that slid would not go back the way they came; they slide where the next leg would
    // start from a mesh much worse than the file's.
    if (options.quality == QualityMode::Best) options.quality = QualityMode::WhereHalfIsLost;
    return options;
  }

  void run_leg() {
    set_up();
    PhaseClock clock;
    clock.start("reading");
    base_ = std::make_shared<const CadModel>(variant_.get());
    add_phases(phases_, clock.phases());
    read_ahead(leg_ + 1);
    result_ = job_->morph(*base_);
    const PipelineReport& report = result_.report;
    if (files_.on_leg && report.outcome == Outcome::Done) files_.on_leg(result_);
    if (leg_ == 0) whole_ = report;
    if (is_series()) add_leg(report);
    add_phases(phases_, report.run.phases);
  }

  void set_up() {
    try {
      job_.emplace(base_, mesh_, leg_options(), std::move(result_.positions));
    } catch (const AssociationError& error) {
      if (leg_ > 0) throw;
      const double given = options_.surface.association.mesh_unit_mm;
      throw AssociationError(likely_mistake(*base_, variant_.get(), mesh_->mesh(), given) +
                             error.what());
    }
  }

  void add_leg(const PipelineReport& report) {
    legs_.push_back({report.cad.variant, report.cad.matched_by, report.after, report.stepping,
                     report.untangling, sum(report.run.phases)});
    const std::string name = "on the way to " + targets_[leg_].string() + ": ";
    for (const std::string& warning : report.run.warnings) warnings_.push_back(name + warning);
    for (const std::string& note : report.run.notes) notes_.push_back(name + note);
  }

  PipelineReport write() {
    PhaseClock clock(options_.progress);
    if (files_.on_result) {
      clock.start("report");
      files_.on_result(result_);
    }
    clock.start("writing");
    const WrittenMesh written = files_.write
                                    ? files_.write(result_)
                                    : write_result(result_, files_.output, files_.has_diagnostics);
    add_phases(phases_, clock.phases());
    PipelineReport report = is_series() ? series_report() : result_.report;
    report.run.written = written.path;
    report.run.rounding = written.rounding;
    phases_.push_back({"other", std::max(0.0, whole_job_.seconds() - sum(phases_))});
    report.run.phases = phases_;
    report.run.seconds = sum(phases_);
    report.run.peak_memory = peak_memory();
    return report;
  }

  PipelineReport series_report() {
    PipelineReport report = result_.report;
    report.cad.base = whole_.cad.base;
    report.before = whole_.before;
    report.run.cache = whole_.run.cache;
    report.mesh.is_unit_detected = whole_.mesh.is_unit_detected;
    report.run.warnings = std::move(warnings_);
    report.run.notes = std::move(notes_);
    report.max_displacement =
        report.mesh.unit_mm *
        (result_.positions - mesh_->mesh().points).rowwise().norm().maxCoeff();
    report.legs = std::move(legs_);
    return report;
  }

  const MorphFiles& files_;
  const PipelineOptions& options_;
  std::vector<fs::path> targets_;  ///< a leg each
  std::size_t leg_ = 0;
  Stopwatch whole_job_;
  std::shared_ptr<const CadModel> base_;
  std::shared_ptr<const MeshFile> mesh_;
  std::future<CadModel> variant_;
  std::optional<MorphJob> job_;
  MorphResult result_;
  PipelineReport whole_;  ///< of the first leg
  std::vector<LegReport> legs_;
  std::vector<std::string> warnings_, notes_;
  std::vector<PhaseTime> phases_;
};

}  // namespace

std::vector<fs::path> MorphFiles::inputs() const {
  std::vector<fs::path> all = {base_cad, variant_cad, mesh};
  all.insert(all.end(), via.begin(), via.end());
  return all;
}

double process_seconds() {
  // The 22nd field, counted after the name in brackets, is the start in clock ticks since boot.
  std::ifstream file("/proc/self/stat");
  std::string text;
  std::getline(file, text);
  std::istringstream fields(text.substr(std::min(text.size(), text.rfind(')') + 1)));
  std::string field;
  for (int i = 3; i <= 21; ++i) fields >> field;
  double ticks = 0;
  timespec now{};
  if (!(fields >> ticks) || clock_gettime(CLOCK_BOOTTIME, &now) != 0) return 0;
  const double seconds = static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
  return std::max(0.0, seconds - ticks / static_cast<double>(sysconf(_SC_CLK_TCK)));
}

double peak_memory() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return 1024.0 * static_cast<double>(usage.ru_maxrss);
}

PipelineReport morph_files(const MorphFiles& files, const PipelineOptions& options) {
  if (!files.via.empty() && !options.face_map.empty())
    throw InvalidInputError(
        "a face map names faces of two CAD models and can't be used with models on the way");
  check_mesh_output(files.output, files.inputs());
  return Trip(files, options).run();
}

}  // namespace cadmorph
