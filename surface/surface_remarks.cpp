#include "surface/surface_remarks.h"

#include <algorithm>
#include <map>
#include <sstream>
#include <utility>

#include "core/remedies.h"

namespace cadmorph {

using Eigen::VectorXd;

std::string name_of(const CadModel& base, const TopologyMatch& match, FaceId face) {
  return "face " + std::to_string(face + 1) + " (" + to_string(base.faces()[face].type) +
         ", variant face " + std::to_string(match.faces[face] + 1) + ")";
}

std::string describe_strays(const Mesh& mesh, const Boundary& boundary, const Association& found) {
  const RowId row = found.farthest_stray;
  std::ostringstream text;
  text.precision(4);
  text << found.stray_nodes
       << " surface nodes lie farther off the CAD than the tolerance, by up to "
       << found.distance[row] << " mm (" << node_name(mesh, boundary.nodes[row])
       << "): amid nodes that lie on it they go with what is nearest, as far off as they are ("
       << words_for(Remedy::Snap) << " puts them on it)";
  return text.str();
}

std::string describe_stranded(const Mesh& mesh, const Boundary& boundary,
                              const Association& found) {
  std::ostringstream text;
  text << found.stranded.size()
       << " surface nodes lie on no CAD face, amid others that do (such as "
       << node_name(mesh, boundary.nodes[found.stranded.front()])
       << "): they go with the volume beside them";
  return text.str();
}

std::string describe_parted_joints(const PartedJoints& parted) {
  std::ostringstream text;
  text << parted.nodes
       << " nodes where parts meet without an edge lie on one of them only, by up to "
       << parted.distance << " mm off the other: do the parts still meet in the variant?";
  return text.str();
}

std::string describe_left_patches(const PartedJoints& left) {
  std::ostringstream text;
  text << left.nodes
       << " nodes where the CAD meets a part of the mesh that slides went with the CAD, by up to "
       << left.distance << " mm off that part: the two hardly meet there in the variant";
  return text.str();
}

std::string describe_face_off_mesh(const CadModel& base, const Association& association) {
  IdVector<FaceId, char> is_met(base.faces().size(), 0);
  for (const FaceId face : association.facet_face)
    if (face >= 0) is_met[face] = 1;
  for (const FaceId f : is_met.ids())
    if (base.faces()[f].other_solid >= 0 && !is_met[f])
      return "face " + std::to_string(f + 1) + " of " + base.file_name() +
             " lies between two solids, but the mesh has no regions: its nodes there are moved as "
             "inner ones";
  return {};
}

std::vector<std::string> describe_folds(const CadModel& base, const TopologyMatch& match,
                                        const Association& association,
                                        const std::vector<FacetId>& folded) {
  std::map<FaceId, int> counts;
  for (const FacetId f : folded) ++counts[association.facet_face[f]];
  std::vector<std::string> lines;
  for (const auto& [face, count] : counts)
    lines.push_back(name_of(base, match, face) + ": " + std::to_string(count) +
                    " of its facets are folded");
  return lines;
}

std::vector<std::string> describe_beyond_wires(const CadModel& base, const TopologyMatch& match,
                                               const Association& association,
                                               const VectorXd& beyond_wires) {
  std::map<FaceId, std::pair<int, double>> beyond;  // nodes and largest distance, by base face
  for (const RowId n : association.entity.ids())
    if (beyond_wires[n] > 0) {
      auto& [count, most] = beyond[association.face(n)];
      ++count;
      most = std::max(most, beyond_wires[n]);
    }
  std::vector<std::string> lines;
  for (const auto& [face, found] : beyond) {
    std::ostringstream text;
    text << name_of(base, match, face) << ": " << found.first
         << " of its nodes lie beyond its wires, by up to " << found.second << " mm";
    lines.push_back(text.str());
  }
  return lines;
}

}  // namespace cadmorph
