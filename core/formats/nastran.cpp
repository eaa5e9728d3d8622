#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <forward_list>
#include <map>
#include <span>
#include <utility>

#include "core/cell_topology.h"
#include "core/errors.h"
#include "core/formats/deck.h"
#include "core/formats/formats.h"
#include "core/formats/number_fields.h"
#include "core/formats/numbered_mesh.h"

namespace fs = std::filesystem;

namespace cadmorph {
namespace {

constexpr std::size_t kSmall = 8, kLarge = 16;  // columns of a field

/// What the lines of a text may have: looked for once, not line by line.
struct Marks {
  explicit Marks(std::string_view text)
      : has_commas(text.find(',') != std::string_view::npos),
        has_tabs(text.find('\t') != std::string_view::npos),
        has_comments(text.find('$') != std::string_view::npos) {}

  /// Whether every field stands in its columns, and nothing else.
  bool are_none() const { return !has_commas && !has_tabs && !has_comments; }

  bool has_commas, has_tabs, has_comments;
};

std::string_view without_comment(std::string_view line) {
  return line.substr(0, std::min(line.find('$'), line.size()));
}

/// A tab goes on to the next field of 8 columns.
std::string without_tabs(std::string_view line) {
  std::string result;
  for (const char c : line) {
    if (c != '\t')
      result += c;
    else
      result.append(kSmall - result.size() % kSmall, ' ');
  }
  return result;
}

bool is_free(std::string_view line) { return line.find(',') != std::string_view::npos; }

bool is_empty(std::string_view line) { return std::ranges::all_of(line, is_blank); }

/// What stands in the first field of a line.
std::string_view name_field(std::string_view line, const Marks& marks) {
  if (marks.has_commas && is_free(line)) return trimmed(line.substr(0, line.find(',')));
  const std::string_view field = line.substr(0, kSmall);
  return trimmed(marks.has_tabs ? field.substr(0, field.find('\t')) : field);
}
std::string_view name_field(std::string_view line) { return name_field(line, Marks(line)); }

bool is_continuation(std::string_view line) {
  if (std::isalpha(static_cast<unsigned char>(line.front()))) return false;  // most lines
  const std::string_view name = name_field(line);
  return name.empty() || name.front() == '+' || name.front() == '*';
}

constexpr std::string_view kInclude = "INCLUDE";

bool is_include(std::string_view line) {
  const std::string_view name = trimmed(line).substr(0, kInclude.size());
  return (name.front() == 'I' || name.front() == 'i') && upper(name) == kInclude;
}

/// Where the INCLUDE card at `begin` ends: a name in quotes may go over several lines.
std::size_t end_of_include(std::string_view text, std::size_t begin) {
  std::size_t end = begin;
  const std::string_view line = take_line(text, end);
  const std::string_view name = trimmed(trimmed(line).substr(kInclude.size()));
  if (!name.starts_with('\'') && !name.starts_with('"')) return end;
  constexpr std::size_t kLongest = 4096;  // file names of the system
  const std::size_t open = std::size_t(name.data() - text.data());
  const std::size_t close = text.substr(0, open + kLongest).find(name.front(), open + 1);
  if (close != std::string_view::npos) take_line(text, end = close);
  return end;
}

/// The fields of a card, 8 a line (4 of large ones) without its name and marks of continuation.
class Card {
 public:
  Card() = default;
  explicit Card(std::string_view record);

  void clear();
  /// Takes the fields of the next line, which has no comment.
  void append_line(std::string_view line, const Marks& marks);

  /// With blanks around; blank where the card has no such field, or is longer than any that is
  /// read.
  std::string_view field(std::size_t i) const {
    return i < count_ ? fields_[i] : std::string_view();
  }
  std::size_t count() const { return count_; }

