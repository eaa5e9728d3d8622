#pragma once

#include <string>
#include <vector>

namespace cadmorph {

/// While it lives, VTK prints nothing in this thread; its errors are collected. VTK's logger on
/// stderr, which would print all a second time, stays off from then on.
class SilentVtk {
 public:
  SilentVtk();
  ~SilentVtk();
  SilentVtk(const SilentVtk&) = delete;
  SilentVtk& operator=(const SilentVtk&) = delete;

  bool has_errors() const { return !errors_.empty(); }

  /// The first message, without VTK's own file, line and address.
  std::string first_error() const;

 private:
  std::vector<std::string> errors_;
};

}  // namespace cadmorph
