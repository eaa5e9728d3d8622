#pragma once

#include <optional>
#include <string>
#include <vector>

#include "cad/topology_match.h"
#include "cad_variants.h"

namespace cadmorph::testing {

/// Two CAD models of which it is known what became what: a row of the corpus.
struct KnownPair {
  /// A family of known_parts.
  const char* part;
  /// What changed: names of dimensions, each with a factor or, signed, an addition, such as
  /// "length 1.3 x +5"; then what moved the whole: "turn" about (1, 2, 3), "spin" about z
  /// (radians), "move" along (3, -7, 11) (millimetres), "scale", "mirror", "sheared", "bent".
  const char* change;
  /// How the variant was written: "order" of entities, "planes", "edges" and "surfaces" reversed,
  /// "seams" and "splits" of them and of edges by a vertex, closed faces "cut", "nurbs", "step".
  const char* written;
  const char* base_written = "";  ///< the same of the base
};

/// All rows.
const std::vector<KnownPair>& known_pairs();

std::string to_string(const KnownPair& pair);

/// A model whose faces have names.
struct KnownModel {
  TopoDS_Shape shape;
  CadModel model;
  std::optional<CadModel> numbered;  ///< the one that has the names, where the file renumbers faces
  std::vector<std::string> names;    ///< of the faces: of one name in both models, one face
};

struct MadePair {
  KnownModel base, variant;
  std::optional<gp_Trsf> motion;  ///< that carries the base exactly onto the variant, if any
  bool is_round;                  ///< which may spin besides
};

MadePair make(const KnownPair& pair);

/// What is wrong with a match of the pair: a line, or nothing. Faces, curves and corners must
/// become those between faces of the same names, a known motion must be found, and what did not
/// move stays.
std::string judge(const MadePair& pair, const MatchedModels& matched);

/// The same of match_models; an error's text where it throws.
std::string outcome(const MadePair& pair);

}  // namespace cadmorph::testing