 private:
  std::array<std::string_view, 24> fields_;
  std::size_t count_ = 0;
  std::forward_list<std::string> lines_;  ///< those whose tabs were replaced
};

void Card::append_line(std::string_view line, const Marks& marks) {
  const bool has_commas = marks.has_commas && is_free(line);
  const std::string_view name = marks.are_none()
                                    ? line.substr(0, kSmall)
                                    : name_field(has_commas ? line : line.substr(0, kSmall), marks);
  const bool is_large = name.find('*') != std::string_view::npos;
  const std::size_t width = is_large ? kLarge : kSmall;
  const std::size_t end = std::min(count_ + (is_large ? 4 : 8), fields_.size());
  if (has_commas) {
    FreeFields free_fields(line);
    std::string_view field;
    free_fields.next(field);
    while (count_ < end && free_fields.next(field)) fields_[count_++] = field;
  } else {
    const bool has_tabs = marks.has_tabs && line.find('\t') != std::string_view::npos;
    const std::string_view plain = has_tabs ? lines_.emplace_front(without_tabs(line)) : line;
    for (std::size_t at = kSmall; count_ < end && at < plain.size(); at += width)
      fields_[count_++] = plain.substr(at, width);
  }
  while (count_ < end) fields_[count_++] = {};  // what the line does not have is blank
}

Card::Card(std::string_view record) {
  const Marks marks(record);
  for (std::size_t at = 0; at < record.size();) {
    const std::string_view line = without_comment(take_line(record, at));
    if (!is_empty(line)) append_line(line, marks);
  }
}

void Card::clear() {
  count_ = 0;
  if (!lines_.empty()) lines_.clear();
}

/// GRID, number, system, x, y, z, ...: what moves is written in large fields.
class GridCard : public NodeStyle {
 public:
  explicit GridCard(std::string newline) : newline_(std::move(newline)) {}

  std::string_view read(std::string_view record, Eigen::RowVector3d& point) const override {
    const Card card(record);
    for (int c = 0; c < 3; ++c)
      if (!read_real(card.field(std::size_t(2 + c)), point(c))) return trimmed(record);
    return {};
  }

  void write(std::string_view record, const Eigen::RowVector3d& point,
             const std::array<bool, 3>& is_changed, double least,
             std::string& text) const override {
    const Card card(record);
    Fields fields;
    for (std::size_t i = 0; i < fields.size(); ++i) fields[i] = trimmed(card.field(i));
    std::string numbers;
    numbers.reserve(3 * kLarge);  // the fields point into it
    for (std::size_t c = 0; c < 3; ++c) {
      std::string_view& field = fields[2 + c];
      if (!is_changed[c] || (field.empty() && std::abs(point(Index(c))) <= least)) continue;
      const std::size_t begin = numbers.size();
      write_real(point(Index(c)), {.width = kLarge, .needs_point = true, .has_letter = false},
                 numbers);
      field = std::string_view(numbers).substr(begin);
    }
    if (is_plain_large(record))
      replace_columns(record, fields, text);
    else
      write_large(record, fields, text);
  }

 private:
  using Fields = std::array<std::string_view, 8>;

  /// Whether a record is one of two lines of large fields with all coordinates in their columns.
  static bool is_plain_large(std::string_view record) {
    std::size_t at = 0;
    const std::string_view first = take_line(record, at), second = take_line(record, at);
    constexpr std::size_t kFirst = kSmall + 4 * kLarge, kSecond = kSmall + kLarge;
    return at == record.size() && first.size() >= kFirst && second.size() >= kSecond &&
           name_field(first).ends_with('*') && !is_free(record) &&
           record.find_first_of("$\t") == std::string_view::npos;
  }

  static void replace_columns(std::string_view record, const Fields& fields, std::string& text) {
    const std::size_t begin = text.size();
    text += record;
    const std::size_t second = record.find('\n') + 1;
    const std::size_t places[] = {kSmall + 2 * kLarge, kSmall + 3 * kLarge, second + kSmall};
    for (std::size_t c = 0; c < 3; ++c) {
      const std::string_view field = fields[2 + c];
      if (trimmed(record.substr(places[c], kLarge)) == field) continue;
      text.replace(begin + places[c], kLarge - field.size(), kLarge - field.size(), ' ');
      text.replace(begin + places[c] + kLarge - field.size(), field.size(), field);
    }
  }

