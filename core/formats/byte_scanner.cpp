#include "core/formats/byte_scanner.h"

#include <algorithm>

#include "core/formats/mesh_format.h"

namespace cadmorph {

Index ByteScanner::count(std::string_view what, int size, std::size_t least_bytes) {
  const std::size_t place = at_;
  const Index count = integer(what, size);
  if (count < 0) fail_at(place, std::string(what) + " is negative: " + std::to_string(count));
  if (std::size_t(count) > rest() / std::max<std::size_t>(least_bytes, 1))
    fail_at(place, std::string(what) + " is " + std::to_string(count) + ", but only " +
                       std::to_string(rest()) +
                       " bytes follow: the file is cut off or the count wrong");
  return count;
}

Index ByteScanner::index(std::string_view what, int size, Index first, Index end) {
  const std::size_t place = at_;
  const Index value = integer(what, size);
  if (value < first || value >= end)
    fail_at(place, std::string(what) + " " + std::to_string(value) + " is not in [" +
                       std::to_string(first) + ", " + std::to_string(end - 1) + "]");
  return value;
}

void ByteScanner::skip(std::string_view what, std::uint64_t size) {
  if (size > rest()) fail_end(what);
  at_ += size;
}

void ByteScanner::fail_at(std::size_t place, const std::string& why) const {
  fail_reading(path_, "byte " + std::to_string(place) + ": " + why);
}

void ByteScanner::fail_end(std::string_view what) const {
  fail("expected " + std::string(what) + ", found the end of the file (" + std::to_string(rest()) +
       " bytes more)");
}

}  // namespace cadmorph
