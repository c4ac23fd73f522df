#pragma once

namespace CLI {
class App;
}

/// The sub-commands of `tabletop`. Each adds itself to the program: its options, and a callback
/// that does the work once the command line is parsed. A callback throws std::invalid_argument for
/// bad usage and unreadable input (exit 2, one line), CommandFailed to end with another code.
namespace tabletop_perception::tools {

/// Ends the program with an exit code after everything was printed that is to be said.
struct CommandFailed {
  int exit_code;
};

void addTrain(CLI::App& app);
void addObjects(CLI::App& app);
void addSegment(CLI::App& app);
void addRecognize(CLI::App& app);
void addPick(CLI::App& app);
void addDoctor(CLI::App& app);
void addSimulate(CLI::App& app);
void addEvaluate(CLI::App& app);
void addBenchmark(CLI::App& app);

}  // namespace tabletop_perception::tools
