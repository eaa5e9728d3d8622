#include "core/formats/node_styles.h"

#include <array>
#include <charconv>
#include <cmath>
#include <utility>

#include "core/formats/number_fields.h"

namespace cadmorph {
namespace {

constexpr RealField kFreeField{.width = 20};  // what Abaqus allows and CalculiX reads

}  // namespace

std::string_view FreeNodeLine::read(std::string_view record, Eigen::RowVector3d& point) const {
  FreeFields fields(record);
  std::string_view field;
  fields.next(field);
  point.setZero();
  for (int c = 0; c < 3 && fields.next(field); ++c)
    if (!read_real(field, point(c))) return trimmed(field);
  return {};
}

void FreeNodeLine::write(std::string_view record, const Eigen::RowVector3d& point,
                         const std::array<bool, 3>& is_changed, double least,
                         std::string& text) const {
  FreeFields fields(record);
  std::string_view field;
  fields.next(field);
  std::size_t kept = 0;
  int c = 0;
  for (; c < 3 && fields.next(field); ++c) {
    const std::string_view token = trimmed(field);
    if (!is_changed[std::size_t(c)] || (token.empty() && std::abs(point(c)) <= least)) continue;
    const auto begin = std::size_t((token.empty() ? field : token).data() - record.data());
    text.append(record, kept, begin - kept);
    write_real(point(c), kFreeField, text);
    kept = begin + token.size();
  }
  text.append(record, kept);
  const std::string separator = record.find(',') == std::string_view::npos ? " " : ", ";
  for (std::string zeros; c < 3; ++c) {
    zeros += separator;
    if (is_changed[std::size_t(c)] && std::abs(point(c)) > least) {
      text += std::exchange(zeros, {});
      write_real(point(c), kFreeField, text);
    } else {
      zeros += '0';
    }
  }
}

std::string_view NodeColumns::read(std::string_view record, Eigen::RowVector3d& point) const {
  for (int c = 0; c < 3; ++c) {
    const std::string_view field = columns(record, first_ + std::size_t(c) * width_, width_);
    if (!read_real(field, point(c))) return trimmed(field);
  }
  return {};
}

void NodeColumns::write(std::string_view record, const Eigen::RowVector3d& point,
                        const std::array<bool, 3>& is_changed, double least,
                        std::string& text) const {
  const std::size_t begin = text.size();
  text += record;
  for (std::size_t c = 0; c < 3; ++c) {
    const std::size_t place = first_ + c * width_;
    const bool is_there = !trimmed(columns(record, place, width_)).empty();
    const double value = point(Index(c));
    if (!is_changed[c] || (!is_there && std::abs(value) <= least)) continue;
    for (std::size_t before = first_; before < place; before += width_)
      if (text.size() - begin <= before) {
        text.append(begin + before - text.size(), ' ');
        text += number(0);
      }
    const std::size_t end = begin + place + width_;
    if (text.size() < end) text.append(end - text.size(), ' ');
    text.replace(begin + place, width_, number(value));
  }
}

std::string NodeColumns::number(double value) const {
  std::string text;
  if (decimals_ < 0) {
    write_real(value, {.width = width_, .needs_point = true}, text);
  } else {
    std::array<char, 64> buffer;
    const auto [end, error] = std::to_chars(buffer.data(), buffer.data() + buffer.size(), value,
                                            std::chars_format::scientific, decimals_);
    text.assign(buffer.data(), end);
    const std::size_t e = text.find('e');
    text[e] = 'E';
    const auto digits = std::ssize(text) - std::ptrdiff_t(e) - 2;
    if (digits < exponent_digits_) text.insert(e + 2, std::size_t(exponent_digits_ - digits), '0');
  }
  return text.size() < width_ ? std::string(width_ - text.size(), ' ') + text : text;
}

}  // namespace cadmorph
