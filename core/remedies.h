#pragma once

#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace cadmorph {

/// What a user can do about an error, a warning or a poor result: settings of a morph, each of
/// which a program has its own words for.
enum class Remedy {
  MeshUnit,              ///< say what the mesh's unit is
  AssociationTolerance,  ///< allow surface nodes farther off the CAD
  Snap,                  ///< put surface nodes exactly on the CAD
  Unmatched,             ///< choose what boundary patches on no CAD face do
  KeepUnmatched,         ///< let them be
  SlideUnmatched,        ///< let them slide on their own surface
  ExpectUnmatched,       ///< say that they are meant, and what they do
  Method,                ///< another method of the volume morph
  RbfMethod,             ///< radial basis functions for it
  ListPairs,             ///< look at the pairs of faces that were found
  FaceMap,               ///< give the pairs of faces
  Via,                   ///< go there by CAD models between
  Improve,               ///< raise elements below a quality
  MoreSteps,             ///< go in several steps
  KeepLayers,            ///< have layers keep their heights
  InvertedInput,         ///< accept elements that are inverted in the input already
  AutomaticUntangling,   ///< let inverted elements be repaired
  AutomaticSteps,        ///< let the number of steps grow
  Cache,                 ///< another file for what is kept of a base
  AllFigures,            ///< see what a summary leaves out
  Count
};

/// How a remedy is asked for, as a part of a message: in plain words, or in those of the program.
std::string words_for(Remedy remedy);

/// Has messages name remedies in a program's own words; remedies that are not named keep the plain
/// ones. To be called once, before any work.
void set_remedy_words(const std::vector<std::pair<Remedy, std::string_view>>& words);

}  // namespace cadmorph
