#include "diagnose.h"

#include <cstdio>

#include "findings.h"

namespace tabletop_perception::tools {

std::string figure(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.3g", value);
  return text;
}

std::string listOf(const std::vector<std::string>& words) {
  std::string text;
  for (const auto& word : words) text += (text.empty() ? "" : ", ") + word;
  return text;
}

double median(std::vector<double> values) {
  if (values.empty()) return 0;
  const auto middle = values.begin() + values.size() / 2;
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

std::vector<Finding> diagnose(const Observed& seen) {
  Findings findings;
  if (!seen.reachable) {
    findings.error("no_master", "no ROS master answers at " + seen.source +
                                    ": start roscore or the launch file, or let ROS_MASTER_URI "
                                    "name the machine where it runs");
    return findings.all();
  }
  checkInput(seen, findings);
  checkHeaders(seen, findings);
  checkRates(seen, findings);
  checkPoints(seen, findings);
  checkTransforms(seen, findings);
  if (seen.graph) checkGraph(seen, findings);
  checkAnswers(seen, findings);
  return findings.all();
}

}  // namespace tabletop_perception::tools
