#include "core/formats/folder_copy.h"

#include <algorithm>
#include <set>
#include <system_error>

#include "core/errors.h"
#include "core/formats/mesh_format.h"

namespace fs = std::filesystem;

namespace cadmorph {
namespace {

class FolderCopy {
 public:
  FolderCopy(fs::path from, fs::path to, fs::path target, const std::vector<fs::path>& left_out)
      : from_(std::move(from)), to_(std::move(to)), target_(std::move(target)) {
    for (const fs::path& file : left_out) {
      left_out_.insert(file);
      for (fs::path folder = file.parent_path(); !folder.empty(); folder = folder.parent_path())
        real_folders_.insert(folder);
    }
  }

  void run() { copy_entries({}); }

 private:
  void copy_entries(const fs::path& folder) {
    for (const fs::directory_entry& entry : fs::directory_iterator(from_ / folder)) {
      const fs::path path = folder / entry.path().filename();
      if (left_out_.contains(path)) continue;
      const bool is_real = real_folders_.contains(path);
      if (entry.is_symlink() && !is_real) {
        copy_link(path);
      } else if (entry.is_directory()) {
        fs::create_directory(to_ / path);
        copy_entries(path);
      } else if (entry.is_regular_file()) {
        fs::copy_file(entry.path(), to_ / path);
      } else {
        fail_writing(target_, entry.path().string() + " is no file, folder or link");
      }
    }
  }

  void copy_link(const fs::path& path) {
    fs::path link = fs::read_symlink(from_ / path);
    if (link.is_relative()) {
      const fs::path inside = (path.parent_path() / link).lexically_normal();
      const bool leaves = !inside.empty() && *inside.begin() == "..";
      if (leaves) {
        const fs::path real_target = fs::weakly_canonical(target_ / path.parent_path());
        const fs::path leads_to = fs::weakly_canonical(from_ / path.parent_path()) / link;
        link = leads_to.lexically_normal().lexically_relative(real_target);
      }
    }
    fs::create_symlink(link, to_ / path);
  }

  const fs::path from_, to_, target_;
  std::set<fs::path> left_out_, real_folders_;
};

bool is_inside(const fs::path& path, const fs::path& folder) {
  return std::ranges::mismatch(folder, path).in1 == folder.end();
}

fs::path real_path(const fs::path& path) {
  const fs::path real = fs::weakly_canonical(path);
  return real.has_filename() ? real : real.parent_path();
}

[[noreturn]] void refuse(const fs::path& target, const std::string& why) {
  throw InvalidInputError("can't write the mesh " + target.string() + ": " + why);
}

}  // namespace

void copy_folder(const fs::path& from, const fs::path& to, const fs::path& target,
                 const std::vector<fs::path>& left_out) {
  try {
    FolderCopy(from, to, target, left_out).run();
  } catch (const fs::filesystem_error& error) {
    fail_writing(target, error.path1().string() + ": " + error.code().message());
  }
}

void check_apart(const fs::path& from, const fs::path& target) {
  const fs::path source = real_path(from), copy = real_path(target);
  if (copy == source) fail_writing(target, "it is the mesh read; choose another folder");
  if (is_inside(copy, source) || is_inside(source, copy))
    refuse(target, "one of it and the mesh read, " + from.string() +
                       ", is inside the other; choose a folder beside it");
}

void check_replaceable(const fs::path& target, const fs::path& from) {
  std::error_code error;
  if (!fs::is_directory(target, error)) return;
  try {
    for (const fs::directory_entry& entry : fs::recursive_directory_iterator(target)) {
      const fs::path path = entry.path().lexically_relative(target);
      if (!fs::exists(fs::symlink_status(from / path)))
        refuse(target, "the folder is there and holds what a copy of the mesh has not, '" +
                           path.string() + "'; choose another, or remove it first");
    }
  } catch (const fs::filesystem_error& failure) {
    fail_writing(target, failure.path1().string() + ": " + failure.code().message());
  }
}

}  // namespace cadmorph
