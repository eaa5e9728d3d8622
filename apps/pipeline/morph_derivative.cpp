#include "apps/pipeline/morph_derivative.h"

#include <string>
#include <utility>

#include "core/errors.h"

namespace cadmorph {

MorphDerivative::MorphDerivative(VolumeDerivative volume, SlideDerivative slide,
                                 std::vector<RowId> rows, Index count)
    : volume_(std::move(volume)), slide_(std::move(slide)), rows_(std::move(rows)), count_(count) {}

// Among the rows that slide takes. Throws InvalidInputError where that can't be done.
RowMatrix MorphDerivative::spread(const RowMatrix& surface) const {
  if (surface.rows() != std::ssize(rows_) || surface.cols() % 3 != 0 || !surface.allFinite())
    throw InvalidInputError("displacements of " + std::to_string(surface.rows()) + " rows and " +
                            std::to_string(surface.cols()) + " columns; expected finite ones of " +
                            std::to_string(rows_.size()) + " surface nodes, three columns each");
  RowMatrix all = RowMatrix::Zero(count_, surface.cols());
  all(rows_, Eigen::all) = surface;
  return all;
}

RowMatrix MorphDerivative::forward(const RowMatrix& surface) const {
  if (!slide_) return volume_.forward(surface);
  return volume_.forward(slide_->forward(spread(surface))(rows_, Eigen::all));
}

RowMatrix MorphDerivative::adjoint(const RowMatrix& volume) const {
  if (!slide_) return volume_.adjoint(volume);
  return slide_->adjoint(spread(volume_.adjoint(volume)))(rows_, Eigen::all);
}

}  // namespace cadmorph
