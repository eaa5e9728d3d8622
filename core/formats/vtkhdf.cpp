#include <algorithm>

#include "core/cell_topology.h"
#include "core/formats/formats.h"
#include "core/formats/hdf5_coordinates.h"

namespace fs = std::filesystem;

namespace cadmorph {
namespace {

const std::string kRoot = "/VTKHDF";

class Reader {
 public:
  explicit Reader(const Hdf5File& file) : file_(file) {}

  ReadMesh run() {
    check_kind();
    read_points();
    const std::vector<Index> nodes = numbers_of_parts("/NumberOfPoints");
    const std::vector<Index> cells = numbers_of_parts("/NumberOfCells");
    const std::vector<Index> sizes = numbers_of_parts("/NumberOfConnectivityIds");
    if (nodes.size() != cells.size() || nodes.size() != sizes.size())
      file_.fail(kRoot,
                 "NumberOfPoints, NumberOfCells and NumberOfConnectivityIds have different "
                 "numbers of parts");
    types_ = file_.integers(kRoot + "/Types");
    offsets_ = file_.integers(kRoot + "/Offsets");
    connectivity_ = file_.integers(kRoot + "/Connectivity");
    for (std::size_t part = 0; part < nodes.size(); ++part)
      add_part(nodes[part], cells[part], sizes[part]);
    if (first_node_ != result_.mesh.node_count() || first_cell_ != std::ssize(types_))
      file_.fail(kRoot, "its parts have " + std::to_string(first_node_) + " points and " +
                            std::to_string(first_cell_) + " cells together, the file " +
                            std::to_string(result_.mesh.node_count()) + " and " +
                            std::to_string(types_.size()));
    return std::move(result_);
  }

 private:
  void check_kind() const {
    const std::string type = file_.text_attribute(kRoot, "Type");
    if (type != "UnstructuredGrid")
      file_.fail(kRoot, "it is of type " + type + "; only UnstructuredGrid is read");
    if (!file_.has(kRoot + "/Steps") || !file_.has_attribute(kRoot + "/Steps", "NSteps")) return;
    const std::vector<Index> steps = file_.integer_attribute(kRoot + "/Steps", "NSteps");
    if (!steps.empty() && steps[0] > 1)
      file_.fail(kRoot + "/Steps", "it has " + std::to_string(steps[0]) +
                                       " time steps; write one of them to a file of its own");
  }

  void read_points() {
    const std::string data = kRoot + "/Points";
    const std::vector<Index> shape = file_.shape(data);
    if (shape.size() != 2 || shape[1] != 3) file_.fail(data, "expected rows of 3 coordinates");
    std::vector<Hdf5Run> runs;
    for (int c = 0; c < 3; ++c)
      runs.push_back({.dataset = data, .first = c, .step = 3, .count = shape[0], .component = c});
    result_.mesh.points = Points::Zero(shape[0], 3);
    result_.copier = read_hdf5_coordinates(file_, runs, result_.mesh.points);
  }

  std::vector<Index> numbers_of_parts(const std::string& name) const {
    return file_.integers(kRoot + name);
  }

  /// A part has its own numbers of nodes, and one offset more than cells.
  void add_part(Index nodes, Index cells, Index size) {
    const Index first_offset = first_cell_ + parts_;
    if (nodes < 0 || cells < 0 || size < 0 || cells > std::ssize(types_) - first_cell_ ||
        cells + 1 > std::ssize(offsets_) - first_offset ||
        size > std::ssize(connectivity_) - first_id_ ||
        nodes > result_.mesh.node_count() - first_node_)
      file_.fail(kRoot, "part " + std::to_string(parts_) + " is larger than the arrays");
    std::vector<Index> cell;
    reserve_cells(result_.mesh, cells, size);
    for (Index c = 0; c < cells; ++c) {
      const Index begin = offsets_[std::size_t(first_offset + c)];
      const Index end = offsets_[std::size_t(first_offset + c + 1)];
      if (begin < 0 || end < begin || end > size)
        file_.fail(kRoot + "/Offsets", "the offsets of cell " + std::to_string(first_cell_ + c) +
                                           " are not in the connectivity");
      cell.clear();
      for (Index i = begin; i < end; ++i) {
        const Index node = connectivity_[std::size_t(first_id_ + i)];
        if (node < 0 || node >= nodes)
          file_.fail(kRoot + "/Connectivity", "cell " + std::to_string(first_cell_ + c) +
                                                  " has point " + std::to_string(node) + " of " +
                                                  std::to_string(nodes));
        cell.push_back(first_node_ + node);
      }
      add_cell(result_.mesh, type_of(first_cell_ + c), cell);
      if (std::ssize(cell) == 0) file_.fail(kRoot + "/Offsets", "a cell has no points");
    }
    first_node_ += nodes;
    first_cell_ += cells;
    first_id_ += size;
    ++parts_;
  }

  CellType type_of(Index cell) const {
    const Index number = types_[std::size_t(cell)];
    if (number == Index(CellType::Polyhedron))
      file_.fail(kRoot + "/Types", "cell " + std::to_string(cell) +
                                       " is a polyhedron, which is not read from VTKHDF; write the "
                                       "mesh as .vtu");
    if (number < 0 || number > 255 || dimension(CellType(number)) < 0)
      file_.fail(kRoot + "/Types", "cell " + std::to_string(cell) + " is of type " +
                                       std::to_string(number) + ", which is not known");
    return CellType(number);
  }

  const Hdf5File& file_;
  ReadMesh result_;
  std::vector<Index> types_, offsets_, connectivity_;
  Index parts_ = 0, first_node_ = 0, first_cell_ = 0, first_id_ = 0;
};

Recognition recognise(const FileStart& start) { return recognise_hdf5(start, kRoot, "VTKHDF"); }

ReadMesh read(const fs::path& path) { return Reader(Hdf5File(path)).run(); }

}  // namespace

const MeshFormat& vtkhdf_format() {
  static const MeshFormat format{
      .name = "VTKHDF", .extensions = {".vtkhdf", ".hdf"}, .recognise = recognise, .read = read};
  return format;
}

}  // namespace cadmorph
