#include <cereal/types/map.hpp>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <map>

#include "apps/pipeline/base_side.h"
#include "apps/pipeline/loaded_libraries.h"
#include "core/archive_types.h"
#include "core/blas.h"
#include "core/checked_file.h"
#include "core/content_hash.h"
#include "core/parallel.h"
#include "core/rbf/kernel_sum.h"

namespace cadmorph {
namespace {

namespace fs = std::filesystem;

const FileKind kCacheFile{.mark = "cadmorph base side\n",
                          .format = 1,
                          .name = "cache of cadmorph",
                          .remedy = "it is made anew"};

// All that a base side depends on: what it is, and its value or the hash of its contents.
using Key = std::map<std::string, std::string>;

std::string exact(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%a", value);
  return text;
}

template <class Enum>
std::string number_of(Enum value) {
  return std::to_string(static_cast<int>(value));
}

template <class Values>
std::string hash_of(const Values& values) {
  return content_hash({reinterpret_cast<const char*>(values.data()),
                       static_cast<std::size_t>(values.size()) * sizeof(*values.data())});
}

// A file may have changed since it was read: what was read counts beside the file.
std::string contents_of(const Mesh& mesh) {
  std::string groups;
  for (const NodeGroup& group : mesh.groups) groups += group.name + "\n" + hash_of(group.nodes);
  return content_hash(groups + hash_of(mesh.points) + hash_of(mesh.types) + hash_of(mesh.offsets) +
                      hash_of(mesh.connectivity) + hash_of(mesh.polyhedron_offsets) +
                      hash_of(mesh.polyhedron_faces) + hash_of(mesh.regions));
}

// Samples of the geometry, which no change of a part leaves as they are.
std::string contents_of(const CadModel& cad) {
  std::vector<double> samples;
  const auto add = [&](const auto& point) {
    samples.insert(samples.end(), point.data(), point.data() + point.size());
  };
  for (const CadVertex& vertex : cad.vertices()) add(vertex.point);
  for (int i = 0; const CadEdge& edge : cad.edges()) {
    for (const double t : {0.0, 0.2, 0.4, 0.6, 0.8, 1.0})
      if (!edge.is_degenerate)
        add(cad.evaluate_edge(i, edge.first + t * (edge.last - edge.first)).point);
    ++i;
  }
  for (int i = 0; const CadFace& face : cad.faces()) {
    for (const double u : {0.0, 0.3, 0.7, 1.0})
      for (const double v : {0.0, 0.3, 0.7, 1.0}) {
        const Eigen::Vector2d weight(u, v), size = face.upper - face.lower;
        add(cad.evaluate(i, face.lower + weight.cwiseProduct(size)).point);
      }
    ++i;
  }
  return hash_of(samples);
}

// Of a mesh that is a folder, what was read of it counts alone.
std::string hash_of_file(const fs::path& mesh) {
  return fs::is_directory(mesh) ? std::string() : file_hash(mesh);
}

std::string names_of(const GroupConstraints& groups) {
  std::string all;
  for (const auto* names : {&groups.held, &groups.rigid, &groups.sliding, &groups.following}) {
    for (const std::string& name : *names) all += name + "\n";
    all += "\n";
  }
  return all;
}

// The program's own bytes and its libraries count, too: another build may compute otherwise.
Key key_of(const BaseInputs& inputs) {
  const VolumeMorphOptions& volume = inputs.options.volume;
  const AssociationOptions& association = inputs.options.surface.association;
  const Kernel& kernel = volume.kernel;
  return {{"program", file_hash("/proc/self/exe")},
          {"instruction set", name(simd::best())},
          {"BLAS kernel", blas_kernel()},
          {"set of libraries", loaded_libraries()},
          {"base CAD", file_hash(inputs.cad->file_name()) + contents_of(*inputs.cad)},
          {"mesh", hash_of_file(inputs.file.path()) + contents_of(inputs.mesh)},
          {"held, rigid, sliding and following groups", names_of(inputs.options.surface.groups)},
          {"mesh unit", exact(association.mesh_unit_mm)},
          {"association tolerance", exact(association.tolerance)},
          {"method", to_string(volume.method)},
          {"kernel", number_of(kernel.kind) + "," + std::to_string(kernel.order) + "," +
                         std::to_string(kernel.dimension) + "," + exact(kernel.shape)},
          {"solver", number_of(volume.rbf.solver)},
          {"tolerance", exact(volume.rbf.tolerance)},
          {"set of local lengths", hash_of(volume.rbf.local_length)},
          {"memory limit", exact(volume.rbf.memory_limit)}};
}

class StaleError : public Error {
 public:
  using Error::Error;
};

void check_key(const Key& written, const Key& wanted) {
  std::string what;
  for (const auto& [name, value] : wanted) {
    const auto found = written.find(name);
    if (found == written.end() || found->second != value) what += (what.empty() ? "" : ", ") + name;
  }
  if (!what.empty()) throw StaleError("it is of another " + what);
}

// LAPACK's own factorisations come out differently by the number of threads.
void check_threads(const BaseSide& side, int threads) {
  const SolverKind solver = side.volume->report().solver;
  if ((solver == SolverKind::Lu || solver == SolverKind::Ldlt) && threads != thread_count())
    throw StaleError("it was made by another number of threads");
}

void store(const BaseSide& side, const Key& key, OutputArchive& archive) {
  archive(key, thread_count(), side.boundary, side.surface->association(), side.rows,
          side.orientation, side.neighbours, side.quality, side.validity, side.checks);
  side.volume->store(archive);
  archive(std::string(kCacheFile.mark));
}

BaseSide restore(const BaseInputs& inputs, const Key& key, InputArchive& archive) {
  check_key(take<Key>(archive), key);
  const int threads = take<int>(archive);
  BaseSide side;
  Association association;
  archive(side.boundary, association, side.rows, side.orientation, side.neighbours, side.quality,
          side.validity, side.checks);
  side.surface.emplace(inputs.cad, inputs.mesh, side.boundary, std::move(association),
                       inputs.options.surface);
  side.volume.emplace(inputs.mesh, inputs.options.volume, archive);
  check_threads(side, threads);
  return side;
}

// Whether a file can be overwritten: whatever damage a cache took at one place, its mark is still
// at the other end.
bool is_cache(const fs::path& path) {
  std::ifstream file(path, std::ios::binary | std::ios::ate);
  const auto size = static_cast<std::size_t>(file.tellg());
  const std::string_view mark = kCacheFile.mark;
  const std::size_t length = std::min(size, mark.size());
  std::string front(length, '\0'), back(length, '\0');
  file.seekg(0).read(front.data(), static_cast<std::streamsize>(length));
  file.seekg(static_cast<std::streamoff>(size - length))
      .read(back.data(), static_cast<std::streamsize>(length));
  return front == mark.substr(0, length) || back == mark;
}

// Why a file that is there can't be opened; empty when it can.
std::string obstacle(const fs::path& path) {
  std::error_code error;
  if (!fs::is_regular_file(path, error) || std::ifstream(path).is_open()) return {};
  return std::strerror(errno);
}

void check_place(const fs::path& path) {
  std::error_code error;
  if (!fs::is_regular_file(path, error) || is_cache(path)) return;
  throw InvalidInputError(path.string() +
                          " is no cache of cadmorph and is left as it is; name another file by "
                          "--cache, or remove this one");
}

std::optional<BaseSide> read(const BaseInputs& inputs, const Key& key, CacheReport& report) {
  std::error_code error;
  if (!fs::exists(report.file, error)) return {};
  try {
    std::optional<BaseSide> side;
    read_checked_file(report.file, kCacheFile,
                      [&](InputArchive& archive) { side = restore(inputs, key, archive); });
    return side;
  } catch (const StaleError& stale) {
    report.remark = report.file.string() + " can't be used, " + stale.what() + "; it is made anew";
  } catch (const IoError& damage) {
    report.remark = damage.what();
  }
  return {};
}

void write(const BaseSide& side, const Key& key, CacheReport& report) {
  try {
    write_checked_file(report.file, kCacheFile,
                       [&](OutputArchive& archive) { store(side, key, archive); });
    report.use = CacheUse::Written;
  } catch (const IoError& error) {
    report.use = CacheUse::NotWritten;
    report.remark += (report.remark.empty() ? "" : "; ") + std::string(error.what()) +
                     "; the base side is not kept";
  }
}

}  // namespace

BaseSide cached_base_side(const BaseInputs& inputs, PhaseClock& clock, CacheReport& report) {
  report.file = inputs.options.cache;
  if (const std::string why = obstacle(report.file); !why.empty()) {
    report.use = CacheUse::NotWritten;
    report.remark =
        report.file.string() + ": can't be read (" + why + "); the base side is not kept";
    return set_up_base_side(inputs, clock);
  }
  check_place(report.file);
  clock.start("cache reading");
  const Key key = key_of(inputs);
  if (std::optional<BaseSide> side = read(inputs, key, report)) {
    report.use = CacheUse::Used;
    return std::move(*side);
  }
  BaseSide side = set_up_base_side(inputs, clock);
  clock.start("cache writing");
  write(side, key, report);
  return side;
}

}  // namespace cadmorph
