#pragma once

#include <filesystem>
#include <vector>

namespace cadmorph {

/// Copies what is in the folder `from` into the folder `to`, which is to be the folder `target`,
/// but for the files `left_out` (paths in `from`), whose folders become real ones. Other symbolic
/// links stay links; one with a relative path out of `from` still leads to the same place. Throws
/// IoError.
void copy_folder(const std::filesystem::path& from, const std::filesystem::path& to,
                 const std::filesystem::path& target,
                 const std::vector<std::filesystem::path>& left_out);

/// Throws InvalidInputError where `target` is `from`, in it, or has it inside.
void check_apart(const std::filesystem::path& from, const std::filesystem::path& target);

/// Throws InvalidInputError where the folder `target` holds anything that `from`, of which a copy
/// is to take its place, has not.
void check_replaceable(const std::filesystem::path& target, const std::filesystem::path& from);

}  // namespace cadmorph
