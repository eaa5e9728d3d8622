#include <cmath>

#include "core/errors.h"
#include "core/rbf/rbf_field_impl.h"

namespace cadmorph {

Kernel in_units(Kernel kernel, double unit) {
  kernel.shape *= unit;
  return kernel;
}

double log_scale(const Kernel& kernel, double unit) {
  const bool has_log = kernel.kind == KernelKind::Polyharmonic && kernel.dimension % 2 == 0;
  return has_log && kernel.cpd_order() > 2 ? std::log(unit) : 0;
}

UnitTargets unit_targets(const CentreFrame& frame, const KernelSum& sum, const RowMatrix& targets,
                         const H2Matrix* far_field) {
  if (targets.cols() != frame.dimension())
    throw InvalidInputError("RBF field: targets of dimension " + std::to_string(targets.cols()) +
                            " for centres of dimension " + std::to_string(frame.dimension()));
  return {sum, frame.to_unit(targets), far_field};
}

RowMatrix RbfField::evaluate(const RowMatrix& targets) const {
  return unit_targets(impl_->frame, impl_->sum, targets, impl_->field.far_field.get())
      .evaluate({&impl_->field})
      .front();
}

FieldTerms RbfField::terms() const {
  const CentreFrame& frame = impl_->frame;
  if (frame.dimension() != 3 || log_scale(impl_->kernel, 2) != 0)
    throw InvalidInputError(
        "RBF field: terms are given for fields in space and kernels without a "
        "logarithm");
  FieldTerms terms;
  terms.origin = frame.centre();
  terms.unit = frame.unit();
  terms.kernel = in_units(impl_->kernel, frame.unit());
  describe(impl_->field, terms);
  return terms;
}

const RbfReport& RbfField::report() const { return impl_->report; }

std::vector<RowMatrix> RbfTargets::evaluate(const std::vector<RbfField>& fields) const {
  std::vector<const UnitField*> unit_fields;
  for (const RbfField& field : fields) unit_fields.push_back(&field.impl_->field);
  return impl_->targets.evaluate(unit_fields);
}

}  // namespace cadmorph
