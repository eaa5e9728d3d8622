#include "apps/batch/batch_results.h"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <mutex>
#include <nlohmann/json.hpp>
#include <set>

#include "apps/batch/csv.h"
#include "apps/pipeline/exit_code.h"
#include "apps/pipeline/output_file.h"
#include "core/errors.h"

namespace cadmorph {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr const char* kPlan = "batch.json";
constexpr int kPlanFormat = 1;

[[noreturn]] void refuse(const fs::path& path, const std::string& why) {
  throw OutputError("can't write " + path.string() + ": " + why);
}

Json to_json(const ResultRow& row) {
  Json json = {{"id", row.id},
               {"step", row.step.string()},
               {"out", row.out.string()},
               {"status", row.exit_code == 0 ? "done" : "failed"},
               {"exit_code", row.exit_code}};
  const ResultFigures figures = row.figures.value_or(ResultFigures{});
  const auto known = [&](auto value) { return row.figures ? Json(value) : Json(nullptr); };
  json["min_scaled_jacobian_before"] = known(figures.min_scaled_jacobian_before);
  json["min_scaled_jacobian_after"] = known(figures.min_scaled_jacobian_after);
  json["mean_scaled_jacobian_before"] = known(figures.mean_scaled_jacobian_before);
  json["mean_scaled_jacobian_after"] = known(figures.mean_scaled_jacobian_after);
  json["worst_twentieth_before"] = known(figures.worst_twentieth_before);
  json["worst_twentieth_after"] = known(figures.worst_twentieth_after);
  const auto height = [](const std::optional<double>& value) {
    return value ? Json(*value) : Json(nullptr);
  };
  json["least_layer_height_ratio"] = height(figures.least_layer_height);
  json["most_layer_height_ratio"] = height(figures.most_layer_height);
  json["inverted"] = known(figures.inverted);
  json["cad_deviation_mm"] = known(figures.cad_deviation_mm);
  json["seconds"] = row.seconds;
  json["message"] = row.message;
  json["step_hash"] = row.step_hash;
  json["out_bytes"] = row.out_bytes;
  json["revision"] = row.revision;
  return json;
}

ResultRow row_of(const Json& json) {
  ResultRow row;
  row.id = json.at("id");
  row.step = json.at("step").get<std::string>();
  row.out = json.at("out").get<std::string>();
  row.exit_code = json.at("exit_code");
  row.seconds = json.at("seconds");
  row.message = json.at("message");
  row.step_hash = json.at("step_hash");
  row.out_bytes = json.at("out_bytes");
  row.revision = json.value("revision", 0);
  if (json.at("inverted").is_null()) return row;
  const auto height = [&](const char* name) -> std::optional<double> {
    const auto found = json.find(name);
    if (found == json.end() || found->is_null()) return std::nullopt;
    return found->get<double>();
  };
  row.figures = {.min_scaled_jacobian_before = json.at("min_scaled_jacobian_before"),
                 .min_scaled_jacobian_after = json.at("min_scaled_jacobian_after"),
                 .mean_scaled_jacobian_before = json.at("mean_scaled_jacobian_before"),
                 .mean_scaled_jacobian_after = json.at("mean_scaled_jacobian_after"),
                 .worst_twentieth_before = json.value("worst_twentieth_before", 0.0),
                 .worst_twentieth_after = json.value("worst_twentieth_after", 0.0),
                 .least_layer_height = height("least_layer_height_ratio"),
                 .most_layer_height = height("most_layer_height_ratio"),
                 .inverted = json.at("inverted"),
                 .cad_deviation_mm = json.at("cad_deviation_mm")};
  return row;
}

// Nothing for a line that is no row.
std::optional<ResultRow> parse_row(const std::string& line) {
  try {
    return row_of(Json::parse(line));
  } catch (const Json::exception&) {
    return {};
  }
}

// File names need not be UTF-8.
std::string dump(const Json& json, int indent = -1) {
  return json.dump(indent, ' ', false, Json::error_handler_t::replace) + "\n";
}

std::vector<std::string> keys_of(const Json& json) {
  std::vector<std::string> keys;
  for (const auto& [key, value] : json.items()) keys.push_back(key);
  return keys;
}

std::vector<std::string> fields_of(const Json& json) {
  std::vector<std::string> fields;
  for (const auto& [key, value] : json.items())
    fields.push_back(value.is_null()     ? ""
                     : value.is_string() ? value.get<std::string>()
                                         : value.dump());
  return fields;
}

Json with_carried(Json json, const std::vector<std::string>& columns, const Variant& variant) {
  for (std::size_t i = 0; i < columns.size(); ++i) json[columns[i]] = variant.carried[i];
  return json;
}

// A file that grows by whole records.
class AppendedFile {
 public:
  explicit AppendedFile(fs::path path)
      : path_(std::move(path)), file_(open(path_.c_str(), O_WRONLY | O_APPEND | O_CLOEXEC)) {
    if (file_ < 0) refuse(path_, std::strerror(errno));
  }
  ~AppendedFile() { close(file_); }
  AppendedFile(const AppendedFile&) = delete;
  AppendedFile& operator=(const AppendedFile&) = delete;

