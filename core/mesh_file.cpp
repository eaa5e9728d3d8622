#include "core/mesh_file.h"

#include <algorithm>

#include "core/edge_lengths.h"
#include "core/errors.h"
#include "core/formats/formats.h"
#include "core/formats/mesh_format.h"

namespace fs = std::filesystem;

namespace cadmorph {
namespace {

// More may turn thin elements over, whose height may be a hundredth of their edges.
constexpr double kLargestRounding = 1e-3;  // of a node's shortest edge

void check_coordinates(const fs::path& path, const Points& points, Index nodes) {
  if (points.rows() != nodes)
    throw InvalidInputError("the array 'coordinates' to write has " +
                            std::to_string(points.rows()) + " rows, not " + std::to_string(nodes));
  if (!points.allFinite())
    throw InvalidInputError("the coordinates to write to " + path.string() + " are not all finite");
}

CoordinateRounding measure_rounding(const Mesh& mesh, const Points& wanted, const Points& written) {
  if (written.rows() == 0) return {};
  const Eigen::VectorXd distances = (written - wanted).rowwise().norm();
  CoordinateRounding rounding;
  if (distances.maxCoeff() == 0) return rounding;
  const Eigen::VectorXd edges = incident_edges(mesh, wanted).shortest;
  for (Index n = 0; n < distances.size(); ++n) {
    rounding.largest = std::max(rounding.largest, distances(n));
    const double relative = edges(n) > 0 ? distances(n) / edges(n) : 0;
    if (relative <= rounding.relative) continue;
    rounding.relative = relative;
    rounding.node = n;
  }
  return rounding;
}

void check_rounding(const CoordinateRounding& rounding, const Mesh& mesh, const fs::path& path) {
  if (rounding.relative <= kLargestRounding) return;
  throw InvalidInputError(
      "can't write the mesh " + path.string() + ": its numbers have too few digits: " +
      node_name(mesh, rounding.node) + " would be rounded by " + std::to_string(rounding.relative) +
      " of its shortest edge; write the mesh with double precision or wider columns first, or with "
      "its origin nearer to the part");
}

/// The groups as arrays of 0 and 1.
ExtraArrays with_groups(const Mesh& mesh, ExtraArrays extra) {
  for (const NodeGroup& group : mesh.groups) {
    std::vector<int> flags(std::size_t(mesh.node_count()), 0);
    for (const Index node : group.nodes) flags[std::size_t(node)] = 1;
    extra.point_integers.emplace(group.name, std::move(flags));
  }
  return extra;
}

/// Of a mesh that comes from no file, where MeshFile itself writes what can be written.
class MemoryCopier : public MeshCopier {
 public:
  void write(const fs::path& target, const Points&, const Points&) const override {
    check_target(target);
  }
  void check_target(const fs::path& target) const override {
    throw InvalidInputError(
        "can't write " + target.string() +
        ": a mesh that comes from no file can be written as .vtu or .vtk alone");
  }
};

Mesh checked(Mesh mesh, const std::string& name) {
  try {
    check_mesh(mesh);
  } catch (const InvalidInputError& error) {
    throw InvalidInputError(name + ": " + error.what());
  }
  return mesh;
}

}  // namespace

struct MeshFile::Impl {
  fs::path path;
  std::string format;
  ReadMesh contents;
  bool is_file = true;
};

MeshFile::MeshFile(const fs::path& path) : impl_(std::make_unique<Impl>()) {
  const MeshFormat& format = format_of(path);
  impl_->path = path;
  impl_->format = format.name;
  impl_->contents = format.read(path);
  impl_->contents.mesh = checked(std::move(impl_->contents.mesh), path.string());
  impl_->contents.mesh.is_of_finite_volumes = format.is_of_finite_volumes;
}

MeshFile::MeshFile(Mesh mesh, std::string name) : impl_(std::make_unique<Impl>()) {
  tidy_groups(mesh);
  impl_->contents.mesh = checked(std::move(mesh), name);
  impl_->contents.copier = std::make_unique<MemoryCopier>();
  impl_->path = std::move(name);
  impl_->format = "memory";
  impl_->is_file = false;
}

MeshFile::~MeshFile() = default;
MeshFile::MeshFile(MeshFile&&) noexcept = default;
MeshFile& MeshFile::operator=(MeshFile&&) noexcept = default;

const Mesh& MeshFile::mesh() const { return impl_->contents.mesh; }

const fs::path& MeshFile::path() const { return impl_->path; }

const std::string& MeshFile::format() const { return impl_->format; }

const std::vector<std::string>& MeshFile::remarks() const { return impl_->contents.remarks; }

const std::vector<std::string>& MeshFile::notes() const { return impl_->contents.notes; }

std::vector<DataArray> MeshFile::arrays() const { return impl_->contents.copier->arrays(); }

bool MeshFile::takes_arrays(const fs::path& path) const {
  return impl_->contents.copier->takes_arrays() || is_vtk_name(path);
}

void MeshFile::check_target(const fs::path& path) const {
  if (impl_->is_file) check_copy_name(impl_->path, path);
  if (!is_vtk_name(path)) impl_->contents.copier->check_target(path);
}

bool MeshFile::needs_folder(const fs::path& path) const {
  return !is_vtk_name(path) && impl_->contents.copier->needs_folder();
}

CoordinateRounding MeshFile::write(const fs::path& path, const Points& points,
                                   const ExtraArrays& extra) const {
  const Mesh& mesh = impl_->contents.mesh;
  const MeshCopier& copier = *impl_->contents.copier;
  check_coordinates(path, points, mesh.node_count());
  check_target(path);
  if (copier.takes_arrays()) {
    copier.write_arrays(path, points, extra);
    return {};
  }
  if (is_vtk_name(path)) {
    Mesh moved = mesh;
    moved.points = points;
    write_mesh(path, moved, with_groups(mesh, extra));
    return {};
  }
  if (!extra.point_arrays.empty() || !extra.cell_arrays.empty() || !extra.point_integers.empty() ||
      !extra.cell_integers.empty())
    throw InvalidInputError("a file of " + impl_->format +
                            " can't hold extra arrays: " + path.string());
  CoordinateRounding rounding;
  copier.write_accepted(path, mesh.points, points, [&](const Points& readable) {
    rounding = measure_rounding(mesh, points, readable);
    check_rounding(rounding, mesh, path);
  });
  return rounding;
}

}  // namespace cadmorph
