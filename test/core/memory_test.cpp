#include <malloc.h>

#include <gtest/gtest.h>

#include "scene.h"
#include "tabletop_perception/pipeline.h"

using namespace tabletop_perception;

/// What a day's work leaves behind.
namespace {

/// Bytes that are allocated and not given back.
std::size_t bytesInUse() {
  const auto info = mallinfo2();
  return info.uordblks + info.hblkhd;
}

}  // namespace

TEST(Memory, AThousandFramesLeaveNothingBehind) {
  const auto scene =
      scene::render({{"box", scene::box(0.12, 0.08, 0.15), scene::standing(0.05, 0.15, 0.7)},
                     {"can", scene::cylinder(0.035, 0.12), scene::standing(-0.05, 0.05, 0)},
                     {"ball", scene::ball(0.06), scene::standing(0.1, -0.15, 0)}},
                    scene::SceneOptions());
  const PipelineOptions options;
  const auto frames = [&](int count) {
    for (int i = 0; i < count; ++i)
      ASSERT_EQ(segmentScene(scene.cloud, scene.up, options).clusters.size(), 3u);
  };
  frames(10);  // what is set up once and stays
  const std::size_t before = bytesInUse();
  if (before == 0) GTEST_SKIP() << "this allocator does not count (sanitizers)";
  frames(1000);
  EXPECT_LT(bytesInUse(), before + 8000);  // one lost block a frame would be more
}
