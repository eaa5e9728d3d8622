#include <exception>

#include "apps/library/derivative.h"
#include "apps/library/impl.h"
#include "apps/summary/json_report.h"
#include "apps/summary/summary.h"

namespace cadmorph::v1 {
namespace {

// Gives the callback of one call to the teller, and takes it back.
class Telling {
 public:
  Telling(Teller& teller, const Progress& progress) : teller_(teller) {
    teller_.progress = progress ? &progress : nullptr;
  }
  ~Telling() { teller_.progress = nullptr; }
  Telling(const Telling&) = delete;
  Telling& operator=(const Telling&) = delete;

 private:
  Teller& teller_;
};

void check_outcome(const PipelineReport& report) {
  if (report.outcome == cadmorph::Outcome::Done) return;
  throw QualityError(bad_cells_text(report) + ":\n" + diagnosis_text(*report.diagnosis) +
                     "  keep_refused returns such a result");
}

std::unique_lock<std::mutex> lock_or_refuse(std::mutex& at_work) {
  std::unique_lock lock(at_work, std::try_to_lock);
  if (!lock)
    throw InvalidInputError(
        "this Morpher is at work for another call (in another thread, or the one whose progress "
        "callback this is): wait for its end, or make a Morpher for each thread");
  return lock;
}

}  // namespace

void Teller::operator()(std::string_view phase, double fraction) const {
  if (progress && !(*progress)(phase, fraction)) throw CancelSignal();
}

Morpher::Impl::Impl(const CadModel& base_cad, const Mesh& base_mesh, PipelineOptions options,
                    const Progress& progress)
    : base(base_cad), mesh(base_mesh) {
  use_fitting_blas_kernel();
  options.progress = [this](std::string_view phase, double fraction) { teller(phase, fraction); };
  const Telling telling(teller, progress);
  const Mesh::Impl& inner = mesh.impl();
  job.emplace(base.impl().model, inner.file, std::move(options),
              inner.moved ? inner.moved->points : Points());
  surface_nodes = job->base().volume->surface_nodes();
  report = report_of(job->base().report);
}

Morpher::Morpher(const CadModel& base, const Mesh& mesh, const MorphOptions& options,
                 const Progress& progress)
    : impl_(at_door(
          [&] { return std::make_shared<Impl>(base, mesh, inner_options(options), progress); })) {}

MorphResult Morpher::morph(const CadModel& variant, const MorphCall& call) const {
  return at_door([&] {
    const auto lock = lock_or_refuse(impl_->at_work);
    const Telling telling(impl_->teller, call.progress);
    auto result = std::make_shared<MorphResult::Impl>();
    result->morpher = impl_;
    result->result = impl_->job->morph(*variant.impl().model);
    PipelineReport& report = result->result.report;
    for (const cadmorph::PhaseTime& phase : report.run.phases) report.run.seconds += phase.seconds;
    report.run.peak_memory = peak_memory();
    if (!call.keep_refused) check_outcome(report);
    result->report = report_of(report);
    return MorphResult(std::move(result));
  });
}

void Morpher::warp_to(const Points& surface_positions, double* result) const {
  at_door([&] {
    const auto lock = lock_or_refuse(impl_->at_work);
    Eigen::Map<Points>(result, impl_->mesh.node_count(), 3) =
        impl_->job->base().volume->morph(surface_positions);
  });
}

void Morpher::slide_to(const Points& surface_positions, double* result) const {
  at_door([&] {
    const auto lock = lock_or_refuse(impl_->at_work);
    Eigen::Map<Points>(result, surface_positions.rows(), 3) = impl_->job->slide(surface_positions);
  });
}

Derivative Morpher::derivative(const Points& surface_positions, const DerivativeCall& call) const {
  return at_door([&] {
    const auto lock = lock_or_refuse(impl_->at_work);
    return make_derivative(*impl_->job, surface_positions, call);
  });
}

Derivative Morpher::derivative(const DerivativeCall& call) const {
  return derivative(impl_->job->base().mesh().points(impl_->surface_nodes, Eigen::all), call);
}

Velocity Morpher::velocity(const ParameterPair& pair, const VelocityCall& call) const {
  return at_door([&] {
    const auto lock = lock_or_refuse(impl_->at_work);
    return make_velocity(*impl_->job, pair, call);
  });
}

std::vector<ParameterGradient> Morpher::gradient(const RowMatrix& sensitivity,
                                                 const std::vector<Parameter>& parameters,
                                                 const GradientCall& call) const {
  return at_door([&] {
    const auto lock = lock_or_refuse(impl_->at_work);
    const Telling telling(impl_->teller, call.progress);
    return make_gradient(*impl_->job, sensitivity, parameters, call.present, impl_->teller);
  });
}

std::vector<ParameterGradient> Morpher::gradient_of_files(
    const RowMatrix& sensitivity, const std::vector<ParameterFiles>& parameters,
    const GradientCall& call) const {
  return at_door([&] {
    const auto lock = lock_or_refuse(impl_->at_work);
    const Telling telling(impl_->teller, call.progress);
    return make_gradient(*impl_->job, sensitivity, parameters, call.present, impl_->teller);
  });
}

void Morpher::linearise(const std::vector<CadModel>& models) {
  at_door([&] {
    const auto lock = lock_or_refuse(impl_->at_work);
    std::vector<cadmorph::CadModel> given;
    for (const CadModel& model : models) given.push_back(*model.impl().model);
    impl_->job->linearise(given);
  });
}

const CadModel& Morpher::base() const { return impl_->base; }
const Mesh& Morpher::mesh() const { return impl_->mesh; }
const Report& Morpher::report() const { return impl_->report; }
const std::vector<Index>& Morpher::surface_nodes() const { return impl_->surface_nodes; }

MorphResult::MorphResult(std::shared_ptr<const Impl> impl) : impl_(std::move(impl)) {}

const Points& MorphResult::positions() const { return impl_->result.positions; }
const Report& MorphResult::report() const { return impl_->report; }
const Mesh& MorphResult::mesh() const { return impl_->morpher->mesh; }
std::string MorphResult::summary() const { return summary_text(impl_->result.report); }

std::string MorphResult::json() const {
  constexpr int kDone = 0, kRefused = 5;
  const PipelineReport& report = impl_->result.report;
  return to_json(report, report.outcome == cadmorph::Outcome::Done ? kDone : kRefused);
}

WrittenMesh MorphResult::write(const std::filesystem::path& path, bool has_diagnostics) const {
  return at_door([&] {
    const cadmorph::WrittenMesh written = write_result(impl_->result, path, has_diagnostics);
    return WrittenMesh{.path = written.path,
                       .largest_rounding = written.rounding.largest,
                       .largest_rounding_per_edge = written.rounding.relative};
  });
}

}  // namespace cadmorph::v1
