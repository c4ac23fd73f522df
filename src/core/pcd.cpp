#include "tabletop_perception/pcd.h"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <map>
#include <optional>
#include <sstream>
#include <stdexcept>
#include <string>

#include <pcl/console/print.h>
#include <pcl/io/pcd_io.h>

#include "tabletop_perception/packed_cloud.h"

namespace tabletop_perception {
namespace {

namespace fs = std::filesystem;

/// PCL prints what it thinks of a file; what is wrong with it is ours to say.
class SilentPcl {
 public:
  SilentPcl() : level_(pcl::console::getVerbosityLevel()) {
    pcl::console::setVerbosityLevel(pcl::console::L_ALWAYS);
  }
  ~SilentPcl() { pcl::console::setVerbosityLevel(level_); }
  SilentPcl(const SilentPcl&) = delete;
  SilentPcl& operator=(const SilentPcl&) = delete;

 private:
  pcl::console::VERBOSITY_LEVEL level_;
};

constexpr std::uint64_t MAX_POINTS = 1u << 30;  // indices of points are ints

[[noreturn]] void refuse(const std::string& what) { throw std::invalid_argument(what); }

std::string readFile(const fs::path& file) {
  if (fs::is_directory(file)) refuse("is a folder, not a file");
  std::ifstream stream(file, std::ios::binary);
  if (!stream) refuse(std::string("cannot be opened: ") + std::strerror(errno));
  std::ostringstream contents;
  contents << stream.rdbuf();
  auto bytes = contents.str();
  if (bytes.empty()) refuse("is empty (0 bytes)");
  return bytes;
}

/// The lines before the data: what has to be known before PCL's reader may touch the file.
struct Header {
  std::map<std::string, std::vector<std::string>> lines;  ///< words after the keyword
  std::size_t size = 0;                                   ///< of the header [bytes]
};

const std::vector<std::string> KEYWORDS = {"VERSION",   "FIELDS", "COLUMNS", "SIZE",
                                           "TYPE",      "COUNT",  "WIDTH",   "HEIGHT",
                                           "VIEWPOINT", "POINTS", "DATA"};

Header parseHeader(const std::string& bytes) {
  Header header;
  std::istringstream stream(bytes);
  for (std::string line; std::getline(stream, line);) {
    std::istringstream words(line);
    std::string keyword;
    words >> keyword;
    if (keyword.empty() || keyword[0] == '#') continue;
    const bool whole = !stream.eof();  // the line has an end
    if (std::find(KEYWORDS.begin(), KEYWORDS.end(), keyword) == KEYWORDS.end()) {
      if (whole || header.lines.empty()) refuse("is not a PCD file");
      break;
    }
    if (header.lines.count(keyword)) refuse("has " + keyword + " twice in its header");
    auto& values = header.lines[keyword];
    for (std::string word; words >> word;) values.push_back(word);
    if (keyword == "DATA" && whole) {
      header.size = static_cast<std::size_t>(stream.tellg());
      return header;
    }
  }
  if (header.lines.empty() && bytes.compare(0, 6, "# .PCD") != 0) refuse("is not a PCD file");
  refuse("is cut short: its header does not end");
}

const std::vector<std::string>& wordsOf(const Header& header, const std::string& keyword) {
  const auto words = header.lines.find(keyword);
  if (words == header.lines.end() || words->second.empty())
    refuse("is not a PCD file: its header has no " + keyword);
  return words->second;
}

std::uint64_t parseCount(const std::string& keyword, const std::string& word) {
  const bool digits =
      std::all_of(word.begin(), word.end(), [](char c) { return c >= '0' && c <= '9'; });
  if (word.empty() || !digits || word.size() > 9)
    refuse("has " + keyword + " '" + word + "' in its header, not a number of points or bytes");
  return std::stoul(word);
}

std::uint64_t countOf(const Header& header, const std::string& keyword) {
  return parseCount(keyword, wordsOf(header, keyword)[0]);
}

std::string gridOf(const Header& header) {
  return wordsOf(header, "WIDTH")[0] + " x " + wordsOf(header, "HEIGHT")[0] + " points";
}

/// Values and bytes that the header says one point has.
struct PointSize {
  std::uint64_t values = 0;
  std::uint64_t bytes = 0;
};

PointSize pointSizeOf(const Header& header) {
  const auto& names = wordsOf(header, header.lines.count("COLUMNS") ? "COLUMNS" : "FIELDS");
  const auto& sizes = wordsOf(header, "SIZE");
  const auto& types = wordsOf(header, "TYPE");
  const auto counts = header.lines.count("COUNT") ? wordsOf(header, "COUNT")
                                                  : std::vector<std::string>(names.size(), "1");
  if (sizes.size() != names.size() || types.size() != names.size() || counts.size() != names.size())
    refuse("is not a PCD file: FIELDS, SIZE, TYPE and COUNT of its header differ in length");
  PointSize point;
  for (std::size_t i = 0; i < names.size(); ++i) {
    const auto size = parseCount("SIZE", sizes[i]);
    const auto count = parseCount("COUNT", counts[i]);
    if (size != 1 && size != 2 && size != 4 && size != 8)
      refuse("has SIZE " + sizes[i] + " in its header, must be 1, 2, 4 or 8");
    if (count > 100000) refuse("has COUNT " + counts[i] + " in its header, at most 100000");
    point.values += count;
    point.bytes += size * count;
  }
  return point;
}

[[noreturn]] void refuseShort(const Header& header, std::uint64_t has, std::uint64_t needed,
                              const std::string& unit) {
  refuse("is cut short: " + gridOf(header) + " need " + std::to_string(needed) + unit +
         ", it has " + std::to_string(has));
}

std::uint64_t countWords(const std::string& line) {
  std::uint64_t count = 0;
  bool inside = false;
  for (const char c : line) {
    const bool blank = c == ' ' || c == '\t' || c == '\r';
    count += !blank && !inside;
    inside = !blank;
  }
  return count;
}

/// Throws unless there is a line for every point, with as many words as a point has values: PCL
/// would take the missing ones for zeros.
void checkAscii(const Header& header, const std::string& bytes, std::uint64_t points,
                std::uint64_t values) {
  std::istringstream stream(bytes);
  stream.seekg(static_cast<std::streamoff>(header.size));
  std::uint64_t lines = 0;
  for (std::string line; std::getline(stream, line);) {
    const auto words = countWords(line);
    if (words == 0) continue;
    if (words < values && stream.eof()) break;  // the last line, unfinished
    ++lines;
    if (words != values)
      refuse("has " + std::to_string(words) + " values in line " + std::to_string(lines) +
             " of its data, a point has " + std::to_string(values));
  }
  if (lines < points) refuseShort(header, lines, points, " lines of data");
}

/// Throws unless the bytes hold all the data that the header speaks of.
void checkData(const Header& header, const std::string& bytes) {
  const auto points = countOf(header, "WIDTH") * countOf(header, "HEIGHT");
  if (points == 0) refuse("holds no points");
  if (points > MAX_POINTS) refuse("says in its header that it holds " + gridOf(header));
  if (header.lines.count("POINTS") == 0 || countOf(header, "POINTS") != points)
    refuse("has a header that does not add up: POINTS is not " + gridOf(header));
  const auto point = pointSizeOf(header);
  const auto& kind = wordsOf(header, "DATA")[0];
  const std::uint64_t has = bytes.size() - header.size;

  if (kind == "ascii") {
    checkAscii(header, bytes, points, point.values);
  } else if (kind == "binary") {
    const auto needed = points * point.bytes;
    if (has < needed) refuseShort(header, has, needed, " bytes of data");
  } else if (kind == "binary_compressed") {
    std::uint32_t sizes[2] = {0, 0};  // compressed, then not
    if (has < sizeof sizes) refuseShort(header, has, sizeof sizes, " bytes of data or more");
    std::memcpy(sizes, bytes.data() + header.size, sizeof sizes);
    const auto needed = sizeof sizes + sizes[0];
    if (has < needed) refuseShort(header, has, needed, " bytes of data");
    if (sizes[1] != points * point.bytes)
      refuse("is damaged: its data unpack to " + std::to_string(sizes[1]) + " bytes, " +
             gridOf(header) + " are " + std::to_string(points * point.bytes));
  } else {
    refuse("has DATA '" + kind + "', must be ascii, binary or binary_compressed");
  }
}

/// A cloud as PCL's reader gives it, and where it was taken from.
struct PclContents {
  pcl::PCLPointCloud2 cloud;
  Eigen::Vector4f origin = Eigen::Vector4f::Zero();
  Eigen::Quaternionf orientation = Eigen::Quaternionf::Identity();
};

PclContents readWithPcl(const std::string& bytes, const Header& expected) {
  const SilentPcl silent;
  pcl::PCDReader reader;
  PclContents contents;
  std::istringstream stream(bytes);
  int version = 0, data_type = 0;
  unsigned int data_index = 0;
  const bool header = reader.readHeader(stream, contents.cloud, contents.origin,
                                        contents.orientation, version, data_type, data_index) == 0;
  const auto points = countOf(expected, "WIDTH") * countOf(expected, "HEIGHT");
  if (!header || data_index != expected.size ||
      contents.cloud.data.size() != points * pointSizeOf(expected).bytes)
    refuse("has a header that does not add up");
  const auto* data = reinterpret_cast<const unsigned char*>(bytes.data());
  stream.clear();
  stream.seekg(data_index);
  const int failed = data_type == 0 ? reader.readBodyASCII(stream, contents.cloud, version)
                                    : reader.readBodyBinary(data, contents.cloud, version,
                                                            data_type == 2, data_index);
  if (failed) refuse("is damaged: its data cannot be unpacked");
  return contents;
}

PackedCloud packedCloudOf(const pcl::PCLPointCloud2& cloud) {
  PackedCloud packed;
  packed.width = cloud.width;
  packed.height = cloud.height;
  packed.point_step = cloud.point_step;
  packed.row_step = cloud.point_step * cloud.width;
  packed.big_endian = false;
  for (const auto& field : cloud.fields)
    packed.fields.push_back({field.name, field.offset, field.datatype, field.count});
  packed.data = cloud.data.data();
  packed.data_size = cloud.data.size();
  return packed;
}

std::vector<Eigen::Vector3f> unpackNormals(const PackedCloud& packed) {
  const auto x = unpackFloats(packed, "normal_x");
  const auto y = unpackFloats(packed, "normal_y");
  const auto z = unpackFloats(packed, "normal_z");
  std::vector<Eigen::Vector3f> normals(x.size());
  for (std::size_t i = 0; i < x.size(); ++i) normals[i] = {x[i], y[i], z[i]};
  return normals;
}

/// A rotation of all zeros, as some programs write it, is none.
Eigen::Isometry3d sensorPose(const PclContents& contents) {
  Eigen::Isometry3d T_data_sensor = Eigen::Isometry3d::Identity();
  if (!contents.origin.allFinite() || !contents.orientation.coeffs().allFinite())
    refuse("has a VIEWPOINT that is not finite");
  T_data_sensor.translation() = contents.origin.head<3>().cast<double>();
  if (!contents.orientation.coeffs().isZero())
    T_data_sensor.linear() = contents.orientation.cast<double>().normalized().toRotationMatrix();
  return T_data_sensor;
}

PcdContents parsePcd(const std::string& bytes) {
  const auto header = parseHeader(bytes);
  checkData(header, bytes);
  const auto contents = readWithPcl(bytes, header);
  const auto packed = packedCloudOf(contents.cloud);

  PcdContents pcd;
  pcd.cloud = unpackCloud(packed);
  if (hasField(packed, "label")) pcd.labels = unpackLabels(packed);
  if (hasField(packed, "normal_x")) pcd.normals = unpackNormals(packed);
  pcd.T_data_sensor = sensorPose(contents);
  return pcd;
}

/// Bytes of a point, grown field by field.
class Packer {
 public:
  Packer(const Cloud& cloud) {
    blob_.width = static_cast<std::uint32_t>(cloud.width);
    blob_.height = static_cast<std::uint32_t>(cloud.height);
    blob_.is_dense = false;
  }

