#pragma once

#include <optional>
#include <string>
#include <utility>

namespace tabletop_perception {

/// What a stage was looking for or, where there is none, the reason with its figures
/// ("largest plane is 61 deg from up, limit 20"). A reason may also go with a value.
template <typename T>
struct Found {
  std::optional<T> value;
  std::string reason;

  Found(T found) : value(std::move(found)) {}  // NOLINT: a value is a find

  static Found none(std::string reason) { return Found(std::nullopt, std::move(reason)); }

  explicit operator bool() const { return value.has_value(); }
  const T& operator*() const { return *value; }
  const T* operator->() const { return &*value; }

 private:
  Found(std::nullopt_t, std::string why) : reason(std::move(why)) {}
};

}  // namespace tabletop_perception
