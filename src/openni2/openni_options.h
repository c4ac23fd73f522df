#pragma once

#include "tabletop_perception/options.h"

namespace tabletop_perception {

/// How an OpenNI2 camera works. A file is as it was recorded: of these only `registration` counts
/// and says whether its depth was registered.
struct OpenniOptions {
  int width = 640;            ///< of both images [pixels]
  int height = 480;           ///< [pixels]
  int fps = 30;               ///< frames per second
  bool registration = true;   ///< depth as the colour camera sees it, by the device
  bool mirror = false;        ///< both images mirrored, left and right
  bool auto_exposure = true;  ///< of colour
  int exposure = 0;           ///< of colour without auto_exposure, as the device counts; 0: its own
  bool auto_white_balance = true;  ///< of colour

  template <typename Visitor>
  void visitFields(Visitor&& visit) {
    visit("width", width, Range{1, 4096});
    visit("height", height, Range{1, 4096});
    visit("fps", fps, Range{1, 240});
    visit("registration", registration);
    visit("mirror", mirror);
    visit("auto_exposure", auto_exposure);
    visit("exposure", exposure, Range{0, 100000});
    visit("auto_white_balance", auto_white_balance);
  }
};

/// Whether the streams may run on with the other options.
inline bool sameStreams(const OpenniOptions& a, const OpenniOptions& b) {
  return a.width == b.width && a.height == b.height && a.fps == b.fps &&
         a.registration == b.registration && a.mirror == b.mirror;
}

inline bool sameExposure(const OpenniOptions& a, const OpenniOptions& b) {
  return a.auto_exposure == b.auto_exposure && a.exposure == b.exposure &&
         a.auto_white_balance == b.auto_white_balance;
}

}  // namespace tabletop_perception