  void write_large(std::string_view record, const Fields& fields, std::string& text) const {
    text += "GRID*   ";
    for (std::size_t i = 0; i < 4; ++i) put(fields[i], text);
    text += newline_;
    text += "*       ";
    std::size_t last = 8;
    while (last > 5 && fields[last - 1].empty()) --last;
    for (std::size_t i = 4; i < last; ++i) put(fields[i], text);
    for (std::size_t at = 0; at < record.size();) {
      const std::string_view line = take_line(record, at);
      const std::size_t comment = line.find('$');
      if (comment == std::string_view::npos) continue;
      text += comment == 0 ? newline_ : " ";
      text += line.substr(comment);
    }
  }

  static void put(std::string_view field, std::string& text) {
    text.append(kLarge - std::min(kLarge, field.size()), ' ');
    text += field.substr(0, kLarge);
  }

  std::string newline_;
};

/// The elements that become cells: their nodes follow `nodes_at` fields behind the name.
struct ElementCard {
  std::string_view name;
  CellType linear;
  CellType quadratic;  ///< the same where there is none
  std::size_t nodes_at = 2;
  bool goes_round = false;  ///< each corner is followed by the node beside it
};

constexpr ElementCard kElements[] = {
    {"CTETRA", CellType::Tetra, CellType::QuadraticTetra},
    {"CHEXA", CellType::Hexahedron, CellType::QuadraticHexahedron},
    {"CPENTA", CellType::Wedge, CellType::QuadraticWedge},
    {"CPYRAM", CellType::Pyramid, CellType::QuadraticPyramid},
    {"CPYRA", CellType::Pyramid, CellType::QuadraticPyramid},
    {"CTRIA3", CellType::Triangle, CellType::Triangle},
    {"CTRIAR", CellType::Triangle, CellType::Triangle},
    {"CTRIA6", CellType::Triangle, CellType::QuadraticTriangle},
    {"CQUAD4", CellType::Quad, CellType::Quad},
    {"CQUADR", CellType::Quad, CellType::Quad},
    {"CQUAD8", CellType::Quad, CellType::QuadraticQuad},
    {"CSHEAR", CellType::Quad, CellType::Quad},
    {"CPLSTN3", CellType::Triangle, CellType::Triangle},
    {"CPLSTS3", CellType::Triangle, CellType::Triangle},
    {"CPLSTN4", CellType::Quad, CellType::Quad},
    {"CPLSTS4", CellType::Quad, CellType::Quad},
    {"CPLSTN6", CellType::Triangle, CellType::QuadraticTriangle},
    {"CPLSTS6", CellType::Triangle, CellType::QuadraticTriangle},
    {"CPLSTN8", CellType::Quad, CellType::QuadraticQuad},
    {"CPLSTS8", CellType::Quad, CellType::QuadraticQuad},
    // Axisymmetric, and plane ones for large strains.
    {"CTRAX3", CellType::Triangle, CellType::Triangle},
    {"CQUADX4", CellType::Quad, CellType::Quad},
    {"CTRAX6", CellType::Triangle, CellType::QuadraticTriangle},
    {"CTRIAX", CellType::Triangle, CellType::QuadraticTriangle},
    {"CTRIAX6", CellType::Triangle, CellType::QuadraticTriangle, 2, true},
    {"CQUADX8", CellType::Quad, CellType::QuadraticQuad},
    {"CQUADX", CellType::Quad, CellType::QuadraticQuad},
    {"CQUAD", CellType::Quad, CellType::QuadraticQuad},
    {"CBAR", CellType::Line, CellType::Line},
    {"CBEAM", CellType::Line, CellType::Line},
    {"CBEND", CellType::Line, CellType::Line},
    {"CROD", CellType::Line, CellType::Line},
    {"CTUBE", CellType::Line, CellType::Line},
    {"CONROD", CellType::Line, CellType::Line, 1},
};

constexpr std::string_view kLeftOut[] = {
    "CELAS1", "CELAS2", "CELAS3", "CELAS4", "CBUSH",  "CBUSH1D", "CDAMP1", "CDAMP2", "CDAMP3",
    "CDAMP4", "CMASS1", "CMASS2", "CMASS3", "CMASS4", "CONM1",   "CONM2",  "CGAP",   "CVISC",
    "CFAST",  "CWELD",  "CSEAM",  "RBE1",   "RBE2",   "RBE3",    "RBAR",   "RROD",   "RSPLINE",
    "PLOTEL", "CBEAM3", "CHBDYG", "CHBDYE", "CHBDYP", "CONV",    "CHACAB", "CHACBR"};

/// A coordinate system of the deck.
struct System {
  DeckPlace place;
  std::string name;  ///< of its card
  Index parent = 0;
  std::array<double, 9> points{};
  NodeFrame frame = {};
  enum class State { Raw, Open, Ready } state = State::Raw;
};

/// A GRID card, before its system is known.
struct Grid {
  DeckPlace place;
  std::size_t length = 0;
  Index number = 0, system = 0;  ///< -1: the default
  Eigen::RowVector3d point;
};

/// Reads a bulk data deck.
class Reader {
 public:
  explicit Reader(const fs::path& path) : sources_(path) {}

