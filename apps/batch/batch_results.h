#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <string>

#include "apps/batch/shard.h"
#include "apps/batch/variant_list.h"
#include "core/types.h"

namespace cadmorph {

/// Figures of a variant that was morphed.
struct ResultFigures {
  double min_scaled_jacobian_before = 0, min_scaled_jacobian_after = 0;
  double mean_scaled_jacobian_before = 0, mean_scaled_jacobian_after = 0;
  double worst_twentieth_before = 0, worst_twentieth_after = 0;  ///< means of the worst 5 %
  /// Of the first cells of layers that moved, new height over old one; none without layers.
  std::optional<double> least_layer_height, most_layer_height;
  Index inverted = 0;           ///< cells that fail the exact validity test
  double cad_deviation_mm = 0;  ///< largest distance of a surface node to the variant CAD
};

/// What became of one variant.
struct ResultRow {
  std::string id;
  std::filesystem::path step;
  std::filesystem::path out;  ///< the mesh written, the failed one too; empty for none
  int exit_code = 0;          ///< as a command of its own would give
  std::optional<ResultFigures> figures;
  double seconds = 0;
  std::string message;           ///< the error, or warnings and hint
  std::string step_hash;         ///< of the STEP file; empty when unknown
  std::uintmax_t out_bytes = 0;  ///< size of `out`
  int revision = 1;              ///< higher than that of earlier rows of the same variant
};

/// What the results of a batch depend on beside the variants.
struct BatchIdentity {
  std::string program, base, base_hash, mesh, mesh_hash;
  std::string options;
};

/// Names that a variant can't have, since files of the folder do, and columns that can't be
/// carried.
bool is_results_name(const std::string& id);
bool is_results_column(const std::string& column);

/// Bytes of a file, or of all files in a folder.
std::uintmax_t size_of(const std::filesystem::path& path);

/// The folder of a batch: batch.json (identity and variants), and results.jsonl and results.csv, or
/// those of one shard: results.<i>-of-<n>.jsonl and .csv.
class BatchFolder {
 public:
  /// Makes the folder and locks the shard's results until the object ends. Throws OutputError when
  /// it can't, or another process has them.
  BatchFolder(const std::filesystem::path& folder, Shard shard);
  ~BatchFolder();
  BatchFolder(const BatchFolder&) = delete;
  BatchFolder& operator=(const BatchFolder&) = delete;

  /// Writes batch.json, or checks that it tells of the same batch; with `is_resumed` variants may
  /// be added. Throws UsageError when the batch is another, lacks variants, or has results and is
  /// not resumed.
  void begin(const BatchIdentity& identity, const VariantList& list, bool is_resumed);

  /// Read batch.json. Throw IoError when there is none, InvalidInputError when it is damaged.
  VariantList read_list() const;
  BatchIdentity read_identity() const;

  /// The newest rows in the folder by id, those of other shards too. Half-written last lines are
  /// left out.
  std::map<std::string, ResultRow> read_rows() const;

  /// Makes `rows` the contents of the shard's results, in the order of the list.
  void write_rows(const VariantList& list, const std::map<std::string, ResultRow>& rows);

  /// Appends a row. Throws OutputError, having appended nothing. Thread-safe.
  void append(const Variant& variant, const ResultRow& row);

  /// Where the mesh of a variant goes.
  std::filesystem::path path_of(const std::filesystem::path& out) const;

  /// Whether the mesh of a row is there, of as many bytes as were written.
  bool holds_mesh(const ResultRow& row) const;

  /// A hidden folder beside, for files that are being written; emptied when this object begins and
  /// gone when it ends, so that nothing half-written outlives a killed process for long.
  const std::filesystem::path& staging() const;

  /// Gives a whole file of the staging folder its place. Throws OutputError.
  void publish(const std::filesystem::path& staged, const std::filesystem::path& out) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace cadmorph
