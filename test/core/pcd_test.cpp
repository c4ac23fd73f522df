#include "tabletop_perception/pcd.h"

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <random>
#include <sstream>
#include <string>

#include <gtest/gtest.h>

#include "tabletop_perception/geometry.h"

using namespace tabletop_perception;
namespace fs = std::filesystem;

namespace {

const char* const HEADER =
    "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\n"
    "TYPE F F F\nCOUNT 1 1 1\n";

std::string readBytes(const fs::path& file) {
  std::ifstream stream(file, std::ios::binary);
  std::ostringstream bytes;
  bytes << stream.rdbuf();
  return bytes.str();
}

/// A folder of its own for every test, which also sees that nothing is printed.
class Pcd : public testing::Test {
 protected:
  Pcd() {
    std::string pattern = (fs::temp_directory_path() / "pcd_test_XXXXXX").string();
    folder_ = mkdtemp(pattern.data());
    testing::internal::CaptureStdout();
    testing::internal::CaptureStderr();
  }

  ~Pcd() override {
    const auto out = testing::internal::GetCapturedStdout();
    EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
    if (IsSkipped())
      std::fputs(out.c_str(), stdout);  // why
    else
      EXPECT_EQ(out, "");
    fs::remove_all(folder_);
  }

  fs::path path(const std::string& name) const { return folder_ / name; }

  fs::path write(const std::string& bytes) const {
    std::ofstream(path("file.pcd"), std::ios::binary) << bytes;
    return path("file.pcd");
  }

  /// What is said of a file, after its path.
  std::string refusalOf(const fs::path& file) const {
    try {
      readPcd(file);
    } catch (const std::invalid_argument& error) {
      const std::string what = error.what();
      EXPECT_EQ(what.find('\n'), std::string::npos) << what;
      EXPECT_EQ(what.find(file.string() + ": "), 0u) << what;
      return what.substr(std::min(what.size(), file.string().size() + 2));
    }
    return "was not refused";
  }

 private:
  fs::path folder_;
};

/// 7 x 5 pixels, two of them without a point, every value different.
PcdContents sample() {
  PcdContents contents;
  contents.cloud = Cloud(7, 5, true);
  std::mt19937 random(1);
  std::uniform_real_distribution<float> value(-2, 2);
  for (std::size_t i = 0; i < contents.cloud.size(); ++i) {
    contents.cloud.setPoint(i, {value(random), value(random), value(random)});
    contents.cloud.rgb[i] = static_cast<std::uint32_t>(random()) & 0xFFFFFF;
    contents.labels.push_back(static_cast<std::uint32_t>(random()));
    contents.normals.push_back(
        Eigen::Vector3f(value(random), value(random), value(random)).normalized());
  }
  contents.cloud.drop(0);
  contents.cloud.drop(17);
  contents.T_data_sensor = Eigen::Translation3d(0.1, -0.2, 0.7) *
                           Eigen::AngleAxisd(1.1, Eigen::Vector3d(1, 2, -3).normalized());
  return contents;
}

bool sameValue(float a, float b) { return a == b || (std::isnan(a) && std::isnan(b)); }

/// x y z of 60 points as text and as bytes.
std::string asciiFile() {
  std::ostringstream file;
  file << HEADER << "WIDTH 60\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS 60\nDATA ascii\n";
  for (int i = 0; i < 60; ++i) file << i * 0.01 << ' ' << -i * 0.5 << ' ' << 1 + i << '\n';
  return file.str();
}

std::string binaryFile() {
  std::ostringstream file;
  file << HEADER << "WIDTH 60\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS 60\nDATA binary\n";
  for (int i = 0; i < 60; ++i) {
    const float p[3] = {i * 0.01f, -i * 0.5f, 1.0f + i};
    file.write(reinterpret_cast<const char*>(p), sizeof p);
  }
  return file.str();
}

}  // namespace

TEST_F(Pcd, RoundtripKeepsGridPointsGapsColorsLabelsNormalsAndViewpoint) {
  const auto written = sample();
  writePcd(path("a.pcd"), written);
  const auto read = readPcd(path("a.pcd"));

  ASSERT_EQ(read.cloud.width, 7);
  ASSERT_EQ(read.cloud.height, 5);
  for (std::size_t i = 0; i < written.cloud.size(); ++i) {
    EXPECT_TRUE(sameValue(read.cloud.x[i], written.cloud.x[i]));
    EXPECT_TRUE(sameValue(read.cloud.y[i], written.cloud.y[i]));
    EXPECT_TRUE(sameValue(read.cloud.z[i], written.cloud.z[i]));
  }
  EXPECT_EQ(validIndices(read.cloud).size(), 33u);
  EXPECT_EQ(read.cloud.rgb, written.cloud.rgb);
  EXPECT_EQ(read.labels, written.labels);
  EXPECT_EQ(read.normals, written.normals);
  EXPECT_TRUE(read.T_data_sensor.isApprox(written.T_data_sensor, 2e-6));
}

