#pragma once

#include <Eigen/Core>
#include <cereal/archives/portable_binary.hpp>
#include <cereal/types/array.hpp>
#include <cereal/types/common.hpp>
#include <cereal/types/string.hpp>
#include <cereal/types/vector.hpp>
#include <cstdint>

#include "core/archive.h"

namespace cereal {

template <class Archive, class Scalar, int Rows, int Columns, int Options>
void save(Archive& archive, const Eigen::Matrix<Scalar, Rows, Columns, Options>& matrix) {
  archive(static_cast<std::int64_t>(matrix.rows()), static_cast<std::int64_t>(matrix.cols()));
  archive(binary_data(matrix.data(), sizeof(Scalar) * static_cast<std::size_t>(matrix.size())));
}

template <class Archive, class Scalar, int Rows, int Columns, int Options>
void load(Archive& archive, Eigen::Matrix<Scalar, Rows, Columns, Options>& matrix) {
  std::int64_t rows = 0, columns = 0;
  archive(rows, columns);
  matrix.resize(rows, columns);
  archive(binary_data(matrix.data(), sizeof(Scalar) * static_cast<std::size_t>(matrix.size())));
}

}  // namespace cereal

namespace cadmorph {

/// Returns the next thing in an archive.
template <class T>
T take(InputArchive& archive) {
  T thing;
  archive(thing);
  return thing;
}

}  // namespace cadmorph
