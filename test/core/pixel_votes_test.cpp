#include "pixel_votes.h"

#include <gtest/gtest.h>

#include "views.h"

using namespace tabletop_perception;

namespace {

/// A block before a camera and nothing behind it.
class VotesOnABlock : public testing::Test {
 protected:
  VotesOnABlock()
      : mesh_(scene::box(0.06, 0.08, 0.1)),
        truth_(views::lookAt(mesh_, {1, 0.8, 0.7}, 0.8)),
        surface_(views::surfaceOf(mesh_, 0.003)),
        image_(views::imageOf(mesh_, truth_)) {
    for (const int i : validIndices(image_))
      area_ += image_.point(i).squaredNorm() / (CAMERA.fx * CAMERA.fx);
  }

  double againstAt(double x, double z = 0) const {
    return votesAgainst(observe(image_, nullptr, CAMERA), surface_,
                        Eigen::Translation3d(x, 0, z) * truth_);
  }

  /// Points at this depth in all pixels without one.
  void fill(float z) {
    for (int v = 0; v < image_.height; ++v)
      for (int u = 0; u < image_.width; ++u) {
        const std::size_t i = static_cast<std::size_t>(v) * image_.width + u;
        if (std::isfinite(image_.z[i])) continue;
        image_.x[i] = static_cast<float>((u - CAMERA.cx) / CAMERA.fx) * z;
        image_.y[i] = static_cast<float>((v - CAMERA.cy) / CAMERA.fy) * z;
        image_.z[i] = z;
      }
  }

  const Projection CAMERA = scene::SceneOptions().projection;
  Mesh mesh_;
  Eigen::Isometry3d truth_;
  Surface surface_;
  Cloud image_;
  double area_ = 0;  ///< of the pixels that show it, where it is [m^2]
};

constexpr double FAR_OFF = 0.03;  // [m]

}  // namespace

TEST_F(VotesOnABlock, AreForItWhereEveryPixelShowsIt) {
  EXPECT_LT(againstAt(0), -0.9 * area_);
  EXPECT_GT(againstAt(0), -1.05 * area_);
}

TEST_F(VotesOnABlock, AreTheFewerForItTheFartherItIsOff) {
  EXPECT_GT(againstAt(0.01), againstAt(0) + 0.1 * area_);
  EXPECT_GT(againstAt(FAR_OFF), againstAt(0.01) + 0.1 * area_);
}

TEST_F(VotesOnABlock, AreAgainstItWhereSomethingIsSeenBehindItAndALittleWhereItMayBeHidden) {
  const Cloud alone = image_;
  const double before_nothing = againstAt(FAR_OFF);
  fill(1.5f);
  const double by_what_is_behind = againstAt(FAR_OFF) - before_nothing;
  image_ = alone;
  fill(0.4f);
  const double by_what_is_before = againstAt(FAR_OFF) - before_nothing;
  EXPECT_GT(by_what_is_before, 0.01 * area_);
  EXPECT_NEAR(by_what_is_behind / by_what_is_before, 4, 1.5);
}

TEST_F(VotesOnABlock, DoNotCountAnEdgeThatIsAPixelOff) {
  fill(1.5f);
  const double pixel = 0.8 / CAMERA.fx;
  EXPECT_LT(againstAt(pixel), -0.9 * area_);
}

TEST_F(VotesOnABlock, AreThoseOfItsPartInThePicture) {
  EXPECT_GT(againstAt(0.47), -0.9 * area_);
  EXPECT_EQ(againstAt(5), 0);
  EXPECT_EQ(againstAt(0, -5), 0) << "behind the camera";
}
