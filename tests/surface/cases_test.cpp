#include <vtkDataArray.h>
#include <vtkNew.h>
#include <vtkPointData.h>
#include <vtkUnstructuredGrid.h>
#include <vtkXMLUnstructuredGridReader.h>

#include <catch2/catch.hpp>
#include <cstdlib>
#include <fstream>
#include <map>
#include <sstream>

#include "cad/step_reader.h"
#include "cad/topology_match.h"
#include "core/errors.h"
#include "core/mesh_file.h"
#include "morph_case.h"

// Real parts with known answers, in a folder outside the project: CMake's CADMORPH_CASES, or the
// environment variable of that name. manifest.csv lists them.

using namespace cadmorph;
using namespace cadmorph::testing;
namespace fs = std::filesystem;

namespace {

fs::path cases_folder() {
  const char* folder = std::getenv("CADMORPH_CASES");
  return folder && *folder ? folder : CADMORPH_CASES_FOLDER;
}

using Row = std::map<std::string, std::string>;

std::vector<std::string> fields(const std::string& line) {
  std::vector<std::string> all;
  std::stringstream text(line.substr(0, line.find('\r')));
  for (std::string field; std::getline(text, field, ',');) all.push_back(field);
  return all;
}

std::vector<Row> read_manifest() {
  std::ifstream in(cases_folder() / "manifest.csv");
  std::string line;
  std::getline(in, line);
  const auto names = fields(line);
  std::vector<Row> rows;
  while (std::getline(in, line)) {
    const auto values = fields(line);
    Row row;
    for (std::size_t i = 0; i < names.size(); ++i)
      row[names[i]] = i < values.size() ? values[i] : "";
    rows.push_back(std::move(row));
  }
  return rows;
}

struct Truth {
  Points points;
  std::vector<char> is_surface, is_known;
  std::vector<std::vector<int>> faces;  // of the variant, that the node lies on
};

Truth read_truth(const fs::path& path) {
  vtkNew<vtkXMLUnstructuredGridReader> reader;
  reader->SetFileName(path.c_str());
  reader->Update();
  vtkUnstructuredGrid* grid = reader->GetOutput();
  const auto array = [&](const char* name) {
    vtkDataArray* values = grid->GetPointData()->GetArray(name);
    if (!values) throw std::runtime_error(path.string() + " lacks " + name);
    return values;
  };
  vtkDataArray *surface = array("truth_surf"), *known = array("truth_known"),
               *faces = array("truth_faces");
  Truth truth;
  truth.points.resize(grid->GetNumberOfPoints(), 3);
  for (vtkIdType n = 0; n < grid->GetNumberOfPoints(); ++n) {
    truth.points.row(n) = Eigen::Vector3d(grid->GetPoint(n));
    truth.is_surface.push_back(surface->GetComponent(n, 0) != 0);
    truth.is_known.push_back(known->GetComponent(n, 0) != 0);
    truth.faces.emplace_back();
    for (int k = 0; k < faces->GetNumberOfComponents(); ++k)
      if (const int face = static_cast<int>(faces->GetComponent(n, k)); face > 0)
        truth.faces.back().push_back(face - 1);
  }
  return truth;
}

void check_refused(const Row& row) {
  const CadModel base = read_step(cases_folder() / row.at("old"));
  const CadModel variant = read_step(cases_folder() / row.at("new"));
  CHECK_THROWS_AS(match_topology(base, variant), TopologyError);
  CHECK_THROWS_WITH(match_topology(base, variant), Catch::Matchers::Contains("face "));
}

void check_morphed(const Row& row) {
  const fs::path folder = cases_folder();
  const MorphCase c =
      mesh_case(read_step(folder / row.at("old")), MeshFile(folder / row.at("mesh")).mesh());
  const Morphed m = morph(c, read_step(folder / row.at("new")));
  const Truth truth = read_truth(folder / row.at("truth"));
  REQUIRE(truth.points.rows() == m.points.rows());

  double off_truth = 0, off_inside = 0, off_cad = 0;
  const FaceOracle oracle(read_shape(folder / row.at("new")));
  for (Index n = 0; n < truth.points.rows(); ++n) {
    const double off = (m.points.row(n) - truth.points.row(n)).norm();
    if (!truth.is_surface[n]) {
      off_inside = std::max(off_inside, off);
      continue;
    }
    if (truth.is_known[n]) off_truth = std::max(off_truth, off);
    for (const int f : truth.faces[n])
      off_cad = std::max(off_cad, oracle.distance(f, m.points.row(n)));
  }
  const double diagonal = std::stod(row.at("diag"));
  CHECK(off_truth / diagonal <= std::stod(row.at("tol_surface")));
  CHECK(off_cad / diagonal <= std::stod(row.at("tol_cad")));
  if (!row.at("tol_interior").empty())
    CHECK(off_inside / diagonal <= std::stod(row.at("tol_interior")));
}

}  // namespace

TEST_CASE("real parts with known answers", "[cases]") {
  const auto rows = read_manifest();
  REQUIRE(!rows.empty());
  for (const Row& row : rows) {
    DYNAMIC_SECTION(row.at("case")) {
      if (row.at("expect") == "refuse") {
        check_refused(row);
      } else {
        check_morphed(row);
      }
    }
  }
}

TEST_CASE("a part that another version of its program saved leaves every node in place",
          "[cases]") {
  const fs::path folder = cases_folder() / "parametric" / "hole_seam";
  if (!fs::exists(folder)) return;
  const MorphCase c =
      mesh_case(read_step(folder / "base.step"), MeshFile(folder / "base.vtu").mesh());
  const Morphed m = morph(c, read_step(folder / "stored.step"));
  CHECK(largest_difference(m.points, c.mesh.points) <= 1e-9 * c.diagonal);
}
