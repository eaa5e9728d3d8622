#pragma once

#include <map>
#include <string>
#include <vector>

#include "apps/pipeline/morph_details.h"

namespace cadmorph {

/// Pairs of base and variant entities of one kind.
struct MatchTable {
  struct Row {
    std::string base, variant;  ///< numbers as `cadmorph match` prints them, and types of faces
    std::string confidence;     ///< 0 to 1
    std::string name;
  };
  std::string kind;  ///< "face", "edge" or "vertex"
  std::vector<Row> rows;
};

/// The face, edge and vertex pairs of a match.
std::vector<MatchTable> match_tables(const CadModel& base, const CadModel& variant,
                                     const TopologyMatch& match);

/// What the report page shows beside the figures.
struct PageContents {
  MorphDetails details;
  std::vector<MatchTable> matches;
  std::vector<std::string> variant_face_types;
  std::filesystem::path pictured_base;          ///< CAD model the morph in the pictures is from
  double pictured_move = 0;                     ///< its largest displacement, millimetres
  std::string surface;                          ///< JSON, see surface_data
  std::string surface_note;                     ///< what the 3D view leaves out; may be empty
  std::map<std::string, std::string> pictures;  ///< bytes of PNG files by their names
  std::string no_picture;                       ///< why there are none
};

/// The report as one HTML page that needs no other file.
std::string report_page(const PipelineReport& report, const PageContents& contents, int exit_code);

}  // namespace cadmorph
