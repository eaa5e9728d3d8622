#pragma once

#include <map>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "core/formats/deck.h"
#include "core/formats/mesh_format.h"
#include "core/formats/number_table.h"

namespace cadmorph {

/// A set of nodes or elements by number.
struct NumberedSet {
  std::string name;
  std::string kind;  ///< of the group that it becomes
  bool is_of_elements = false;
  std::vector<Index> numbers;
  std::vector<Index> rows = {};  ///< elements, or nodes, by their place in the deck
};

/// A node that is tied to others, by numbers.
struct NumberedTie {
  Index node = 0;
  std::vector<Index> others = {};
};

/// Nodes, elements and sets with the numbers of their file: what a deck gives before it is known
/// which nodes there are.
struct NumberedMesh {
  std::vector<Index> node_numbers;
  std::vector<double> coordinates;   ///< three a node, in the mesh's frame
  std::vector<NodeRecords> records;  ///< `nodes` are rows of node_numbers

  std::vector<Index> element_numbers;
  std::vector<CellType> types;
  std::vector<Index> offsets = {0};
  std::vector<Index> connectivity;  ///< numbers of nodes, in VTK's order
  std::vector<int> regions;         ///< of each element
  std::vector<DeckPlace> places;    ///< of each element

  std::vector<NumberedSet> sets;
  std::vector<NumberedTie> ties;

  Index element_count() const { return std::ssize(types); }

  void add_node(Index number, const Eigen::RowVector3d& point);
  void add_element(Index number, CellType type, std::span<const Index> nodes, int region,
                   DeckPlace place);

  /// Appends the elements [first, last) of a piece of the deck that was read apart.
  void append_elements(const NumberedMesh& piece, Index first, Index last);
  /// Where there is no room for the elements of a piece: makes it for them and for those of
  /// `pieces_to_come` more like it.
  void reserve_elements(const NumberedMesh& piece, double pieces_to_come);
  void reserve_nodes(std::size_t more);
  void clear_elements();
};

/// Appends a remark on elements of a deck that are no cells, counted by their kind, if there are
/// any.
void remark_on_left_out(const std::map<std::string, Index>& counts,
                        std::vector<std::string>& remarks);

/// Gathers the nodes of one group after another, each node once a group.
class GroupNodes {
 public:
  explicit GroupNodes(Index node_count) : last_group_(std::size_t(node_count), 0) {}

  void add(Index node) {
    if (std::exchange(last_group_[std::size_t(node)], group_) != group_) nodes_.push_back(node);
  }
  void add(std::span<const Index> nodes) {
    for (const Index node : nodes) add(node);
  }
  /// Ends the group.
  std::vector<Index> take() {
    ++group_;
    return std::exchange(nodes_, {});
  }

 private:
  std::vector<int> last_group_;  ///< that each node is in
  int group_ = 1;
  std::vector<Index> nodes_;
};

/// Makes one mesh of the parts of a deck.
class MeshAssembly {
 public:
  /// Where a part went.
  struct Placed {
    NumberTable rows = {};          ///< of its node numbers
    std::vector<Index> nodes = {};  ///< of each row
    Index first_cell = 0;           ///< its cells follow in their order
  };

  explicit MeshAssembly(const DeckSources& sources) : sources_(sources) {}

  /// Adds a part, moved by `frames`, its sets as groups, and its ties. A node defined twice in one
  /// place is one node. Throws IoError where it lies in two places, and for elements whose nodes
  /// are missing.
  Placed add(NumberedMesh part, const std::vector<NodeFrame>& frames = {});

  /// See core/formats/mid_node_order.h. Sets of faces are to be added after it.
  void order_mid_nodes(CellType type);

  Mesh& mesh() { return mesh_; }
  const Mesh& mesh() const { return mesh_; }
  Index node_count() const { return std::ssize(points_) / 3; }
  std::vector<NodeRecords>& records() { return records_; }

  /// The mesh and its copier. `region_array` names the regions, which stay where there are several.
  ReadMesh finish(DeckSources sources, const std::string& region_array);

 private:
  const DeckSources& sources_;
  Mesh mesh_;
  std::vector<double> points_;
  std::vector<NodeRecords> records_;
};

}  // namespace cadmorph
