#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>

#include "api.h"
#include "types.h"

namespace cadmorph::CADMORPH_V1 {

/// A CAD model, in millimetres. Copies share the data; it does not change, so threads may share it.
class CadModel {
 public:
  /// Reads a STEP file (AP203, AP214, AP242). Throws IoError when it is missing, CadError when it
  /// is truncated, no STEP, or holds no face. Readers wait for each other: OCCT's is global.
  static CadModel from_step(const std::filesystem::path& path);

  /// Reads a STEP file that lies in memory, to the bit as from disk. `name` stands for the path in
  /// reports and messages. Throws CadError.
  static CadModel from_step_bytes(std::string_view bytes,
                                  const std::string& name = "STEP in memory");

  /// Reads a shape in OCCT's BREP format, as text or binary, its lengths in millimetres: what
  /// FreeCAD's shape.exportBrepToString() and BRepTools or BinTools write. Throws CadError.
  static CadModel from_brep_bytes(std::string_view bytes,
                                  const std::string& name = "BREP in memory");

  const std::string& name() const;  ///< path, or the name given
  const std::string& unit() const;  ///< length unit named in the file; the model is in millimetres
  Index face_count() const;
  Index edge_count() const;
  Index vertex_count() const;
  int solid_count() const;
  Eigen::Vector3d lower_mm() const;  ///< bounding box
  Eigen::Vector3d upper_mm() const;
  double diagonal_mm() const;  ///< of the bounding box

  struct Impl;
  explicit CadModel(std::shared_ptr<const Impl> impl);
  const Impl& impl() const { return *impl_; }

 private:
  std::shared_ptr<const Impl> impl_;
};

}  // namespace cadmorph::CADMORPH_V1
