#include "family_steps.h"

#include "cad/step_reader.h"
#include "cad_variants.h"
#include "models/bore.h"
#include "models/pipe.h"

namespace cadmorph::testing {
namespace {

TopoDS_Shape make(const std::string& family, double change) {
  return family == "bore" ? models::make_bore(change) : models::make_pipe(change);
}

}  // namespace

CadModel family_cad(const std::string& family, double change) {
  return to_model(make(family, change));
}

void write_family_step(const std::filesystem::path& path, const std::string& family,
                       double change) {
  write_step(path, make(family, change));
}

MorphJob family_job(const std::string& family, const std::string& mesh, PipelineOptions options) {
  return MorphJob(std::make_shared<const CadModel>(read_step(model_file(family + "/base.step"))),
                  std::make_shared<const MeshFile>(model_file(family + "/" + mesh + ".vtu")),
                  std::move(options));
}

Index invalid_cells(const Mesh& mesh, const Points& positions) {
  return check_validity(mesh, positions, detect_orientation(mesh)).invalid;
}

}  // namespace cadmorph::testing
