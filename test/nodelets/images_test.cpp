#include <gtest/gtest.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <memory>
#include <stdexcept>
#include <vector>

#include "color_partner.h"
#include "graph.h"
#include "image_codec.h"

namespace tabletop_perception {
namespace {

using namespace test;

// --- which colour image belongs to a depth image

sensor_msgs::ImageConstPtr imageAt(double stamp) {
  const auto image = boost::make_shared<sensor_msgs::Image>();
  image->header.stamp = ros::Time(stamp);
  return image;
}

TEST(ColorPartner, isTheNearestWithinTheInterval) {
  ColorPartner partner(ros::Duration(0.02));
  for (const double stamp : {99.97, 99.985, 100.01}) partner.addColor(imageAt(stamp));
  const auto done = partner.addDepth(imageAt(100), true);
  ASSERT_EQ(done.size(), 1u);
  ASSERT_TRUE(done[0].second);
  EXPECT_EQ(done[0].second->header.stamp, ros::Time(100.01));
}

TEST(ColorPartner, isWaitedForUntilItComes) {
  ColorPartner partner(ros::Duration(0.02));
  const auto depth = imageAt(100);
  EXPECT_TRUE(partner.addDepth(depth, true).empty());
  EXPECT_TRUE(partner.addColor(imageAt(99.9)).empty());
  const auto done = partner.addColor(imageAt(100.015));
  ASSERT_EQ(done.size(), 1u);
  EXPECT_EQ(done[0].first, depth);
  EXPECT_TRUE(done[0].second);
}

TEST(ColorPartner, isDoneWithoutWhereNoneCanComeAnyMore) {
  ColorPartner partner(ros::Duration(0.02));
  EXPECT_TRUE(partner.addDepth(imageAt(100), true).empty());
  const auto too_late = partner.addColor(imageAt(100.03));
  ASSERT_EQ(too_late.size(), 1u);
  EXPECT_FALSE(too_late[0].second);

  EXPECT_TRUE(partner.addDepth(imageAt(101), true).empty());
  const auto overtaken = partner.addDepth(imageAt(101.03), true);
  ASSERT_EQ(overtaken.size(), 1u);
  EXPECT_EQ(overtaken[0].first->header.stamp, ros::Time(101));

  ColorPartner fresh(ros::Duration(0.02));
  EXPECT_EQ(fresh.addDepth(imageAt(100), false).size(), 1u) << "where nobody sends colours";
}

// --- compressed images

sensor_msgs::Image depthOf(const std::string& encoding, const std::vector<float>& metres) {
  sensor_msgs::Image image;
  image.encoding = encoding;
  image.width = static_cast<std::uint32_t>(metres.size());
  image.height = 1;
  image.step = image.width * (encoding == "16UC1" ? 2 : 4);
  image.data.resize(image.step);
  for (std::size_t i = 0; i < metres.size(); ++i) {
    const auto raw = static_cast<std::uint16_t>(std::lround(1e3 * metres[i]));
    if (encoding == "16UC1")
      std::memcpy(&image.data[2 * i], &raw, 2);
    else
      std::memcpy(&image.data[4 * i], &metres[i], 4);
  }
  return image;
}

TEST(ImageCodec, depthInMillimetresComesBackAsItWas) {
  const auto depth = depthOf("16UC1", {0, 0.001, 0.731, 65.535});
  const auto back = imageFromCompressed(*compressedDepth(depth));
  EXPECT_EQ(back->encoding, "16UC1");
  EXPECT_EQ(back->data, depth.data);
}

TEST(ImageCodec, depthInMetresComesBackInMillimetres) {
  const auto metres = depthOf("32FC1", {NAN, 0.7314f, -1, 70});
  const auto back = imageFromCompressed(*compressedDepth(metres));
  EXPECT_EQ(back->encoding, "16UC1");
  EXPECT_EQ(back->data, depthOf("16UC1", {0, 0.731, 0, 0}).data);
}

TEST(ImageCodec, inverseDepthOfThePluginIsRead) {
  auto message = *compressedDepth(depthOf("16UC1", {0, 1.0, 2.0}));  // numbers 0, 1000, 2000
  message.format = "32FC1; compressedDepth png";
  const float a = 900, b = 100;
  std::memcpy(&message.data[4], &a, 4);
  std::memcpy(&message.data[8], &b, 4);
  const auto back = imageFromCompressed(message);
  ASSERT_EQ(back->encoding, "32FC1");
  std::array<float, 3> metres;
  std::memcpy(metres.data(), back->data.data(), sizeof metres);
  EXPECT_TRUE(std::isnan(metres[0]));
  EXPECT_FLOAT_EQ(metres[1], 1.0f);
  EXPECT_FLOAT_EQ(metres[2], 900.0f / 1900);
}

// Messages as compressed_depth_image_transport and compressed_image_transport lay them out, byte by
// byte: before the PNG of depth an int32 (0: inverse depth) and two floats, by which numbers of
// 16 bits become metres; with depth_max 10 and depth_quantization 100 they are 10100 and -1009.

using Bytes = std::vector<std::uint8_t>;

const Bytes NO_PARAMETERS(12, 0);
const Bytes PARAMETERS = {0, 0, 0, 0, 0x00, 0xD0, 0x1D, 0x46, 0x00, 0x40, 0x7C, 0xC4};

/// 3 x 1 pixels of 16 bits: 0, 731, 65535.
const Bytes MILLIMETRES = {
    0x89, 0x50, 0x4E, 0x47, 0x0D, 0x0A, 0x1A, 0x0A, 0x00, 0x00, 0x00, 0x0D, 0x49, 0x48, 0x44,
    0x52, 0x00, 0x00, 0x00, 0x03, 0x00, 0x00, 0x00, 0x01, 0x10, 0x00, 0x00, 0x00, 0x00, 0x6E,
    0x1B, 0x97, 0x2B, 0x00, 0x00, 0x00, 0x12, 0x49, 0x44, 0x41, 0x54, 0x78, 0x01, 0x01, 0x07,
    0x00, 0xF8, 0xFF, 0x00, 0x00, 0x00, 0x02, 0xDB, 0xFF, 0xFF, 0x05, 0x9D, 0x02, 0xDC, 0x6D,
    0xDC, 0x57, 0x44, 0x00, 0x00, 0x00, 0x00, 0x49, 0x45, 0x4E, 0x44, 0xAE, 0x42, 0x60, 0x82};

/// 3 x 1 pixels of 16 bits: 0, 9091 for 1 m, 4041 for 2 m.
const Bytes INVERSE_DEPTHS = {
    0x89, 0x50, 0x4E, 0x47, 0x0D, 0x0A, 0x1A, 0x0A, 0x00, 0x00, 0x00, 0x0D, 0x49, 0x48, 0x44,
    0x52, 0x00, 0x00, 0x00, 0x03, 0x00, 0x00, 0x00, 0x01, 0x10, 0x00, 0x00, 0x00, 0x00, 0x6E,
    0x1B, 0x97, 0x2B, 0x00, 0x00, 0x00, 0x12, 0x49, 0x44, 0x41, 0x54, 0x78, 0x01, 0x01, 0x07,
    0x00, 0xF8, 0xFF, 0x00, 0x00, 0x00, 0x23, 0x83, 0x0F, 0xC9, 0x03, 0x03, 0x01, 0x7F, 0xC5,
    0xDD, 0xAD, 0xD4, 0x00, 0x00, 0x00, 0x00, 0x49, 0x45, 0x4E, 0x44, 0xAE, 0x42, 0x60, 0x82};

/// 2 x 1 pixels, red green blue: 200 100 50, 1 2 3.
const Bytes COLORS = {0x89, 0x50, 0x4E, 0x47, 0x0D, 0x0A, 0x1A, 0x0A, 0x00, 0x00, 0x00, 0x0D, 0x49,
                      0x48, 0x44, 0x52, 0x00, 0x00, 0x00, 0x02, 0x00, 0x00, 0x00, 0x01, 0x08, 0x02,
                      0x00, 0x00, 0x00, 0x7B, 0x40, 0xE8, 0xDD, 0x00, 0x00, 0x00, 0x12, 0x49, 0x44,
                      0x41, 0x54, 0x78, 0x01, 0x01, 0x07, 0x00, 0xF8, 0xFF, 0x00, 0xC8, 0x64, 0x32,
                      0x01, 0x02, 0x03, 0x07, 0x7D, 0x01, 0x65, 0x33, 0xF6, 0x31, 0x94, 0x00, 0x00,
                      0x00, 0x00, 0x49, 0x45, 0x4E, 0x44, 0xAE, 0x42, 0x60, 0x82};

sensor_msgs::CompressedImage laidOut(const std::string& format, const Bytes& first,
                                     const Bytes& second = {}) {
  sensor_msgs::CompressedImage message;
  message.format = format;
  message.data = first;
  message.data.insert(message.data.end(), second.begin(), second.end());
  return message;
}

TEST(ImageCodec, readsWhatThePluginsLayOut) {
  // "16UC1; compressedDepth" without the kind of file is of the plug-in before it had others.
  for (const std::string format : {"16UC1; compressedDepth png", "16UC1; compressedDepth"})
    EXPECT_EQ(imageFromCompressed(laidOut(format, NO_PARAMETERS, MILLIMETRES))->data,
              depthOf("16UC1", {0, 0.731f, 65.535f}).data);

  const auto metres =
      imageFromCompressed(laidOut("32FC1; compressedDepth png", PARAMETERS, INVERSE_DEPTHS));
  EXPECT_EQ(metres->encoding, "32FC1");
  std::array<float, 3> depths{};
  ASSERT_EQ(metres->data.size(), sizeof depths);
  std::memcpy(depths.data(), metres->data.data(), sizeof depths);
  EXPECT_TRUE(std::isnan(depths[0]));
  EXPECT_FLOAT_EQ(depths[1], 1);
  EXPECT_FLOAT_EQ(depths[2], 2);

  const auto color = imageFromCompressed(laidOut("rgb8; png compressed bgr8", COLORS));
  EXPECT_EQ(color->encoding, "bgr8");
  EXPECT_EQ(color->data, Bytes({50, 100, 200, 3, 2, 1}));
}

TEST(ImageCodec, laysOutWhatThePluginsRead) {
  const auto depth = compressedDepth(depthOf("16UC1", {0, 0.731f, 65.535f}));
  EXPECT_EQ(depth->format, "16UC1; compressedDepth png");
  const auto same = laidOut("", NO_PARAMETERS, MILLIMETRES);
  const auto image_header = 12 + 33;  // the signature of PNG, size, 16 bits, grey
  ASSERT_GT(depth->data.size(), image_header);
  EXPECT_TRUE(std::equal(same.data.begin(), same.data.begin() + image_header, depth->data.begin()));

  // They take pixels of "compressed bgr8" for blue green red, and those of other words as they are.
  sensor_msgs::Image image;
  image.encoding = "rgb8";
  image.width = image.height = 16;
  image.step = 48;
  for (int i = 0; i < 256; ++i) image.data.insert(image.data.end(), {200, 100, 50});
  const auto color = compressedColor(image);
  EXPECT_EQ(color->format, "rgb8; jpeg compressed bgr8");
  const auto back = imageFromCompressed(*color);
  ASSERT_EQ(back->data.size(), image.data.size());
  EXPECT_NEAR(back->data[0], 50, 3);
  EXPECT_NEAR(back->data[2], 200, 3);

  image.encoding = "mono8";
  image.width = 48;
  const auto grey = compressedColor(image);
  EXPECT_EQ(grey->format, "mono8; jpeg compressed ");
  ASSERT_GE(grey->data.size(), 2u);
  EXPECT_EQ(Bytes(grey->data.begin(), grey->data.begin() + 2), Bytes({0xFF, 0xD8}));
}

TEST(ImageCodec, whatIsNoImageIsNamed) {
  sensor_msgs::CompressedImage message;
  message.format = "16UC1; compressedDepth png";
  message.data.resize(100);
  EXPECT_THROW(imageFromCompressed(message), std::invalid_argument);
  message.format = "jpeg";
  EXPECT_THROW(imageFromCompressed(message), std::invalid_argument);
  message.format = "16UC1; compressedDepth rvl";
  try {
    imageFromCompressed(message);
    ADD_FAILURE() << "read as PNG";
  } catch (const std::invalid_argument& error) {
    EXPECT_STREQ(error.what(),
                 "'16UC1; compressedDepth rvl' is not read: the plug-in's parameter format must be "
                 "png");
  }
  auto color = depthOf("16UC1", {1});
  EXPECT_THROW(compressedColor(color), std::invalid_argument) << "depth is no colour";
  color.encoding = "rgb8";
  EXPECT_THROW(compressedColor(color), std::invalid_argument) << "too short";
}

// --- the graph with images at its entrance

/// Sends depth, colour and camera_info of a scene in the frame "camera".
class ImageCamera {
 public:
  explicit ImageCamera(ros::NodeHandle& nh)
      : nh_(nh),
        depth_pub_(nh.advertise<sensor_msgs::Image>("/camera/depth_registered/image_raw", 1)),
        info_pub_(nh.advertise<sensor_msgs::CameraInfo>("/camera/rgb/camera_info", 1)) {}

