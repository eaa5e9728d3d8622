#include "apps/summary/whole_progress.h"

#include <algorithm>
#include <array>

namespace cadmorph {
namespace {

/// From where to where a phase goes in a morph: rough, for what takes long differs by part.
struct Span {
  std::string_view phase;
  double from, to;
};

constexpr std::string_view kFirstOfMorph = "boundary";
constexpr std::array<Span, 17> kSpans{{{"reading", 0, 0.1},
                                       {kFirstOfMorph, 0.1, 0.13},
                                       {"association", 0.13, 0.25},
                                       {"associating", 0.13, 0.25},
                                       {"volume set-up", 0.25, 0.35},
                                       {"preparing the solver", 0.25, 0.35},
                                       {"quality before", 0.35, 0.4},
                                       {"cache reading", 0.1, 0.4},
                                       {"cache writing", 0.4, 0.42},
                                       {"matching", 0.42, 0.45},
                                       {"surface morph", 0.45, 0.5},
                                       {"volume morph", 0.5, 0.75},
                                       {"solving", 0.5, 0.75},
                                       {"untangling", 0.75, 0.9},
                                       {"untangle", 0.75, 0.9},
                                       {"quality after", 0.9, 0.95},
                                       {"report", 0.95, 0.97}}};
constexpr Span kLast{"writing", 0.97, 1};

}  // namespace

double WholeProgress::operator()(std::string_view phase, double fraction) {
  if (phase == kFirstOfMorph) begun_ = std::min(begun_ + 1, morphs_);
  const auto known = std::ranges::find(kSpans, phase, &Span::phase);
  const bool is_last = phase == kLast.phase;
  if (known == kSpans.end() && !is_last) return done_;
  const Span& span = is_last ? kLast : *known;
  const double part = span.from + std::clamp(fraction, 0.0, 1.0) * (span.to - span.from);
  done_ = std::max(done_, (std::max(begun_ - 1, 0) + part) / morphs_);
  return done_;
}

}  // namespace cadmorph