TEST_F(Pcd, RoundtripWithoutExtrasGivesBlackPointsAndNoLabels) {
  PcdContents written;
  written.cloud = Cloud(2, 1, false);
  written.cloud.setPoint(1, {1, 2, 3});
  writePcd(path("a.pcd"), written);
  const auto read = readPcd(path("a.pcd"));
  EXPECT_FALSE(read.cloud.valid(0));
  EXPECT_EQ(read.cloud.point(1), Eigen::Vector3f(1, 2, 3));
  EXPECT_EQ(read.cloud.rgb, std::vector<std::uint32_t>(2, 0));
  EXPECT_TRUE(read.labels.empty());
  EXPECT_TRUE(read.normals.empty());
  EXPECT_TRUE(read.T_data_sensor.isApprox(Eigen::Isometry3d::Identity()));
}

TEST_F(Pcd, ReadsAsciiAndBinaryAlike) {
  const auto ascii = readPcd(write(asciiFile())).cloud;
  const auto binary = readPcd(write(binaryFile())).cloud;
  ASSERT_EQ(ascii.size(), 60u);
  EXPECT_EQ(ascii.point(59), Eigen::Vector3f(0.59f, -29.5f, 60));
  EXPECT_EQ(ascii.y, binary.y);
  EXPECT_EQ(ascii.z, binary.z);
}

TEST_F(Pcd, ReadsNaNAndInfinityInAsciiAsNoPoint) {
  const auto cloud = readPcd(write(std::string(HEADER) +
                                   "WIDTH 3\nHEIGHT 1\nPOINTS 3\nDATA ascii\n1 2 3\nnan nan nan\n"
                                   "1 inf 2\n"))
                         .cloud;
  EXPECT_EQ(validIndices(cloud), Indices{0});
}

TEST_F(Pcd, TakesTheViewpointAsTheSensorsPoseInTheData) {
  const auto viewpoint = [&](const std::string& values) {
    return readPcd(write(std::string(HEADER) + "WIDTH 1\nHEIGHT 1\nVIEWPOINT " + values +
                         "\nPOINTS 1\nDATA ascii\n0 0 0\n"))
        .T_data_sensor;
  };
  // a quarter turn about z, the quaternion twice as long as it should be
  const auto turned = viewpoint("1 2 3 1.41421356 0 0 1.41421356");
  EXPECT_TRUE((turned * Eigen::Vector3d(1, 0, 0)).isApprox(Eigen::Vector3d(1, 3, 3), 1e-6));
  EXPECT_TRUE(viewpoint("1 2 3 0 0 0 0").linear().isIdentity());
}

TEST_F(Pcd, RefusesWhatIsNoCloud) {
  EXPECT_EQ(refusalOf(path("missing.pcd")), "cannot be opened: No such file or directory");
  EXPECT_EQ(refusalOf(path(".")), "is a folder, not a file");
  EXPECT_EQ(refusalOf(write("")), "is empty (0 bytes)");
  EXPECT_EQ(refusalOf(write("ply\nformat ascii 1.0\nend_header\n")), "is not a PCD file");
  EXPECT_EQ(refusalOf(write("hello")), "is not a PCD file");
  EXPECT_EQ(refusalOf(write(std::string(5000, '\0'))), "is not a PCD file");
  EXPECT_EQ(refusalOf(write("\x89PNG\r\n\x1a\n\n\n")), "is not a PCD file");
}

TEST_F(Pcd, RefusesACloudWithoutPoints) {
  for (const std::string kind : {"ascii", "binary", "binary_compressed"})
    EXPECT_EQ(
        refusalOf(write(std::string(HEADER) + "WIDTH 0\nHEIGHT 1\nPOINTS 0\nDATA " + kind + "\n")),
        "holds no points");
}

