#include "apps/batch/variant_list.h"

#include <algorithm>
#include <map>
#include <optional>

#include "apps/batch/batch_results.h"
#include "apps/batch/csv.h"
#include "apps/pipeline/exit_code.h"
#include "apps/pipeline/output_file.h"
#include "core/formats/mesh_format.h"

namespace cadmorph {
namespace {

namespace fs = std::filesystem;

bool can_be_file_name(const std::string& id) {
  return !id.empty() && id.front() != '.' && id.find_first_of("/\\\n\r") == std::string::npos &&
         id.find('\0') == std::string::npos && !is_results_name(id);
}

class ManifestReader {
 public:
  ManifestReader(const fs::path& manifest, std::string mesh_extension)
      : manifest_(manifest), extension_(std::move(mesh_extension)) {}

  VariantList read() {
    const std::vector<CsvRecord> records = read_csv(manifest_);
    if (records.empty()) fail(1, "holds no line; the first must name the columns: id,step");
    read_columns(records.front());
    for (auto record = records.begin() + 1; record != records.end(); ++record) add(*record);
    if (list_.variants.empty()) fail(records.front().line, "no variant stands below the columns");
    return std::move(list_);
  }

 private:
  [[noreturn]] void fail(int line, const std::string& what) const {
    throw InvalidInputError(manifest_.string() + ":" + std::to_string(line) + ": " + what);
  }

  void read_columns(const CsvRecord& record) {
    const auto& names = record.fields;
    for (std::size_t i = 0; i < names.size(); ++i) {
      const int line = record.line;
      if (std::count(names.begin(), names.end(), names[i]) > 1)
        fail(line, "the column \"" + names[i] + "\" stands twice");
      if (names[i] == "id")
        id_ = i;
      else if (names[i] == "step")
        step_ = i;
      else if (names[i] == "out")
        out_ = i;
      else if (is_results_column(names[i]))
        fail(line, "the column \"" + names[i] + "\" has the name of one of the results; rename it");
      else
        list_.carried_columns.push_back(names[i]);
    }
    columns_ = names.size();
    if (!id_ || !step_)
      fail(record.line, "no column \"" + std::string(id_ ? "step" : "id") +
                            "\"; the first line must name the columns, as in id,step,out");
  }

  void add(const CsvRecord& record) {
    const auto& fields = record.fields;
    if (fields.size() != columns_)
      fail(record.line,
           std::to_string(fields.size()) + " fields for " + std::to_string(columns_) + " columns");
    Variant variant{.id = fields[*id_], .step = fields[*step_], .out = {}, .carried = {}};
    if (!can_be_file_name(variant.id))
      fail(record.line,
           "the id \"" + variant.id + "\" can't name a file; use letters, digits and - _ inside");
    if (variant.step.empty()) fail(record.line, "no STEP file for \"" + variant.id + "\"");
    if (variant.step.is_relative()) variant.step = manifest_.parent_path() / variant.step;
    variant.out = out_ && !fields[*out_].empty() ? fields[*out_] : variant.id + extension_;
    if (variant.out.is_absolute() || std::ranges::find(variant.out, "..") != variant.out.end())
      fail(record.line,
           "the output " + variant.out.string() + " must lie in the folder of the batch");
    if (mesh_extension(variant.out) != extension_ && !is_vtk_name(variant.out))
      fail(record.line, "the output " + variant.out.string() + " must be a " + extension_ +
                            " file, as the mesh is");
    check_new(variant.id, "the id \"" + variant.id + "\"", record.line);
    variant.out = variant.out.lexically_normal();
    for (const fs::path& out : {variant.out, failed_path(variant.out).lexically_normal()})
      check_new('/' + out.string(), "the output " + out.string(), record.line);
    for (std::size_t i = 0; i < columns_; ++i)
      if (i != id_ && i != step_ && i != out_) variant.carried.push_back(fields[i]);
    list_.variants.push_back(std::move(variant));
  }

  void check_new(const std::string& key, const std::string& what, int line) {
    const auto [seen, is_new] = lines_.emplace(key, line);
    if (!is_new) fail(line, what + " stands in line " + std::to_string(seen->second) + " already");
  }

  fs::path manifest_;
  std::string extension_;
  std::optional<std::size_t> id_, step_, out_;
  std::size_t columns_ = 0;
  std::map<std::string, int> lines_;  // ids, and outputs after a slash
  VariantList list_;
};

}  // namespace

VariantList list_variants(const std::vector<fs::path>& steps, const std::string& mesh_extension) {
  VariantList list;
  std::map<std::string, fs::path> seen;
  for (const fs::path& step : steps) {
    const std::string id = step.stem().string();
    if (!can_be_file_name(id))
      throw UsageError(step.string() + " gives no id that can name a file; use --manifest");
    // "a" that is refused writes a.failed.vtu.
    for (const std::string& name : {id, id + ".failed"}) {
      const auto [other, is_new] = seen.emplace(name, step);
      if (!is_new)
        throw UsageError(other->second.string() + " and " + step.string() + " would both write " +
                         name + mesh_extension + "; give them ids with --manifest");
    }
    list.variants.push_back({id, step, id + mesh_extension, {}});
  }
  return list;
}

VariantList read_manifest(const fs::path& manifest, const std::string& mesh_extension) {
  return ManifestReader(manifest, mesh_extension).read();
}

}  // namespace cadmorph