  void withColor() { color_pub_ = nh_.advertise<sensor_msgs::Image>("/camera/rgb/image_raw", 1); }
  void withoutColor() { color_pub_.shutdown(); }

  bool connected() const {
    return depth_pub_.getNumSubscribers() > 0 && info_pub_.getNumSubscribers() > 0 &&
           (!color_pub_ || color_pub_.getNumSubscribers() > 0);
  }

  sensor_msgs::Image depthImage(const std::string& encoding) const {
    sensor_msgs::Image image = emptyImage(encoding, encoding == "16UC1" ? 2 : 4);
    for (std::size_t i = 0; i < scene_.cloud.size(); ++i) {
      const float depth = scene_.cloud.z[i];
      const auto raw = static_cast<std::uint16_t>(std::isnan(depth) ? 0 : std::lround(1e3 * depth));
      if (encoding == "16UC1")
        std::memcpy(&image.data[2 * i], &raw, 2);
      else
        std::memcpy(&image.data[4 * i], &depth, 4);
    }
    return image;
  }

  sensor_msgs::Image colorImage() const {
    sensor_msgs::Image image = emptyImage("rgb8", 3);
    for (std::size_t i = 0; i < scene_.cloud.size(); ++i)
      for (int c = 0; c < 3; ++c)
        image.data[3 * i + c] = static_cast<std::uint8_t>(scene_.cloud.rgb[i] >> (16 - 8 * c));
    return image;
  }

