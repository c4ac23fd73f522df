#pragma once

#include <string>
#include <type_traits>
#include <vector>

#include <yaml-cpp/yaml.h>

#include "tabletop_perception/options.h"

namespace tabletop_perception {

/// What a node holds, in one line for messages.
std::string inOneLine(const YAML::Node& yaml);

/// Throws std::invalid_argument when a key of `yaml` is not among `known`; the message lists them.
void checkYamlKeys(const std::string& section, const YAML::Node& yaml,
                   const std::vector<std::string>& known);

/// Reads the fields of `options` that `yaml` names; the others keep their values. An unknown key,
/// a value of the wrong type and a value out of range throw std::invalid_argument.
template <typename Options>
void readYaml(const std::string& section, const YAML::Node& yaml, Options& options) {
  std::vector<std::string> known;
  options.visitFields([&](const std::string& name, auto& field, const auto&...) {
    known.push_back(name);
    if (!yaml || !yaml.IsMap() || !yaml[name]) return;
    try {
      field = yaml[name].template as<std::decay_t<decltype(field)>>();
    } catch (const YAML::Exception&) {
      throw std::invalid_argument(section + "." + name + " cannot be '" + inOneLine(yaml[name]) +
                                  "': wrong type");
    }
  });
  checkYamlKeys(section, yaml, known);
  checkOptions(section, options);
}

}  // namespace tabletop_perception