  void append(const std::string& record) {
    const off_t before = lseek(file_, 0, SEEK_END);
    const ssize_t count = write(file_, record.data(), record.size());
    if (count == static_cast<ssize_t>(record.size())) return;
    const std::string why = count < 0 ? std::strerror(errno) : "the disk is full";
    // A part of a record is dropped when it is read, too, should this fail.
    if (count > 0) (void)!ftruncate(file_, before);
    refuse(path_, why);
  }

 private:
  fs::path path_;
  int file_;
};

// Holds a file locked while it lives. The file stays: another process may just have opened it.
class LockFile {
 public:
  explicit LockFile(const fs::path& path)
      : file_(open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0666)) {
    if (file_ < 0) refuse(path, std::strerror(errno));
    if (flock(file_, LOCK_EX | LOCK_NB) != 0) {
      const bool is_taken = errno == EWOULDBLOCK;
      const std::string why = is_taken ? "" : std::strerror(errno);
      close(file_);
      if (!is_taken) refuse(path, why);
      throw OutputError(path.string() + " is locked: " + owner(path) +
                        " is at work on these variants. Wait for it, or name another folder or "
                        "shard.");
    }
    char host[256] = "";
    gethostname(host, sizeof host - 1);
    const std::string text = "process " + std::to_string(getpid()) + " on " + host + "\n";
    if (ftruncate(file_, 0) != 0 || write(file_, text.data(), text.size()) < 0)
      refuse(path, std::strerror(errno));
  }
  ~LockFile() { close(file_); }
  LockFile(const LockFile&) = delete;
  LockFile& operator=(const LockFile&) = delete;

 private:
  static std::string owner(const fs::path& path) {
    std::string line;
    std::ifstream file(path);
    std::getline(file, line);
    return line.empty() ? "another process" : line;
  }

  int file_;
};

Json to_json(const BatchIdentity& identity) {
  return {{"program", identity.program},     {"base", identity.base},
          {"base_hash", identity.base_hash}, {"mesh", identity.mesh},
          {"mesh_hash", identity.mesh_hash}, {"options", identity.options}};
}

BatchIdentity identity_of(const Json& json) {
  return {.program = json.at("program"),
          .base = json.at("base"),
          .base_hash = json.at("base_hash"),
          .mesh = json.at("mesh"),
          .mesh_hash = json.at("mesh_hash"),
          .options = json.at("options")};
}

Json to_json(const VariantList& list) {
  Json variants = Json::array();
  for (const Variant& variant : list.variants)
    variants.push_back({{"id", variant.id},
                        {"step", variant.step.string()},
                        {"out", variant.out.string()},
                        {"carried", variant.carried}});
  return {{"carried_columns", list.carried_columns}, {"variants", variants}};
}

VariantList list_of(const Json& json) {
  VariantList list;
  list.carried_columns = json.at("carried_columns").get<std::vector<std::string>>();
  for (const Json& item : json.at("variants")) {
    list.variants.push_back({item.at("id"), item.at("step").get<std::string>(),
                             item.at("out").get<std::string>(), item.at("carried")});
    if (list.variants.back().carried.size() != list.carried_columns.size())
      throw InvalidInputError("batch.json is damaged: \"" + list.variants.back().id +
                              "\" has fields of other columns");
  }
  return list;
}

