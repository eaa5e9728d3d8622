#pragma once

#include <Eigen/Core>
#include <cereal/archives/portable_binary.hpp>
#include <cereal/types/array.hpp>
#include <cereal/types/common.hpp>
#include <cstdint>
#include <limits>
#include <string>
#include <type_traits>
#include <vector>

#include "core/archive.h"

namespace cadmorph {

/// Most bytes that what is being read can hold. What claims more is refused before memory is taken.
inline thread_local std::uint64_t archive_bytes = std::numeric_limits<std::uint64_t>::max();

/// A number of things of at least so many bytes each. Throws cereal::Exception.
inline std::size_t checked_count(std::uint64_t count, std::size_t bytes) {
  if (count > archive_bytes / bytes) throw cereal::Exception("it claims more than the file holds");
  return static_cast<std::size_t>(count);
}

}  // namespace cadmorph

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
  if (rows < 0 || columns < 0 || (Rows != Eigen::Dynamic && rows != Rows) ||
      (Columns != Eigen::Dynamic && columns != Columns))
    throw Exception("a matrix has another shape");
  const std::size_t width =
      cadmorph::checked_count(static_cast<std::uint64_t>(columns), sizeof(Scalar));
  if (width > 0) cadmorph::checked_count(static_cast<std::uint64_t>(rows), width * sizeof(Scalar));
  matrix.resize(rows, columns);
  archive(binary_data(matrix.data(), sizeof(Scalar) * static_cast<std::size_t>(matrix.size())));
}

// As cereal/types/vector.hpp and string.hpp, with sizes checked.

template <class Archive>
std::size_t load_size(Archive& archive, std::size_t bytes) {
  size_type size = 0;
  archive(make_size_tag(size));
  return cadmorph::checked_count(size, bytes);
}

template <class Archive, class T>
void save(Archive& archive, const std::vector<T>& values) {
  archive(make_size_tag(static_cast<size_type>(values.size())));
  if constexpr (std::is_arithmetic_v<T>)
    archive(binary_data(values.data(), sizeof(T) * values.size()));
  else
    for (const T& value : values) archive(value);
}

template <class Archive, class T>
void load(Archive& archive, std::vector<T>& values) {
  if constexpr (std::is_arithmetic_v<T>) {
    values.resize(load_size(archive, sizeof(T)));
    archive(binary_data(values.data(), sizeof(T) * values.size()));
  } else {
    values.resize(load_size(archive, 1));
    for (T& value : values) archive(value);
  }
}

template <class Archive>
void save(Archive& archive, const std::string& text) {
  archive(make_size_tag(static_cast<size_type>(text.size())));
  archive(binary_data(text.data(), text.size()));
}

template <class Archive>
void load(Archive& archive, std::string& text) {
  text.resize(load_size(archive, 1));
  archive(binary_data(text.data(), text.size()));
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
