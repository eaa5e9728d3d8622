#pragma once

#include <TopoDS_Shape.hxx>
#include <compare>
#include <functional>
#include <map>
#include <string>
#include <vector>

namespace cadmorph::testing {

/// A shape whose faces have names that don't depend on its dimensions: by the primitive and the
/// number that a face has there, carried on through all operations by OCCT's own history.
struct NamedShape {
  TopoDS_Shape shape;
  std::vector<std::string> names;  ///< of the faces, in the order of the CadModel
};

/// Dimensions of a part by their names. An unknown name throws.
class Sizes {
 public:
  Sizes(std::initializer_list<std::pair<const std::string, double>> sizes) : sizes_(sizes) {}
  double operator()(const std::string& name) const { return sizes_.at(name); }
  double& operator[](const std::string& name) { return sizes_.at(name); }
  bool has(const std::string& name) const { return sizes_.contains(name); }
  auto operator<=>(const Sizes&) const = default;

 private:
  std::map<std::string, double> sizes_;
};

/// A family of parts: one for each set of dimensions (millimetres, radians).
struct KnownPart {
  std::string name;
  Sizes sizes;  ///< those of the base
  std::function<NamedShape(const Sizes&)> make;
  bool is_round = false;  ///< may spin about an axis without a change of its shape
};

/// The family of that name; throws where there is none.
const KnownPart& known_part(const std::string& name);

}  // namespace cadmorph::testing