  ReadMesh run() {
    read_file(0, end_of_control(sources_.text(0)));
    add_grids();
    name_properties();
    MeshAssembly assembly(sources_);
    assembly.add(std::move(mesh_));
    ReadMesh result = assembly.finish(std::move(sources_), "property");
    remark_on_left_out(left_out_, result.remarks);
    if (incomplete_ > 0)
      result.remarks.push_back(std::to_string(incomplete_) +
                               " elements lack some of their mid-side nodes and are taken as "
                               "linear; the others of their mid-side nodes follow the rest");
    return result;
  }

 private:
  /// Where the bulk data begin.
  static std::size_t end_of_control(std::string_view text) {
    for (std::size_t at = 0; at < text.size();) {
      const std::string_view full = trimmed(take_line(text, at));
      if (!full.starts_with('B') && !full.starts_with('b')) continue;
      const std::string line = upper(full.substr(0, 40));
      if (!line.starts_with("BEGIN")) continue;
      if (trimmed(std::string_view(line).substr(5)).starts_with("BULK")) return at;
    }
    return 0;
  }

  /// How much of a block was read.
  struct Counts {
    Index grids = 0, elements = 0, incomplete = 0;
  };

  /// A card of another kind, or one that can't be read, and what stands before it in its block.
  struct OtherCard {
    std::size_t begin = 0, end = 0;  ///< in the text
    Counts before;
  };

  /// Some of the lines of a file, and their cards.
  struct CardBlock {
    std::size_t begin = 0, end = 0;
    bool has_failed = false;  ///< what follows the card that can't be read is not tried
    std::vector<Grid> grids = {};
    NumberedMesh elements = {};
    Index incomplete = 0;  ///< elements
    std::vector<OtherCard> others = {};
    Card card = {};                 ///< that is being read
    std::vector<Index> nodes = {};  ///< of its element

    Counts counts() const { return {std::ssize(grids), elements.element_count(), incomplete}; }
    void clear() {
      has_failed = false;
      grids.clear();
      elements.clear_elements();
      incomplete = 0;
      others.clear();
    }
  };

  /// Cards of nodes and elements are read on all threads; others, and what is wrong, on one.
  void read_file(std::size_t file, std::size_t at) {
    const std::string_view text = sources_.text(file);
    const auto goes_on = [&](std::size_t place) {
      const std::string_view line = without_comment(take_line(text, place));
      return is_empty(line) || is_continuation(line);
    };
    const auto read = [&](CardBlock& block) { read_block(file, block); };
    std::size_t taken_to = at;
    const auto take = [&](CardBlock& block) {
      if (block.begin < taken_to) {  // it begins amid the name of a file to include
        block.begin = std::min(taken_to, block.end);
        read_block(file, block);
      }
      Counts taken;
      for (const OtherCard& card : block.others) {
        take_cards(file, block, taken, card.before);
        taken = card.before;
        taken_to = card.end;
        here_ = {file, card.begin};
        read_other(text.substr(card.begin, card.end - card.begin));
        if (has_ended_) return false;
      }
      take_cards(file, block, taken, block.counts());
      return true;
    };
    read_blocks<CardBlock>(text, at, text.size(), goes_on, read, take);
  }

  /// Takes the nodes and elements of a block between two others of its cards.
  void take_cards(std::size_t file, const CardBlock& block, const Counts& first,
                  const Counts& last) {
    grids_.insert(grids_.end(), block.grids.begin() + first.grids,
                  block.grids.begin() + last.grids);
    mesh_.reserve_elements(block.elements, blocks_behind(sources_.text(file), block));
    mesh_.append_elements(block.elements, first.elements, last.elements);
    incomplete_ += last.incomplete - first.incomplete;
  }

