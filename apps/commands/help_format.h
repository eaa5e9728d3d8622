#pragma once

#include <CLI/CLI.hpp>
#include <initializer_list>
#include <memory>
#include <string>
#include <vector>

namespace cadmorph {

/// Help in lines that a terminal holds, with plain names for the kinds of values.
std::shared_ptr<CLI::Formatter> help_formatter();

/// The end of a command's help: its examples, and those exit codes that it can end with.
std::string help_end(const std::vector<std::string>& examples, std::initializer_list<int> codes);

}  // namespace cadmorph
