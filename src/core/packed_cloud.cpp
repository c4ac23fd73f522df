#include "tabletop_perception/packed_cloud.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <stdexcept>

#include <Eigen/Core>

#include "range_crop.h"
#include "simd.h"

namespace tabletop_perception {
namespace {

enum Datatype : std::uint8_t { INT32 = 5, UINT32 = 6, FLOAT32 = 7, FLOAT64 = 8 };
constexpr std::uint64_t DATATYPE_SIZES[] = {0, 1, 1, 2, 2, 4, 4, 4, 8};
constexpr const char* DATATYPE_NAMES[] = {"nothing", "int8",   "uint8",   "int16",  "uint16",
                                          "int32",   "uint32", "float32", "float64"};
constexpr std::uint64_t MAX_POINTS = 1u << 30;  // indices of points are ints
constexpr std::uint32_t MAX_RUN = 64;  // points that are read at once: bytes and values stay cached
constexpr std::size_t READ_AHEAD = 8192;   // fetched before it is read [bytes]
constexpr std::size_t WRITE_AHEAD = 2048;  // fetched before it is written [bytes]

bool hostIsBigEndian() {
  const std::uint16_t one = 1;
  std::uint8_t first;
  std::memcpy(&first, &one, 1);
  return first == 0;
}

[[noreturn]] void refuse(const std::string& what) { throw std::invalid_argument(what); }

std::string gridOf(const PackedCloud& packed) {
  return std::to_string(packed.width) + " x " + std::to_string(packed.height) + " points";
}

/// Throws unless the rows that the header speaks of lie within the data.
void checkLayout(const PackedCloud& packed) {
  const std::uint64_t points = std::uint64_t{packed.width} * packed.height;
  if (points == 0) return;
  if (points > MAX_POINTS)
    refuse("cloud of " + gridOf(packed) + " is too large, at most " + std::to_string(MAX_POINTS));
  const std::uint64_t row = std::uint64_t{packed.width} * packed.point_step;
  if (packed.row_step < row)
    refuse("row_step must be at least width x point_step = " + std::to_string(row) +
           " bytes, got " + std::to_string(packed.row_step));
  const std::uint64_t needed = std::uint64_t{packed.row_step} * (packed.height - 1) + row;
  if (packed.data_size < needed)
    refuse("data is too short for " + gridOf(packed) + ": " + std::to_string(packed.data_size) +
           " bytes, " + std::to_string(needed) + " needed");
}

const PackedCloud::Field* findField(const PackedCloud& packed, const std::string& name) {
  const auto field = std::find_if(packed.fields.begin(), packed.fields.end(),
                                  [&](const auto& candidate) { return candidate.name == name; });
  return field == packed.fields.end() ? nullptr : &*field;
}

std::string namesOf(const std::vector<PackedCloud::Field>& fields) {
  std::string names;
  for (const auto& field : fields) names += (names.empty() ? "" : " ") + field.name;
  return names.empty() ? "none" : names;
}

/// The field of that name; throws unless it exists, lies within the point and has one of two types.
const PackedCloud::Field& requireField(const PackedCloud& packed, const std::string& name,
                                       Datatype type, Datatype other_type) {
  const auto* field = findField(packed, name);
  if (!field)
    refuse("cloud has no field '" + name + "', its fields are: " + namesOf(packed.fields));
  if (field->datatype != type && field->datatype != other_type)
    refuse("field '" + name + "' must be " + DATATYPE_NAMES[type] + " or " +
           DATATYPE_NAMES[other_type] + ", got " +
           (field->datatype <= FLOAT64 ? DATATYPE_NAMES[field->datatype]
                                       : "datatype " + std::to_string(field->datatype)));
  const std::uint64_t end = field->offset + DATATYPE_SIZES[field->datatype];
  if (end > packed.point_step)
    refuse("field '" + name + "' ends at byte " + std::to_string(end) +
           " of a point, point_step is " + std::to_string(packed.point_step));
  return *field;
}

template <typename Value, bool SWAP>
Value readValue(const std::uint8_t* bytes) {
  Value value;
  if (SWAP) {
    std::uint8_t swapped[sizeof(Value)];
    std::reverse_copy(bytes, bytes + sizeof(Value), swapped);
    std::memcpy(&value, swapped, sizeof(Value));
  } else {
    std::memcpy(&value, bytes, sizeof(Value));
  }
  return value;
}

/// Points side by side in one row.
struct Run {
  std::uint32_t row, first, count;
};

/// Calls visit(run) for all points, in their order.
template <typename Visit>
void visitRuns(const PackedCloud& packed, Visit visit) {
  for (std::uint32_t row = 0; row < packed.height; ++row)
    for (std::uint32_t first = 0; first < packed.width; first += MAX_RUN)
      visit(Run{row, first, std::min(MAX_RUN, packed.width - first)});
}

template <typename Value, bool SWAP, typename Out>
void readValues(const std::uint8_t* bytes, std::uint32_t step, std::uint32_t count, Out* out) {
  for (std::uint32_t i = 0; i < count; ++i)
    out[i] = static_cast<Out>(readValue<Value, SWAP>(bytes + std::size_t{i} * step));
}

/// Where a field of the first point of a run is.
const std::uint8_t* bytesOf(const PackedCloud& packed, std::uint32_t offset, const Run& run) {
  return packed.data + std::size_t{run.row} * packed.row_step +
         std::size_t{run.first} * packed.point_step + offset;
}

/// One field of a run of points.
template <typename Value, typename Out>
void readRun(const PackedCloud& packed, std::uint32_t offset, const Run& run, Out* out) {
  const auto* bytes = bytesOf(packed, offset, run);
  if (packed.big_endian == hostIsBigEndian())
    readValues<Value, false>(bytes, packed.point_step, run.count, out);
  else
    readValues<Value, true>(bytes, packed.point_step, run.count, out);
}

void readFloatRun(const PackedCloud& packed, const PackedCloud::Field& field, const Run& run,
                  float* out) {
  if (field.datatype == FLOAT32)
    readRun<float>(packed, field.offset, run, out);
  else
    readRun<double>(packed, field.offset, run, out);
}

/// Whether x, y and z are floats side by side that can be read as they are, with one more behind.
bool hasPlainPoints(const PackedCloud& packed, const PackedCloud::Field& x,
                    const PackedCloud::Field& y, const PackedCloud::Field& z) {
  const auto follows = [](const PackedCloud::Field& next, const PackedCloud::Field& field) {
    return next.datatype == FLOAT32 && next.offset == field.offset + sizeof(float);
  };
  return x.datatype == FLOAT32 && follows(y, x) && follows(z, y) &&
         x.offset + 4 * sizeof(float) <= packed.point_step &&
         packed.big_endian == hostIsBigEndian();
}

/// Coordinates of plain points, four of them at a time.
void readPlainRun(const PackedCloud& packed, std::uint32_t offset, const Run& run, float* x,
                  float* y, float* z) {
  const auto* bytes = bytesOf(packed, offset, run);
  std::uint32_t i = 0;
  for (; i + 4 <= run.count; i += 4) {
    Eigen::Matrix4f block;
    for (int k = 0; k < 4; ++k)
      std::memcpy(block.col(k).data(), bytes + std::size_t{i + k} * packed.point_step, 16);
    block.transposeInPlace();
    std::memcpy(x + i, block.col(0).data(), 16);
    std::memcpy(y + i, block.col(1).data(), 16);
    std::memcpy(z + i, block.col(2).data(), 16);
  }
  for (; i < run.count; ++i) {
    const auto* point = bytes + std::size_t{i} * packed.point_step;
    x[i] = readValue<float, false>(point);
    y[i] = readValue<float, false>(point + 4);
    z[i] = readValue<float, false>(point + 8);
  }
}

void dropNonFinite(float* x, float* y, float* z, std::size_t count) {
  for (std::size_t i = 0; i < count; ++i) {
    // 0 x v is 0 for finite values, else NaN; no branch, so that compilers vectorise it
    const float nothing = 0 * x[i] + 0 * y[i] + 0 * z[i];
    x[i] += nothing;
    y[i] += nothing;
    z[i] += nothing;
  }
}

const PackedCloud::Field* findColor(const PackedCloud& packed) {
  for (const char* name : {"rgb", "rgba"}) {
    if (!findField(packed, name)) continue;
    const auto* field = findField(packed, name);
    return &requireField(packed, name, field->datatype == INT32 ? INT32 : FLOAT32, UINT32);
  }
  return nullptr;
}

}  // namespace

bool hasField(const PackedCloud& packed, const std::string& name) {
  return findField(packed, name) != nullptr;
}

Cloud unpackCloud(const PackedCloud& packed) {
  return unpackCloud(packed, 0, std::numeric_limits<double>::infinity());
}

Cloud unpackCloud(const PackedCloud& packed, double min_range, double max_range) {
  checkLayout(packed);
  if (packed.width == 0 || packed.height == 0) return {};
  const auto& x = requireField(packed, "x", FLOAT32, FLOAT64);
  const auto& y = requireField(packed, "y", FLOAT32, FLOAT64);
  const auto& z = requireField(packed, "z", FLOAT32, FLOAT64);
  const auto* color = findColor(packed);

  Cloud cloud;
  cloud.width = static_cast<int>(packed.width);
  cloud.height = static_cast<int>(packed.height);
  const std::size_t size = std::size_t{packed.width} * packed.height;
  for (auto* values : {&cloud.x, &cloud.y, &cloud.z}) values->reserve(size);
  if (color) cloud.rgb.reserve(size);
  const bool plain = hasPlainPoints(packed, x, y, z);
  const bool cropped = min_range > 0 || std::isfinite(max_range);
  float xs[MAX_RUN], ys[MAX_RUN], zs[MAX_RUN];
  std::uint32_t colors[MAX_RUN];
  const auto append = [](const auto* from, std::uint32_t count, auto& to) {
    prefetch<true>(reinterpret_cast<const char*>(to.data() + to.size()) + WRITE_AHEAD,
                   count * sizeof *from);
    to.insert(to.end(), from, from + count);
  };
  visitRuns(packed, [&](const Run& run) {
    prefetch(bytesOf(packed, 0, run) + READ_AHEAD, std::size_t{run.count} * packed.point_step);
    if (plain) {
      readPlainRun(packed, x.offset, run, xs, ys, zs);
    } else {
      readFloatRun(packed, x, run, xs);
      readFloatRun(packed, y, run, ys);
      readFloatRun(packed, z, run, zs);
    }
    if (!std::isfinite(max_range)) dropNonFinite(xs, ys, zs, run.count);
    if (cropped) dropOutside(xs, ys, zs, run.count, min_range, max_range);
    append(xs, run.count, cloud.x);
    append(ys, run.count, cloud.y);
    append(zs, run.count, cloud.z);
    if (!color) return;
    readRun<std::uint32_t>(packed, color->offset, run, colors);
    for (auto& rgb : colors) rgb &= 0xFFFFFF;  // the top byte is alpha or padding
    append(colors, run.count, cloud.rgb);
  });
  return cloud;
}

std::vector<std::uint32_t> unpackLabels(const PackedCloud& packed) {
  checkLayout(packed);
  const auto& field = requireField(packed, "label", UINT32, INT32);
  std::vector<std::uint32_t> labels(std::size_t{packed.width} * packed.height);
  auto* out = labels.data();
  visitRuns(packed, [&](const Run& run) {
    readRun<std::uint32_t>(packed, field.offset, run, out);
    out += run.count;
  });
  return labels;
}

std::vector<float> unpackFloats(const PackedCloud& packed, const std::string& name) {
  checkLayout(packed);
  const auto& field = requireField(packed, name, FLOAT32, FLOAT64);
  std::vector<float> values(std::size_t{packed.width} * packed.height);
  auto* out = values.data();
  visitRuns(packed, [&](const Run& run) {
    readFloatRun(packed, field, run, out);
    out += run.count;
  });
  return values;
}

}  // namespace tabletop_perception