  void read_block(std::size_t file, CardBlock& block) const {
    const std::string_view text = sources_.text(file);
    const Marks marks(text.substr(block.begin, block.end - block.begin));
    block.clear();
    CardName name;
    std::size_t begin = block.begin, end = block.begin;  // of the card
    const auto finish = [&] {
      if (end > begin)
        read_card({file, begin}, text.substr(begin, end - begin), marks, name, block);
      block.card.clear();
    };
    for (std::size_t at = block.begin; at < block.end;) {
      const std::size_t place = at;
      const std::string_view full = take_line(text, at);
      const std::string_view line = marks.has_comments ? without_comment(full) : full;
      if (is_empty(line)) continue;
      if (!is_continuation(line)) {
        finish();
        begin = place;
      } else if (end == begin) {
        begin = end = at;  // of nothing
        continue;
      }
      block.card.append_line(line, marks);
      end = place + full.size();
      if (begin == place && is_include(line)) end = at = end_of_include(text, place);
    }
    finish();
  }

  /// The name of a card, and what it is: many of one name follow each other.
  struct CardName {
    std::string columns, field, name;
    const ElementCard* element = nullptr;

    void set(std::string_view record, const Marks& marks) {
      if (marks.are_none() && record.substr(0, kSmall) == columns) return;
      columns = record.substr(0, kSmall);
      std::string_view line = record.substr(0, record.find('\n'));
      if (marks.has_comments) line = without_comment(line);
      std::string_view found = name_field(line, marks);
      if (found.ends_with('*')) found.remove_suffix(1);
      if (found == field && !name.empty()) return;
      field = found;
      name = upper(trimmed(field));
      element = nullptr;
      for (const ElementCard& candidate : kElements)
        if (candidate.name == name) element = &candidate;
    }
  };

  void read_card(DeckPlace place, std::string_view record, const Marks& marks, CardName& name,
                 CardBlock& block) const {
    const OtherCard other{
        .begin = place.place, .end = place.place + record.size(), .before = block.counts()};
    if (!block.has_failed) {
      name.set(record, marks);
      try {
        if (read_node_or_element(place, record, name, block)) return;
      } catch (const Error&) {
        block.has_failed = true;  // it is read again in its turn, when what went wrong is told
      }
    }
    block.others.push_back(other);
  }

  /// False for a card of another kind. Leaves the block as it is where it throws.
  bool read_node_or_element(DeckPlace place, std::string_view record, const CardName& name,
                            CardBlock& block) const {
    if (name.element)
      read_element(*name.element, place, block);
    else if (name.name == "GRID")
      read_grid(place, record, block);
    else
      return false;
    return true;
  }

  void read_other(std::string_view record) {
    name_.set(record, Marks(record));
    const std::string& name = name_.name;
    CardBlock block{.card = Card(record)};
    if (read_node_or_element(here_, record, name_, block)) {
      take_cards(here_.file, block, {}, block.counts());
    } else if (name == "ENDDATA") {
      has_ended_ = true;
    } else if (name.starts_with("INCLUDE")) {
      read_include(record);
    } else if (name == "GRDSET") {
      read_default(record);
    } else if (name.starts_with("CORD")) {
      read_system(name, record);
    } else if (!read_tie(name, record) && std::ranges::find(kLeftOut, name) != std::end(kLeftOut)) {
      ++left_out_[name];
    }
  }

  /// The fields of a card of any length, without blanks.
  static std::vector<std::string> all_fields(std::string_view record) {
    const Marks marks(record);
    std::vector<std::string> fields;
    Card card;
    for (std::size_t at = 0; at < record.size();) {
      const std::string_view line = without_comment(take_line(record, at));
      if (is_empty(line)) continue;
      card.clear();
      card.append_line(line, marks);
      for (std::size_t i = 0; i < card.count(); ++i) fields.emplace_back(trimmed(card.field(i)));
    }
    return fields;
  }

