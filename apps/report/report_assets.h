#pragma once

#include <string_view>

namespace cadmorph {

// The files of apps/report/page, put into the program by the build. The script and its licences are
// empty in a build without npm or its packages.
extern const std::string_view kPageTemplate;
extern const std::string_view kBinTableTemplate;
extern const std::string_view kOverviewTemplate;
extern const std::string_view kPageStyle;
extern const std::string_view kPageScript;
extern const std::string_view kPageLicences;

}  // namespace cadmorph
