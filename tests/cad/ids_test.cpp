#include "cad/ids.h"

#include <catch2/catch.hpp>
#include <concepts>
#include <vector>

#include "cad/topology_match.h"

using namespace cadmorph;

namespace {

template <class Vector, class Key>
concept FoundBy = requires(Vector vector, Key key) {
  vector[key];
};
template <class A, class B>
concept Comparable = requires(A a, B b) {
  a == b;
};

}  // namespace

TEST_CASE("Ids of one kind are no numbers of another kind", "[cad][ids]") {
  using Faces = IdVector<FaceId, CadFace>;
  STATIC_REQUIRE(FoundBy<Faces, FaceId>);
  STATIC_REQUIRE_FALSE(FoundBy<Faces, EdgeId>);
  STATIC_REQUIRE_FALSE(FoundBy<Faces, int>);
  STATIC_REQUIRE_FALSE(FoundBy<Faces, std::size_t>);
  // vertices()[corners[match.corners[curve]]]
  STATIC_REQUIRE(FoundBy<decltype(TopologyMatch::corners), CornerId>);
  STATIC_REQUIRE_FALSE(FoundBy<decltype(TopologyMatch::corners), CurveId>);
  STATIC_REQUIRE_FALSE(std::constructible_from<FaceId, EdgeId>);
  STATIC_REQUIRE_FALSE(std::convertible_to<int, FaceId>);
  STATIC_REQUIRE(Comparable<FaceId, FaceId>);
  STATIC_REQUIRE_FALSE(Comparable<FaceId, EdgeId>);
}

TEST_CASE("the Ids of a vector go through all its places", "[cad][ids]") {
  const IdVector<EdgeId, double> lengths{3, 4, 5};
  std::vector<double> seen;
  for (const EdgeId edge : lengths.ids()) seen.push_back(lengths[edge] + edge);
  CHECK(seen == std::vector<double>{3, 5, 7});
  CHECK(EdgeId() == -1);
}
