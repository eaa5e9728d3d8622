#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "apps/batch/batch_results.h"

namespace cadmorph {

/// A variant of a batch as the overview shows it.
struct OverviewVariant {
  std::string id;
  std::vector<std::string> carried;  ///< one a carried column
  std::optional<ResultRow> row;      ///< none where it is not done yet
  std::string picture;               ///< PNG; empty for none
};

struct Overview {
  std::string base, mesh;  ///< what all variants are of
  std::vector<std::string> carried_columns;
  std::vector<OverviewVariant> variants;
  std::string no_picture;  ///< why there is none; empty where there are
};

/// A page of HTML, whole in itself: the variants with their pictures, quality and time, sortable by
/// every column, those that failed with their reason, and any of them side by side.
std::string overview_page(const Overview& overview);

}  // namespace cadmorph