// What differs between two batches, in words.
std::string difference(const Json& old, const Json& now) {
  std::string text;
  const auto note = [&](const char* key, const std::string& what) {
    if (old.at(key) != now.at(key)) text += (text.empty() ? "" : ", ") + what;
  };
  note("program", "the version of cadmorph");
  note("base_hash", "the base CAD");
  note("mesh_hash", "the mesh");
  note("options", "the options (then \"" + old.at("options").get<std::string>() + "\", now \"" +
                      now.at("options").get<std::string>() + "\")");
  return text;
}

// Variants of the plan that a list lacks, the first of them by name.
std::string lacking(const VariantList& plan, const VariantList& list) {
  constexpr std::size_t kNamed = 3;  // as many as a line holds
  std::set<std::string> given;
  for (const Variant& variant : list.variants) given.insert(variant.id);
  std::string text;
  std::size_t count = 0;
  for (const Variant& variant : plan.variants)
    if (!given.contains(variant.id) && ++count <= kNamed)
      text.append(count > 1 ? ", " : "").append(variant.id);
  if (count > kNamed) text += std::string(" and ") + std::to_string(count - kNamed) + " more";
  return text;
}

// Whole lines of a file, without their ends.
std::vector<std::string> whole_lines(const fs::path& path) {
  const std::string text = read_bytes(path);
  std::vector<std::string> lines;
  for (std::size_t begin = 0, end; (end = text.find('\n', begin)) != std::string::npos;
       begin = end + 1)
    lines.push_back(text.substr(begin, end - begin));
  return lines;
}

}  // namespace

std::uintmax_t size_of(const fs::path& path) {
  std::error_code error;
  if (!fs::is_directory(path, error)) return fs::file_size(path, error);
  std::uintmax_t size = 0;
  for (const auto& entry : fs::recursive_directory_iterator(path, error))
    if (entry.is_regular_file(error)) size += entry.file_size(error);
  return size;
}

bool is_results_name(const std::string& id) {
  return id == "results" || id.starts_with("results.") || id == "batch" || id == "pictures";
}

bool is_results_column(const std::string& column) {
  static const std::vector<std::string> all = keys_of(to_json(ResultRow{}));
  return std::ranges::find(all, column) != all.end();
}

struct BatchFolder::Impl {
  Impl(const fs::path& batch_folder, Shard shard) : folder(batch_folder) {
    if (shard.count > 1)
      stem += std::string(".") + std::to_string(shard.index) + "-of-" + std::to_string(shard.count);
    std::error_code error;
    fs::create_directories(folder, error);
    if (error && !fs::is_directory(folder)) refuse(folder, error.message());
    lock.emplace(folder / ("." + stem + ".lock"));
    staging = folder / ("." + stem + ".partial");
    fs::remove_all(staging, error);
    fs::create_directory(staging, error);
    if (error) refuse(staging, error.message());
  }
  ~Impl() {
    std::error_code ignored;
    fs::remove_all(staging, ignored);
  }

  void replace(const fs::path& path, const std::string& text) const {
    const fs::path staged = staging / path.filename();
    write_text(staged, text);
    move(staged, path);
  }

  static void move(const fs::path& from, const fs::path& to) {
    std::error_code error;
    fs::rename(from, to, error);
    if (error) refuse(to, error.message());
  }

  fs::path json_lines() const { return folder / (stem + ".jsonl"); }
  fs::path csv() const { return folder / (stem + ".csv"); }

  Json read_plan() const {
    const fs::path path = folder / kPlan;
    if (!fs::exists(path))
      throw IoError(path.string() + ": can't be read; is this the folder of a batch?");
    try {
      Json plan = Json::parse(read_bytes(path));
      if (plan.at("format") != kPlanFormat)
        throw InvalidInputError(path.string() + ": of another version of cadmorph");
      identity_of(plan.at("identity"));
      list_of(plan);
      return plan;
    } catch (const Json::exception&) {
      throw InvalidInputError(
          path.string() +
          ": damaged, or cut short. Nothing else tells of what the results in that folder are: "
          "start the batch anew in another one.");
    }
  }

  fs::path folder, staging;
  std::string stem = "results";
  std::optional<LockFile> lock;
  std::vector<std::string> columns;
  std::optional<AppendedFile> json_file, csv_file;
  std::mutex mutex;
};

BatchFolder::BatchFolder(const fs::path& folder, Shard shard)
    : impl_(std::make_unique<Impl>(folder, shard)) {}

BatchFolder::~BatchFolder() = default;

