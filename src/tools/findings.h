#pragma once

#include <algorithm>
#include <initializer_list>
#include <string>
#include <utility>
#include <vector>

#include "diagnose.h"

namespace tabletop_perception::tools {

/// What was found so far.
class Findings {
 public:
  void error(std::string id, std::string text) {
    all_.push_back({std::move(id), Finding::Severity::ERROR, std::move(text)});
  }
  void warning(std::string id, std::string text) {
    all_.push_back({std::move(id), Finding::Severity::WARNING, std::move(text)});
  }
  void hint(std::string id, std::string text) {
    all_.push_back({std::move(id), Finding::Severity::HINT, std::move(text)});
  }

  /// Whether one of these was found.
  bool any(std::initializer_list<const char*> ids) const {
    return std::any_of(all_.begin(), all_.end(), [&](const Finding& finding) {
      return std::find(ids.begin(), ids.end(), finding.id) != ids.end();
    });
  }

  const std::vector<Finding>& all() const { return all_; }

 private:
  std::vector<Finding> all_;
};

/// A figure with three digits that count, as people write it: 0.25, 812, 1.7e+09.
std::string figure(double value);

/// Words with commas between them.
std::string listOf(const std::vector<std::string>& words);

/// The middle one; of none: 0.
double median(std::vector<double> values);

/// The median age of the clouds when they arrive [s]; none: not known, or not to be believed.
std::optional<double> cloudLag(const Observed& seen);

/// The parts of diagnose(). The messages that should come and do; how they are stamped and named;
/// how many of them come; what is in them; whether tf knows where they are.
void checkInput(const Observed& seen, Findings& findings);
void checkHeaders(const Observed& seen, Findings& findings);
void checkRates(const Observed& seen, Findings& findings);
void checkPoints(const Observed& seen, Findings& findings);
void checkTransforms(const Observed& seen, Findings& findings);

/// The graph's nodelets, parameters and database, and what they answer.
void checkGraph(const Observed& seen, Findings& findings);
void checkAnswers(const Observed& seen, Findings& findings);

}  // namespace tabletop_perception::tools
