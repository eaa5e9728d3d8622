#include "core/formats/deck.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <ranges>
#include <set>
#include <utility>

#include "core/byte_order_mark.h"
#include "core/errors.h"
#include "core/formats/number_fields.h"
#include "core/parallel.h"

namespace fs = std::filesystem;

namespace cadmorph {
namespace {

constexpr double kDegree = std::numbers::pi / 180;
constexpr double kRounding = 1e-9;  // of the mesh's size: what a morph leaves of a plane

/// A record that changes.
struct Edit {
  TextToken place;
  const NodeRecords* records = nullptr;
  Index node = 0;
};

/// The coordinates of a record and which of them change.
struct NewCoordinates {
  Eigen::RowVector3d point;
  std::array<bool, 3> is_changed{};
};

Eigen::RowVector3d to_mesh(const NodeRecords& records, Eigen::RowVector3d point) {
  for (const NodeFrame& frame : records.frames) point = frame.to_mesh(point);
  return point;
}

Eigen::RowVector3d to_file(const NodeRecords& records, Eigen::RowVector3d point,
                           const Eigen::RowVector3d& old_point) {
  for (const NodeFrame& frame : records.frames | std::views::reverse)
    point = frame.to_file(point, old_point);
  return point;
}

NewCoordinates new_coordinates(const Edit& edit, const Eigen::RowVector3d& in_file,
                               const Points& before, const Points& after) {
  NewCoordinates result;
  const Eigen::RowVector3d old_point = before.row(edit.node);
  result.point = after.row(edit.node);
  if (edit.records->frames.empty()) {
    for (int c = 0; c < 3; ++c) result.is_changed[std::size_t(c)] = result.point(c) != old_point(c);
    return result;
  }
  const Eigen::RowVector3d old_local = to_file(*edit.records, old_point, in_file);
  result.point = to_file(*edit.records, result.point, in_file);
  for (int c = 0; c < 3; ++c) result.is_changed[std::size_t(c)] = result.point(c) != old_local(c);
  return result;
}

double size_of(const Points& points) { return points.size() ? points.cwiseAbs().maxCoeff() : 0; }

bool is_same_place(const Edit& a, const Edit& b) { return a.place.place == b.place.place; }

/// Several instances of a part have its nodes: they must move alike.
void check_alike(const Edit& first, const Edit& second, const Points& before, const Points& after) {
  const auto motion = [&](const Edit& edit) -> Eigen::RowVector3d {
    const Eigen::RowVector3d none = Eigen::RowVector3d::Zero();
    return to_file(*edit.records, after.row(edit.node), none) -
           to_file(*edit.records, before.row(edit.node), none);
  };
  if ((motion(first) - motion(second)).norm() <= kRounding * size_of(before)) return;
  throw InvalidInputError("nodes " + std::to_string(first.node) + " and " +
                          std::to_string(second.node) + " are the same node of a part in the " +
                          first.records->owner + " and the " + second.records->owner +
                          ", but would move differently: give each instance a part of its own");
}

/// The records of a file that change, in its order; of shared ones the first.
std::vector<Edit> edits_of(const std::vector<NodeRecords>& all, std::size_t file,
                           const Points& before, const Points& after) {
  std::vector<Edit> edits;
  for (const NodeRecords& records : all) {
    if (records.file != file) continue;
    for (std::size_t i = 0; i < records.places.size(); ++i) {
      const Index node = records.nodes[i];
      if (records.is_shared || before.row(node) != after.row(node))
        edits.push_back({records.places[i], &records, node});
    }
  }
  const auto by_place = [](const Edit& a, const Edit& b) { return a.place.place < b.place.place; };
  if (!std::ranges::is_sorted(edits, by_place)) std::ranges::stable_sort(edits, by_place);
  for (std::size_t i = 1; i < edits.size(); ++i)
    if (is_same_place(edits[i - 1], edits[i])) check_alike(edits[i - 1], edits[i], before, after);
  const auto doubles = std::ranges::unique(edits, is_same_place);
  edits.erase(doubles.begin(), doubles.end());
  std::erase_if(edits,
                [&](const Edit& edit) { return before.row(edit.node) == after.row(edit.node); });
  return edits;
}

/// Appends the new record.
void write_record(const Edit& edit, std::string_view record, const Points& before,
                  const Points& after, double least, std::string& text) {
  Eigen::RowVector3d in_file = Eigen::RowVector3d::Zero();
  if (!edit.records->frames.empty()) edit.records->style->read(record, in_file);
  const NewCoordinates wanted = new_coordinates(edit, in_file, before, after);
  edit.records->style->write(record, wanted.point, wanted.is_changed, least, text);
}

/// The records that change, in the style of their file; `readable` becomes what a reader finds.
class ChangedRecords : public ReplacedText {
 public:
  ChangedRecords(std::vector<Edit> edits, const Points& before, const Points& after,
                 Points& readable)
      : edits_(std::move(edits)),
        before_(before),
        after_(after),
        readable_(readable),
        least_(kRounding * size_of(before)) {}

