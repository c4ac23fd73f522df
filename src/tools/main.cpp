#include <algorithm>
#include <cstdio>
#include <exception>
#include <string>

#include <CLI/CLI.hpp>

#include "commands.h"
#include "tabletop_perception/frame_memory.h"

namespace {

constexpr int BAD_USAGE = 2;

/// Says on stderr, in one line, why the program ends.
int fail(std::string what) {
  std::replace(what.begin(), what.end(), '\n', ' ');
  std::fprintf(stderr, "tabletop: %s\n", what.c_str());
  return BAD_USAGE;
}

/// What the command line lacks or has too much, and where to read on.
std::string usageError(const CLI::App& app, const CLI::ParseError& error) {
  const auto commands = app.get_subcommands();
  if (!commands.empty())
    return std::string(error.what()) + " (see tabletop " + commands[0]->get_name() + " --help)";
  const auto words = app.remaining();
  return (words.empty() ? error.what() : "no subcommand " + words[0]) + " (see tabletop --help)";
}

/// Full disks and closed pipes show when the last of the output is written.
int finish(int exit_code) {
  return std::fflush(stdout) == 0 && !std::ferror(stdout) ? exit_code
                                                          : fail("the output cannot be written");
}

}  // namespace

int main(int argc, char** argv) {
  using namespace tabletop_perception::tools;
  tabletop_perception::keepFrameMemory();
  CLI::App app{"Finds tables, the objects on them and their 6D poses in depth camera clouds.",
               "tabletop"};
  app.set_version_flag("--version", "tabletop " TABLETOP_VERSION);
  app.require_subcommand(1);
  app.footer(
      "Lengths are metres and angles radians unless an option's name says otherwise.\n"
      "Exit code: 0 done, 1 nothing found or a check failed, 2 bad usage or unreadable input.\n"
      "Example: tabletop recognize scene.pcd --database objects.db\n"
      "`tabletop SUBCOMMAND --help` tells more.");
  addTrain(app);
  addObjects(app);
  addSegment(app);
  addRecognize(app);
  addPick(app);
  addDoctor(app);
  addSimulate(app);
  addEvaluate(app);
  addBenchmark(app);

  try {
    app.parse(argc, argv);
    return finish(0);
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) return finish(app.exit(error));  // --help, --version
    return fail(usageError(app, error));
  } catch (const CommandFailed& failed) {
    return finish(failed.exit_code);
  } catch (const std::exception& error) {
    return fail(error.what());
  }
}
