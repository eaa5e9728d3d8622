#include "cad_variants.h"

#include <BRepCheck_Analyzer.hxx>
#include <BRepGProp.hxx>
#include <GProp_GProps.hxx>
#include <algorithm>
#include <catch2/catch.hpp>

// The other tests rest on these variants: OCCT must find them valid, with the known volume.

using namespace cadmorph;
using namespace cadmorph::testing;

namespace {

double volume(const TopoDS_Shape& shape) {
  GProp_GProps properties;
  BRepGProp::VolumeProperties(shape, properties);
  return properties.Mass();
}

}  // namespace

TEST_CASE("shuffled and reversed shapes are valid and the same", "[cad][variants]") {
  for (const std::string name :
       {"box", "plate_12_holes", "bracket", "stepped_shaft", "sphere", "torus", "cone_frustum",
        "cone", "cylinder", "blade", "two_blocks", "sphere_in_box"})
    for (const ShuffleOptions& options :
         {ShuffleOptions{.seed = 1}, ShuffleOptions{.seed = 2, .has_reversed_planes = true},
          ShuffleOptions{.seed = 3, .has_reversed_edges = true},
          ShuffleOptions{.seed = 4, .has_reversed_surfaces = true, .probability = 1},
          ShuffleOptions{
              .seed = 5, .has_split_seams = true, .has_split_edges = true, .probability = 1},
          ShuffleOptions{.seed = 6,
          .has_reversed_planes = true,
          .has_reversed_edges = true,
          .has_reversed_surfaces = true,
          .has_split_edges = true}}) {
      DYNAMIC_SECTION(name << ' ' << options.seed) {
        const TopoDS_Shape shape = read_shape(model_file("shapes/" + name + ".step"));
        const Shuffled variant = shuffle(shape, options);
        CHECK(BRepCheck_Analyzer(variant.shape).IsValid());
        // Gauss points of curved faces move with the wires: not exact.
        CHECK(volume(variant.shape) == Approx(volume(shape)).epsilon(1e-4));
        std::vector<int> sorted(variant.faces.begin(), variant.faces.end());
        std::sort(sorted.begin(), sorted.end());
        for (std::size_t f = 0; f < sorted.size(); ++f) CHECK(sorted[f] == static_cast<int>(f));
      }
    }
}

TEST_CASE("moved control points leave shapes valid", "[cad][variants]") {
  for (const auto& [name, height] :
       std::vector<std::pair<std::string, double>>{{"box", 20},
                                                   {"plate_12_holes", 12},
                                                   {"stepped_shaft", 70},
                                                   {"blade", 75},
                                                   {"cone", 30}}) {
    DYNAMIC_SECTION(name) {
      const TopoDS_Shape nurbs = to_nurbs(read_shape(model_file("shapes/" + name + ".step")));
      CHECK(BRepCheck_Analyzer(with_moved_poles(nurbs, twist_and_taper(height, 0.3))).IsValid());
    }
  }
}
