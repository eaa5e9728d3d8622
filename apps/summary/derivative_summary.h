#pragma once

#include <string>

#include "apps/pipeline/design_velocity.h"

namespace cadmorph {

/// A velocity and a gradient as a summary, as JSON, and the gradient as a table (name, gradient,
/// step, max_speed).
std::string velocity_text(const VelocityReport& report);
std::string velocity_json(const VelocityReport& report, int exit_code);
std::string gradient_text(const GradientReport& report);
std::string gradient_json(const GradientReport& report, int exit_code);
std::string gradient_csv(const GradientReport& report);

}  // namespace cadmorph
