#include "options_ros.h"

#include <sstream>

namespace tabletop_perception {
namespace {

using XmlRpc::XmlRpcValue;

std::invalid_argument wrongType(const std::string& name, const XmlRpcValue& value,
                                const std::string& right) {
  std::ostringstream got;
  value.write(got);
  return std::invalid_argument(name + " must be " + right + ", got '" + got.str() + "'");
}

}  // namespace

void readParameter(const std::string& name, XmlRpcValue value, double& to) {
  if (value.getType() == XmlRpcValue::TypeInt)
    to = static_cast<int>(value);
  else if (value.getType() == XmlRpcValue::TypeDouble)
    to = static_cast<double>(value);
  else
    throw wrongType(name, value, "a number");
}

void readParameter(const std::string& name, XmlRpcValue value, int& to) {
  if (value.getType() != XmlRpcValue::TypeInt) throw wrongType(name, value, "a whole number");
  to = static_cast<int>(value);
}

void readParameter(const std::string& name, XmlRpcValue value, bool& to) {
  if (value.getType() != XmlRpcValue::TypeBoolean) throw wrongType(name, value, "true or false");
  to = static_cast<bool>(value);
}

void readParameter(const std::string& name, XmlRpcValue value, std::string& to) {
  if (value.getType() != XmlRpcValue::TypeString) throw wrongType(name, value, "a word");
  to = static_cast<std::string>(value);
}

void readParameter(const std::string& name, XmlRpcValue value, std::vector<double>& to) {
  if (value.getType() != XmlRpcValue::TypeArray) throw wrongType(name, value, "a list of numbers");
  to.resize(value.size());
  for (int i = 0; i < value.size(); ++i)
    readParameter(name + "[" + std::to_string(i) + "]", value[i], to[i]);
}

PipelineOptions servedOptions(const ros::NodeHandle& nh) {
  PipelineOptions options;
  options.visitStages(
      [&](const std::string& section, auto& stage) { readOptions(nh, section, stage); });
  return options;
}

}  // namespace tabletop_perception
