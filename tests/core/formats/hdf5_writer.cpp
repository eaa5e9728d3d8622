#include "tests/core/formats/hdf5_writer.h"

#include <catch2/catch.hpp>

namespace cadmorph::test {

Hdf5Writer::Hdf5Writer(const std::filesystem::path& path)
    : file_(H5Fcreate(path.c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT)) {
  REQUIRE(file_ >= 0);
}

Hdf5Writer::~Hdf5Writer() { H5Fclose(file_); }

void Hdf5Writer::group(const std::string& name) {
  const hid_t made = H5Pcreate(H5P_GROUP_CREATE);
  H5Pset_link_creation_order(made, H5P_CRT_ORDER_TRACKED | H5P_CRT_ORDER_INDEXED);
  const hid_t group = H5Gcreate2(file_, name.c_str(), H5P_DEFAULT, made, H5P_DEFAULT);
  REQUIRE(group >= 0);
  H5Gclose(group);
  H5Pclose(made);
}

void Hdf5Writer::numbers(const std::string& name, const std::vector<double>& values,
                         Storage storage) {
  write(name, H5T_NATIVE_DOUBLE, values.data(), values.size(), std::move(storage));
}

void Hdf5Writer::singles(const std::string& name, const std::vector<float>& values,
                         Storage storage) {
  write(name, H5T_NATIVE_FLOAT, values.data(), values.size(), std::move(storage));
}

void Hdf5Writer::integers(const std::string& name, const std::vector<int>& values,
                          Storage storage) {
  write(name, H5T_NATIVE_INT, values.data(), values.size(), std::move(storage));
}

void Hdf5Writer::bytes(const std::string& name, const std::string& values, Storage storage) {
  write(name, H5T_NATIVE_SCHAR, values.data(), values.size(), std::move(storage));
}

void Hdf5Writer::write(const std::string& name, hid_t type, const void* values, std::size_t count,
                       Storage storage) {
  if (storage.shape.empty()) storage.shape = {count};
  const hid_t space = H5Screate_simple(int(storage.shape.size()), storage.shape.data(), nullptr);
  REQUIRE(H5Sget_simple_extent_npoints(space) == hssize_t(count));
  const hid_t made = H5Pcreate(H5P_DATASET_CREATE);
  if (!storage.chunk.empty()) H5Pset_chunk(made, int(storage.chunk.size()), storage.chunk.data());
  if (storage.is_compressed) H5Pset_deflate(made, 6);
  const hid_t set = H5Dcreate2(file_, name.c_str(), storage.type < 0 ? type : storage.type, space,
                               H5P_DEFAULT, made, H5P_DEFAULT);
  REQUIRE(set >= 0);
  REQUIRE(H5Dwrite(set, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, values) >= 0);
  H5Dclose(set);
  H5Pclose(made);
  H5Sclose(space);
}

void Hdf5Writer::attribute(const std::string& object, const std::string& name,
                           const std::vector<int>& values) {
  const hsize_t count = values.size();
  const hid_t space = H5Screate_simple(1, &count, nullptr);
  const hid_t attribute = H5Acreate_by_name(file_, object.c_str(), name.c_str(), H5T_NATIVE_INT,
                                            space, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT);
  REQUIRE(H5Awrite(attribute, H5T_NATIVE_INT, values.data()) >= 0);
  H5Aclose(attribute);
  H5Sclose(space);
}

void Hdf5Writer::attribute(const std::string& object, const std::string& name,
                           const std::string& text, std::size_t length) {
  std::string padded = text;
  padded.resize(std::max(length, text.size()));
  const hid_t type = H5Tcopy(H5T_C_S1);
  H5Tset_size(type, padded.size());
  const hid_t space = H5Screate(H5S_SCALAR);
  const hid_t attribute = H5Acreate_by_name(file_, object.c_str(), name.c_str(), type, space,
                                            H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT);
  REQUIRE(H5Awrite(attribute, type, padded.data()) >= 0);
  H5Aclose(attribute);
  H5Sclose(space);
  H5Tclose(type);
}

}  // namespace cadmorph::test
