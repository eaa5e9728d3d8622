#include "apps/library/derivative.h"

#include <functional>
#include <string>
#include <utility>

#include "apps/pipeline/design_velocity.h"
#include "apps/pipeline/morph_derivative.h"
#include "apps/pipeline/step_queue.h"

namespace cadmorph::v1 {

namespace {

ParameterModels models_of(const ParameterPair& pair) {
  return {*pair.plus.impl().model, *pair.minus.impl().model, pair.step};
}

Points present_surface(const MorphJob& job, const std::optional<CadModel>& present) {
  if (!present) return {};
  return job.morph_surface(*present->impl().model).surface_positions;
}

std::vector<ParameterGradient> gradient_by(const MorphJob& job, const RowMatrix& sensitivity,
                                           const std::vector<std::string>& names,
                                           const std::function<ParameterModels()>& next,
                                           const std::optional<CadModel>& present,
                                           const Teller& teller) {
  const Points positions = present_surface(job, present);
  teller("adjoint", 0);
  const Gradient gradient(job, sensitivity, positions);
  std::vector<ParameterGradient> result;
  for (const std::string& name : names) {
    teller("parameters", static_cast<double>(result.size()) / static_cast<double>(names.size()));
    const SurfaceVelocity velocity = surface_velocity(job, next(), positions);
    result.push_back({.name = name,
                      .gradient = gradient(velocity),
                      .max_speed = velocity.velocity.rowwise().norm().maxCoeff(),
                      .motion_mm = velocity.motion,
                      .warnings = velocity.warnings});
  }
  return result;
}

}  // namespace

struct Derivative::Impl {
  MorphDerivative map;
};

Derivative::Derivative(std::shared_ptr<const Impl> impl) : impl_(std::move(impl)) {}

Index Derivative::node_count() const { return impl_->map.node_count(); }
Index Derivative::surface_count() const { return std::ssize(impl_->map.surface_nodes()); }

void Derivative::forward_to(const RowMatrix& surface, double* result) const {
  at_door([&] {
    Eigen::Map<RowMatrix>(result, node_count(), surface.cols()) = impl_->map.forward(surface);
  });
}

void Derivative::adjoint_to(const RowMatrix& volume, double* result) const {
  at_door([&] {
    Eigen::Map<RowMatrix>(result, surface_count(), volume.cols()) = impl_->map.adjoint(volume);
  });
}

struct Velocity::Impl {
  SurfaceVelocity surface;
  Points nodes;
  RowMatrix errors;
};

Velocity::Velocity(std::shared_ptr<const Impl> impl) : impl_(std::move(impl)) {}

const Points& Velocity::surface() const { return impl_->surface.velocity; }
const Points& Velocity::nodes() const { return impl_->nodes; }
const RowMatrix& Velocity::errors() const { return impl_->errors; }
double Velocity::motion_mm() const { return impl_->surface.motion; }
double Velocity::unevenness() const { return impl_->surface.unevenness; }
const std::vector<std::string>& Velocity::warnings() const { return impl_->surface.warnings; }

Derivative make_derivative(const MorphJob& job, const Points& surface_positions,
                           const DerivativeCall& call) {
  return Derivative(std::make_shared<const Derivative::Impl>(
      Derivative::Impl{job.derivative(surface_positions, call.slide)}));
}

Velocity make_velocity(const MorphJob& job, const ParameterPair& pair, const VelocityCall& call) {
  const Points present = present_surface(job, call.present);
  auto impl = std::make_shared<Velocity::Impl>();
  impl->surface = call.half ? surface_velocity(job, models_of(pair), models_of(*call.half), present)
                            : surface_velocity(job, models_of(pair), present);
  NodeVelocity nodes = carry_inside(job, impl->surface);
  impl->nodes = nodes.velocity;
  impl->errors = std::move(nodes.error);
  return Velocity(std::move(impl));
}

std::vector<ParameterGradient> make_gradient(const MorphJob& job, const RowMatrix& sensitivity,
                                             const std::vector<Parameter>& parameters,
                                             const std::optional<CadModel>& present,
                                             const Teller& teller) {
  std::vector<std::string> names;
  for (const Parameter& parameter : parameters) names.push_back(parameter.name);
  auto at = parameters.begin();
  return gradient_by(
      job, sensitivity, names, [&] { return models_of((at++)->pair); }, present, teller);
}

std::vector<ParameterGradient> make_gradient(const MorphJob& job, const RowMatrix& sensitivity,
                                             const std::vector<ParameterFiles>& parameters,
                                             const std::optional<CadModel>& present,
                                             const Teller& teller) {
  std::vector<std::string> names;
  std::vector<std::filesystem::path> files;
  for (const ParameterFiles& parameter : parameters) {
    names.push_back(parameter.name);
    files.insert(files.end(), {parameter.plus, parameter.minus});
  }
  StepQueue queue(std::move(files));
  auto at = parameters.begin();
  return gradient_by(
      job, sensitivity, names, [&] { return next_models(queue, (at++)->step); }, present, teller);
}

}  // namespace cadmorph::v1
