// Changes values and sizes of the datasets and attributes of HDF5 files, which stay whole: libhdf5
// itself does not bear damaged ones, for which they are read in a process of their own first.

#include <hdf5.h>

#include <algorithm>
#include <random>
#include <vector>

#include "fuzz_file.h"

extern "C" std::size_t LLVMFuzzerMutate(std::uint8_t* data, std::size_t size, std::size_t max_size);

namespace {

struct Place {
  std::string object, attribute;  ///< no attribute: the dataset itself
};

herr_t add_attribute(hid_t object, const char* name, const H5A_info_t*, void* data) {
  auto& places = *static_cast<std::vector<Place>*>(data);
  std::string path(1 + static_cast<std::size_t>(H5Iget_name(object, nullptr, 0)), '\0');
  path.resize(static_cast<std::size_t>(H5Iget_name(object, path.data(), path.size())));
  places.push_back({path, name});
  return 0;
}

herr_t add_object(hid_t file, const char* name, const H5O_info_t* info, void* data) {
  if (info->type == H5O_TYPE_DATASET) static_cast<std::vector<Place>*>(data)->push_back({name, {}});
  const hid_t object = H5Oopen(file, name, H5P_DEFAULT);
  H5Aiterate2(object, H5_INDEX_NAME, H5_ITER_INC, nullptr, add_attribute, data);
  H5Oclose(object);
  return 0;
}

void mutate_bytes(std::vector<std::uint8_t>& bytes) {
  std::vector<std::uint8_t> changed = bytes;
  if (!bytes.empty()) LLVMFuzzerMutate(changed.data(), changed.size(), changed.size());
  bytes = changed;
}

// The dataset made anew with one of its sizes changed.
void resize(hid_t file, const std::string& name, hid_t type, std::vector<hsize_t> sizes,
            std::vector<std::uint8_t> bytes, std::mt19937& random) {
  hsize_t& size = sizes[random() % sizes.size()];
  const hsize_t choices[] = {0, 1, size + 1, size > 0 ? size - 1 : 0, 2 * size};
  size = choices[random() % std::size(choices)];
  hsize_t count = 1;
  for (const hsize_t s : sizes) count *= s;
  bytes.resize(count * H5Tget_size(type));
  const hid_t space = H5Screate_simple(static_cast<int>(sizes.size()), sizes.data(), nullptr);
  H5Ldelete(file, name.c_str(), H5P_DEFAULT);
  const hid_t dataset =
      H5Dcreate2(file, name.c_str(), type, space, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT);
  H5Dwrite(dataset, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, bytes.data());
  H5Dclose(dataset);
  H5Sclose(space);
}

void mutate(hid_t file, const Place& place, std::mt19937& random) {
  const bool is_dataset = place.attribute.empty();
  const hid_t item = is_dataset
                         ? H5Dopen2(file, place.object.c_str(), H5P_DEFAULT)
                         : H5Aopen_by_name(file, place.object.c_str(), place.attribute.c_str(),
                                           H5P_DEFAULT, H5P_DEFAULT);
  const hid_t type = is_dataset ? H5Dget_type(item) : H5Aget_type(item);
  const hid_t space = is_dataset ? H5Dget_space(item) : H5Aget_space(item);
  const auto count = static_cast<std::size_t>(H5Sget_simple_extent_npoints(space));
  std::vector<hsize_t> sizes(static_cast<std::size_t>(H5Sget_simple_extent_ndims(space)));
  H5Sget_simple_extent_dims(space, sizes.data(), nullptr);
  // Those of variable length hold pointers.
  if (H5Tis_variable_str(type) == 0 && H5Tget_class(type) != H5T_VLEN) {
    std::vector<std::uint8_t> bytes(count * H5Tget_size(type));
    if (is_dataset)
      H5Dread(item, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, bytes.data());
    else
      H5Aread(item, type, bytes.data());
    mutate_bytes(bytes);
    if (!is_dataset)
      H5Awrite(item, type, bytes.data());
    else if (!sizes.empty() && random() % 4 == 0)
      resize(file, place.object, type, sizes, bytes, random);
    else
      H5Dwrite(item, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, bytes.data());
  }
  H5Sclose(space);
  H5Tclose(type);
  is_dataset ? H5Dclose(item) : H5Aclose(item);
}

}  // namespace

extern "C" std::size_t LLVMFuzzerCustomMutator(std::uint8_t* data, std::size_t size,
                                               std::size_t max_size, unsigned seed) {
  const std::string_view bytes = cadmorph::testing::text_of(data, size);
  if (!bytes.starts_with("\x89HDF")) return LLVMFuzzerMutate(data, size, max_size);
  H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
  const cadmorph::testing::FuzzFolder folder;
  const std::filesystem::path path = folder.put("file.h5", bytes);
  const hid_t file = H5Fopen(path.c_str(), H5F_ACC_RDWR, H5P_DEFAULT);
  if (file < 0) return size;
  std::vector<Place> places;
  H5Ovisit2(file, H5_INDEX_NAME, H5_ITER_INC, add_object, &places, H5O_INFO_BASIC);
  std::mt19937 random(seed);
  if (!places.empty()) mutate(file, places[random() % places.size()], random);
  H5Fclose(file);
  if (std::filesystem::file_size(path) > max_size) return size;
  std::ifstream(path, std::ios::binary)
      .read(reinterpret_cast<char*>(data), std::streamsize(max_size));
  return std::filesystem::file_size(path);
}
