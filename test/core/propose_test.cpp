#include "tabletop_perception/propose.h"

#include <vector>

#include <gtest/gtest.h>

using namespace tabletop_perception;

namespace {

using Unions = std::vector<std::vector<int>>;

/// Points in a row at the given places along x [m], each a cluster of its own.
Unions unionsOfPointsAt(const std::vector<float>& places, double gap) {
  Cloud cloud(static_cast<int>(places.size()), 1, false);
  std::vector<Indices> clusters;
  for (std::size_t i = 0; i < places.size(); ++i) {
    cloud.setPoint(i, {places[i], 0, 1});
    clusters.push_back({static_cast<int>(i)});
  }
  return clusterUnions(cloud, clusters, gap);
}

}  // namespace

TEST(ClusterUnions, ClustersApartStandAlone) {
  EXPECT_EQ(unionsOfPointsAt({0, 1, 2}, 0.015), (Unions{{0}, {1}, {2}}));
}

TEST(ClusterUnions, TwoThatTouchAreAlsoOne) {
  EXPECT_EQ(unionsOfPointsAt({0, 0.01f, 2}, 0.015), (Unions{{0}, {1}, {2}, {0, 1}}));
}

TEST(ClusterUnions, AChainIsItsPairsAndAllOfIt) {
  EXPECT_EQ(unionsOfPointsAt({0.001f, 0.021f, 0.041f}, 0.015),
            (Unions{{0}, {1}, {2}, {0, 1}, {1, 2}, {0, 1, 2}}));
}

TEST(ClusterUnions, WithoutAGapThereAreNone) {
  EXPECT_EQ(unionsOfPointsAt({0, 0.001f}, 0), (Unions{{0}, {1}}));
  EXPECT_TRUE(unionsOfPointsAt({}, 0.015).empty());
}
