#pragma once

#include <cstdarg>
#include <cstdio>
#include <string>

namespace tabletop_perception {

/// What printf would print, at most 255 characters.
inline std::string format(const char* text, ...) __attribute__((format(printf, 1, 2)));
inline std::string format(const char* text, ...) {
  char line[256];
  va_list values;
  va_start(values, text);
  std::vsnprintf(line, sizeof line, text, values);
  va_end(values);
  return line;
}

}  // namespace tabletop_perception
