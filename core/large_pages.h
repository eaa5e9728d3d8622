#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

namespace cadmorph {

/// Tells the system that memory not yet used will be used whole: pages of 2 MB take a small part of
/// the time to get that 4 KB ones take. A hint; does nothing where there are no such pages.
void use_large_pages(void* memory, std::size_t size);

/// Makes room for `size` values and, where the values must move for it, for twice as many as there
/// was: room for a little more each time would move all values each time.
template <class Value>
void reserve_large(std::vector<Value>& values, std::size_t size) {
  if (size <= values.capacity()) return;
  values.reserve(std::max(size, 2 * values.capacity()));
  Value* const unused = values.data() + values.size();
  use_large_pages(unused, (values.capacity() - values.size()) * sizeof(Value));
}

}  // namespace cadmorph