  sensor_msgs::CameraInfo info() const {
    sensor_msgs::CameraInfo info;
    info.width = 640;
    info.height = 480;
    info.K = {525, 0, 319.5, 0, 525, 239.5, 0, 0, 1};
    info.P = {525, 0, 319.5, 0, 0, 525, 239.5, 0, 0, 0, 1, 0};
    return info;
  }

  ros::Time send(sensor_msgs::Image depth, sensor_msgs::CameraInfo info) {
    const ros::Time stamp = ros::Time::now();
    depth.header.stamp = info.header.stamp = stamp;
    depth.header.frame_id = info.header.frame_id = "camera";
    info_pub_.publish(info);
    if (color_pub_) {
      auto color = colorImage();
      color.header = depth.header;
      color.header.stamp += ros::Duration(0.008);
      color_pub_.publish(color);
    }
    depth_pub_.publish(depth);
    return stamp;
  }
  ros::Time send(const std::string& encoding) { return send(depthImage(encoding), info()); }

  const scene::SyntheticScene& scene() const { return scene_; }

 private:
  static sensor_msgs::Image emptyImage(const std::string& encoding, int pixel_bytes) {
    sensor_msgs::Image image;
    image.encoding = encoding;
    image.width = 640;
    image.height = 480;
    image.step = 640 * pixel_bytes;
    image.data.resize(std::size_t{image.step} * image.height);
    return image;
  }