  Index count() const override { return std::ssize(edits_); }
  TextToken place(Index part) const override { return edits_[std::size_t(part)].place; }
  void write(Index part, std::string_view old_text, std::string& text) const override {
    const Edit& edit = edits_[std::size_t(part)];
    const std::size_t begin = text.size();
    write_record(edit, old_text, before_, after_, least_, text);
    Eigen::RowVector3d point;
    edit.records->style->read(std::string_view(text).substr(begin), point);
    readable_.row(edit.node) = to_mesh(*edit.records, point);
  }

 private:
  std::vector<Edit> edits_;
  const Points &before_, &after_;
  Points& readable_;
  double least_;
};

/// Whether a name stays below the folder that it starts from.
bool is_below(const fs::path& name) {
  const fs::path plain = name.lexically_normal();
  return plain.is_relative() && !plain.empty() && *plain.begin() != "..";
}

class DeckCopier : public MeshCopier {
 public:
  DeckCopier(std::vector<DeckFile> files, std::vector<NodeRecords> records)
      : files_(std::move(files)), records_(std::move(records)) {}

  void write(const fs::path& target, const Points& before, const Points& after) const override {
    write_accepted(target, before, after, [](const Points&) {});
  }

  void write_accepted(const fs::path& target, const Points& before, const Points& after,
                      const std::function<void(const Points&)>& accept) const override {
    check_target(target);
    std::set<fs::path> written;
    std::vector<std::pair<fs::path, fs::path>> replacing;  // files, and those that they replace
    Points readable = after;
    try {
      for (std::size_t file = files_.size(); file-- > 1;) {
        fs::path path = target_of(target, file);
        if (path.empty() || (fs::exists(path) && !holds_nodes(file))) continue;
        if (fs::exists(path)) {
          replacing.emplace_back(path.parent_path() / (".new-" + path.filename().string()), path);
          path = replacing.back().first;
        }
        create_folder_of(path, written);
        written.insert(path);
        write_file(file, path, before, after, readable, [] {});
      }
      write_file(0, target, before, after, readable, [&] { accept(readable); });
      for (const auto& [file, old] : replacing) fs::rename(file, old);
    } catch (const fs::filesystem_error& error) {
      remove(written);
      fail_writing(target, error.code().message() + ": " + error.path1().string());
    } catch (const Error&) {
      remove(written);
      throw;
    }
  }

  bool needs_folder() const override {
    for (std::size_t file = 1; file < files_.size(); ++file)
      if (holds_nodes(file)) return true;
    return false;
  }

  void check_target(const fs::path& target) const override {
    for (std::size_t file = 1; file < files_.size(); ++file) {
      const std::string name = files_[file].name.string();
      if (!holds_nodes(file)) continue;
      if (!is_below(files_[file].name))
        throw InvalidInputError("the included file " + name +
                                " holds nodes, and the deck does not name it by a path below the "
                                "deck's folder: a copy of the deck would overwrite it; put it "
                                "there, or its lines in place of the line that includes it");
      for (const fs::path& other : files_[file].others)
        if (const fs::path first = fs::absolute(target).parent_path() / other; fs::exists(first))
          throw InvalidInputError("the deck includes " + name + ", which holds nodes, but a copy " +
                                  "of it would include " + first.string() +
                                  " instead: remove that file, or write the copy into a folder "
                                  "of its own");
      const fs::path path = target_of(target, file);
      if (path.empty() || are_one_file(path, files_[file].source.path))
        throw InvalidInputError("the included file " + name +
                                " holds nodes: a copy of the deck in the same folder would "
                                "overwrite it; write the copy into another folder");
      if (fs::exists(path) && !fs::exists(target))  // else of a copy that this one replaces
        throw InvalidInputError("the deck includes " + name + ", which holds nodes, but " +
                                path.string() +
                                " is there already: remove it, or write the copy into a folder "
                                "of its own");
    }
  }

 private:
  bool holds_nodes(std::size_t file) const {
    return std::ranges::any_of(
        records_, [&](const NodeRecords& r) { return r.file == file && !r.places.empty(); });
  }

  /// Where an included file goes; empty: it stays where it is.
  fs::path target_of(const fs::path& target, std::size_t file) const {
    if (!is_below(files_[file].name)) return {};
    fs::path path = fs::absolute(target).parent_path() / files_[file].name;
    return are_one_file(path, files_[file].source.path) ? fs::path() : path;
  }

  void write_file(std::size_t file, const fs::path& path, const Points& before, const Points& after,
                  Points& readable, const std::function<void()>& accept) const {
    const SourceFile& source = files_[file].source;
    std::vector<Edit> edits = edits_of(records_, file, before, after);
    if (!edits.empty())
      return write_replaced(source, ChangedRecords(std::move(edits), before, after, readable), path,
                            accept);
    accept();
    write_unchanged(source, path);
  }