  /// RBE2, element, node, components, others; RBE3, element, blank, node, components, weight,
  /// components, others, weight, ...; RBAR, element, node, other. False for what is no such card.
  bool read_tie(const std::string& name, std::string_view record) {
    const bool is_rbe3 = name == "RBE3";
    if (!is_rbe3 && name != "RBE2" && name != "RBAR") return false;
    const std::vector<std::string> fields = all_fields(record);
    NumberedTie tie;
    const std::size_t node = is_rbe3 ? 2 : 1;
    const std::size_t first = is_rbe3 ? 6 : name == "RBE2" ? 3 : 2;
    const std::size_t last = std::min(fields.size(), name == "RBAR" ? 3 : fields.size());
    if (first >= last || !read_integer(fields[node], tie.node)) return false;
    constexpr Index kLongest = 1 << 20;  // of a range: 8 MB of numbers, a slip asks for no more
    for (std::size_t i = first; i < last; ++i) {
      Index number = 0;
      double weight = 0;
      if (fields[i].empty()) continue;
      if (upper(fields[i]) == "THRU" && !tie.others.empty() && i + 1 < last &&
          read_integer(fields[i + 1], number)) {
        if (number > tie.others.back() + kLongest) return false;
        while (tie.others.back() < number) tie.others.push_back(tie.others.back() + 1);
        ++i;
      } else if (read_integer(fields[i], number)) {
        if (number < 1 || number > kHighestNumber) return false;
        tie.others.push_back(number);
      } else if (is_rbe3 && read_real(fields[i], weight)) {
        ++i;  // its components
      } else {
        break;  // what the card says of other things
      }
    }
    if (tie.others.empty()) return false;
    mesh_.ties.push_back(std::move(tie));
    return true;
  }

  Index number_of(DeckPlace place, std::string_view field, std::string_view what,
                  bool may_be_blank) const {
    Index value = 0;
    if (read_integer(field, value) && value >= 0 && value <= kHighestNumber) return value;
    if (!may_be_blank || !is_empty(field)) sources_.fail_expected(place, what, field);
    return 0;
  }

  void read_grid(DeckPlace place, std::string_view record, CardBlock& block) const {
    const Card& card = block.card;
    if (record.size() > 0xffff) sources_.fail(place, "the card is too long");
    Grid grid{.place = place, .length = record.size(), .point = {}};
    grid.number = number_of(place, card.field(0), "the number of a node", false);
    grid.system = is_empty(card.field(1))
                      ? -1
                      : number_of(place, card.field(1), "the number of a coordinate system", false);
    for (std::size_t c = 0; c < 3; ++c)
      if (!read_real(card.field(2 + c), grid.point(Index(c))))
        sources_.fail_expected(place, "a coordinate", card.field(2 + c));
    block.grids.push_back(grid);
  }

  void read_default(std::string_view record) {
    const Card card(record);
    default_system_ = number_of(here_, card.field(1), "the number of a coordinate system", true);
  }

  void read_system(const std::string& name, std::string_view record) {
    const Card card(record);
    const Index number =
        number_of(here_, card.field(0), "the number of a coordinate system", false);
    System system{.place = here_, .name = name};
    if (name == "CORD2R" || name == "CORD2C") {
      system.parent = number_of(here_, card.field(1), "the number of a coordinate system", true);
      for (std::size_t i = 0; i < 9; ++i)
        if (!read_real(card.field(2 + i), system.points[i]))
          sources_.fail_expected(here_, "a coordinate", card.field(2 + i));
    }
    systems_.insert_or_assign(number, system);
  }

  void read_include(std::string_view record) {
    const std::string_view rest = trimmed(trimmed(record).substr(kInclude.size()));
    std::string_view lines = without_comment(rest);
    if (rest.starts_with('\'') || rest.starts_with('"')) {
      const std::size_t close = rest.find(rest.front(), 1);
      if (close == std::string_view::npos)
        sources_.fail(here_, "the name of the file to include has no closing quote: add it");
      lines = rest.substr(1, close - 1);
    }
    std::string name;
    for (std::size_t at = 0; at < lines.size();) name += trimmed(take_line(lines, at));
    if (name.empty()) sources_.fail(here_, "expected the name of a file to include");
    const std::size_t file = sources_.include(name, here_);
    read_file(file, 0);
    sources_.leave();
  }

