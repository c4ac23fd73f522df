#include "outline.h"

#include <gtest/gtest.h>

#include "views.h"

using namespace tabletop_perception;

namespace {

/// A block before a camera and nothing behind it.
class Block : public testing::Test {
 protected:
  Block()
      : mesh_(scene::box(0.06, 0.08, 0.1)),
        truth_(views::lookAt(mesh_, {1, 0.8, 0.7}, 0.8)),
        index_({views::modelOf("block", mesh_, {})}),
        image_(views::imageOf(mesh_, truth_)) {}

  OffOutline offAt(const Eigen::Isometry3d& pose) const {
    const auto observation = observe(image_, nullptr, scene::SceneOptions().projection);
    return SeenOutline(observation, index_, 0, truth_).offAt(pose);
  }

  Eigen::Isometry3d shifted(double x) const { return Eigen::Translation3d(x, 0, 0) * truth_; }

  Mesh mesh_;
  Eigen::Isometry3d truth_;
  ModelIndex index_;
  Cloud image_;
};

}  // namespace

TEST_F(Block, IsHardlyOffItsOwnOutline) {
  const int seen = static_cast<int>(validIndices(image_).size());
  EXPECT_LT(offAt(truth_).pixels, seen / 20);
}

TEST_F(Block, LeavesItsEdgeUncoveredWhereItIsShifted) {
  const int step = offAt(shifted(0.004)).pixels - offAt(truth_).pixels;
  EXPECT_GT(step, 50);
  EXPECT_GT(offAt(shifted(0.008)).pixels - offAt(truth_).pixels, 1.5 * step);
}

TEST_F(Block, CoversWhatIsSeenBehindItButNotWhatHidesIt) {
  const auto shifted_off = [&] { return offAt(shifted(0.01)).pixels; };
  const int before_nothing = shifted_off();
  const Projection camera = scene::SceneOptions().projection;
  const auto fill = [&](float z) {  // all pixels without a point
    for (int v = 0; v < image_.height; ++v)
      for (int u = 0; u < image_.width; ++u) {
        const std::size_t i = static_cast<std::size_t>(v) * image_.width + u;
        if (std::isfinite(image_.z[i])) continue;
        image_.x[i] = static_cast<float>((u - camera.cx) / camera.fx) * z;
        image_.y[i] = static_cast<float>((v - camera.cy) / camera.fy) * z;
        image_.z[i] = z;
      }
  };
  const Cloud alone = image_;
  fill(1.5f);
  EXPECT_GT(shifted_off(), before_nothing + 100);
  image_ = alone;
  fill(0.4f);
  EXPECT_EQ(shifted_off(), before_nothing);
}

TEST_F(Block, CostsNothingComparedWithItselfAndMoreWhereManyPatchesAreOff) {
  const auto best = offAt(truth_);
  EXPECT_EQ(outlineCost(best, best), 0);
  EXPECT_GT(outlineCost(offAt(shifted(0.008)), best), 1);
}
