#include "apps/batch/sensitivity_files.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <optional>
#include <set>
#include <span>

#include "apps/batch/csv.h"
#include "core/errors.h"

namespace cadmorph {
namespace {

namespace fs = std::filesystem;

// A table's coordinates may be rounded by this part of the mesh's size: those of six digits are.
constexpr double kSamePlace = 1e-5;

// A table whose first line names the columns.
class Table {
 public:
  explicit Table(const fs::path& path) : path_(path), records_(read_csv(path)) {
    if (records_.empty()) fail(1, "holds no line; the first must name the columns");
  }

  [[noreturn]] void fail(int line, const std::string& what) const {
    throw InvalidInputError(path_.string() + ":" + std::to_string(line) + ": " + what);
  }

  std::optional<std::size_t> find(const std::string& name) const {
    const auto& names = records_.front().fields;
    const auto place = std::ranges::find(names, name);
    if (place == names.end()) return {};
    return static_cast<std::size_t>(place - names.begin());
  }

  std::size_t column(const std::string& name) const {
    const auto place = find(name);
    if (place) return *place;
    std::string known;
    for (const std::string& other : records_.front().fields)
      known += (known.empty() ? "" : ", ") + other;
    fail(records_.front().line, "no column \"" + name + "\"; there are " + known);
  }

  std::span<const CsvRecord> rows() const { return std::span(records_).subspan(1); }

  const std::string& text(const CsvRecord& row, std::size_t column) const {
    if (row.fields.size() != records_.front().fields.size())
      fail(row.line, std::to_string(row.fields.size()) + " fields for " +
                         std::to_string(records_.front().fields.size()) + " columns");
    return row.fields[column];
  }

  template <class Number>
  Number number(const CsvRecord& row, std::size_t column) const {
    const std::string& field = text(row, column);
    Number value{};
    const auto [end, error] = std::from_chars(field.data(), field.data() + field.size(), value);
    if (error != std::errc() || end != field.data() + field.size())
      fail(row.line,
           "\"" + field + "\" in column \"" + records_.front().fields[column] + "\" is no number");
    return value;
  }

 private:
  fs::path path_;
  std::vector<CsvRecord> records_;
};

Sensitivity read_table(const fs::path& file, const Mesh& mesh) {
  const Table table(file);
  if (table.rows().empty()) table.fail(1, "no node stands below the columns");
  const std::size_t id = table.column("PointID");
  std::vector<std::size_t> places, slopes;
  for (const std::string axis : {"x", "y", "z"}) {
    if (axis == "z" && !table.find("Sensitivity_z")) break;
    places.push_back(table.column(axis));
    slopes.push_back(table.column("Sensitivity_" + axis));
  }
  const double size = (mesh.points.colwise().maxCoeff() - mesh.points.colwise().minCoeff()).norm();
  RowMatrix result = RowMatrix::Zero(mesh.node_count(), 3);
  std::vector<char> is_given(static_cast<std::size_t>(mesh.node_count()), 0);
  for (const CsvRecord& row : table.rows()) {
    const auto node = table.number<Index>(row, id);
    if (node < 0 || node >= mesh.node_count())
      table.fail(row.line, "PointID " + std::to_string(node) + " is not in the mesh of " +
                               std::to_string(mesh.node_count()) + " nodes");
    for (std::size_t d = 0; d < places.size(); ++d) {
      const auto axis = static_cast<Index>(d);
      const double x = table.number<double>(row, places[d]);
      if (!(std::abs(x - mesh.points(node, axis)) <= kSamePlace * size))
        table.fail(row.line, "PointID " + std::to_string(node) + " lies at " + std::to_string(x) +
                                 ", the mesh's node at " + std::to_string(mesh.points(node, axis)) +
                                 ": the table is of another mesh, or not of the base");
      const double slope = table.number<double>(row, slopes[d]);
      if (is_given[node] && slope != result(node, axis))
        table.fail(row.line,
                   "PointID " + std::to_string(node) + " stands twice, with other values");
      result(node, axis) = slope;
    }
    is_given[node] = 1;
  }
  return {std::move(result), std::move(is_given)};
}

RowMatrix read_array(const fs::path& file, const std::string& name, const MeshFile& mesh) {
  std::optional<MeshFile> other;
  if (file != mesh.path()) other.emplace(file);
  std::vector<DataArray> found;
  std::string known;
  for (DataArray& array : (other ? *other : mesh).arrays()) {
    if (array.location != ArrayLocation::Point || array.values.cols() != 3) continue;
    known += (known.empty() ? "" : ", ") + array.name;
    if (name.empty() || array.name == name) found.push_back(std::move(array));
  }
  if (found.size() != 1)
    throw InvalidInputError(
        file.string() + ": " +
        (name.empty() ? "name the array of dJ/dX by --array" : "no array " + name) +
        "; point arrays with 3 components: " + (known.empty() ? "none" : known));
  return std::move(found.front().values);
}

}  // namespace

std::vector<DesignParameter> read_parameters(const fs::path& path) {
  const Table table(path);
  const std::size_t name = table.column("name"), plus = table.column("plus"),
                    minus = table.column("minus"), step = table.column("step");
  std::vector<DesignParameter> result;
  std::set<std::string> seen;
  for (const CsvRecord& row : table.rows()) {
    DesignParameter parameter{table.text(row, name), table.text(row, plus), table.text(row, minus),
                              table.number<double>(row, step)};
    if (parameter.name.empty()) table.fail(row.line, "a parameter without a name");
    if (!seen.insert(parameter.name).second)
      table.fail(row.line, "the parameter " + parameter.name + " stands twice");
    if (!(parameter.step > 0) || !std::isfinite(parameter.step))
      table.fail(row.line, "the step of " + parameter.name + " is not positive");
    for (fs::path* file : {&parameter.plus, &parameter.minus}) {
      if (file->empty()) table.fail(row.line, "a STEP file of " + parameter.name + " is missing");
      if (file->is_relative()) *file = path.parent_path() / *file;
    }
    result.push_back(std::move(parameter));
  }
  if (result.empty()) table.fail(1, "no parameter stands below the columns");
  return result;
}

Sensitivity read_sensitivity(const fs::path& file, const std::string& array, const MeshFile& mesh) {
  Sensitivity sensitivity = file.extension() == ".csv"
                                ? read_table(file, mesh.mesh())
                                : Sensitivity{read_array(file, array, mesh), {}};
  const RowMatrix& result = sensitivity.values;
  if (result.rows() != mesh.mesh().node_count())
    throw InvalidInputError(file.string() + " has " + std::to_string(result.rows()) +
                            " nodes, the mesh " + mesh.path().string() + " " +
                            std::to_string(mesh.mesh().node_count()));
  for (Index i = 0; i < result.rows(); ++i)
    if (!result.row(i).allFinite())
      throw InvalidInputError(file.string() + ": the sensitivity of node " + std::to_string(i) +
                              " is not finite");
  return sensitivity;
}

}  // namespace cadmorph
