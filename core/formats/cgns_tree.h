#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "core/formats/mesh_format.h"

namespace cadmorph {

/// A node of a CGNS file.
struct CgnsNode {
  std::string name;
  std::string label;         ///< "Zone_t"
  std::string type;          ///< of its data: "R8", "I4", "C1"; "MT": it has none
  std::vector<Index> shape;  ///< of its data, the index that runs fastest last
  std::string path;          ///< "/Base/Zone/GridCoordinates/CoordinateX"
  std::vector<CgnsNode> children;

  /// The child of a label, or of a name; null where there is none.
  const CgnsNode* with_label(std::string_view label) const;
  const CgnsNode* with_name(std::string_view name) const;
};

/// Coordinates of one component: the data of `node`, of the mesh's nodes `nodes`.
struct CgnsRun {
  const CgnsNode* node = nullptr;
  int component = 0;
  std::vector<Index> nodes;
};

/// A CGNS file: its tree of nodes, stored in HDF5 or ADF. Members throw IoError, naming the node.
class CgnsTree {
 public:
  virtual ~CgnsTree() = default;

  const CgnsNode& root() const { return root_; }

  /// The data of a node. Throw when it has none, or data of another type.
  virtual std::vector<Index> integers(const CgnsNode& node) const = 0;
  virtual std::vector<double> numbers(const CgnsNode& node) const = 0;
  virtual std::string text(const CgnsNode& node) const = 0;

  /// Reads the coordinates of `runs` into `points` (the last counts where a node has several) and
  /// returns what copies the file.
  virtual std::unique_ptr<const MeshCopier> read_coordinates(const std::vector<CgnsRun>& runs,
                                                             Points& points) const = 0;

  /// Throws IoError: "can't read the mesh PATH: '/Base/Zone': WHY".
  [[noreturn]] void fail(const CgnsNode& node, const std::string& why) const;

 protected:
  explicit CgnsTree(std::filesystem::path path) : path_(std::move(path)) {}

  std::filesystem::path path_;
  CgnsNode root_;
};

/// Whether a file begins as one of ADF, CGNS's own container.
bool is_adf(const FileStart& start);

/// Reads the tree of a CGNS file in HDF5 or ADF. Throws IoError; links to other files are refused.
std::unique_ptr<const CgnsTree> read_cgns_tree(const std::filesystem::path& path);

}  // namespace cadmorph