  void addField(const std::string& name, std::uint8_t datatype) {
    pcl::PCLPointField field;
    field.name = name;
    field.offset = blob_.point_step;
    field.datatype = datatype;
    field.count = 1;
    blob_.fields.push_back(field);
    blob_.point_step += 4;
  }

  /// After the last field: room for all the points.
  void allocate() {
    blob_.row_step = blob_.point_step * blob_.width;
    blob_.data.resize(std::size_t{blob_.row_step} * blob_.height);
  }

  /// The four bytes of every field, point by point in the order of the fields.
  template <typename Value>
  void put(const Value& value) {
    static_assert(sizeof(Value) == 4);
    std::memcpy(&blob_.data[written_], &value, 4);
    written_ += 4;
  }

  const pcl::PCLPointCloud2& blob() const { return blob_; }

 private:
  pcl::PCLPointCloud2 blob_;
  std::size_t written_ = 0;
};

pcl::PCLPointCloud2 pack(const PcdContents& contents) {
  const auto& cloud = contents.cloud;
  using Field = pcl::PCLPointField;
  Packer packer(cloud);
  for (const char* name : {"x", "y", "z", "rgb"}) packer.addField(name, Field::FLOAT32);
  if (!contents.normals.empty())
    for (const char* name : {"normal_x", "normal_y", "normal_z"})
      packer.addField(name, Field::FLOAT32);
  if (!contents.labels.empty()) packer.addField("label", Field::UINT32);
  packer.allocate();
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    packer.put(cloud.x[i]);
    packer.put(cloud.y[i]);
    packer.put(cloud.z[i]);
    packer.put(cloud.colored() ? cloud.rgb[i] : std::uint32_t{0});
    if (!contents.normals.empty())
      for (int axis = 0; axis < 3; ++axis) packer.put(contents.normals[i][axis]);
    if (!contents.labels.empty()) packer.put(contents.labels[i]);
  }
  return packer.blob();
}

void checkSizes(const fs::path& file, const PcdContents& contents) {
  const auto points = contents.cloud.size();
  if (points == 0) refuse(file.string() + " cannot be written: the cloud has no pixels");
  for (const auto size : {contents.labels.size(), contents.normals.size()})
    if (size != 0 && size != points)
      refuse(file.string() + " cannot be written: " + std::to_string(size) +
             " labels or normals for " + std::to_string(points) + " points");
}

}  // namespace

PcdContents readPcd(const fs::path& file) {
  try {
    return parsePcd(readFile(file));
  } catch (const std::exception& error) {
    throw std::invalid_argument(file.string() + ": " + error.what());
  }
}

void writePcd(const fs::path& file, const PcdContents& contents) {
  checkSizes(file, contents);
  const Eigen::Quaternionf orientation(contents.T_data_sensor.linear().cast<float>());
  Eigen::Vector4f origin = Eigen::Vector4f::Zero();
  origin.head<3>() = contents.T_data_sensor.translation().cast<float>();

  const SilentPcl silent;
  std::ofstream stream(file, std::ios::binary);
  if (!stream)
    throw std::runtime_error(file.string() + ": cannot be written: " + std::strerror(errno));
  const int failed =
      pcl::PCDWriter().writeBinaryCompressed(stream, pack(contents), origin, orientation);
  stream.close();
  if (failed || !stream)
    throw std::runtime_error(file.string() + ": cannot be written: disk full?");
}

}  // namespace tabletop_perception
