#pragma once

#include <TopoDS_Shape.hxx>
#include <functional>
#include <gp_Trsf.hxx>

#include "cad/topology_match.h"
#include "morph_case.h"

namespace cadmorph::testing {

// Of a part's diagonal: what a morph whose answer is known may be off by.
inline constexpr double kKnown = 1e-8;

/// Where `map` puts the nodes of the boundary.
Points moved_by(const MorphCase& c,
                const std::function<Eigen::Vector3d(const Eigen::Vector3d&)>& map);

TopoDS_Shape cylinder(double radius, double height);

TopoDS_Shape sphere_at(const Eigen::Vector3d& centre, double radius);

gp_Trsf turn_about_z(double angle);

/// Of all faces, edges and vertices; at least 1e-7.
double largest_tolerance(const CadModel& model);

struct OnCad {
  double farthest = 0;  ///< of any node of a facet from the variant of the facet's base face
  Index folded = 0;     ///< facets that look to the inside of their variant face
};

/// Judges a morphed triangulation whose regions are the base faces of its triangles.
OnCad judge(const MorphCase& c, const Points& surface, const TopologyMatch& match,
            const CadModel& variant, const TopoDS_Shape& shape);

}  // namespace cadmorph::testing
