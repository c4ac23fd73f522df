#pragma once

#include <sstream>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

namespace tabletop_perception {

/// Values that an option may take, both ends included.
struct Range {
  double min;
  double max;
};

/// Odd whole numbers that an option may take, both ends included.
struct OddRange : Range {};

/// Two options of which the first must be below the second.
struct Order {
  std::string low_name;
  double low;
  std::string high_name;
  double high;
};

/// Words that an option may take.
struct Choices {
  std::vector<std::string> words;
};

/// Words of which an option may name one or several, with spaces between.
struct WordList {
  std::vector<std::string> words;
};

/// The words of such an option.
std::vector<std::string> splitWords(const std::string& value);

/// Throws std::invalid_argument with the option's full name, its value and what would be right,
/// unless `value` lies in `range`.
template <typename T>
void checkOption(const std::string& name, const T& value, const Range& range) {
  if (value >= range.min && value <= range.max) return;  // false for NaN
  std::ostringstream message;
  message << name << " must be between " << range.min << " and " << range.max << ", got " << value;
  throw std::invalid_argument(message.str());
}

/// As above, unless `value` is odd and lies in `range`.
void checkOption(const std::string& name, int value, const OddRange& range);

/// As above, unless `value` is one of `choices`.
void checkOption(const std::string& name, const std::string& value, const Choices& choices);

/// As above, unless `value` holds some words of the list and no other.
void checkOption(const std::string& name, const std::string& value, const WordList& list);

/// Throws std::invalid_argument with both names and values unless the first option of the pair is
/// below the second; `prefix` comes before the names.
void checkOrder(const std::string& prefix, const Order& order);

/// Whether an options struct has options that go by pairs: `std::vector<Order> order() const`.
template <typename Options, typename = void>
struct HasOrder : std::false_type {};
template <typename Options>
struct HasOrder<Options, std::void_t<decltype(std::declval<const Options&>().order())>>
    : std::true_type {};

/// Checks every field of an options struct, and that no two contradict each other; `prefix` comes
/// before the names in messages.
///
/// An options struct names its fields once, for yaml, the parameter server, dynamic_reconfigure
/// and this check:
///   visit("leaf_size", leaf_size, Range{0, 1});   numbers
///   visit("metric", metric, Choices{{"l1"}});     words
///   visit("enabled", enabled);                    flags
template <typename Options>
void checkFields(const std::string& prefix, Options options) {
  options.visitFields([&](const std::string& name, auto& field, const auto&... limits) {
    (checkOption(prefix + name, field, limits), ...);
  });
  if constexpr (HasOrder<Options>::value)
    for (const auto& order : options.order()) checkOrder(prefix, order);
}

/// The same; `section` is the stage's name in yaml ("filter").
template <typename Options>
void checkOptions(const std::string& section, const Options& options) {
  checkFields(section + ".", options);
}

}  // namespace tabletop_perception
