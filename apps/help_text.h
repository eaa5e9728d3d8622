#pragma once

#include <array>
#include <string_view>

namespace cadmorph {

/// A page of docs, put into the program by the build.
struct HelpTopic {
  std::string_view name, text;
};

/// The first tells of the exit codes.
extern const std::array<HelpTopic, 4> kHelpTopics;

}  // namespace cadmorph
