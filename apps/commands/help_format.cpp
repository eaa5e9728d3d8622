#include "apps/commands/help_format.h"

#include <map>
#include <sstream>

namespace cadmorph {
namespace {

// Within a terminal of 100 columns, a third of them for options; longer ones have their own line.
constexpr std::size_t kColumns = 98, kOptionColumns = 34;

const std::map<int, std::string>& exit_codes() {
  static const std::map<int, std::string> all = {
      {0, "done"},
      {1, "bad usage"},
      {2, "an input can't be read or is invalid"},
      {3, "the CAD models do not correspond"},
      {4, "the mesh does not lie on the base CAD"},
      {5, "inverted elements remain, or quality is below what was asked"},
      {6, "memory, disk or numerics"},
      {7, "the meshes differ"},
      {8, "some variants failed"}};
  return all;
}

std::string wrapped(const std::string& text, std::size_t width) {
  std::istringstream words(text);
  std::string word, result;
  std::size_t column = 0;
  while (words >> word) {
    if (column > 0 && column + 1 + word.size() > width) {
      result += "\n";
      column = 0;
    } else if (column > 0) {
      result += " ";
      ++column;
    }
    result += word;
    column += word.size();
  }
  return result;
}

class Formatter : public CLI::Formatter {
 public:
  Formatter() { column_width(kOptionColumns); }

  std::string make_option_desc(const CLI::Option* option) const override {
    return wrapped(option->get_description(), kColumns - kOptionColumns);
  }

  // Without what checks the value: the program says so where it is wrong.
  std::string make_option_opts(const CLI::Option* option) const override {
    std::string text = CLI::Formatter::make_option_opts(option);
    const std::string type = option->get_type_name();
    const auto plain = type.find(':'), place = text.find(type);
    if (plain != std::string::npos && place != std::string::npos)
      text.replace(place, type.size(), type.substr(0, plain));
    return text;
  }
};

}  // namespace

std::shared_ptr<CLI::Formatter> help_formatter() { return std::make_shared<Formatter>(); }

std::string help_end(const std::vector<std::string>& examples, std::initializer_list<int> codes) {
  std::string text = examples.size() == 1 ? "Example:\n" : "Examples:\n";
  for (const std::string& example : examples) text += "  cadmorph " + example + "\n";
  std::string meanings;
  for (const int code : codes)
    meanings += (meanings.empty() ? "" : "; ") + std::to_string(code) + " " + exit_codes().at(code);
  return text + "\n" + wrapped("Exit codes: " + meanings, kColumns) +
         "\nWhat to do about each: cadmorph help exit-codes";
}

}  // namespace cadmorph