  void read_element(const ElementCard& element, DeckPlace place, CardBlock& block) const {
    const Card& card = block.card;
    const Index number = number_of(place, card.field(0), "the number of an element", false);
    const Index property = element.nodes_at == 2
                               ? number_of(place, card.field(1), "the number of a property", true)
                               : 0;
    constexpr Index kHighestRegion = 1 << 30;  // fits into an int, as regions are
    if (property > kHighestRegion)
      sources_.fail_expected(place, "the number of a property", card.field(1));
    const std::size_t corners = std::size_t(cell_node_count(element.linear));
    const std::size_t most = std::size_t(cell_node_count(element.quadratic));
    std::vector<Index>& nodes = block.nodes;
    nodes.clear();
    for (std::size_t i = 0; i < most; ++i) {
      const std::size_t round = i < corners ? 2 * i : 2 * (i - corners) + 1;
      const std::string_view field =
          card.field(element.nodes_at + (element.goes_round ? round : i));
      const bool may_be_blank = i >= corners;
      const Index node = field.empty() && may_be_blank
                             ? 0
                             : number_of(place, field, "the number of a node", may_be_blank);
      if (node == 0 && i < corners)
        sources_.fail(place, "element " + std::to_string(number) + " lacks a corner node");
      nodes.push_back(node);
    }
    if (dimension(element.linear) == 3 && !is_empty(card.field(element.nodes_at + most)))
      sources_.fail(place, "element " + std::to_string(number) + " has more than the " +
                               std::to_string(most) + " nodes that Nastran knows of such ones");
    // A mid-side node that is missing has the number 0.
    const bool is_full = std::ranges::find(nodes, 0) == nodes.end();
    const auto is_node = [](Index node) { return node > 0; };
    if (!is_full && std::ranges::any_of(std::span(nodes).subspan(corners), is_node))
      ++block.incomplete;
    if (!is_full) nodes.resize(corners);
    const CellType type = is_full ? element.quadratic : element.linear;
    to_vtk_order(type, nodes);
    block.elements.add_element(number, type, nodes, int(property), place);
  }

  /// Nastran's mid-side nodes go bottom, upright, top; VTK's bottom, top, upright.
  static void to_vtk_order(CellType type, std::vector<Index>& nodes) {
    const auto swap_ranges = [&](std::ptrdiff_t first, std::ptrdiff_t count) {
      const auto at = nodes.begin() + first;
      std::rotate(at, at + count, at + 2 * count);
    };
    if (type == CellType::QuadraticHexahedron) swap_ranges(12, 4);
    if (type == CellType::QuadraticWedge) swap_ranges(9, 3);
  }

  /// The frame of a system, from those that it refers to.
  const NodeFrame& frame_of(Index number, DeckPlace from) {
    const auto found = systems_.find(number);
    if (found == systems_.end())
      sources_.fail(from, "coordinate system " + std::to_string(number) + " is not defined");
    System& system = found->second;
    if (system.state == System::State::Ready) return system.frame;
    if (system.state == System::State::Open)
      sources_.fail(system.place,
                    "coordinate system " + std::to_string(number) + " refers to itself");
    if (system.name != "CORD2R" && system.name != "CORD2C")
      sources_.fail(from, "coordinate system " + std::to_string(number) + " is a " + system.name +
                              ": of nodes in other systems than the basic one, only those in "
                              "CORD2R and CORD2C are read; write the nodes in the basic system");
    system.state = System::State::Open;
    std::array<Eigen::Vector3d, 3> points;
    for (std::size_t i = 0; i < 3; ++i) {
      Eigen::RowVector3d point = Eigen::RowVector3d::Map(system.points.data() + 3 * i);
      if (system.parent != 0) point = frame_of(system.parent, system.place).to_mesh(point);
      points[i] = point.transpose();
    }
    const Eigen::Vector3d z = points[1] - points[0];
    const Eigen::Vector3d y = z.cross(points[2] - points[0]);
    if (!(y.norm() > 0))
      sources_.fail(system.place, "the points of the coordinate system lie on one line");
    system.frame.origin = points[0].transpose();
    system.frame.axes.col(2) = z.normalized();
    system.frame.axes.col(1) = y.normalized();
    system.frame.axes.col(0) = y.cross(z).normalized();
    system.frame.is_cylindrical = system.name == "CORD2C";
    system.state = System::State::Ready;
    return system.frame;
  }

