#include "core/formats/hdf5_coordinates.h"

#include <algorithm>
#include <optional>
#include <span>
#include <utility>

#include "core/errors.h"
#include "core/formats/child_process.h"
#include "core/formats/coordinate_places.h"
#include "core/formats/source_file.h"
#include "core/temporary_file.h"

namespace fs = std::filesystem;

namespace cadmorph {
namespace {

/// A run in a dataset that HDF5 has to write.
struct RewrittenRun {
  std::string dataset;
  BinaryRun run;  ///< its place and stride count numbers, not bytes
};

Index node_of(const BinaryRun& run, Index i) {
  return run.nodes.empty() ? run.first_node + i : run.nodes[std::size_t(i)];
}

struct Part {
  BinaryRun run;
  Index first = 0, step = 1;  ///< of its numbers in the dataset
};

/// The part of `run` whose numbers lie in `extent`; nothing where there is none.
std::optional<Part> part_in(const Hdf5Run& run, const Hdf5Extent& extent,
                            const Hdf5Number& number) {
  const auto step_to = [&](Index place) {  // the first i with first + i * step >= place
    return place <= run.first ? 0 : (place - run.first + run.step - 1) / run.step;
  };
  const Index begin = step_to(extent.first);
  const Index end = std::min(run.count, step_to(extent.first + extent.count));
  if (begin >= end) return {};
  const std::uint64_t size =
      number.type == BinaryRun::Type::Float32 ? sizeof(float) : sizeof(double);
  BinaryRun part{
      .place = extent.place + std::uint64_t(run.first + begin * run.step - extent.first) * size,
      .stride = std::uint64_t(run.step) * size,
      .count = end - begin,
      .component = run.component,
      .type = number.type,
      .is_big_endian = number.is_big_endian,
      .first_node = run.first_node + begin};
  if (!run.nodes.empty()) part.nodes.assign(run.nodes.begin() + begin, run.nodes.begin() + end);
  return Part{.run = std::move(part), .first = run.first + begin * run.step, .step = run.step};
}

/// Whether the bytes at the places of `part` are the values that the library gave; reads them into
/// `points`.
bool lies_there(const Part& part, const std::vector<double>& values, std::string_view bytes,
                const fs::path& path, Points& points) {
  if (part.run.place > bytes.size()) return false;
  read_runs(bytes, {{part.run}}, path, points);
  for (Index i = 0; i < part.run.count; ++i)
    if (points(node_of(part.run, i), part.run.component) !=
        values[std::size_t(part.first + i * part.step)])
      return false;
  return true;
}

class Hdf5Copier : public MeshCopier {
 public:
  Hdf5Copier(SourceFile source, BinaryPlaces places, std::vector<RewrittenRun> rewritten)
      : source_(std::move(source)), places_(std::move(places)), rewritten_(std::move(rewritten)) {
    all_ = places_;
    for (const RewrittenRun& run : rewritten_) all_.runs.push_back(run.run);
  }

  void write(const fs::path& target, const Points& before, const Points& after) const override {
    check_components(all_, before, after);
    const std::vector<Change> changes = changes_of(before, after);
    if (changes.empty()) return write_places(source_, places_, before, after, target);
    FileBytes bytes = read_again(source_);
    replace_coordinates({bytes.data(), bytes.size()}, places_, before, after);
    TemporaryFile file(target);
    file.write(bytes.data(), bytes.size(), 0);
    const ChildProcess process(seconds_to_read(bytes.size()), [&](const Socket& socket) {
      {
        const Hdf5Library library(file.path(), Hdf5Library::Mode::Write);
        for (const Change& change : changes)
          library.replace(change.dataset, change.positions, change.values);
        library.flush();
      }  // closed: else the file stays marked as being written
      constexpr char kDone = 1;
      socket.send(&kDone, 1);
    });
    if (char done = 0; !process.socket().receive(&done, 1))
      fail_writing(target, "HDF5 can't write its coordinates anew; it may be damaged");
    file.commit();
  }
  Points readable(const Points& before, const Points& after) const override {
    return readable_points(all_, before, after);
  }

 private:
  /// New numbers of a dataset.
  struct Change {
    std::string dataset;
    std::vector<Index> positions;
    std::vector<double> values;
  };

  std::vector<Change> changes_of(const Points& before, const Points& after) const {
    std::vector<Change> changes;
    for (const auto& [dataset, run] : rewritten_)
      for (Index i = 0; i < run.count; ++i) {
        const Index node = node_of(run, i);
        const double value = after(node, run.component);
        if (value == before(node, run.component)) continue;
        if (changes.empty() || changes.back().dataset != dataset)
          changes.push_back({.dataset = dataset, .positions = {}, .values = {}});
        changes.back().positions.push_back(Index(run.place) + i * Index(run.stride));
        changes.back().values.push_back(value);
      }
    return changes;
  }

  SourceFile source_;
  BinaryPlaces places_;
  std::vector<RewrittenRun> rewritten_;  ///< those of a dataset one after the other
  BinaryPlaces all_;                     ///< both, for all but their places
};

}  // namespace

std::unique_ptr<const MeshCopier> read_hdf5_coordinates(const Hdf5File& file,
                                                        const std::vector<Hdf5Run>& runs,
                                                        Points& points) {
  const SourceBytes source = read_source(file.path());
  BinaryPlaces places;
  std::vector<RewrittenRun> rewritten;
  std::string name;
  std::vector<double> values;
  std::vector<Hdf5Extent> extents;
  Hdf5Number number;
  for (const Hdf5Run& run : runs) {
    if (run.count == 0) continue;
    if (run.dataset != name) {
      name = run.dataset;
      number = file.coordinate_type(name);
      values = file.numbers(name);
      extents = file.extents(name);
    }
    const Index last = run.first + (run.count - 1) * run.step;
    if (last >= std::ssize(values))
      file.fail(name, "it has " + std::to_string(values.size()) +
                          " numbers, too few for the coordinates of " + std::to_string(run.count) +
                          " nodes");
    BinaryPlaces parts;
    Index count = 0;
    for (const Hdf5Extent& extent : extents)
      if (std::optional<Part> part = part_in(run, extent, number)) {
        if (!lies_there(*part, values, source.bytes, file.path(), points)) break;
        count += part->run.count;
        parts.runs.push_back(std::move(part->run));
      }
    if (count == run.count) {
      std::ranges::move(parts.runs, std::back_inserter(places.runs));
      continue;
    }
    RewrittenRun kept{.dataset = name,
                      .run = {.place = std::uint64_t(run.first),
                              .stride = std::uint64_t(run.step),
                              .count = run.count,
                              .component = run.component,
                              .type = number.type,
                              .first_node = run.first_node,
                              .nodes = run.nodes}};
    for (Index i = 0; i < run.count; ++i)
      points(node_of(kept.run, i), run.component) = values[std::size_t(run.first + i * run.step)];
    rewritten.push_back(std::move(kept));
  }
  return std::make_unique<Hdf5Copier>(source.source, std::move(places), std::move(rewritten));
}

}  // namespace cadmorph
