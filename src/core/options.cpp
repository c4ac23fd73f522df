#include "tabletop_perception/options.h"

#include <algorithm>

#include "tabletop_perception/options_yaml.h"

namespace tabletop_perception {
namespace {

std::string joined(const std::vector<std::string>& words) {
  std::string list;
  for (const auto& word : words) list += (list.empty() ? "" : ", ") + word;
  return list;
}

bool contains(const std::vector<std::string>& words, const std::string& word) {
  return std::find(words.begin(), words.end(), word) != words.end();
}

}  // namespace

void checkOption(const std::string& name, int value, const OddRange& range) {
  checkOption(name, value, static_cast<const Range&>(range));
  if (value % 2 == 0)
    throw std::invalid_argument(name + " must be odd, got " + std::to_string(value));
}

void checkOrder(const std::string& prefix, const Order& order) {
  if (order.low < order.high) return;
  std::ostringstream message;
  message << prefix << order.low_name << " must be below " << prefix << order.high_name << ", got "
          << order.low << " and " << order.high;
  throw std::invalid_argument(message.str());
}

void checkOption(const std::string& name, const std::string& value, const Choices& choices) {
  if (!contains(choices.words, value))
    throw std::invalid_argument(name + " must be one of " + joined(choices.words) + ", got '" +
                                value + "'");
}

std::vector<std::string> splitWords(const std::string& value) {
  std::istringstream stream(value);
  std::vector<std::string> words;
  for (std::string word; stream >> word;) words.push_back(word);
  return words;
}

void checkOption(const std::string& name, const std::string& value, const WordList& list) {
  const auto words = splitWords(value);
  const auto known = [&](const std::string& word) { return contains(list.words, word); };
  if (words.empty() || !std::all_of(words.begin(), words.end(), known))
    throw std::invalid_argument(name + " must be one or several of " + joined(list.words) +
                                " with spaces between, got '" + value + "'");
}

std::string inOneLine(const YAML::Node& yaml) {
  std::string line = YAML::Dump(yaml);
  std::replace(line.begin(), line.end(), '\n', ' ');
  return line;
}

void checkYamlKeys(const std::string& section, const YAML::Node& yaml,
                   const std::vector<std::string>& known) {
  if (!yaml || yaml.IsNull()) return;
  if (!yaml.IsMap())
    throw std::invalid_argument(section + " must hold options by name, got '" + inOneLine(yaml) +
                                "'");
  for (const auto& entry : yaml) {
    const auto key = entry.first.IsScalar() ? entry.first.Scalar() : inOneLine(entry.first);
    if (!contains(known, key))
      throw std::invalid_argument("no such option: " + section + "." + key + "; there are " +
                                  joined(known));
  }
}

}  // namespace tabletop_perception