  const scene::SyntheticScene scene_ = scene::threeObjects();
  ros::NodeHandle nh_;
  ros::Publisher depth_pub_, info_pub_, color_pub_;
};

class Images : public testing::Test {
 protected:
  using CloudRecorder = Recorder<sensor_msgs::PointCloud2>;

  void listen() {
    clouds_ = std::make_unique<CloudRecorder>(nh_, "/perception/depth_image/cloud");
    ASSERT_TRUE(spinUntil([&] { return camera_.connected() && log_.connected(); }));
  }

  /// The cloud of an image, sent until it comes through.
  sensor_msgs::PointCloud2ConstPtr cloudOf(const std::string& encoding) {
    for (int i = 0; i < 30; ++i) {
      const auto stamp = camera_.send(encoding);
      if (spinUntil([&] { return clouds_->has(stamp); }, 0.5)) return clouds_->at(stamp);
    }
    return nullptr;
  }

  bool warned(const sensor_msgs::Image& depth, const sensor_msgs::CameraInfo& info,
              const std::string& part) {
    log_.clear();
    for (int i = 0; i < 30 && !log_.has(part); ++i) {
      camera_.send(depth, info);
      spinUntil([&] { return log_.has(part); }, 0.5);
    }
    return log_.has(part);
  }

  void expectTrueCloud(const sensor_msgs::PointCloud2ConstPtr& message, bool colored) {
    ASSERT_TRUE(message);
    EXPECT_EQ(message->header.frame_id, "camera");
    const Cloud cloud = cloudFromMessage(*message);
    const Cloud& truth = camera_.scene().cloud;
    ASSERT_EQ(cloud.width, truth.width);
    ASSERT_EQ(cloud.height, truth.height);
    for (std::size_t i = 0; i < truth.size(); ++i) {
      ASSERT_EQ(cloud.valid(i), truth.valid(i)) << i;
      if (truth.valid(i)) {
        ASSERT_LT((cloud.point(i) - truth.point(i)).norm(), 0.001);
      }
    }
    EXPECT_EQ(cloud.rgb, colored ? truth.rgb : std::vector<std::uint32_t>());
  }

