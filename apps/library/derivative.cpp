#include "apps/library/derivative.h"

#include <utility>

#include "apps/library/impl.h"
#include "apps/pipeline/design_velocity.h"

namespace cadmorph::v1 {

struct Derivative::Impl {
  VolumeDerivative map;
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
};

Velocity::Velocity(std::shared_ptr<const Impl> impl) : impl_(std::move(impl)) {}

const Points& Velocity::surface() const { return impl_->surface.velocity; }
const Points& Velocity::nodes() const { return impl_->nodes; }
double Velocity::motion_mm() const { return impl_->surface.motion; }
double Velocity::unevenness() const { return impl_->surface.unevenness; }
const std::vector<std::string>& Velocity::warnings() const { return impl_->surface.warnings; }

Derivative make_derivative(const MorphJob& job, const Points& surface_positions) {
  return Derivative(std::make_shared<const Derivative::Impl>(
      Derivative::Impl{job.volume().derivative(surface_positions)}));
}

Velocity make_velocity(const MorphJob& job, const cadmorph::CadModel& plus,
                       const cadmorph::CadModel& minus, double step) {
  auto impl = std::make_shared<Velocity::Impl>();
  impl->surface = surface_velocity(job, {plus, minus, step});
  impl->nodes = carry_inside(job, impl->surface).velocity;
  return Velocity(std::move(impl));
}

}  // namespace cadmorph::v1