void BatchFolder::begin(const BatchIdentity& identity, const VariantList& list, bool is_resumed) {
  Json plan = {{"format", kPlanFormat}, {"identity", to_json(identity)}};
  plan.update(to_json(list));
  const std::string folder = impl_->folder.string();
  if (fs::exists(impl_->folder / kPlan)) {
    const Json old = impl_->read_plan();
    const std::string differs = difference(old.at("identity"), plan["identity"]);
    if (!differs.empty())
      throw UsageError(folder + " holds another batch; different: " + differs +
                       ". Name another folder with -o.");
    if (!is_resumed && fs::exists(impl_->json_lines()))
      throw UsageError(folder +
                       " holds results of this batch already; go on with --resume, or name "
                       "another folder with -o.");
    if (!is_resumed && old.at("variants") != plan["variants"])
      throw UsageError(folder +
                       " holds a batch of other variants; give them all with --resume, or name "
                       "another folder with -o.");
    if (const std::string lacks = lacking(list_of(old), list); !lacks.empty())
      throw UsageError(folder + " holds variants that are not given: " + lacks +
                       ". Give them, too (what is finished is kept), or name another folder with "
                       "-o.");
    if (old == plan) return;
  } else if (fs::exists(impl_->json_lines()) || fs::exists(impl_->csv())) {
    throw UsageError(folder + " holds " + impl_->csv().filename().string() +
                     " but no batch.json, which would tell what its results are of. Move them "
                     "away, or name another folder with -o.");
  }
  impl_->replace(impl_->folder / kPlan, dump(plan, 1));
}

VariantList BatchFolder::read_list() const { return list_of(impl_->read_plan()); }

BatchIdentity BatchFolder::read_identity() const {
  return identity_of(impl_->read_plan().at("identity"));
}

std::map<std::string, ResultRow> BatchFolder::read_rows() const {
  std::map<std::string, ResultRow> rows;
  std::vector<fs::path> files;
  for (const auto& entry : fs::directory_iterator(impl_->folder))
    if (entry.path().extension() == ".jsonl" && is_results_name(entry.path().stem().string()))
      files.push_back(entry.path());
  std::ranges::sort(files);
  for (const fs::path& path : files)
    for (const std::string& line : whole_lines(path)) {
      const std::optional<ResultRow> row = parse_row(line);
      if (!row) continue;
      const auto [place, is_new] = rows.try_emplace(row->id, *row);
      if (!is_new && row->revision >= place->second.revision) place->second = *row;
    }
  return rows;
}

void BatchFolder::write_rows(const VariantList& list,
                             const std::map<std::string, ResultRow>& rows) {
  std::string json_text;
  std::vector<std::string> header = keys_of(to_json(ResultRow{}));
  header.insert(header.end(), list.carried_columns.begin(), list.carried_columns.end());
  std::string csv_text = csv_line(header);
  for (const Variant& variant : list.variants) {
    const auto row = rows.find(variant.id);
    if (row == rows.end()) continue;
    const Json json = with_carried(to_json(row->second), list.carried_columns, variant);
    json_text += dump(json);
    csv_text += csv_line(fields_of(json));
  }
  impl_->json_file.reset();
  impl_->csv_file.reset();
  impl_->replace(impl_->json_lines(), json_text);
  impl_->replace(impl_->csv(), csv_text);
  impl_->json_file.emplace(impl_->json_lines());
  impl_->csv_file.emplace(impl_->csv());
  impl_->columns = list.carried_columns;
}

void BatchFolder::append(const Variant& variant, const ResultRow& row) {
  const Json json = with_carried(to_json(row), impl_->columns, variant);
  const std::lock_guard guard(impl_->mutex);
  impl_->json_file->append(dump(json));
  impl_->csv_file->append(csv_line(fields_of(json)));
}

fs::path BatchFolder::path_of(const fs::path& out) const { return impl_->folder / out; }

bool BatchFolder::holds_mesh(const ResultRow& row) const {
  std::error_code error;
  const fs::path out = path_of(row.out);
  return fs::exists(out, error) && size_of(out) == row.out_bytes;
}

const fs::path& BatchFolder::staging() const { return impl_->staging; }

void BatchFolder::publish(const fs::path& staged, const fs::path& out) const {
  Impl::move(staged, path_of(out));
}

}  // namespace cadmorph
