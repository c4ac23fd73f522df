#pragma once

#include <sstream>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <vector>

namespace tabletop_perception {

/// Values that an option may take, both ends included.
struct Range {
  double min;
  double max;
};

/// Words that an option may take.
struct Choices {
  std::vector<std::string> words;
};

/// Throws std::invalid_argument with the option's full name, its value and what would be right,
/// unless `value` lies in `range`.
template <typename T>
void checkOption(const std::string& name, const T& value, const Range& range) {
  if (value >= range.min && value <= range.max) return;  // false for NaN
  std::ostringstream message;
  message << name << " must be between " << range.min << " and " << range.max << ", got " << value;
  throw std::invalid_argument(message.str());
}

/// As above, unless `value` is one of `choices`.
void checkOption(const std::string& name, const std::string& value, const Choices& choices);

/// Checks every field of an options struct; `section` is the stage's name in yaml ("filter").
///
/// An options struct names its fields once, for yaml, the parameter server, dynamic_reconfigure
/// and this check:
///   visit("leaf_size", leaf_size, Range{0, 1});   numbers
///   visit("metric", metric, Choices{{"l1"}});     words
///   visit("enabled", enabled);                    flags
template <typename Options>
void checkOptions(const std::string& section, Options options) {
  options.visitFields([&](const std::string& name, auto& field, const auto&... limits) {
    (checkOption(section + "." + name, field, limits), ...);
  });
}

}  // namespace tabletop_perception
