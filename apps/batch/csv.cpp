#include "apps/batch/csv.h"

#include <csv.h>

#include <algorithm>

#include "apps/pipeline/output_file.h"
#include "core/byte_order_mark.h"

namespace cadmorph {
namespace {

// Takes libcsv's fields and ends of records.
struct Collector {
  std::vector<CsvRecord> records;
  CsvRecord current{{}, 1};

  static void take_field(void* text, std::size_t size, void* self) {
    static_cast<Collector*>(self)->current.fields.emplace_back(static_cast<const char*>(text),
                                                               size);
  }
  static void end_record(int, void* self) {
    auto& collector = *static_cast<Collector*>(self);
    collector.records.push_back(collector.current);
    collector.current.fields.clear();
  }
};

class Parser {
 public:
  explicit Parser(std::string name) : name_(std::move(name)) {
    csv_init(&parser_, CSV_STRICT | CSV_STRICT_FINI);
  }
  ~Parser() { csv_free(&parser_); }
  Parser(const Parser&) = delete;
  Parser& operator=(const Parser&) = delete;

  // Line by line, so that each record's line is known.
  std::vector<CsvRecord> run(std::string_view text) {
    int& line = collector_.current.line;
    for (line = 0; !text.empty();) {
      ++line;
      const std::size_t size = std::min(text.find('\n'), text.size() - 1) + 1;
      check(csv_parse(&parser_, text.data(), size, Collector::take_field, Collector::end_record,
                      &collector_) == size);
      text.remove_prefix(size);
    }
    check(csv_fini(&parser_, Collector::take_field, Collector::end_record, &collector_) == 0);
    return std::move(collector_.records);
  }

 private:
  void check(bool is_good) {
    if (!is_good)
      throw InvalidInputError(name_ + ":" + std::to_string(collector_.current.line) +
                              ": a quote where none may stand, or one that is not closed (" +
                              csv_strerror(csv_error(&parser_)) + ")");
  }

  std::string name_;
  csv_parser parser_{};
  Collector collector_;
};

std::string quoted(const std::string& field) {
  std::string text(2 * field.size() + 2, '\0');
  text.resize(csv_write(text.data(), text.size(), field.data(), field.size()));
  return text;
}

}  // namespace

std::vector<CsvRecord> read_csv(const std::filesystem::path& path) {
  const std::string text = read_bytes(path);
  return Parser(path.string()).run(std::string_view(text).substr(byte_order_mark_size(text)));
}

std::string csv_line(const std::vector<std::string>& fields) {
  std::string line;
  for (const std::string& field : fields) {
    if (&field != &fields.front()) line += ',';
    const bool is_plain = field.find_first_of(",\"\r\n") == std::string::npos &&
                          !field.starts_with(' ') && !field.ends_with(' ');
    line += is_plain ? field : quoted(field);
  }
  return line + "\n";
}

}  // namespace cadmorph
