// The CAD of the large families, made in memory: the files are not kept.

#include <BRepGProp.hxx>
#include <GProp_GProps.hxx>
#include <catch2/catch.hpp>
#include <functional>

#include "models/canister.h"
#include "models/courier.h"
#include "models/step_files.h"
#include "models/wing.h"

using namespace cadmorph;
using namespace cadmorph::models;

namespace {

struct Family {
  std::string name;
  std::function<TopoDS_Shape(double)> make;
  EntityCounts counts;  ///< as the family's README says
};

double volume(const TopoDS_Shape& shape) {
  GProp_GProps properties;
  BRepGProp::VolumeProperties(shape, properties, 1e-8);
  return properties.Mass();
}

}  // namespace

TEST_CASE("families are valid and keep their topology from the base to 150 %", "[models]") {
  const Family family = GENERATE(Family{"canister", make_canister, {9, 18, 10}},
                                 Family{"courier", make_courier, {116, 282, 176}},
                                 Family{"wing", make_wing, {4, 6, 4}});
  CAPTURE(family.name);
  for (const double change : {0., 0.5, 1., 1.5}) {
    CAPTURE(change);
    const TopoDS_Shape shape = family.make(change);
    REQUIRE_NOTHROW(check_valid(shape, family.name));
    CHECK(count_entities(shape) == family.counts);
  }
}

TEST_CASE("the wing has the volume of its sections", "[models]") {
  // A ruled wing between sections of one shape: area of the profile times the integral of the
  // squared chord. The area, of the profile's formula integrated by hand: NACA 0012's polynomial
  // gives 2 * 5 t (2/3 a0 + a1/2 + a2/3 + a3/4 + a4/5), the widened trailing edge 2 * 0.004 / 2.
  const double profile =
      10 * 0.12 * (0.2969 * 2 / 3 - 0.1260 / 2 - 0.3516 / 3 + 0.2843 / 4 - 0.1015 / 5) + 0.004;
  const double squared_chord = (1000. * 1000 + 1000. * 600 + 600. * 600) / 3;
  // 61 points of a cubic spline: fourth order, 1e-6 of the area.
  CHECK(volume(make_wing(0)) == Approx(1500 * squared_chord * profile).epsilon(1e-5));
}
