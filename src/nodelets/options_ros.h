#pragma once

#include <set>
#include <stdexcept>
#include <string>
#include <vector>

#include <XmlRpcValue.h>
#include <dynamic_reconfigure/Config.h>
#include <dynamic_reconfigure/config_tools.h>
#include <ros/node_handle.h>

#include "tabletop_perception/options.h"
#include "tabletop_perception/pipeline.h"

namespace tabletop_perception {

/// Copies what dynamic_reconfigure tells into Options, field by name.
template <typename Options>
Options optionsFromMessage(const dynamic_reconfigure::Config& message) {
  Options options;
  options.visitFields([&](const std::string& name, auto& field, const auto&...) {
    dynamic_reconfigure::ConfigTools::getParameter(message, name, field);
  });
  return options;
}

template <typename Options, typename Config>
Options optionsFromConfig(const Config& config) {
  dynamic_reconfigure::Config message;
  config.__toMessage__(message);
  return optionsFromMessage<Options>(message);
}

/// Reads one parameter; throws std::invalid_argument with its name when it has another type. A
/// whole number is fine for a double.
void readParameter(const std::string& name, XmlRpc::XmlRpcValue value, double& to);
void readParameter(const std::string& name, XmlRpc::XmlRpcValue value, int& to);
void readParameter(const std::string& name, XmlRpc::XmlRpcValue value, bool& to);
void readParameter(const std::string& name, XmlRpc::XmlRpcValue value, std::string& to);
void readParameter(const std::string& name, XmlRpc::XmlRpcValue value, std::vector<double>& to);

/// Checks a node's parameters against Options: throws std::invalid_argument for a key that is
/// neither a field nor one of `known`, for a wrong type, for a value out of range and for two
/// that contradict each other.
template <typename Options>
void checkParameters(const std::string& node, XmlRpc::XmlRpcValue parameters,
                     std::set<std::string> known) {
  if (parameters.getType() != XmlRpc::XmlRpcValue::TypeStruct) return;  // nothing is set
  Options options;
  options.visitFields([&](const std::string& name, auto& field, const auto&...) {
    known.insert(name);
    if (parameters.hasMember(name)) readParameter(node + "/" + name, parameters[name], field);
  });
  checkFields(node + "/", options);

  std::string list;
  for (const auto& name : known) list += (list.empty() ? "" : ", ") + name;
  for (const auto& [name, value] : parameters)
    if (!known.count(name))
      throw std::invalid_argument("no such parameter: " + node + "/" + name + "; there are " +
                                  list);
}

/// The options of a stage as the parameters under `nh`/`section`, which another nodelet serves,
/// are set.
template <typename Options>
void readOptions(const ros::NodeHandle& nh, const std::string& section, Options& options) {
  XmlRpc::XmlRpcValue set;
  if (!nh.getParam(section, set) || set.getType() != XmlRpc::XmlRpcValue::TypeStruct) return;
  options.visitFields([&](const std::string& name, auto& field, const auto&...) {
    if (set.hasMember(name)) readParameter(section + "/" + name, set[name], field);
  });
  checkOptions(section, options);
}

/// The options of every stage as the parameters beside a nodelet say: those that the other nodelets
/// of the graph are served with. Throws std::invalid_argument as checkParameters does.
PipelineOptions servedOptions(const ros::NodeHandle& nh);

}  // namespace tabletop_perception
