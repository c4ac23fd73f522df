#include <algorithm>
#include <cstdio>
#include <memory>
#include <stdexcept>
#include <string>

#include <CLI/CLI.hpp>

#include "commands.h"
#include "diagnose.h"
#include "findings.h"
#include "observe.h"
#include "result_json.h"

namespace tabletop_perception::tools {
namespace {

struct DoctorArguments {
  std::string bag;  ///< empty: the running graph
  std::string topic;
  std::string ns = "/perception";
  double seconds = 5;
  bool json = false;
};

std::string severityName(Finding::Severity severity) {
  switch (severity) {
    case Finding::Severity::ERROR:
      return "error";
    case Finding::Severity::WARNING:
      return "warning";
    default:
      return "hint";
  }
}

nlohmann::ordered_json diagnosisJson(const Observed& seen, const std::vector<Finding>& findings) {
  nlohmann::ordered_json json;
  json["source"] = seen.source;
  json["seconds"] = seen.seconds;
  json["input"] = seen.input;
  json["clouds"] = seen.clouds.size();
  json["findings"] = nlohmann::ordered_json::array();
  for (const auto& finding : findings)
    json["findings"].push_back(
        {{"id", finding.id}, {"severity", severityName(finding.severity)}, {"text", finding.text}});
  return json;
}

bool anythingWrong(const std::vector<Finding>& findings) {
  return std::any_of(findings.begin(), findings.end(), [](const Finding& finding) {
    return finding.severity != Finding::Severity::HINT;
  });
}

void printDiagnosis(const Observed& seen, const std::vector<Finding>& findings) {
  for (const auto& finding : findings)
    std::printf("%s %s: %s\n", severityName(finding.severity).c_str(), finding.id.c_str(),
                finding.text.c_str());
  if (!anythingWrong(findings))
    std::printf("nothing wrong: %zu clouds on %s in %s s\n", seen.clouds.size(), seen.input.c_str(),
                figure(seen.seconds).c_str());
}

void doctor(const DoctorArguments& arguments) {
  const auto seen = arguments.bag.empty()
                        ? observeGraph(arguments.ns, arguments.topic, arguments.seconds)
                        : observeBag(arguments.bag, arguments.topic);
  const auto findings = diagnose(seen);
  if (arguments.json)
    std::fputs(jsonLine(diagnosisJson(seen, findings)).c_str(), stdout);
  else
    printDiagnosis(seen, findings);
  if (anythingWrong(findings)) throw CommandFailed{1};
}

/// `perception` and `/perception/` are the same namespace.
std::string namespaceName(std::string name) {
  while (!name.empty() && name.back() == '/') name.pop_back();
  return name.empty() || name[0] == '/' ? name : "/" + name;
}

}  // namespace

void addDoctor(CLI::App& app) {
  auto* command = app.add_subcommand(
      "doctor", "say in plain words what is wrong with a running graph or a bag");
  const auto arguments = std::make_shared<DoctorArguments>();
  auto* bag =
      command->add_option("BAG,--bag", arguments->bag, "look at a bag, not at a running graph")
          ->type_name("FILE");
  command->add_option("--topic", arguments->topic,
                      "of the camera's clouds (default: what the filter listens to; of a bag, its "
                      "only one)");
  command->add_option("--seconds", arguments->seconds, "how long to listen [s]")
      ->check(CLI::Range(0.5, 3600.0))
      ->capture_default_str()
      ->excludes(bag);
  command->add_option("--namespace", arguments->ns, "that the nodelets live in")
      ->capture_default_str()
      ->excludes(bag);
  command->add_flag("--json", arguments->json, "print one JSON object");
  command->footer(
      "Prints a line per cause: severity, id, and what it is, with what would be right.\n"
      "Exit code: 0 nothing wrong, 1 something is, 2 bad usage or unreadable bag.\n"
      "Example: tabletop doctor --seconds 10");
  command->callback([arguments] {
    arguments->ns = namespaceName(arguments->ns);
    doctor(*arguments);
  });
}

}  // namespace tabletop_perception::tools
