#pragma once

#include <optional>
#include <string>

#include "apps/pipeline.h"

namespace cadmorph {

/// The command line asks for something that does not exist or makes no sense.
class UsageError : public Error {
 public:
  using Error::Error;
};

enum class Command { Morph, Quality, Match };

/// What the command line asks for.
struct CommandLine {
  Command command = Command::Morph;
  MorphFiles files;  ///< quality: the mesh alone; match: the two CAD files alone
  PipelineOptions pipeline;
  std::string json;  ///< file for the report, "-" for stdout, empty for none
  std::optional<std::filesystem::path> face_map;
  bool is_quiet = false;
  int threads = 0;  ///< 0: all
};

/// Parses the command line. Returns nothing when it asked for help or the version, which are then
/// printed. Throws UsageError.
std::optional<CommandLine> parse_command_line(int argc, char** argv);

/// Where the morphed mesh goes when not told: `<stem>.morphed.<ext>` beside the mesh.
std::filesystem::path default_output(const std::filesystem::path& mesh);

}  // namespace cadmorph
