#include "tabletop_perception/packed_cloud.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <stdexcept>

namespace tabletop_perception {
namespace {

enum Datatype : std::uint8_t { INT32 = 5, UINT32 = 6, FLOAT32 = 7, FLOAT64 = 8 };
constexpr std::uint64_t DATATYPE_SIZES[] = {0, 1, 1, 2, 2, 4, 4, 4, 8};
constexpr const char* DATATYPE_NAMES[] = {"nothing", "int8",   "uint8",   "int16",  "uint16",
                                          "int32",   "uint32", "float32", "float64"};
constexpr std::uint64_t MAX_POINTS = 1u << 30;  // indices of points are ints

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

template <typename Value, bool SWAP, typename Out>
void readValues(const std::uint8_t* bytes, std::uint32_t step, std::uint32_t count, Out* out) {
  for (std::uint32_t i = 0; i < count; ++i)
    out[i] = static_cast<Out>(readValue<Value, SWAP>(bytes + std::size_t{i} * step));
}

/// One field of one row.
template <typename Value, typename Out>
void readRow(const PackedCloud& packed, std::uint32_t offset, std::uint32_t row, Out* out) {
  const auto* bytes = packed.data + std::size_t{row} * packed.row_step + offset;
  if (packed.big_endian == hostIsBigEndian())
    readValues<Value, false>(bytes, packed.point_step, packed.width, out);
  else
    readValues<Value, true>(bytes, packed.point_step, packed.width, out);
}

void readFloatRow(const PackedCloud& packed, const PackedCloud::Field& field, std::uint32_t row,
                  float* out) {
  if (field.datatype == FLOAT32)
    readRow<float>(packed, field.offset, row, out);
  else
    readRow<double>(packed, field.offset, row, out);
}

void dropNonFinite(Cloud& cloud, std::size_t begin, std::size_t end) {
  for (std::size_t i = begin; i < end; ++i) {
    // 0 x v is 0 for finite values, else NaN; no branch, so that compilers vectorise it
    const float nothing = 0 * cloud.x[i] + 0 * cloud.y[i] + 0 * cloud.z[i];
    cloud.x[i] += nothing;
    cloud.y[i] += nothing;
    cloud.z[i] += nothing;
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
  checkLayout(packed);
  if (packed.width == 0 || packed.height == 0) return {};
  const auto& x = requireField(packed, "x", FLOAT32, FLOAT64);
  const auto& y = requireField(packed, "y", FLOAT32, FLOAT64);
  const auto& z = requireField(packed, "z", FLOAT32, FLOAT64);
  const auto* color = findColor(packed);

  Cloud cloud(static_cast<int>(packed.width), static_cast<int>(packed.height), color != nullptr);
  for (std::uint32_t row = 0; row < packed.height; ++row) {
    const auto begin = std::size_t{row} * packed.width;
    readFloatRow(packed, x, row, &cloud.x[begin]);
    readFloatRow(packed, y, row, &cloud.y[begin]);
    readFloatRow(packed, z, row, &cloud.z[begin]);
    dropNonFinite(cloud, begin, begin + packed.width);
    if (color) readRow<std::uint32_t>(packed, color->offset, row, &cloud.rgb[begin]);
  }
  for (auto& rgb : cloud.rgb) rgb &= 0xFFFFFF;  // the top byte is alpha or padding
  return cloud;
}

std::vector<std::uint32_t> unpackLabels(const PackedCloud& packed) {
  checkLayout(packed);
  const auto& field = requireField(packed, "label", UINT32, INT32);
  std::vector<std::uint32_t> labels(std::size_t{packed.width} * packed.height);
  for (std::uint32_t row = 0; row < packed.height; ++row)
    readRow<std::uint32_t>(packed, field.offset, row, &labels[std::size_t{row} * packed.width]);
  return labels;
}

std::vector<float> unpackFloats(const PackedCloud& packed, const std::string& name) {
  checkLayout(packed);
  const auto& field = requireField(packed, name, FLOAT32, FLOAT64);
  std::vector<float> values(std::size_t{packed.width} * packed.height);
  for (std::uint32_t row = 0; row < packed.height; ++row)
    readFloatRow(packed, field, row, &values[std::size_t{row} * packed.width]);
  return values;
}

}  // namespace tabletop_perception
