// What shows a morph to people, away from the drawing: details, surfaces, the page's text.

#include <Eigen/Geometry>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <numeric>

#include "apps/picture/picture_scene.h"
#include "apps/picture/scratch_folder.h"
#include "apps/picture/visible_surface.h"
#include "apps/pipeline/morph_details.h"
#include "apps/report/surface_data.h"
#include "cad/projector.h"
#include "cad/step_reader.h"
#include "command_line.h"
#include "core/mesh_file.h"

extern "C" {
#include <b64/cdecode.h>
}

namespace cadmorph {
namespace {

using testing::source_file;

/// The tetrahedra of the bore, morphed to the full change.
struct Bore {
  CadModel variant = read_step(source_file("models/bore/step20.step"));
  MorphJob job{std::make_shared<const CadModel>(read_step(source_file("models/bore/base.step"))),
               std::make_shared<const MeshFile>(source_file("models/bore/tet.vtu"))};
  MorphResult result = job.morph(variant);
};

const Bore& bore() {
  static const Bore bore;
  return bore;
}

template <class Value>
std::vector<Value> decoded(const std::string& text) {
  std::string bytes(text.size(), '\0');
  base64_decodestate state;
  base64_init_decodestate(&state);
  const int length =
      base64_decode_block(text.data(), static_cast<int>(text.size()), bytes.data(), &state);
  std::vector<Value> values(static_cast<std::size_t>(length) / sizeof(Value));
  std::memcpy(values.data(), bytes.data(), values.size() * sizeof(Value));
  return values;
}

RowMatrix dequantised(const nlohmann::ordered_json& field) {
  const auto steps = decoded<std::uint16_t>(field["data"]);
  const auto columns = static_cast<Index>(field["low"].size());
  RowMatrix values(static_cast<Index>(steps.size()) / columns, columns);
  for (Index i = 0; i < values.size(); ++i)
    values(i / columns, i % columns) = field["low"][i % columns].get<double>() +
                                       field["size"][i % columns].get<double>() * steps[i] / 65535;
  return values;
}

// Half a step of the widest column, and a little for rounding.
double half_step(const nlohmann::ordered_json& field) {
  double widest = 0;
  for (const double size : field["size"]) widest = std::max(widest, size);
  return 0.5001 * widest / 65535;
}

double six_volumes(const Points& points, std::span<const Index> tetra) {
  const auto p = [&](int i) -> Eigen::Vector3d { return points.row(tetra[i]); };
  return (p(1) - p(0)).cross(p(2) - p(0)).dot(p(3) - p(0));
}

TEST_CASE("The histograms of a morph count each element and each surface node once",
          "[apps][report]") {
  const MorphDetails details = gather_details(bore().result);
  const Histogram& jacobian = details.scaled_jacobian;
  const Mesh& mesh = bore().job.base().mesh();
  std::vector<Index> expected(jacobian.after.size(), 0);
  for (Index c = 0; c < mesh.cell_count(); ++c) {
    const double share = (scaled_jacobian(mesh, bore().result.positions, c) - jacobian.low) /
                         (jacobian.high - jacobian.low);
    ++expected[std::min<std::size_t>(static_cast<std::size_t>(share * expected.size()),
                                     expected.size() - 1)];
  }
  CHECK(jacobian.after == expected);
  CHECK(jacobian.low == 0);  // no element is inverted
  const auto sum = [](const std::vector<Index>& counts) {
    return std::accumulate(counts.begin(), counts.end(), Index{0});
  };
  CHECK(sum(jacobian.before) == mesh.cell_count());
  const auto matched = static_cast<Index>(bore().job.base().boundary.nodes.size());
  CHECK(sum(details.deviation.before) + details.exact_before == matched);
  CHECK(sum(details.deviation.after) + details.exact_after == matched);
}

TEST_CASE("The worst elements are listed worst first, with the CAD face nearest to them",
          "[apps][report]") {
  const auto& [variant, job, result] = bore();
  const MorphDetails details = gather_details(result, {.worst = 30});
  REQUIRE(details.worst.size() == 30);
  std::vector<double> sorted = result.quality.values;
  std::ranges::sort(sorted);
  for (std::size_t i = 0; i < details.worst.size(); ++i) {
    const WorstElement& element = details.worst[i];
    CHECK(element.after == sorted[i]);
    CHECK(element.before ==
          scaled_jacobian(job.base().mesh(), job.base().mesh().points, element.cell));
    // The face is that of the nearest facet: within an element's size as near as any.
    const double size = 2 * 4.6;  // millimetres: the mesh's edge length, doubled by the morph
    const double distance = project_globally(variant, element.face, element.centre).distance;
    int faces = 0;
    for (const FaceId f : variant.faces().ids()) {
      const FaceFoot foot = project_globally(variant, f, element.centre);
      if (!variant.is_inside(f, foot.uv)) continue;
      ++faces;
      CHECK(distance <= foot.distance + size);
    }
    CHECK(faces >= 6);
  }
}

TEST_CASE("The surface in the page is the mesh's, to half a step of its numbers",
          "[apps][report]") {
  const auto& [variant, job, result] = bore();
  const nlohmann::ordered_json surface = surface_data(result);
  const auto& nodes = job.base().boundary.nodes;
  REQUIRE(surface["nodes"] == nodes.size());
  REQUIRE(surface["is_simplified"] == false);
  const Points before = job.base().mesh().points(nodes, Eigen::all);
  const RowMatrix moved = result.positions(nodes, Eigen::all) - before;
  const RowMatrix position = dequantised(surface["position"]);
  const RowMatrix displacement = dequantised(surface["displacement"]);
  CHECK((position - before).cwiseAbs().maxCoeff() <= half_step(surface["position"]));
  CHECK((displacement - moved).cwiseAbs().maxCoeff() <= half_step(surface["displacement"]));

  const auto sizes = decoded<std::uint8_t>(surface["sizes"]);
  const auto corners = decoded<std::uint32_t>(surface["corners"]);
  REQUIRE(sizes.size() == static_cast<std::size_t>(job.base().boundary.facet_count()));
  REQUIRE(corners.size() == 3 * sizes.size());
  for (std::size_t i = 0; i < corners.size(); ++i)
    REQUIRE(nodes[corners[i]] == job.base().boundary.connectivity[i]);

  Eigen::VectorXd least = Eigen::VectorXd::Ones(job.base().mesh().node_count());
  for (Index c = 0; c < job.base().mesh().cell_count(); ++c)
    for (const Index node : job.base().mesh().cell(c))
      least[node] = std::min(least[node], scaled_jacobian(job.base().mesh(), result.positions, c));
  const RowMatrix jacobian = dequantised(surface["jacobian"]);
  CHECK((jacobian.col(1) - least(nodes)).cwiseAbs().maxCoeff() <= half_step(surface["jacobian"]));
}

TEST_CASE("A large surface is simplified between nodes of the mesh, and says so",
          "[apps][report]") {
  const auto& [variant, job, result] = bore();
  const Index most = job.base().boundary.facet_count() / 4;
  const nlohmann::ordered_json surface = surface_data(result, most);
  CHECK(surface["is_simplified"] == true);
  CHECK(surface["triangles"] == job.base().boundary.facet_count());
  CHECK(surface["facets"] <= most);
  CHECK(surface["facets"] >= most / 2);
  const RowMatrix position = dequantised(surface["position"]);
  const Points all = job.base().mesh().points(job.base().boundary.nodes, Eigen::all);
  for (Index i = 0; i < position.rows(); ++i) {
    const double nearest = (all.rowwise() - position.row(i)).rowwise().norm().minCoeff();
    REQUIRE(nearest <= std::sqrt(3) * half_step(surface["position"]));
  }
}

TEST_CASE("The cells in a box are those whose centres are", "[apps][picture]") {
  const Mesh mesh = MeshFile(source_file("models/bore/hex.vtu")).mesh();
  const Eigen::Vector3d low = mesh.points.colwise().minCoeff(),
                        high = mesh.points.colwise().maxCoeff();
  const Eigen::AlignedBox3d box(low + 0.2 * (high - low), low + 0.7 * (high - low));
  const std::vector<char> is_inside = cells_in_box(mesh, box);
  Index count = 0;
  for (Index c = 0; c < mesh.cell_count(); ++c) {
    Points corners(mesh.cell(c).size(), 3);
    for (Index i = 0; i < corners.rows(); ++i) corners.row(i) = mesh.points.row(mesh.cell(c)[i]);
    const Eigen::Vector3d centre =
        (corners.colwise().minCoeff() + corners.colwise().maxCoeff()).transpose() / 2;
    const bool is_expected =
        ((centre - box.min()).array() >= 0).all() && ((box.max() - centre).array() >= 0).all();
    REQUIRE(static_cast<bool>(is_inside[c]) == is_expected);
    count += is_expected;
  }
  CHECK(count > 0);
  CHECK(count < mesh.cell_count() / 4);
}

TEST_CASE("The faces around a part of a mesh enclose the volume of its cells", "[apps][picture]") {
  const Mesh mesh = MeshFile(source_file("models/bore/tet.vtu")).mesh();
  const CellNeighbours neighbours = find_cell_neighbours(mesh);
  const std::vector<char> is_shown = cells_above_middle(mesh, box_of(mesh), 1);
  const VisibleSurface surface = visible_surface(mesh, neighbours, is_shown);
  double shown = 0, enclosed = 0;
  for (Index c = 0; c < mesh.cell_count(); ++c)
    if (is_shown[c]) shown += six_volumes(mesh.points, mesh.cell(c));
  Eigen::Vector3d area = Eigen::Vector3d::Zero();
  for (Index f = 0; f < surface.mesh.cell_count(); ++f) {
    const auto p = [&](int i) -> Eigen::Vector3d {
      return surface.mesh.points.row(surface.mesh.cell(f)[i]);
    };
    enclosed += p(0).dot(p(1).cross(p(2)));
    area += (p(1) - p(0)).cross(p(2) - p(0)) / 2;
    REQUIRE(is_shown[surface.cells[f]]);
  }
  const double box = (mesh.points.colwise().maxCoeff() - mesh.points.colwise().minCoeff()).prod();
  CHECK(shown > 0.2 * 6 * box);                         // about half of a block with two holes
  CHECK(std::abs(enclosed - shown) <= 1e-9 * shown);    // rounding of 10,000 terms
  CHECK(area.norm() <= 1e-9 * std::pow(box, 2.0 / 3));  // a closed surface has no net area
}

TEST_CASE("Without a display the report says that there is no picture, and the job is done",
          "[apps][report]") {
  const testing::Workplace place;
  const auto result =
      place.run("box.step box_moved.step box.vtu -o out.vtu --report page.html --picture p.png",
                "unset DISPLAY; PATH=/nonexistent");
  CHECK(result.exit_code == 0);
  CHECK_THAT(result.err, Catch::Contains("there is no picture: no display to render on"));
  CHECK_THAT(place.read("page.html"), Catch::Contains("There is no picture: no display"));
  CHECK_FALSE(place.has("p.png"));
  CHECK(place.has("out.vtu"));
}

TEST_CASE("A picture that can't be prepared costs nothing else", "[apps][report]") {
  const testing::Workplace place;
  const std::string nowhere = "export TMPDIR=/nonexistent;";
  const auto result = place.run(
      "box.step box_moved.step box.vtu -o out.vtu --picture p.png --report page.html", nowhere);
  CHECK(result.exit_code == 0);
  CHECK_THAT(result.err, Catch::Contains("there is no picture: can't make a temporary folder"));
  CHECK_THAT(place.read("page.html"), Catch::Contains("There is no picture"));
  CHECK(place.has("out.vtu"));
  CHECK(place.run("quality box.vtu --picture p.png", nowhere).exit_code == 0);
  CHECK_FALSE(place.has("p.png"));
}

TEST_CASE("A cut leaves a wall of one cell whole", "[apps][report]") {
  Mesh wall = testing::box_mesh(1);  // 1 x 2 x 3 cells
  CHECK(std::ranges::count(cells_above_middle(wall, box_of(wall), 0), 1) == 6);
  CHECK(std::ranges::count(cells_above_middle(wall, box_of(wall), 1), 1) == 3);
  CHECK(std::ranges::count(cells_above_middle(wall, box_of(wall), 2), 1) == 4);
  wall.points.col(1).array() += 1e-12 * wall.points.col(0).array();
  CHECK(std::ranges::count(cells_above_middle(wall, box_of(wall), 1), 1) == 3);
}

TEST_CASE("The page of a refused result begins with the reason", "[apps][report]") {
  const testing::Workplace place;
  Mesh mesh = testing::box_mesh(3);
  mesh.points.row((3 * 7 + 3) * 4 + 1) += Eigen::RowVector3d(4, 4, 4);  // an inner node
  write_mesh(place.folder() / "inverted.vtu", mesh);
  const auto result = place.run(
      "box.step box_moved.step inverted.vtu -o out.vtu --untangle never --report page.html",
      "unset DISPLAY; PATH=/nonexistent");
  REQUIRE(result.exit_code == 5);
  const std::string page = place.read("page.html");
  const auto reason = page.find("id=\"diagnosis\""), warnings = page.find("id=\"warnings\"");
  REQUIRE(reason != std::string::npos);
  REQUIRE(warnings != std::string::npos);
  CHECK(reason < warnings);
  CHECK_THAT(page.substr(reason, warnings - reason), Catch::Contains(" are inverted\n"));
  CHECK_THAT(page, Catch::Contains("All surface nodes lie on their CAD entities"));
  CHECK_THAT(page, !Catch::Contains("id=\"deviation-chart\""));
  CHECK_THAT(page, Catch::Contains("not counted here"));  // why fewer edges than in the summary
}

TEST_CASE("An interrupt while pictures are drawn leaves nothing behind", "[apps][report]") {
  namespace fs = std::filesystem;
  const testing::Workplace place;
  fs::copy_file(CADMORPH_PROGRAM, place.folder() / "cadmorph");
  place.write("cadmorph-picture", "#!/bin/sh\nkill -INT $PPID\nexec sleep 2\n");
  fs::permissions(place.folder() / "cadmorph-picture", fs::perms::owner_all);
  fs::create_directory(place.folder() / "tmp");
  const std::string command = "cd '" + place.folder().string() +
                              "' && TMPDIR=tmp ./cadmorph box.step box_moved.step box.vtu "
                              "-o out.vtu --report page.html > out.txt 2>&1";
  std::system(command.c_str());
  CHECK(fs::is_empty(place.folder() / "tmp"));
  CHECK_FALSE(place.has("page.html"));
}

TEST_CASE("A report that can't be written costs neither mesh nor summary", "[apps][report]") {
  const testing::Workplace place;
  // Room for the mesh and the figures, in blocks of 512 bytes, not for the page.
  const auto result =
      place.run("box.step box_moved.step box.vtu -o out.vtu --report page.html --json x.json",
                "unset DISPLAY; PATH=/nonexistent; ulimit -f 30;");
  CHECK(result.exit_code == 6);
  CHECK_THAT(result.err, Catch::Contains("error: can't write page.html"));
  CHECK_THAT(result.out, Catch::Contains("Written       out.vtu"));
  CHECK(nlohmann::json::parse(place.read("x.json"))["exit_code"] == 6);
  CHECK(place.has("out.vtu"));
  CHECK_FALSE(place.has("page.html"));
}

TEST_CASE("The pictures of a series are named after its last morph", "[apps][report]") {
  const testing::Workplace place;
  place.make_boxes(3);
  REQUIRE(
      place.run("v0.step v2.step box.vtu --via v1.step -o out.vtu --report page.html").exit_code ==
      0);
  const std::string page = place.read("page.html");
  if (page.find("There is no picture") != std::string::npos) return;
  CHECK_THAT(page, Catch::Contains("<figcaption>Base<span class=\"note\">v1.step</span>"));
  CHECK_THAT(page, Catch::Contains("dark blue: 0.1 mm"));  // of 0.2 mm in all
}

TEST_CASE("Names in the page can't break it", "[apps][report]") {
  const testing::Workplace place;
  const std::string name = "<b>'&.vtu";
  std::filesystem::rename(place.folder() / "box.vtu", place.folder() / name);
  const auto result = place.run("box.step box_moved.step \"" + name + "\" --report page.html",
                                "unset DISPLAY; PATH=/nonexistent");
  REQUIRE(result.exit_code == 0);
  const std::string page = place.read("page.html");
  CHECK_THAT(page, Catch::Contains("<h1>&lt;b&gt;&apos;&amp;.vtu onto box_moved.step</h1>"));
  CHECK_THAT(page, !Catch::Contains("<p class=\"subtitle\">from <b>"));
}

TEST_CASE("A report can't take the place of an input or of another output", "[apps][report]") {
  const testing::Workplace place;
  const std::string job = "box.step box_moved.step box.vtu -o out.vtu ";
  CHECK(place.run(job + "--report box.step").exit_code == 1);
  CHECK(place.run(job + "--picture out.vtu").exit_code == 1);
  CHECK(place.run(job + "--report a.html --json a.html").exit_code == 1);
  CHECK(place.run(job + "--report nowhere/a.html").exit_code == 6);
  CHECK(place.run("quality box.vtu --picture box.vtu").exit_code == 1);
  CHECK_FALSE(place.has("out.vtu"));
}

TEST_CASE("Of a body in a far field the picture shows what lies around the body",
          "[apps][picture]") {
  const std::string ball = source_file("models/shapes/sphere_far_field").string();
  const MorphJob job(std::make_shared<const CadModel>(read_step(ball + ".step")),
                     std::make_shared<const MeshFile>(ball + ".vtu"));
  const MorphResult result = job.morph(read_step(ball + "_variant.step"));
  const CellNeighbours neighbours = find_cell_neighbours(job.base().mesh());
  const QualityReport before = measure_quality(job.base().mesh(), job.base().mesh().points,
                                               detect_orientation(job.base().mesh()));
  DrawnMesh drawn{.mesh = job.base().mesh(),
                  .neighbours = neighbours,
                  .before = before,
                  .moved = &result.positions,
                  .after = &result.quality};
  const ScratchFolder folder;
  const double whole = box_of(job.base().mesh()).sizes().maxCoeff();
  const auto size_of = [&](const char* name) {
    return box_of(MeshFile(folder.path() / name).mesh()).sizes().maxCoeff();
  };
  write_surfaces(drawn, folder.path());
  CHECK(size_of("surface.vtu") < 0.5 * whole);
  CHECK(size_of("cut.vtu") < 0.75 * whole);  // cells go beyond the box
  // What moves as a whole is shown as a whole.
  const Points shifted = job.base().mesh().points.rowwise() + Eigen::RowVector3d(1, 0, 0);
  drawn.moved = &shifted;
  write_surfaces(drawn, folder.path());
  CHECK(size_of("surface.vtu") == whole);
}

}  // namespace
}  // namespace cadmorph
