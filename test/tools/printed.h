#pragma once

#include <string>

#include <gtest/gtest.h>
#include <CLI/CLI.hpp>

namespace tabletop_perception::tools {

/// Runs a sub-command that `add` adds with the words of a command line, its name first; gives back
/// what it prints on stdout.
inline std::string printedBy(void (*add)(CLI::App&), const std::string& words) {
  CLI::App app;
  add(app);
  testing::internal::CaptureStdout();
  try {
    app.parse(words, false);
  } catch (...) {
    testing::internal::GetCapturedStdout();
    throw;
  }
  return testing::internal::GetCapturedStdout();
}

}  // namespace tabletop_perception::tools
