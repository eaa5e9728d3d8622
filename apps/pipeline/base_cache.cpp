#include "apps/pipeline/base_cache.h"

#include <cereal/types/map.hpp>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <map>

#include "apps/pipeline/loaded_libraries.h"
#include "core/archive_types.h"
#include "core/blas.h"
#include "core/checked_file.h"
#include "core/content_hash.h"
#include "core/parallel.h"
#include "core/rbf/kernel_sum.h"
#include "core/remedies.h"

namespace cadmorph {
namespace {

namespace fs = std::filesystem;

const FileKind kCacheFile{.mark = "cadmorph base side\n",
                          .format = 3,
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
  for (const NodeGroup& group : mesh.groups)
    groups += group.name + "\n" + group.partner + "\n" + hash_of(group.nodes);
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
  for (const EdgeId id : cad.edges().ids()) {
    const CadEdge& edge = cad.edges()[id];
    for (const double t : {0.0, 0.2, 0.4, 0.6, 0.8, 1.0})
      if (!edge.is_degenerate)
        add(cad.evaluate_edge(id, edge.first + t * (edge.last - edge.first)).point);
  }
  for (const FaceId id : cad.faces().ids()) {
    const CadFace& face = cad.faces()[id];
    for (const double u : {0.0, 0.3, 0.7, 1.0})
      for (const double v : {0.0, 0.3, 0.7, 1.0}) {
        const Eigen::Vector2d weight(u, v), size = face.upper - face.lower;
        add(cad.evaluate(id, face.lower + weight.cwiseProduct(size)).point);
      }
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
  for (const auto& [first, second] : groups.periodic) all += first + "\n" + second + "\n";
  return all;
}

// The program's own bytes and its libraries count, too: another build may compute otherwise.
Key key_of(const BaseSide& side) {
  const VolumeMorphOptions& volume = side.options.volume;
  const AssociationOptions& association = side.options.surface.association;
  const Kernel& kernel = volume.kernel;
  return {{"program", file_hash("/proc/self/exe")},
          {"instruction set", name(simd::best())},
          {"BLAS kernel", blas_kernel()},
          {"set of libraries", loaded_libraries()},
          {"base CAD", file_hash(side.cad->file_name()) + contents_of(*side.cad)},
          {"mesh", hash_of_file(side.mesh_file->path()) + contents_of(side.mesh())},
          {"held, rigid, sliding, following and periodic groups",
           names_of(side.options.surface.groups)},
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
                          " is no cache of cadmorph and is left as it is; name another file (" +
                          words_for(Remedy::Cache) + "), or remove this one");
}

// Does `read` with the file, if it is there; tells in the report why it can't be used.
template <class Read>
bool try_to_read(CacheReport& report, Read&& read) {
  std::error_code error;
  if (!fs::exists(report.file, error)) return false;
  try {
    read_checked_file(report.file, kCacheFile, read);
    return true;
  } catch (const StaleError& stale) {
    report.remark = report.file.string() + " can't be used, " + stale.what() + "; it is made anew";
  } catch (const IoError& damage) {
    report.remark = damage.what();
  }
  return false;
}

template <class Write>
void try_to_write(CacheReport& report, Write&& write) {
  try {
    write_checked_file(report.file, kCacheFile, write);
    report.use = CacheUse::Written;
  } catch (const IoError& error) {
    report.use = CacheUse::NotWritten;
    report.remark += (report.remark.empty() ? "" : "; ") + std::string(error.what()) +
                     "; the base side is not kept";
  }
}

}  // namespace

CacheReport BaseCache::set_up(BaseSide& side, PhaseClock& clock) {
  CacheReport report{.file = side.options.cache};
  if (const std::string why = obstacle(report.file); !why.empty()) {
    report.use = CacheUse::NotWritten;
    report.remark =
        report.file.string() + ": can't be read (" + why + "); the base side is not kept";
    side.set_up(clock);
    return report;
  }
  check_place(report.file);
  clock.start("cache reading");
  const Key key = key_of(side);
  const bool is_read = try_to_read(report, [&](InputArchive& archive) {
    check_key(take<Key>(archive), key);
    const int threads = take<int>(archive);
    side.restore(archive);
    check_threads(side, threads);
  });
  if (is_read) {
    report.use = CacheUse::Used;
    return report;
  }
  side.set_up(clock);
  clock.start("cache writing");
  try_to_write(report, [&](OutputArchive& archive) {
    archive(key, thread_count());
    side.store(archive);
    archive(std::string(kCacheFile.mark));
  });
  return report;
}

}  // namespace cadmorph
