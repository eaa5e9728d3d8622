#include "volume/volume_derivative.h"

#include <string>
#include <utility>

#include "core/errors.h"

namespace cadmorph {
namespace {

void check(const RowMatrix& given, Index rows, const char* what) {
  if (given.rows() != rows)
    throw InvalidInputError(std::to_string(given.rows()) + " rows for " + std::to_string(rows) +
                            " " + what);
  for (Index i = 0; i < rows; ++i)
    if (!given.row(i).allFinite())
      throw InvalidInputError("row " + std::to_string(i) + " of those for the " + what +
                              " is not finite");
}

}  // namespace

VolumeDerivative::VolumeDerivative(Index node_count, std::vector<Index> surface_nodes,
                                   std::vector<Part> parts)
    : node_count_(node_count), surface_nodes_(std::move(surface_nodes)), parts_(std::move(parts)) {}

RowMatrix VolumeDerivative::forward(const RowMatrix& surface) const {
  check(surface, std::ssize(surface_nodes_), "surface nodes");
  RowMatrix result = RowMatrix::Zero(node_count_, surface.cols());
  for (const Part& part : parts_)
    result(part.volume, Eigen::all) = part.map.forward(surface(part.surface, Eigen::all));
  result(surface_nodes_, Eigen::all) = surface;
  return result;
}

RowMatrix VolumeDerivative::adjoint(const RowMatrix& volume) const {
  check(volume, node_count_, "nodes");
  RowMatrix result = volume(surface_nodes_, Eigen::all);
  for (const Part& part : parts_)
    result(part.surface, Eigen::all) += part.map.adjoint(volume(part.volume, Eigen::all));
  return result;
}

}  // namespace cadmorph
