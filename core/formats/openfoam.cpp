#include <algorithm>
#include <charconv>
#include <map>
#include <system_error>

#include "core/errors.h"
#include "core/formats/folder_copy.h"
#include "core/formats/formats.h"
#include "core/formats/openfoam/poly_mesh.h"
#include "core/temporary_file.h"

namespace fs = std::filesystem;

namespace cadmorph {
namespace {

bool is_folder(const fs::path& path) {
  std::error_code error;
  return fs::is_directory(path, error);
}

/// The polyMesh folder of a case, of its constant folder or of a time; empty when there is none.
fs::path find_poly_mesh(const fs::path& folder) {
  for (const fs::path& path : {folder / "constant" / "polyMesh", folder / "polyMesh"})
    if (is_folder(path)) return path;
  const bool is_itself =
      !find_foam_file(folder, "faces").empty() || !find_foam_file(folder, "owner").empty();
  return is_itself ? folder : fs::path();
}

/// The names of the folders in a folder.
std::vector<std::string> folders_in(const fs::path& folder) {
  std::vector<std::string> names;
  std::error_code error;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder, error))
    if (entry.is_directory(error)) names.push_back(entry.path().filename().string());
  std::ranges::sort(names);
  return names;
}

/// The whole of a text as a number.
template <class Number>
bool parse(std::string_view text, Number& value) {
  const auto [last, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  return error == std::errc() && last == text.data() + text.size() && !text.starts_with('-');
}

/// The meshes in a folder.
struct CaseMeshes {
  fs::path whole;                    ///< its polyMesh folder; empty: there is none
  std::map<int, fs::path> pieces;    ///< polyMesh folders by the number of the processor
  std::string collated;              ///< a folder of pieces in OpenFOAM's collated form
  std::vector<std::string> regions;  ///< folders in constant with a mesh each
};

CaseMeshes find_meshes(const fs::path& folder) {
  CaseMeshes found;
  found.whole = find_poly_mesh(folder);
  const std::string processor = "processor";
  for (const std::string& name : folders_in(folder)) {
    int number = 0;
    const fs::path poly_mesh = folder / name / "constant" / "polyMesh";
    if (!name.starts_with(processor) || !is_folder(poly_mesh)) continue;
    if (parse(std::string_view(name).substr(processor.size()), number))
      found.pieces[number] = poly_mesh;
    else if (name.starts_with(processor + "s"))
      found.collated = name;
  }
  for (const std::string& name : folders_in(folder / "constant"))
    if (is_folder(folder / "constant" / name / "polyMesh")) found.regions.push_back(name);
  return found;
}

bool has_mesh(const CaseMeshes& found) {
  return !found.whole.empty() || !found.pieces.empty() || !found.collated.empty() ||
         !found.regions.empty();
}

[[noreturn]] void refuse(const fs::path& target, const std::string& why) {
  throw InvalidInputError("can't write the mesh " + target.string() + ": " + why);
}

/// Writes copies of the folder with other points files.
class FoamCopier : public MeshCopier {
 public:
  FoamCopier(fs::path folder, std::vector<FoamPoints> files)
      : folder_(std::move(folder)), files_(std::move(files)) {}

  void write(const fs::path& target, const Points& before, const Points& after) const override {
    check_target(target);
    TemporaryFolder copy(target);
    std::vector<fs::path> paths;
    for (const FoamPoints& file : files_)
      paths.push_back(file.source.path.lexically_relative(folder_));
    copy_folder(folder_, copy.path(), target, paths);
    for (std::size_t i = 0; i < files_.size(); ++i)
      write_copy(files_[i].source, files_[i].places, before, after, copy.path() / paths[i]);
    copy.commit();
  }

  void check_target(const fs::path& target) const override {
    check_apart(folder_, target);
    std::error_code error;
    if (fs::exists(target, error) && !is_folder(target))
      refuse(target, "there is a file of that name, but it is to be a folder");
    if (!is_folder(target)) return;
    if (!fs::is_empty(target, error) && !has_mesh(find_meshes(target)))
      refuse(target, "the folder is there and no case of OpenFOAM; choose another");
    check_replaceable(target, folder_);
  }

  Points readable(const Points& before, const Points& after) const override {
    Points worst;
    for (const FoamPoints& file : files_) {
      Points readable = readable_points(file.places, before, after);
      if (readable.rows() == 0) continue;
      if (worst.rows() == 0) {
        worst = std::move(readable);
        continue;
      }
      for (Index n = 0; n < worst.rows(); ++n)
        if ((readable.row(n) - after.row(n)).norm() > (worst.row(n) - after.row(n)).norm())
          worst.row(n) = readable.row(n);
    }
    return worst;
  }

 private:
  fs::path folder_;
  std::vector<FoamPoints> files_;
};

/// The points file of a piece, of which nodes its rows are.
FoamPoints with_nodes(FoamPoints file, std::vector<Index> nodes) {
  if (auto* text = std::get_if<TextPlaces>(&file.places))
    text->nodes = std::move(nodes);
  else
    for (BinaryRun& run : std::get<BinaryPlaces>(file.places).runs) run.nodes = nodes;
  return file;
}

/// Tells of time folders: their results, and meshes of their own.
void remark_times(const fs::path& folder, std::vector<std::string>& remarks) {
  std::vector<std::pair<double, std::string>> results, meshes;
  for (const std::string& name : folders_in(folder)) {
    double time = 0;
    if (!parse(name, time)) continue;
    if (time > 0) results.emplace_back(time, name);
    if (is_folder(folder / name / "polyMesh")) meshes.emplace_back(time, name);
  }
  const auto list = [](auto& times) {
    std::ranges::sort(times);
    std::string text;
    for (const auto& [time, name] : times) text += (text.empty() ? "" : ", ") + name;
    return text;
  };
  if (!results.empty())
    remarks.push_back("the folders of times " + list(results) +
                      " are copied as they are: results on the base mesh");
  if (!meshes.empty())
    remarks.push_back("the folders of times " + list(meshes) +
                      " have a polyMesh of their own, which is copied as it is, of the base");
}

void check_numbers(const fs::path& path, const CaseMeshes& found) {
  int expected = 0;
  for (const auto& [number, folder] : found.pieces) {
    if (number != expected)
      fail_reading(path, "the folder processor" + std::to_string(expected) +
                             " is missing, but there is processor" +
                             std::to_string(found.pieces.rbegin()->first));
    ++expected;
  }
}

/// Reads the whole mesh; the pieces, if there are any, get the points of their nodes.
Mesh read_whole(const CaseMeshes& found, std::vector<FoamPoints>& files,
                std::vector<std::string>& remarks) {
  PolyMesh whole = read_poly_mesh(found.whole);
  for (const auto& [number, folder] : found.pieces) {
    PolyMesh piece = read_poly_mesh_points(folder);
    std::vector<Index> nodes = nodes_of_piece(whole, piece, remarks);
    files.push_back(with_nodes(std::move(piece.file), std::move(nodes)));
  }
  files.push_back(std::move(whole.file));
  return to_mesh(std::move(whole));
}

Mesh read_pieces(const CaseMeshes& found, std::vector<FoamPoints>& files,
                 std::vector<std::string>& remarks) {
  std::vector<PolyMesh> pieces;
  for (const auto& [number, folder] : found.pieces) pieces.push_back(read_poly_mesh(folder));
  for (PolyMesh& piece : pieces) files.push_back(std::move(piece.file));
  JoinedPieces joined = join_pieces(std::move(pieces));
  for (std::size_t p = 0; p < files.size(); ++p)
    files[p] = with_nodes(std::move(files[p]), std::move(joined.nodes[p]));
  remarks.insert(remarks.end(), joined.remarks.begin(), joined.remarks.end());
  return to_mesh(std::move(joined.mesh));
}

Recognition recognise(const FileStart& start) {
  return start.is_folder && has_mesh(find_meshes(start.path)) ? Recognition::Sure : Recognition::No;
}

ReadMesh read(const fs::path& given) {
  const fs::path path = fs::absolute(given).lexically_normal();
  const CaseMeshes found = find_meshes(path);
  if (found.whole.empty() && found.pieces.empty()) {
    if (!found.collated.empty())
      fail_reading(given, "the pieces in " + found.collated +
                              " are in OpenFOAM's collated form, which is not supported; write "
                              "them with '-fileHandler uncollated' first");
    std::string regions;
    for (const std::string& name : found.regions) regions += " constant/" + name;
    fail_reading(given, "it has a mesh for each of several regions; give one of:" + regions);
  }
  check_numbers(given, found);
  ReadMesh result;
  std::vector<FoamPoints> files;
  const bool is_whole = !found.whole.empty();
  result.mesh = is_whole ? read_whole(found, files, result.remarks)
                         : read_pieces(found, files, result.remarks);
  if (!found.pieces.empty())
    result.remarks.push_back(
        (is_whole ? "the whole mesh was read; " : "one mesh was read from the pieces; ") +
        std::to_string(found.pieces.size()) + " processor folders get their points");
  if (!found.collated.empty())
    result.remarks.push_back("the pieces in " + found.collated +
                             " stay those of the base: decompose the case anew");
  remark_times(path, result.remarks);
  if (!found.pieces.empty()) remark_times(path / "processor0", result.remarks);
  result.copier = std::make_unique<FoamCopier>(path, std::move(files));
  return result;
}

}  // namespace

const MeshFormat& openfoam_format() {
  static const MeshFormat format{.name = "OpenFOAM",
                                 .extensions = {},
                                 .recognise = recognise,
                                 .read = read,
                                 .is_of_finite_volumes = true};
  return format;
}

}  // namespace cadmorph
