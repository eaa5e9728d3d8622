#include <unordered_map>

#include "apps/library/impl.h"
#include "apps/pipeline/output_file.h"
#include "core/formats/gmsh_elements.h"
#include "core/quality.h"

namespace cadmorph::v1 {
namespace {

CellType cell_type(std::uint8_t number, Index cell, const std::string& name) {
  const auto type = static_cast<CellType>(number);
  if (type == CellType::Polyhedron)
    throw InvalidInputError(name + ": cell " + std::to_string(cell) +
                            " is a polyhedron, which only a mesh file can bring");
  if (cadmorph::dimension(type) < 0)
    throw InvalidInputError(name + ": cell " + std::to_string(cell) + " has the type " +
                            std::to_string(number) + ", which is none of VTK's that are known");
  return type;
}

// All is copied: Eigen allocates otherwise in programs built for other vector instructions, so that
// no matrix may change hands.
cadmorph::Mesh inner_mesh(const MeshArrays& arrays, const std::string& name) {
  cadmorph::Mesh mesh;
  mesh.types.reserve(arrays.types.size());
  for (const std::uint8_t number : arrays.types)
    mesh.types.push_back(cell_type(number, std::ssize(mesh.types), name));
  mesh.points = arrays.points;
  mesh.offsets = arrays.offsets;
  mesh.connectivity = arrays.connectivity;
  mesh.regions = arrays.regions;
  for (const MeshGroup& group : arrays.groups)
    mesh.groups.push_back({group.name, group.kind, group.nodes});
  for (const NodeGroup& group : mesh.groups)
    for (const Index node : group.nodes)
      if (node < 0 || node >= mesh.node_count())
        throw InvalidInputError(name + ": the group " + group.name + " names the node " +
                                std::to_string(node) + " of " + std::to_string(mesh.node_count()));
  return mesh;
}

std::shared_ptr<const Mesh::Impl> make_impl(const MeshArrays& arrays, const std::string& name) {
  return at_door([&] {
    return std::make_shared<const Mesh::Impl>(
        std::make_shared<const MeshFile>(inner_mesh(arrays, name), name));
  });
}

void append(MeshArrays& arrays, const GmshElements& block,
            const std::unordered_map<std::size_t, Index>& ids, const std::string& name) {
  if (block.type < 1 || block.type > std::ssize(kGmshElements))
    throw InvalidInputError(name + ": elements of gmsh's type " + std::to_string(block.type) +
                            " can't be used; those of first and second order can");
  const GmshElement& kind = kGmshElements[block.type - 1];
  const auto nodes = static_cast<std::size_t>(kind.nodes);
  if (block.node_tags.size() % nodes != 0)
    throw InvalidInputError(name + ": " + std::to_string(block.node_tags.size()) +
                            " node tags are no whole number of elements with " +
                            std::to_string(nodes) + " nodes (gmsh's type " +
                            std::to_string(block.type) + ")");
  for (std::size_t first = 0; first < block.node_tags.size(); first += nodes) {
    for (std::size_t i = 0; i < nodes; ++i) {
      const std::size_t tag = block.node_tags[first + kind.order[i]];
      const auto id = ids.find(tag);
      if (id == ids.end())
        throw InvalidInputError(name + ": an element names the node tag " + std::to_string(tag) +
                                ", which is not among the nodes");
      arrays.connectivity.push_back(id->second);
    }
    arrays.types.push_back(static_cast<std::uint8_t>(kind.type));
    arrays.offsets.push_back(std::ssize(arrays.connectivity));
  }
}

}  // namespace

Mesh::Mesh(std::shared_ptr<const Impl> impl) : impl_(std::move(impl)) {}

Mesh::Mesh(const MeshArrays& arrays, const std::string& name) : impl_(make_impl(arrays, name)) {}

Mesh Mesh::read(const std::filesystem::path& path) {
  return at_door(
      [&] { return Mesh(std::make_shared<const Impl>(std::make_shared<const MeshFile>(path))); });
}

Mesh Mesh::from_gmsh(std::span<const std::size_t> node_tags, const Points& coordinates,
                     std::span<const GmshElements> elements, const std::string& name) {
  if (std::ssize(node_tags) != coordinates.rows())
    throw InvalidInputError(name + ": " + std::to_string(node_tags.size()) +
                            " node tags and coordinates of " + std::to_string(coordinates.rows()) +
                            " nodes");
  std::unordered_map<std::size_t, Index> ids;
  for (const std::size_t tag : node_tags)
    if (!ids.emplace(tag, std::ssize(ids)).second)
      throw InvalidInputError(name + ": the node tag " + std::to_string(tag) + " comes twice");
  MeshArrays arrays{.points = coordinates, .types = {}, .offsets = {0}, .connectivity = {}};
  for (const GmshElements& block : elements) append(arrays, block, ids, name);
  return Mesh(arrays, name);
}

Mesh Mesh::at(const Points& positions) const {
  return at_door([&] {
    check_positions(impl_->mesh(), positions);
    auto moved = std::make_shared<Impl>(impl_->file, impl_->file->mesh());
    moved->moved->points = positions;
    return Mesh(std::shared_ptr<const Impl>(std::move(moved)));
  });
}

const Points& Mesh::points() const { return impl_->mesh().points; }

std::vector<std::uint8_t> Mesh::types() const {
  std::vector<std::uint8_t> result;
  for (const CellType type : impl_->vtk_cells().types)
    result.push_back(static_cast<std::uint8_t>(type));
  return result;
}

const std::vector<Index>& Mesh::offsets() const { return impl_->vtk_cells().offsets; }
const std::vector<Index>& Mesh::connectivity() const { return impl_->vtk_cells().connectivity; }
const std::vector<int>& Mesh::regions() const { return impl_->mesh().regions; }

std::vector<MeshGroup> Mesh::groups() const {
  std::vector<MeshGroup> result;
  for (const NodeGroup& group : impl_->mesh().groups)
    result.push_back({group.name, group.nodes, group.kind});
  return result;
}

const std::string& Mesh::format() const { return impl_->file->format(); }
std::string Mesh::name() const { return impl_->file->path().string(); }
const std::vector<std::string>& Mesh::remarks() const { return impl_->file->remarks(); }

WrittenMesh Mesh::write(const std::filesystem::path& path, const Points& positions) const {
  return at_door([&] {
    WrittenMesh written{.path = path};
    as_output([&] {
      const CoordinateRounding rounding = impl_->file->write(path, positions);
      written.largest_rounding = rounding.largest;
      written.largest_rounding_per_edge = rounding.relative;
    });
    return written;
  });
}

}  // namespace cadmorph::v1
