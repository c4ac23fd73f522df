#include "progress.h"

#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <utility>

namespace tabletop_perception::tools {
namespace {

constexpr int BAR_WIDTH = 30;  // [characters]

}  // namespace

std::string barText(double done, double seconds) {
  done = std::clamp(done, 0.0, 1.0);
  const int filled = static_cast<int>(done * BAR_WIDTH);
  char numbers[64];
  if (done >= 1)
    std::snprintf(numbers, sizeof numbers, "100 %% in %.0f s", std::ceil(seconds));
  else if (done > 0)
    std::snprintf(numbers, sizeof numbers, "%3.0f %% %.0f s left", std::floor(done * 100),
                  std::ceil(seconds * (1 - done) / done));
  else
    std::snprintf(numbers, sizeof numbers, "  0 %%");
  return "[" + std::string(filled, '#') + std::string(BAR_WIDTH - filled, '.') + "] " + numbers;
}

ProgressBar::ProgressBar(std::string what)
    : what_(std::move(what)),
      on_terminal_(isatty(STDERR_FILENO) != 0),
      start_(std::chrono::steady_clock::now()) {
  show(0);
}

ProgressBar::~ProgressBar() {
  if (on_terminal_) std::fputc('\n', stderr);
}

void ProgressBar::show(double done) {
  if (on_terminal_) return drawBar(done);
  const int quarters = static_cast<int>(std::clamp(done, 0.0, 1.0) * 4);
  if (quarters == quarters_) return;
  quarters_ = quarters;
  std::fprintf(stderr, "%s: %d %%\n", what_.c_str(), quarters * 25);
}

void ProgressBar::drawBar(double done) const {
  constexpr const char* CLEAR_REST_OF_LINE = "\033[K";
  const std::chrono::duration<double> passed = std::chrono::steady_clock::now() - start_;
  std::fprintf(stderr, "\r%s %s%s", what_.c_str(), barText(done, passed.count()).c_str(),
               CLEAR_REST_OF_LINE);
  std::fflush(stderr);
}

}  // namespace tabletop_perception::tools