  /// Adds the folders that it creates to `written`.
  static void create_folder_of(const fs::path& path, std::set<fs::path>& written) {
    for (fs::path folder = path.parent_path(); !fs::exists(folder); folder = folder.parent_path())
      written.insert(folder);
    fs::create_directories(path.parent_path());
  }

  /// What is in a folder before it.
  static void remove(const std::set<fs::path>& written) {
    std::error_code error;
    for (const fs::path& path : written | std::views::reverse) fs::remove(path, error);
  }

  std::vector<DeckFile> files_;
  std::vector<NodeRecords> records_;
};

}  // namespace

DeckSources::DeckSources(const fs::path& path) {
  SourceBytes main = read_source(path);
  files_.push_back({.source = std::move(main.source), .name = {}});
  texts_.push_back(std::move(main.bytes));
}

DeckFile DeckSources::find(const std::string& name, DeckPlace from) const {
  const fs::path main_folder = files_[0].source.path.parent_path();
  DeckFile file;
  for (const bool has_slashes : {false, true})
    for (const fs::path& folder : folders_) {
      std::string path = (folder / name).string();
      if (has_slashes) std::ranges::replace(path, '\\', '/');
      file.name = path;
      file.source.path = main_folder / path;
      if (std::error_code error; fs::is_regular_file(file.source.path, error)) return file;
      file.others.push_back(file.name);
    }
  std::string others;
  for (const fs::path& folder : folders_ | std::views::drop(1))
    others += (others.empty() ? ", nor one in " : ", ") + folder.string();
  fail(from, "there is no file " + (main_folder / name).string() + " to include" + others +
                 "; copy it there");
}

std::size_t DeckSources::include(const std::string& name, DeckPlace from) {
  DeckFile found = find(name, from);
  const fs::path path = found.source.path;
  for (std::size_t file = 0; file < files_.size(); ++file) {
    if (!are_one_file(files_[file].source.path, path)) continue;
    if (std::ranges::find(open_, file) != open_.end())
      fail(from, "the file " + name + " includes itself");
    has_repeats_ = true;
    open_.push_back(file);
    return file;
  }
  constexpr std::size_t kMostFiles = 0xffff;  // the most that DeckPlace counts
  if (files_.size() > kMostFiles) fail(from, "the deck includes too many files");
  SourceBytes included = read_source(path);
  found.source = std::move(included.source);
  const std::lock_guard lock(*mutex_);
  files_.push_back(std::move(found));
  texts_.push_back(std::move(included.bytes));
  open_.push_back(files_.size() - 1);
  return open_.back();
}

std::vector<std::string> DeckSources::left_behind() const {
  std::vector<std::string> names;
  for (std::size_t file = 1; file < files_.size(); ++file)
    if (!is_below(files_[file].name)) names.push_back(files_[file].name.string());
  return names;
}

void DeckSources::fail(DeckPlace place, const std::string& why) const {
  std::unique_lock lock(*mutex_);
  const std::string_view text = texts_[place.file];
  const fs::path path = files_[place.file].source.path;
  lock.unlock();
  TextScanner(text, path).fail_at(place.place, why);
}

void DeckSources::fail_expected(DeckPlace place, std::string_view what,
                                std::string_view found) const {
  std::string text(trimmed(found).substr(0, 40));
  std::ranges::replace_if(
      text, [](unsigned char c) { return c < 32 || c > 126; }, '?');
  fail(place, "expected " + std::string(what) + ", found '" + text + "'");
}

std::string_view take_line(std::string_view text, std::size_t& at) {
  const std::size_t begin = at == 0 ? byte_order_mark_size(text) : at;
  const std::size_t end = std::min(text.find('\n', at), text.size());
  at = std::min(end + 1, text.size());
  std::string_view line = text.substr(begin, end - begin);
  if (line.ends_with('\r')) line.remove_suffix(1);
  return line;
}

Eigen::RowVector3d NodeFrame::to_mesh(const Eigen::RowVector3d& point) const {
  Eigen::RowVector3d local = point;
  if (is_cylindrical) {
    const double angle = point(1) * kDegree;
    local = {point(0) * std::cos(angle), point(0) * std::sin(angle), point(2)};
  }
  return local * axes.transpose() + origin;
}

Eigen::RowVector3d NodeFrame::to_file(const Eigen::RowVector3d& point,
                                      const Eigen::RowVector3d& old_point) const {
  Eigen::RowVector3d local = (point - origin) * axes;
  if (!is_cylindrical) return local;
  const double radius = std::hypot(local(0), local(1));
  if (radius == 0) return {0, old_point(1), local(2)};
  const double angle = std::atan2(local(1), local(0)) / kDegree;
  const double turns = std::round((old_point(1) - angle) / 360);
  return {radius, angle + 360 * turns, local(2)};
}

std::unique_ptr<const MeshCopier> make_deck_copier(std::vector<DeckFile> files,
                                                   std::vector<NodeRecords> records) {
  return std::make_unique<DeckCopier>(std::move(files), std::move(records));
}

}  // namespace cadmorph