  ros::NodeHandle nh_;
  ImageCamera camera_{nh_};
  LogRecorder log_{nh_};
  std::unique_ptr<CloudRecorder> clouds_;
};

TEST_F(Images, nothingIsSubscribedUntilSomebodyListens) {
  ASSERT_TRUE(ros::service::waitForService("/perception/depth_image/set_parameters", 20000));
  EXPECT_FALSE(spinUntil([&] { return camera_.connected(); }, 2));
  listen();
  clouds_.reset();
  EXPECT_TRUE(spinUntil([&] { return !camera_.connected(); }, 5)) << "and then it sleeps again";
}

TEST_F(Images, depthAloneOfBothEncodingsBecomesTheTrueCloud) {
  listen();
  expectTrueCloud(cloudOf("16UC1"), false);
  expectTrueCloud(cloudOf("32FC1"), false);
}

TEST_F(Images, anImageOfTheSameMomentColoursTheCloud) {
  camera_.withColor();
  listen();
  expectTrueCloud(cloudOf("16UC1"), true);
}

TEST_F(Images, aGraphInTwoPartsTakesThemCompressed) {
  camera_.withColor();
  const CloudRecorder clouds(nh_, "/compressed/filter/cloud");
  ros::Time stamp;
  ASSERT_TRUE(spinUntil([&] {
    stamp = camera_.send("16UC1");
    return spinUntil([&] { return clouds.has(stamp); }, 0.5);
  }));
  const Cloud cloud = cloudFromMessage(*clouds.at(stamp));
  const Cloud& truth = camera_.scene().cloud;
  ASSERT_EQ(cloud.size(), truth.size());
  for (std::size_t i = 0; i < truth.size(); ++i) {
    if (!cloud.valid(i)) continue;
    ASSERT_LT((cloud.point(i) - truth.point(i)).norm(), 0.001);
  }
  const std::size_t middle = truth.size() / 2 + truth.width / 2;  // of a thing, of one colour
  ASSERT_TRUE(cloud.valid(middle));
  for (const int shift : {0, 8, 16})
    EXPECT_NEAR((cloud.rgb[middle] >> shift) & 255, (truth.rgb[middle] >> shift) & 255, 10);
  EXPECT_FALSE(ros::service::exists("/compressed/table/set_parameters", false))
      << "the part of the camera's machine ends with the filter";
}

TEST_F(Images, thingsOnTheTableComeOutAtTheOtherEnd) {
  Recorder<RecognizedObjectArray> objects(nh_, "/perception/refine/objects");
  ASSERT_TRUE(spinUntil([&] { return camera_.connected(); }));
  ASSERT_TRUE(spinUntil([&] {
    const auto stamp = camera_.send("16UC1");
    return spinUntil([&] { return objects.has(stamp); }, 1);
  }));
  const auto& frame = *objects.all().rbegin()->second;
  EXPECT_EQ(frame.header.frame_id, "camera");
  EXPECT_GE(frame.objects.size(), 3u) << frame.reason;
}

TEST_F(Images, whatDoesNotAddUpIsSkippedWithAWarning) {
  listen();
  auto info = camera_.info();
  info.K.fill(0);
  EXPECT_TRUE(warned(camera_.depthImage("16UC1"), info, "no usable K"));
  info = camera_.info();
  info.width = 320;
  EXPECT_TRUE(warned(camera_.depthImage("16UC1"), info, "320 x 480"));
  auto image = camera_.depthImage("16UC1");
  image.encoding = "bgr8";
  EXPECT_TRUE(warned(image, camera_.info(), "16UC1 (mm) or 32FC1 (m), got 'bgr8'"));
  image = camera_.depthImage("32FC1");
  for (std::size_t i = 0; i < image.data.size(); i += 4) {
    float depth;
    std::memcpy(&depth, &image.data[i], 4);
    depth *= 1000;
    std::memcpy(&image.data[i], &depth, 4);
  }
  EXPECT_TRUE(warned(image, camera_.info(), "are these millimetres?"));
  expectTrueCloud(cloudOf("16UC1"), false);
}

}  // namespace
}  // namespace tabletop_perception

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "images_test");
  return RUN_ALL_TESTS();
}