TEST_F(Pcd, RefusesHeadersThatDoNotAddUp) {
  const auto refusal = [&](const std::string& header) { return refusalOf(write(header)); };
  EXPECT_EQ(refusal(std::string(HEADER) + "WIDTH 2\nHEIGHT 2\nPOINTS 5\nDATA ascii\n"),
            "has a header that does not add up: POINTS is not 2 x 2 points");
  EXPECT_EQ(refusal(std::string(HEADER) + "WIDTH -2\nHEIGHT 2\nPOINTS 5\nDATA ascii\n"),
            "has WIDTH '-2' in its header, not a number of points or bytes");
  EXPECT_EQ(refusal(std::string(HEADER) + "HEIGHT 2\nPOINTS 5\nDATA ascii\n"),
            "is not a PCD file: its header has no WIDTH");
  EXPECT_EQ(refusal(std::string(HEADER) + "WIDTH 1\nHEIGHT 1\nPOINTS 1\nDATA zip\n1 2 3\n"),
            "has DATA 'zip', must be ascii, binary or binary_compressed");
  EXPECT_EQ(refusal("VERSION 0.7\nFIELDS x y z\nSIZE 4 4\nTYPE F F F\nWIDTH 1\nHEIGHT 1\nPOINTS 1\n"
                    "DATA ascii\n1 2 3\n"),
            "is not a PCD file: FIELDS, SIZE, TYPE and COUNT of its header differ in length");
  EXPECT_EQ(refusal("VERSION 0.7\nFIELDS a b c\nSIZE 4 4 4\nTYPE F F F\nWIDTH 1\nHEIGHT 1\n"
                    "POINTS 1\nDATA ascii\n1 2 3\n"),
            "cloud has no field 'x', its fields are: a b c");
  // gigabytes that PCL would set aside before it looks for them
  EXPECT_EQ(refusal(std::string(HEADER) +
                    "WIDTH 30000\nHEIGHT 30000\nPOINTS 900000000\nDATA binary\n12345"),
            "is cut short: 30000 x 30000 points need 10800000000 bytes of data, it has 5");
}

TEST_F(Pcd, RefusesAnAsciiLineThatIsNoPoint) {
  EXPECT_EQ(refusalOf(write(std::string(HEADER) +
                            "WIDTH 2\nHEIGHT 1\nPOINTS 2\nDATA ascii\n1 2 3\n4 5 6 7 8\n")),
            "has 5 values in line 2 of its data, a point has 3");
}

TEST_F(Pcd, RefusesEveryTruncationWithOneLine) {
  writePcd(path("compressed.pcd"), sample());
  for (const auto& whole : {asciiFile(), binaryFile(), readBytes(path("compressed.pcd"))}) {
    const bool ascii = whole == asciiFile();
    // an ascii file may lack the last line's end, and digits of the last number
    const std::size_t complete = ascii ? whole.size() - 2 : whole.size();
    for (std::size_t size = 0; size < complete; ++size) {
      const auto refusal = refusalOf(write(whole.substr(0, size)));
      ASSERT_NE(refusal, "was not refused") << size << " of " << whole.size() << " bytes";
      if (size > 100) {
        EXPECT_NE(refusal.find("is cut short"), std::string::npos) << size << ": " << refusal;
      }
    }
    EXPECT_EQ(refusalOf(write(whole)), "was not refused");
  }
}

TEST_F(Pcd, SurvivesDamagedBytes) {
  writePcd(path("compressed.pcd"), sample());
  std::mt19937 random(2);
  for (const auto& whole : {asciiFile(), binaryFile(), readBytes(path("compressed.pcd"))}) {
    for (int trial = 0; trial < 2000; ++trial) {
      auto damaged = whole;
      for (int i = 0; i < 1 + trial % 3; ++i)
        damaged[random() % damaged.size()] = static_cast<char>(random());
      refusalOf(write(damaged));  // checks the form of what is said; anything but a crash is right
    }
  }
}

TEST_F(Pcd, RefusesToWriteWhatCannotBeWritten) {
  EXPECT_THROW(writePcd(path("a.pcd"), {}), std::invalid_argument);
  auto uneven = sample();
  uneven.labels.pop_back();
  EXPECT_THROW(writePcd(path("a.pcd"), uneven), std::invalid_argument);
  EXPECT_FALSE(fs::exists(path("a.pcd")));
  EXPECT_THROW(writePcd(path("missing") / "a.pcd", sample()), std::runtime_error);
}

TEST_F(Pcd, ReadsARealOrganisedCloudWithLabels) {
  const char* const data = std::getenv("TABLETOP_DATA");
  const fs::path file =
      (data ? fs::path(data) : fs::path(PROJECT_DIR) / "../shared/data") / "mosd" / "learn0.pcd";
  if (!fs::exists(file)) GTEST_SKIP() << file << " is not there";
  const auto contents = readPcd(file);
  EXPECT_EQ(contents.cloud.width, 640);
  EXPECT_EQ(contents.cloud.height, 480);
  EXPECT_EQ(contents.labels.size(), 307200u);
  EXPECT_GT(validIndices(contents.cloud).size(), 100000u);
  EXPECT_TRUE(contents.cloud.colored());
}