  /// Records go by file and system.
  void add_grids() {
    std::map<std::pair<std::size_t, Index>, std::size_t> blocks;
    mesh_.reserve_nodes(grids_.size());
    for (Grid& grid : grids_) {
      if (grid.system < 0) grid.system = default_system_;
      const auto [found, is_new] = blocks.emplace(
          std::pair(std::size_t(grid.place.file), grid.system), mesh_.records.size());
      if (is_new) {
        NodeRecords block{.file = grid.place.file, .style = style_of(grid.place.file)};
        if (grid.system != 0) block.frames.push_back(frame_of(grid.system, grid.place));
        mesh_.records.push_back(std::move(block));
      }
      NodeRecords& block = mesh_.records[found->second];
      for (const NodeFrame& frame : block.frames) grid.point = frame.to_mesh(grid.point);
      block.places.push_back({.place = grid.place.place, .length = grid.length});
      block.nodes.push_back(std::ssize(mesh_.node_numbers));
      mesh_.add_node(grid.number, grid.point);
    }
  }

  std::shared_ptr<const NodeStyle> style_of(std::size_t file) const {
    const std::string_view text = sources_.text(file);
    const std::size_t end = text.find('\n');
    const bool has_return = end != std::string_view::npos && end > 0 && text[end - 1] == '\r';
    return std::make_shared<GridCard>(has_return ? "\r\n" : "\n");
  }

  /// Shells beside solids are parts of the boundary with a name: the number of their property.
  void name_properties() {
    if (std::ranges::none_of(mesh_.types, [](CellType type) { return dimension(type) == 3; }))
      return;
    std::map<int, std::vector<Index>> rows;
    for (std::size_t e = 0; e < mesh_.types.size(); ++e)
      if (dimension(mesh_.types[e]) == 2) rows[mesh_.regions[e]].push_back(Index(e));
    for (auto& [property, elements] : rows)
      mesh_.sets.push_back({.name = std::to_string(property),
                            .kind = "property",
                            .is_of_elements = true,
                            .numbers = {},
                            .rows = std::move(elements)});
  }

  DeckSources sources_;
  NumberedMesh mesh_;
  std::vector<Grid> grids_;
  std::map<Index, System> systems_;
  Index default_system_ = 0;
  DeckPlace here_;
  bool has_ended_ = false;
  CardName name_;
  std::map<std::string, Index> left_out_;
  Index incomplete_ = 0;
};

/// BEGIN BULK tells, or the first card of a node.
Recognition recognise(const FileStart& start) {
  const std::string_view text = start.bytes;
  bool is_possible = false;
  for (std::size_t at = 0; at < text.size();) {
    const std::string_view line = without_comment(take_line(text, at));
    if (trimmed(line).empty()) continue;
    if (line.front() == '*' || line.front() == '/') {
      if (!is_possible) return Recognition::No;
      continue;
    }
    const std::string start_of_line = upper(trimmed(line).substr(0, 40));
    if (start_of_line.starts_with("BEGIN") && start_of_line.find("BULK") != std::string::npos)
      return Recognition::Sure;
    const std::string name = upper(name_field(line));
    if (name == "GRID" || name == "GRID*") return Recognition::Sure;
    is_possible = is_possible || name == "CEND" || name.starts_with("SOL ") ||
                  name.starts_with("INCLUDE") || name.starts_with("CORD") || name == "PSHELL" ||
                  name == "PSOLID" || name == "PARAM" || name == "MAT1" || name == "MAT1*";
  }
  return is_possible ? Recognition::Possible : Recognition::No;
}

ReadMesh read(const fs::path& path) { return Reader(path).run(); }

}  // namespace

const MeshFormat& nastran_format() {
  static const MeshFormat format{.name = "Nastran",
                                 .extensions = {".bdf", ".nas", ".dat", ".fem"},
                                 .recognise = recognise,
                                 .read = read};
  return format;
}

}  // namespace cadmorph
