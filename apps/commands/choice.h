#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <utility>
#include <vector>

namespace cadmorph {

/// Adds an option whose values are names of a choice, in the order they are listed in.
template <class Enum>
CLI::Option* add_choice(CLI::App& app, const std::string& flag, Enum& target,
                        const std::vector<std::pair<std::string, Enum>>& names,
                        const std::string& description) {
  std::string list;
  for (const auto& [name, value] : names) list += (list.empty() ? "" : "|") + name;
  const auto choose = [&target, names, flag, list](const std::string& text) {
    for (const auto& [name, value] : names)
      if (name == text) {
        target = value;
        return;
      }
    throw CLI::ValidationError(flag + " " + text, "give one of " + list);
  };
  return app.add_option_function<std::string>(flag, choose, description)->type_name(list);
}

}  // namespace cadmorph
