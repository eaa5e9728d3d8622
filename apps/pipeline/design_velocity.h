#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "apps/pipeline/morph_job.h"
#include "apps/pipeline/step_queue.h"

namespace cadmorph {

/// How the surface moves with a CAD parameter p, by central differences of its morphs.
struct SurfaceVelocity {
  /// m x 3: dX/dp of the nodes that the surface prescribes (rows as VolumeMorph::surface_nodes), in
  /// the mesh's unit per unit of p.
  Points velocity;
  /// m x 3: where these nodes are at p; empty: where they are at the base, to rounding
  Points present;
  double step = 0;
  double motion = 0;         ///< most that the step moves a node, millimetres
  double cad_tolerance = 0;  ///< half of the base CAD's edges have no larger one, millimetres
  /// How far the surface at p is from the middle between both morphs, largest over the largest
  /// motion: of the order of the step; large where the step is, or where the models are not p + h
  /// and p - h.
  double unevenness = 0;
  /// m x 3: estimated error of the velocity where two steps were taken; else empty.
  Points error;
  std::vector<std::string> warnings;
};

/// The models of a parameter p: at p + step and at p - step.
struct ParameterModels {
  CadModel plus, minus;
  double step = 0;
};

/// Morphs the surface to both models and takes central differences (error of order step^2). A node
/// on an edge or vertex keeps to that: where faces meet anew, the velocity is that of their
/// intersection. `present`: where the surface nodes are at p (m x 3); empty, or within 1e-9 of the
/// mesh's size of the base: p is the base's.
/// Throws InvalidInputError for a step that is not positive, or that moves the surface by less than
/// the CAD's tolerance, and what MorphJob::morph_surface throws.
SurfaceVelocity surface_velocity(const MorphJob& job, const ParameterModels& models,
                                 const Points& present = {});

/// The same of two pairs, the second with half of the first's step: Richardson's extrapolation
/// (error of order step^4), and the error of the second pair that it tells. Throws
/// InvalidInputError where the second step is not half of the first.
SurfaceVelocity surface_velocity(const MorphJob& job, const ParameterModels& models,
                                 const ParameterModels& half, const Points& present = {});

/// dX/dp of all nodes (N x 3): the surface's carried inside by the derivative of the volume morph
/// at the surface's present positions; at the base in the direction of the motion. With an
/// estimated error also that of each node, N x 1; else N x 0. Throws what VolumeMorph::derivative
/// throws.
struct NodeVelocity {
  RowMatrix velocity, error;
};
NodeVelocity carry_inside(const MorphJob& job, const SurfaceVelocity& surface);

/// The next two models of a queue, as a parameter's.
ParameterModels next_models(StepQueue& queue, double step);

/// dJ/dp of any number of parameters from dJ/dX of all nodes, by one adjoint of the volume morph:
/// the sum of dJ/dX times carry_inside of the parameter's velocity, to rounding. Where anchors may
/// hold a motion from the base, they are its own, and it is carried inside.
class Gradient {
 public:
  /// `sensitivity`: N x 3. `present`: where the surface nodes are (m x 3); empty: at the base.
  /// Throws InvalidInputError on a wrong size or a number that is not finite, and what
  /// VolumeMorph::derivative throws.
  Gradient(const MorphJob& job, RowMatrix sensitivity, const Points& present = {});

  /// `velocity`: about the same positions.
  double operator()(const SurfaceVelocity& velocity) const;

  /// dJ/dX of the surface nodes (m x 3) where no anchors hold the motion.
  const RowMatrix& surface() const { return surface_; }

 private:
  const MorphJob& job_;
  RowMatrix sensitivity_, surface_;
  VolumeMorph::HoldCheck holds_;
};

struct VelocityFiles {
  std::filesystem::path base_cad, plus, minus, mesh, output;
  double step = 0;
  std::filesystem::path half_plus, half_minus;  ///< of half the step; empty: none
  CadReader read_cad = {};
};

/// What a velocity came to.
struct VelocityReport {
  std::filesystem::path base_cad, mesh, written;
  Index nodes = 0, surface_nodes = 0;
  double mesh_unit_mm = 1, step = 0, motion = 0, cad_tolerance = 0, unevenness = 0;
  double max_speed = 0;  ///< mesh units per unit of the parameter
  Index fastest_node = -1;
  Eigen::RowVector3d fastest_place = Eigen::RowVector3d::Zero();  ///< in the mesh's unit
  std::optional<double> max_error;                                ///< estimated; of any node
  std::vector<std::string> warnings;
  double seconds = 0;
};

/// Writes dX/dp of a mesh's nodes as the point array cadmorph_velocity (with two steps also its
/// estimated error, cadmorph_velocity_error) beside the mesh's own into `output`, a file of a VTK
/// format. Throws as morph_files does.
VelocityReport velocity_files(const VelocityFiles& files, const PipelineOptions& options = {});

/// A CAD parameter and the files of its models.
struct DesignParameter {
  std::string name;
  std::filesystem::path plus, minus;
  double step = 0;
};

struct GradientEntry {
  std::string name;
  double gradient = 0, step = 0;
  double max_speed = 0;  ///< of the surface, mesh units per unit of the parameter
  double motion = 0;     ///< most that the step moves a surface node, millimetres
};

struct GradientReport {
  std::filesystem::path base_cad, mesh;
  Index nodes = 0, surface_nodes = 0;
  double mesh_unit_mm = 1;
  double sensitivity_norm = 0, surface_norm = 0;  ///< of dJ/dX, and of what it comes to there
  std::vector<GradientEntry> entries;
  std::vector<std::string> warnings;
  double adjoint_seconds = 0, seconds = 0;
};

/// dJ/dX by nodes.
struct Sensitivity {
  RowMatrix values;            ///< N x 3, per the mesh's unit
  std::vector<char> is_given;  ///< of each node; the others' is zero. Empty: all are
};

/// Base CAD, parameters and how their STEP files are read.
struct ParameterFiles {
  std::filesystem::path base_cad;
  std::vector<DesignParameter> parameters;
  CadReader read_cad = {};
};

/// dJ/dp of parameters from dJ/dX: one adjoint of the volume, and for
/// each parameter the velocity of the surface alone; the next CAD model is read meanwhile. Throws
/// InvalidInputError on a wrong size of the sensitivity, and as morph_files does.
GradientReport gradient_files(const ParameterFiles& files,
                              const std::shared_ptr<const MeshFile>& mesh,
                              const Sensitivity& sensitivity, const PipelineOptions& options = {});

}  // namespace cadmorph
