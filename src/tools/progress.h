#pragma once

#include <chrono>
#include <string>

namespace tabletop_perception::tools {

/// Shows on stderr how far a work is: a bar with the time left on a terminal, else a line at every
/// quarter.
class ProgressBar {
 public:
  /// `what`: the work in a few words ("training can").
  explicit ProgressBar(std::string what);
  /// Ends the bar's line, so that what follows begins a new one.
  ~ProgressBar();
  ProgressBar(const ProgressBar&) = delete;
  ProgressBar& operator=(const ProgressBar&) = delete;

  /// `done`: share of the work, 0 to 1, never less than before.
  void show(double done);

 private:
  void drawBar(double done) const;

  std::string what_;
  bool on_terminal_;
  std::chrono::steady_clock::time_point start_;
  int quarters_ = -1;  ///< told so far, where there is no terminal
};

/// "[##########..........]  50 % 12 s left" for a work that took `seconds` [s] for the share
/// `done`.
std::string barText(double done, double seconds);

}  // namespace tabletop_perception::tools
