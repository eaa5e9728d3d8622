#pragma once

#include "apps/library/impl.h"
#include "apps/library/include/cadmorph/derivative.h"

namespace cadmorph::v1 {

Derivative make_derivative(const MorphJob& job, const Points& surface_positions,
                           const DerivativeCall& call);

Velocity make_velocity(const MorphJob& job, const ParameterPair& pair, const VelocityCall& call);

std::vector<ParameterGradient> make_gradient(const MorphJob& job, const RowMatrix& sensitivity,
                                             const std::vector<Parameter>& parameters,
                                             const std::optional<CadModel>& present,
                                             const Teller& teller);

std::vector<ParameterGradient> make_gradient(const MorphJob& job, const RowMatrix& sensitivity,
                                             const std::vector<ParameterFiles>& parameters,
                                             const std::optional<CadModel>& present,
                                             const Teller& teller);

}  // namespace cadmorph::v1
