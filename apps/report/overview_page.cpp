#include "apps/report/overview_page.h"

#include <kainjow/mustache.hpp>

#include "apps/report/base64.h"
#include "apps/report/report_assets.h"
#include "apps/summary/summary.h"
#include "apps/summary/text_table.h"
#include "apps/version.h"

namespace cadmorph {
namespace {

using kainjow::mustache::data;
using kainjow::mustache::list;
using kainjow::mustache::mustache;

data cell(const std::string& text, const std::string& sorted_by) {
  data result;
  result.set("text", text);
  result.set("key", sorted_by);
  return result;
}

data number(const char* pattern, double value) {
  return cell(format(pattern, value), format("%.17g", value));
}

data none() { return cell("", ""); }

// In the order of figure_columns.
void add_figures(const std::optional<ResultRow>& row, list& cells) {
  if (row && row->figures) {
    const ResultFigures& figures = *row->figures;
    cells.push_back(number("%.4f", figures.min_scaled_jacobian_before));
    cells.push_back(number("%.4f", figures.min_scaled_jacobian_after));
    cells.push_back(number("%.4f", figures.mean_scaled_jacobian_after));
    cells.push_back(number("%.4f", figures.worst_twentieth_after));
    cells.push_back(cell(with_commas(figures.inverted), std::to_string(figures.inverted)));
    cells.push_back(number("%.2g", figures.cad_deviation_mm));
  } else {
    for (int i = 0; i < 6; ++i) cells.push_back(none());
  }
  cells.push_back(row ? number("%.2f", row->seconds) : none());
}

list figure_columns() {
  list result;
  for (const char* name : {"least scaled Jacobian before", "after", "mean after", "worst 5 % after",
                           "inverted elements", "deviation from CAD, mm", "seconds"})
    result.push_back(cell(name, ""));
  return result;
}

std::string status_of(const std::optional<ResultRow>& row) {
  if (!row) return "to do";
  return row->exit_code == 0 ? "done" : "failed (" + std::to_string(row->exit_code) + ")";
}

data variant_row(const OverviewVariant& variant) {
  data result;
  const bool is_failed = variant.row && variant.row->exit_code != 0;
  result.set("id", variant.id);
  result.set("status", status_of(variant.row));
  result.set("is_failed", is_failed);
  result.set("has_picture", !variant.picture.empty());
  result.set("picture", base64(variant.picture));
  list cells;
  for (const std::string& value : variant.carried) cells.push_back(cell(value, value));
  add_figures(variant.row, cells);
  result.set("cells", cells);
  result.set("message", variant.row ? variant.row->message : "");
  return result;
}

}  // namespace

std::string overview_page(const Overview& overview) {
  data page;
  page.set("version", kVersion);
  page.set("base", overview.base);
  page.set("mesh", overview.mesh);
  std::size_t done = 0, failed = 0;
  list variants, columns;
  for (const OverviewVariant& variant : overview.variants) {
    variants.push_back(variant_row(variant));
    if (variant.row) ++(variant.row->exit_code == 0 ? done : failed);
  }
  for (const std::string& column : overview.carried_columns) columns.push_back(cell(column, ""));
  for (const data& column : figure_columns()) columns.push_back(column);
  page.set("columns", columns);
  page.set("variants", variants);
  page.set("is_good", done == overview.variants.size());
  page.set("outcome", with_commas(static_cast<Index>(done)) + " of " +
                          with_commas(std::ssize(overview.variants)) + " done" +
                          (failed > 0 ? ", " + std::to_string(failed) + " failed" : ""));
  page.set("no_picture", overview.no_picture.empty() ? data(false) : data(overview.no_picture));
  page.set("style", std::string(kPageStyle));
  mustache html{std::string(kOverviewTemplate)};
  return html.render(page);
}

}  // namespace cadmorph
